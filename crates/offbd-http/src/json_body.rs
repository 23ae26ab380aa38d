//! Small JSON bodies: their media type, size and content.

use axum::body::Body;
use axum::extract::{FromRequest, Request};
use axum::http::HeaderMap;
use axum::http::header::CONTENT_TYPE;
use serde::de::DeserializeOwned;

use super::{App, Problem, body};
use offbd_wire::json;
use offbd_wire::problem::MEDIA_TYPE;

/// Size limit of a small JSON body, bytes; a longer one is answered with 413.
const MAX_SMALL_BYTES: usize = 16 << 10;

/// The value in a small JSON body of at most `LIMIT` bytes. An empty body and `null` count as
/// `{}`.
pub(super) struct JsonBody<T, const LIMIT: usize = MAX_SMALL_BYTES>(pub(super) T);

impl<T: DeserializeOwned, const LIMIT: usize> FromRequest<App> for JsonBody<T, LIMIT> {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        let (parts, body) = request.into_parts();
        let bytes = read(app, &parts.headers, body, LIMIT).await?;
        Ok(Self(parse(&bytes)?))
    }
}

/// Reads a JSON body of at most `limit` bytes.
///
/// # Errors
/// 415 if the body is not empty and its media type is not JSON; the errors of [`body::read`].
pub(super) async fn read(
    app: &App,
    headers: &HeaderMap,
    body: Body,
    limit: usize,
) -> Result<Vec<u8>, Problem> {
    let timeout = app.service.limits().requests.body_timeout();
    let bytes = body::read(headers, body, limit, timeout, &app.budget.whole()).await?.bytes;
    check_media_type(headers, &bytes)?;
    Ok(bytes)
}

/// Parses the small JSON body of a route that is not part of the API.
///
/// # Errors
/// 415 if its media type is not JSON, 400 if it is not valid JSON, 422 with the pointer of an
/// invalid element.
pub fn parse_json<T: DeserializeOwned>(headers: &HeaderMap, bytes: &[u8]) -> Result<T, Problem> {
    check_media_type(headers, bytes)?;
    parse(bytes)
}

fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    let bytes = match bytes.trim_ascii() {
        b"" | b"null" => b"{}",
        bytes => bytes,
    };
    json::check_object(bytes)?;
    Ok(json::parse(bytes)?)
}

fn check_media_type(headers: &HeaderMap, body: &[u8]) -> Result<(), Problem> {
    let header = headers.get(CONTENT_TYPE).map(|text| text.to_str().unwrap_or_default());
    if body.is_empty() || header.is_some_and(is_json) {
        return Ok(());
    }
    let found = match header {
        Some(text) => format!("the media type `{text}`"),
        None => "a body without `Content-Type`".to_owned(),
    };
    let detail = format!("{found} is not supported; use application/json");
    Err(Problem::new(MEDIA_TYPE, detail))
}

/// Whether a media type is JSON, or a format on its basis such as `application/merge+json`.
fn is_json(header: &str) -> bool {
    let essence = header.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    essence == "application/json"
        || essence.starts_with("application/") && essence.ends_with("+json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_media_type_is_json_whatever_its_parameters() {
        for header in ["application/json", "Application/JSON; charset=utf-8", "application/a+json"]
        {
            assert!(is_json(header), "{header}");
        }
        for header in ["", "text/json", "application/jsonl", "application/xml", "x+json"] {
            assert!(!is_json(header), "{header}");
        }
    }
}
