//! What goes wrong, as RFC 9457 says it. The one place that knows which status
//! an error has.

use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::http::header::{CONTENT_TYPE, HeaderValue, RETRY_AFTER, WWW_AUTHENTICATE};
use axum::http::{Method, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use crate::service::{RETRY_AFTER_S, ServiceError};
use crate::wire::telemetry::BatchError;
use offbd_core::vocabulary::Invalid;

/// An error (`application/problem+json`, RFC 9457).
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct Problem {
    /// Names the kind of problem.
    #[serde(rename = "type")]
    pub kind: Box<str>,
    /// The kind in words.
    #[schema(value_type = String)]
    pub title: &'static str,
    pub status: u16,
    /// This one in words.
    pub detail: Box<str>,
    /// JSON pointer (RFC 6901) of the offending element of the body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pointer: Option<Box<str>>,
    /// Name of the offending query parameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter: Option<Box<str>>,
    /// The request's id, as in `x-request-id` and in the log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instance: Option<Box<str>>,
}

impl Problem {
    /// A problem of the kind `slug`, in words `title`.
    pub fn new(
        status: StatusCode,
        slug: &str,
        title: &'static str,
        detail: impl Into<String>,
    ) -> Self {
        Self {
            kind: format!("urn:offbd:problem:{slug}").into(),
            title,
            status: status.as_u16(),
            detail: detail.into().into(),
            pointer: None,
            parameter: None,
            instance: None,
        }
    }

    fn at(self, pointer: &str) -> Self {
        Self { pointer: Some(pointer.into()), ..self }
    }

    fn status(&self) -> StatusCode {
        StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR)
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = self.status();
        let body = serde_json::to_vec(&self).unwrap_or_default();
        let mut response = (status, body).into_response();
        let headers = response.headers_mut();
        headers.insert(CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        if matches!(status, StatusCode::SERVICE_UNAVAILABLE | StatusCode::TOO_MANY_REQUESTS) {
            headers.insert(RETRY_AFTER, HeaderValue::from(RETRY_AFTER_S));
        }
        if status == StatusCode::UNAUTHORIZED {
            headers.insert(WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"offbd\""));
        }
        response.extensions_mut().insert(self);
        response
    }
}

impl From<ServiceError> for Problem {
    fn from(error: ServiceError) -> Self {
        use ServiceError as E;
        let detail = error.to_string();
        let new = |status, slug, title| Self::new(status, slug, title, detail.clone());
        let missing = |slug, title| new(StatusCode::NOT_FOUND, slug, title);
        let conflict = |slug, title| new(StatusCode::CONFLICT, slug, title);
        match error {
            E::UnknownAsset { .. } => missing("unknown-asset", "No such asset"),
            E::UnknownSession { .. } => missing("unknown-session", "No such session"),
            E::UnknownReplay { .. } => missing("unknown-replay", "No such replay"),
            E::UnknownCalibration { .. } => missing("unknown-calibration", "No such calibration"),
            E::UnknownToken { .. } => missing("unknown-token", "No such token"),
            E::UnknownCode(_) => missing("unknown-code", "No such fault code"),
            E::NoRecording { .. } => missing("no-recording", "No recording"),
            E::AssetExists { .. } => conflict("asset-exists", "The asset is there already"),
            E::TokenExists { .. } => conflict("token-exists", "The name is taken"),
            E::SessionExists { .. } => conflict("session-exists", "The session is there already"),
            E::SessionEnded { .. } => conflict("session-ended", "The session has ended"),
            E::NothingToAcknowledge { .. } => conflict("nothing-to-acknowledge", "No occurrence"),
            E::NoDriveCycle(_) => conflict("no-drive-cycle", "No drive cycle"),
            E::NotDone { .. } => conflict("not-done", "Not done yet"),
            E::NothingOffered { .. } => conflict("nothing-offered", "Nothing is offered"),
            E::AlreadyLearnt { .. } => conflict("already-learnt", "The rig is learnt already"),
            E::Invalid(invalid) => Self::from(invalid),
            E::Batch(batch) => Self::from(batch),
            E::TooMany { .. } => new(StatusCode::PAYLOAD_TOO_LARGE, "too-large", "Too large"),
            E::RegistryFull { .. } => {
                new(StatusCode::INSUFFICIENT_STORAGE, "registry-full", "The registry is full")
            }
            E::Busy { .. } => new(StatusCode::TOO_MANY_REQUESTS, "busy", "Too much at once"),
            E::Unavailable { .. } | E::Outage { .. } | E::Stalled { .. } => {
                new(StatusCode::SERVICE_UNAVAILABLE, "unavailable", "Not available now")
            }
            E::NotStored { .. } => {
                new(StatusCode::SERVICE_UNAVAILABLE, "store", "The store failed")
            }
            E::Store(_) => {
                tracing::error!(error = detail, "the store failed");
                let detail = "the store failed; what was not acknowledged was not taken";
                Self::new(StatusCode::SERVICE_UNAVAILABLE, "store", "The store failed", detail)
            }
            E::Corrupt { .. } => {
                tracing::error!(error = detail, "the store is corrupt");
                new(StatusCode::INTERNAL_SERVER_ERROR, "corrupt", "The store cannot be read")
            }
        }
    }
}

impl From<Invalid> for Problem {
    /// `?name` stands for a query parameter, a pointer for an element of the
    /// body, the empty one for the whole of a body that cannot be read.
    fn from(invalid: Invalid) -> Self {
        let detail = invalid.to_string();
        if let Some(parameter) = invalid.element.strip_prefix('?') {
            let problem = Self::new(StatusCode::BAD_REQUEST, "query", "Bad query", detail);
            return Self { parameter: Some(parameter.into()), ..problem };
        }
        if invalid.element.is_empty() {
            let title = "The body cannot be read";
            let detail = invalid.reason;
            return Self::new(StatusCode::BAD_REQUEST, "malformed", title, detail).at("");
        }
        let title = "An element cannot be";
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, "invalid", title, detail).at(&invalid.element)
    }
}

impl From<BatchError> for Problem {
    fn from(error: BatchError) -> Self {
        let detail = error.to_string();
        match error {
            BatchError::Malformed { pointer, .. } => {
                let title = "The body cannot be read";
                Self::new(StatusCode::BAD_REQUEST, "malformed", title, detail).at(&pointer)
            }
            BatchError::TooMany { .. } => {
                Self::new(StatusCode::PAYLOAD_TOO_LARGE, "too-large", "Too large", detail)
            }
        }
    }
}

impl From<QueryRejection> for Problem {
    fn from(rejection: QueryRejection) -> Self {
        Self::new(StatusCode::BAD_REQUEST, "query", "Bad query", rejection.body_text())
    }
}

impl From<PathRejection> for Problem {
    fn from(rejection: PathRejection) -> Self {
        Self::new(StatusCode::BAD_REQUEST, "path", "Bad path", rejection.body_text())
    }
}

pub(super) async fn not_found(uri: Uri) -> Problem {
    let detail = format!("nothing is at {}; /openapi.yaml says what there is", uri.path());
    Problem::new(StatusCode::NOT_FOUND, "unknown-path", "No such path", detail)
}

pub(super) async fn method_not_allowed(method: Method, uri: Uri) -> Problem {
    not_allowed(&method, &uri)
}

pub(super) fn not_allowed(method: &Method, uri: &Uri) -> Problem {
    let detail = format!("{} does not take {method}", uri.path());
    Problem::new(StatusCode::METHOD_NOT_ALLOWED, "method", "Method not allowed", detail)
}
