//! `ETag`, `If-Match` and `If-None-Match`: the edition of what people edit (RFC 9110, sections
//! 8.8.3, 13.1.1 and 13.1.2).

use axum::Json;
use axum::extract::FromRequestParts;
use axum::http::header::{ETAG, HeaderName, IF_MATCH, IF_NONE_MATCH};
use axum::http::request::Parts;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use super::Problem;
use offbd_service::{Edition, Expected};
use offbd_wire::problem::MALFORMED_CONDITION;

/// The edition that the request may replace: any without `If-Match`, none with `If-None-Match: *`.
pub(super) struct IfMatch(pub(super) Expected);

impl<S: Send + Sync> FromRequestParts<S> for IfMatch {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        let matching = parsed(&parts.headers, &IF_MATCH, "`If-Match`")?;
        let malformed = |detail| Err(Problem::new(MALFORMED_CONDITION, detail));
        match (matching, parsed(&parts.headers, &IF_NONE_MATCH, "`If-None-Match`")?) {
            (matching, Expected::Anything) => Ok(Self(matching)),
            (Expected::Anything, Expected::Existing) => Ok(Self(Expected::Nothing)),
            (_, Expected::Existing) => {
                malformed("`If-Match` and `If-None-Match: *` cannot hold together")
            }
            _ => malformed("`If-None-Match` of a change must be `*`"),
        }
    }
}

/// The editions that the client has: none without `If-None-Match`.
pub(super) struct IfNoneMatch(Expected);

impl<S: Send + Sync> FromRequestParts<S> for IfNoneMatch {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        parsed(&parts.headers, &IF_NONE_MATCH, "`If-None-Match`").map(Self)
    }
}

impl IfNoneMatch {
    /// Returns a resource, or 304 with its entity tag if the client has this edition.
    pub(super) fn answer<T: Serialize>(&self, tagged: Tagged<T>) -> Response {
        let (headers, value) = tagged;
        let tag = headers[0].1.trim_matches('"');
        let is_known = match &self.0 {
            Expected::Anything | Expected::Nothing => false,
            Expected::Existing => true,
            Expected::OneOf(tags) => tags.iter().any(|known| known == tag),
        };
        if is_known {
            return (StatusCode::NOT_MODIFIED, headers).into_response();
        }
        (headers, value).into_response()
    }
}

fn parsed(headers: &HeaderMap, name: &HeaderName, shown: &str) -> Result<Expected, Problem> {
    expected(headers, name).ok_or_else(|| {
        let detail = format!("{shown} must be `*`, or entity tags in quotes, separated by commas");
        Problem::new(MALFORMED_CONDITION, detail)
    })
}

/// Returns the editions that the header `name` lists; `None` if it is malformed. A tag may be weak:
/// proxies that compress a response make it weak, and the tags depend on the content alone.
fn expected(headers: &HeaderMap, name: &HeaderName) -> Option<Expected> {
    let fields = headers.get_all(name).iter();
    let fields: Vec<&str> = fields.map(|field| field.to_str().ok()).collect::<Option<_>>()?;
    match fields.as_slice() {
        [] => return Some(Expected::Anything),
        [field] if field.trim() == "*" => return Some(Expected::Existing),
        _ => {}
    }
    let tags: Vec<_> = fields.iter().map(|field| listed(field)).collect::<Option<_>>()?;
    Some(Expected::OneOf(tags.concat()))
}

/// Returns the tags in a list, at least one, without their quotes; a comma may be part of a tag.
fn listed(field: &str) -> Option<Vec<String>> {
    let (mut tags, mut rest) = (Vec::new(), field.trim());
    loop {
        let opaque = rest.strip_prefix("W/").unwrap_or(rest).strip_prefix('"')?;
        let (tag, after) = opaque.split_once('"')?;
        tags.push(tag.to_owned());
        let after = after.trim_start();
        if after.is_empty() {
            return Some(tags);
        }
        rest = after.strip_prefix(',')?.trim_start();
    }
}

/// A resource, and the entity tag of its edition as a header.
pub(super) type Tagged<T> = ([(HeaderName, String); 1], Json<T>);

pub(super) fn tagged<T: Serialize>(edition: Edition<T>) -> Tagged<T> {
    with_tag(edition.tag.to_string(), edition.value)
}

/// Returns `value` with the entity tag `etag`, which has its quotes.
pub(super) fn with_tag<T: Serialize>(etag: String, value: T) -> Tagged<T> {
    ([(ETAG, etag)], Json(value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    #[test]
    fn if_match_is_a_star_or_a_list_of_tags() {
        let parsed = |fields: &[&'static str]| {
            let fields = fields.iter().map(|field| (IF_MATCH, HeaderValue::from_static(field)));
            expected(&fields.collect(), &IF_MATCH)
        };
        let of = |tags: &[&str]| Some(Expected::OneOf(tags.iter().map(|&t| t.into()).collect()));
        assert_eq!(parsed(&[]), Some(Expected::Anything));
        assert_eq!(parsed(&["*"]), Some(Expected::Existing));
        assert_eq!(parsed(&["\"a\""]), of(&["a"]));
        assert_eq!(parsed(&["\"a\" , W/\"b,b\"", "\"c\""]), of(&["a", "b,b", "c"]));
        for malformed in ["", "a", "\"a", "\"a\" \"b\"", "*, \"a\"", "w/\"a\""] {
            assert_eq!(parsed(&[malformed]), None, "{malformed}");
        }
    }
}
