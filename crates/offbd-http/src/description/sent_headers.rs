//! The response headers that clients read, described where they are sent.
//!
//! A handler names the headers that it sends itself. Headers that every response with a certain
//! status has are added here.

use axum::http::StatusCode;
use utoipa::openapi::header::{Header, HeaderBuilder};
use utoipa::openapi::schema::{ObjectBuilder, Type};
use utoipa::openapi::{Components, Ref, RefOr, Response};

/// A header that several responses share.
struct SentHeader {
    name: &'static str,
    /// The statuses of all responses that have it; others name it.
    always_with: &'static [StatusCode],
    kind: Type,
    description: &'static str,
}

/// The header of every response.
const REQUEST_ID: &str = "x-request-id";

const HEADERS: [SentHeader; 8] = [
    SentHeader {
        name: REQUEST_ID,
        always_with: &[],
        kind: Type::String,
        description: "Id of the request, as in the log: that of the request itself, or a new one",
    },
    SentHeader {
        name: "Retry-After",
        always_with: &[StatusCode::TOO_MANY_REQUESTS, StatusCode::SERVICE_UNAVAILABLE],
        kind: Type::Integer,
        description: "Seconds after which to send the request again",
    },
    SentHeader {
        name: "WWW-Authenticate",
        always_with: &[StatusCode::UNAUTHORIZED, StatusCode::FORBIDDEN],
        kind: Type::String,
        description: "The scheme of authentication, and what the token lacks",
    },
    SentHeader {
        name: "Accept-Encoding",
        always_with: &[StatusCode::UNSUPPORTED_MEDIA_TYPE],
        kind: Type::String,
        description: "The codings that a body may have, if it has another one",
    },
    SentHeader {
        name: "ETag",
        always_with: &[StatusCode::NOT_MODIFIED, StatusCode::PRECONDITION_FAILED],
        kind: Type::String,
        description: "Entity tag of the edition, for `If-Match` and `If-None-Match`",
    },
    SentHeader {
        name: "Location",
        always_with: &[],
        kind: Type::String,
        description: "Path of what the request has created or begun",
    },
    SentHeader {
        name: "Content-Disposition",
        always_with: &[],
        kind: Type::String,
        description: "A name for the file",
    },
    SentHeader {
        name: "Set-Cookie",
        always_with: &[],
        kind: Type::String,
        description: "The login, or its end",
    },
];

/// Adds the headers of every response with this status, and refers to the description of each.
pub(super) fn describe(code: &str, response: &mut Response) {
    for header in &HEADERS {
        let is_always = header.name == REQUEST_ID
            || header.always_with.iter().any(|status| status.as_str() == code);
        if is_always || response.headers.contains_key(header.name) {
            let reference = Ref::new(format!("#/components/headers/{}", header.name));
            response.headers.insert(header.name.to_owned(), RefOr::Ref(reference));
        }
    }
}

/// Adds the descriptions to which responses refer.
pub(super) fn add_to(components: &mut Components) {
    let described = HEADERS.iter().map(|header| (header.name.to_owned(), object(header).into()));
    components.headers.extend(described);
}

fn object(header: &SentHeader) -> Header {
    let schema = ObjectBuilder::new().schema_type(header.kind.clone()).build();
    HeaderBuilder::new().schema(Some(schema)).description(Some(header.description)).build()
}
