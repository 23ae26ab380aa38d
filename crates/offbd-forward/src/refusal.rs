//! What the agent answers instead of an acknowledgement: problems (RFC 9457), as of the service.

use std::time::Duration;

use axum::body::Body;
use axum::extract::Request;
use axum::http::StatusCode;
use axum::http::header::{ACCEPT_ENCODING, CONTENT_LENGTH, CONTENT_TYPE, HeaderValue, RETRY_AFTER};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use offbd_core::vocabulary::Invalid;
use offbd_net::coding::{ACCEPTED_CODINGS, BodyError, UnsupportedCoding};
use offbd_wire::problem::{self, ProblemType};
use offbd_wire::telemetry::{BatchError, UnsupportedMediaType};
use serde_json::{Value, json};
use tower_http::request_id::RequestId;

use super::batch::SpoolError;

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
    Coding(#[from] UnsupportedCoding),
    #[error(transparent)]
    Body(#[from] BodyError),
    #[error("the body was not received in {} s", .0.as_secs())]
    SlowBody(Duration),
    #[error("`Host` must be an IP address, localhost, or a name that is given with --host")]
    Host,
    #[error("the request comes from a page of another site")]
    Origin,
}

impl Refusal {
    fn kind(&self) -> &'static ProblemType {
        match self {
            Self::MediaType(_) => problem::MEDIA_TYPE,
            Self::Batch(BatchError::Malformed { .. }) => problem::MALFORMED,
            Self::Batch(BatchError::TooMany { .. }) => problem::TOO_LARGE,
            Self::Coding(_) => problem::CONTENT_CODING,
            Self::Body(BodyError::TooLong { .. }) => problem::TOO_LARGE,
            Self::Body(_) => problem::MALFORMED,
            Self::SlowBody(_) => problem::SLOW_BODY,
            Self::Host => problem::MISDIRECTED,
            Self::Origin => problem::FORBIDDEN,
            Self::Asset(_) => problem::INVALID,
            Self::Spool(SpoolError::Full { .. }) => problem::SPOOL_FULL,
            Self::Spool(_) => problem::SPOOL,
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
        let kind = self.kind();
        let mut problem = json!({
            "type": kind.uri(), "title": kind.title, "status": kind.status,
            "detail": self.to_string(),
        });
        if let Some(pointer) = self.pointer() {
            problem["pointer"] = pointer.into();
        }
        let status = StatusCode::from_u16(kind.status);
        let mut response = status.unwrap_or(StatusCode::INTERNAL_SERVER_ERROR).into_response();
        let headers = response.headers_mut();
        headers.insert(CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        if let Self::Spool(_) = self {
            headers.insert(RETRY_AFTER, HeaderValue::from(RETRY_AFTER_S));
        }
        if let Self::Coding(_) = self {
            headers.insert(ACCEPT_ENCODING, HeaderValue::from_static(ACCEPTED_CODINGS));
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
