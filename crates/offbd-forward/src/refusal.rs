//! What the agent answers instead of an acknowledgement: problems (RFC 9457), as of the service.

use axum::body::Body;
use axum::extract::Request;
use axum::extract::rejection::BytesRejection;
use axum::http::StatusCode;
use axum::http::header::{CONTENT_LENGTH, CONTENT_TYPE, HeaderValue, RETRY_AFTER};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use offbd_core::vocabulary::Invalid;
use offbd_wire::PROBLEM_TYPE;
use offbd_wire::telemetry::{BatchError, UnsupportedMediaType};
use serde_json::{Value, json};
use tower_http::request_id::RequestId;

use super::intake::BODY_TIMEOUT;
use super::spool::SpoolError;

/// When a device may try again while the spool takes no more, s.
const RETRY_AFTER_S: u16 = 5;

/// Why a request is refused.
#[derive(Debug, thiserror::Error)]
pub(super) enum Refusal {
    #[error(transparent)]
    MediaType(#[from] UnsupportedMediaType),
    #[error(transparent)]
    Batch(#[from] BatchError),
    #[error(transparent)]
    Asset(#[from] Invalid),
    #[error(transparent)]
    Spool(#[from] SpoolError),
    #[error(transparent)]
    Body(#[from] BytesRejection),
    #[error("the body was not received in {} s", BODY_TIMEOUT.as_secs())]
    SlowBody,
    #[error("`Host` must be an IP address, localhost, or a name that is given with --host")]
    Host,
    #[error("the request comes from a page of another site")]
    Origin,
}

impl Refusal {
    /// The status, the name of the problem's type, and its title.
    fn kind(&self) -> (StatusCode, &'static str, &'static str) {
        match self {
            Self::MediaType(_) => {
                (StatusCode::UNSUPPORTED_MEDIA_TYPE, "media-type", "Unsupported media type")
            }
            Self::Batch(BatchError::Malformed { .. }) => {
                (StatusCode::BAD_REQUEST, "malformed", "Malformed body")
            }
            Self::Batch(BatchError::TooMany { .. }) => {
                (StatusCode::PAYLOAD_TOO_LARGE, "too-large", "Content too large")
            }
            Self::Body(rejection) if rejection.status() == StatusCode::PAYLOAD_TOO_LARGE => {
                (StatusCode::PAYLOAD_TOO_LARGE, "too-large", "Content too large")
            }
            Self::Body(_) => (StatusCode::BAD_REQUEST, "malformed", "Malformed body"),
            Self::SlowBody => (StatusCode::REQUEST_TIMEOUT, "slow-body", "Request timeout"),
            Self::Host => (StatusCode::MISDIRECTED_REQUEST, "misdirected", "Misdirected request"),
            Self::Origin => (StatusCode::FORBIDDEN, "forbidden", "Forbidden"),
            Self::Asset(_) => (StatusCode::UNPROCESSABLE_ENTITY, "invalid", "Invalid value"),
            Self::Spool(SpoolError::Full { .. }) => {
                (StatusCode::TOO_MANY_REQUESTS, "spool-full", "Spool full")
            }
            Self::Spool(_) => (StatusCode::SERVICE_UNAVAILABLE, "spool", "Not stored"),
        }
    }

    /// The invalid element of the body, as a JSON pointer.
    fn pointer(&self) -> Option<&str> {
        match self {
            Self::Batch(BatchError::Malformed { pointer, .. }) => Some(pointer),
            Self::Asset(invalid) => Some(&invalid.element),
            _ => None,
        }
    }
}

impl IntoResponse for Refusal {
    /// The body is written by [`name_request`], which knows the id of the request.
    fn into_response(self) -> Response {
        let (status, slug, title) = self.kind();
        let mut problem = json!({
            "type": format!("{PROBLEM_TYPE}{slug}"), "title": title, "status": status.as_u16(),
            "detail": self.to_string(),
        });
        if let Some(pointer) = self.pointer() {
            problem["pointer"] = pointer.into();
        }
        let mut response = status.into_response();
        let headers = response.headers_mut();
        headers.insert(CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        if let Self::Spool(_) = self {
            headers.insert(RETRY_AFTER, HeaderValue::from(RETRY_AFTER_S));
        }
        response.extensions_mut().insert(Problem(problem));
        response
    }
}

/// A problem without the id of its request.
#[derive(Clone)]
struct Problem(Value);

/// Writes the problem of a refused request, with the id of the request as its `instance`.
pub(super) async fn name_request(request: Request, next: Next) -> Response {
    let id = request.extensions().get::<RequestId>().cloned();
    let mut response = next.run(request).await;
    if let Some(Problem(mut problem)) = response.extensions_mut().remove::<Problem>() {
        let id = id.as_ref().and_then(|id| id.header_value().to_str().ok());
        problem["instance"] = id.map(|id| format!("urn:uuid:{id}")).into();
        *response.body_mut() = Body::from(problem.to_string());
        response.headers_mut().remove(CONTENT_LENGTH);
    }
    response
}
