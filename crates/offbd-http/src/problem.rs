//! Error responses as problem details (RFC 9457). The only place that maps an error to
//! its status.

use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::http::header::{
    ACCEPT_ENCODING, CONTENT_TYPE, ETAG, HeaderValue, RETRY_AFTER, WWW_AUTHENTICATE,
};
use axum::http::{Method, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::coding::{ACCEPTED_CODINGS, UNKNOWN_CODING};
use super::retry::retry_after_s;
use offbd_core::vocabulary::Invalid;
use offbd_service::{EntityTag, RETRY_AFTER_S, ServiceError};
use offbd_wire::PROBLEM_TYPE;
use offbd_wire::sovd::SovdErrorView;
use offbd_wire::telemetry::BatchError;

/// An error (`application/problem+json`, RFC 9457).
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct Problem {
    /// URI of the problem type.
    #[serde(rename = "type")]
    pub kind: Box<str>,
    /// Summary of the problem type.
    #[schema(value_type = String)]
    pub title: &'static str,
    pub status: u16,
    /// Explanation of this occurrence.
    pub detail: Box<str>,
    /// JSON pointer (RFC 6901) to the invalid element of the body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pointer: Option<Box<str>>,
    /// Name of the invalid query parameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter: Option<Box<str>>,
    /// The present entity tag of what the request was to replace, in quotes, for `If-Match`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>)]
    pub etag: Option<Box<EntityTag>>,
    /// Id of the request, as in `x-request-id` and in the log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instance: Option<Box<str>>,
    /// The members of an error of SOVD, in answers of its adapter.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    #[schema(ignore)]
    pub sovd: Option<Box<SovdErrorView>>,
    /// Seconds for the header `Retry-After`.
    #[serde(skip)]
    pub retry_after_s: u32,
}

impl Problem {
    /// Returns a problem of the type `urn:offbd:problem:{slug}`.
    pub fn new(
        status: StatusCode,
        slug: &str,
        title: &'static str,
        detail: impl Into<String>,
    ) -> Self {
        Self {
            kind: format!("{PROBLEM_TYPE}{slug}").into(),
            title,
            status: status.as_u16(),
            detail: detail.into().into(),
            pointer: None,
            parameter: None,
            etag: None,
            instance: None,
            sovd: None,
            retry_after_s: RETRY_AFTER_S as u32,
        }
    }

    /// Adds the members of an error of SOVD.
    pub(super) fn with_sovd(self) -> Self {
        let error_code = match self.status {
            401 | 403 => "insufficient-access-rights",
            400 | 408 | 413 | 415 | 422 => "incomplete-request",
            409 => "precondition-not-fulfilled",
            500..=599 => "sovd-server-failure",
            _ => "vendor-specific",
        };
        let vendor_code = self.kind.rsplit(':').next().unwrap_or_default().into();
        let named = [("parameter", &self.parameter), ("pointer", &self.pointer)];
        let named = named.into_iter().filter_map(|(key, value)| Some((key, value.clone()?)));
        let parameters = named.collect();
        let message = self.detail.clone();
        let sovd = SovdErrorView { error_code, message, vendor_code, parameters };
        Self { sovd: Some(Box::new(sovd)), ..self }
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
            headers.insert(RETRY_AFTER, HeaderValue::from(self.retry_after_s));
        }
        if status == StatusCode::UNAUTHORIZED {
            headers.insert(WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"offbd\""));
        }
        if let Some(etag) = self.etag.as_ref().and_then(|tag| tag.to_string().parse().ok()) {
            headers.insert(ETAG, etag);
        }
        // Only then: with the header a 415 speaks of the coding, not of the media type
        // (RFC 9110, section 12.5.3).
        if self.kind.ends_with(UNKNOWN_CODING) {
            headers.insert(ACCEPT_ENCODING, HeaderValue::from_static(ACCEPTED_CODINGS));
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
            E::UnknownRemark { .. } => missing("unknown-remark", "No such remark"),
            E::UnknownCalibration { .. } => missing("unknown-calibration", "No such calibration"),
            E::UnknownToken { .. } => missing("unknown-token", "No such token"),
            E::UnknownChannel { .. } => missing("unknown-channel", "No such channel"),
            E::UnknownRule { .. } => missing("unknown-rule", "No such rule"),
            E::UnknownDelivery { .. } => missing("unknown-delivery", "No such delivery"),
            E::ChannelExists { .. } => conflict("channel-exists", "Channel already exists"),
            E::ChannelInUse { .. } => conflict("channel-in-use", "Channel is in use"),
            E::TooManySettings { .. } => conflict("too-many", "Limit reached"),
            E::UnknownCode(_) => missing("unknown-code", "No such fault code"),
            E::NoRecording { .. } => missing("no-recording", "No recording"),
            E::AssetExists { .. } => conflict("asset-exists", "Asset already exists"),
            E::TokenExists { .. } => conflict("token-exists", "Token name already in use"),
            E::SessionExists { .. } => conflict("session-exists", "Session already exists"),
            E::SessionEnded { .. } => conflict("session-ended", "Session has ended"),
            E::NothingToAcknowledge { .. } => {
                conflict("nothing-to-acknowledge", "No current occurrence")
            }
            E::NoDriveCycle(_) => conflict("no-drive-cycle", "No drive cycle"),
            E::JobEnded { .. } => conflict("job-ended", "Job neither waits nor runs"),
            E::NotDone { .. } => conflict("not-done", "Calibration not done"),
            E::NothingOffered { .. } => conflict("nothing-offered", "No calibration offered"),
            E::AlreadyLearnt { .. } => conflict("already-learnt", "Rig already calibrated"),
            E::Changed { now } => {
                let etag = now.map(Box::new);
                Self {
                    etag,
                    ..new(StatusCode::PRECONDITION_FAILED, "changed", "Changed meanwhile")
                }
            }
            E::Invalid(invalid) => Self::from(invalid),
            E::Batch(batch) => Self::from(batch),
            E::TooMany { .. } => {
                new(StatusCode::PAYLOAD_TOO_LARGE, "too-large", "Content too large")
            }
            E::RegistryFull { .. } => {
                new(StatusCode::INSUFFICIENT_STORAGE, "registry-full", "Asset limit reached")
            }
            E::Busy { .. } => {
                let retry_after_s = retry_after_s();
                let status = StatusCode::TOO_MANY_REQUESTS;
                Self { retry_after_s, ..new(status, "busy", "Too many requests") }
            }
            E::Unavailable { .. } | E::Outage { .. } | E::Stalled { .. } => {
                new(StatusCode::SERVICE_UNAVAILABLE, "unavailable", "Service unavailable")
            }
            E::Rebuilding { retry_after_s } => {
                let status = StatusCode::SERVICE_UNAVAILABLE;
                let retry_after_s = u32::try_from(retry_after_s).unwrap_or(u32::MAX);
                Self { retry_after_s, ..new(status, "rebuilding", "Engine is being rebuilt") }
            }
            E::Moving => new(StatusCode::SERVICE_UNAVAILABLE, "moving", "Asset is moving"),
            E::NotStored { .. } => new(StatusCode::SERVICE_UNAVAILABLE, "store", "Store error"),
            E::Store(_) => {
                tracing::error!(error = detail, "the store failed");
                let detail = "the store failed; unacknowledged data were not stored, retry";
                Self::new(StatusCode::SERVICE_UNAVAILABLE, "store", "Store error", detail)
            }
            E::Corrupt { .. } => {
                tracing::error!(error = detail, "the store is corrupt");
                new(StatusCode::INTERNAL_SERVER_ERROR, "corrupt", "Corrupt data in the store")
            }
        }
    }
}

impl From<Invalid> for Problem {
    /// The element `?name` is a query parameter (400), a JSON pointer is an element of
    /// the body (422), and the empty pointer is a malformed body (400).
    fn from(invalid: Invalid) -> Self {
        let detail = invalid.to_string();
        if let Some(parameter) = invalid.element.strip_prefix('?') {
            let title = "Invalid query parameter";
            let problem = Self::new(StatusCode::BAD_REQUEST, "query", title, detail);
            return Self { parameter: Some(parameter.into()), ..problem };
        }
        if invalid.element.is_empty() {
            let title = "Malformed body";
            let detail = invalid.reason;
            return Self::new(StatusCode::BAD_REQUEST, "malformed", title, detail).at("");
        }
        let title = "Invalid value";
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, "invalid", title, detail).at(&invalid.element)
    }
}

impl From<BatchError> for Problem {
    fn from(error: BatchError) -> Self {
        let detail = error.to_string();
        match error {
            BatchError::Malformed { pointer, .. } => {
                let title = "Malformed body";
                Self::new(StatusCode::BAD_REQUEST, "malformed", title, detail).at(&pointer)
            }
            BatchError::TooMany { .. } => {
                Self::new(StatusCode::PAYLOAD_TOO_LARGE, "too-large", "Content too large", detail)
            }
        }
    }
}

impl From<QueryRejection> for Problem {
    fn from(rejection: QueryRejection) -> Self {
        let title = "Invalid query parameter";
        tracing::debug!(%rejection, "the description permits a query that is not understood");
        Self::new(StatusCode::BAD_REQUEST, "query", title, "the query cannot be understood")
    }
}

impl From<PathRejection> for Problem {
    fn from(rejection: PathRejection) -> Self {
        tracing::debug!(%rejection, "invalid path");
        Self::new(StatusCode::BAD_REQUEST, "path", "Invalid path", "the path is not valid UTF-8")
    }
}

pub(super) async fn not_found(uri: Uri) -> Problem {
    let detail = format!("no route matches {}; see /openapi.yaml", uri.path());
    Problem::new(StatusCode::NOT_FOUND, "unknown-path", "No such path", detail)
}

pub(super) async fn method_not_allowed(method: Method, uri: Uri) -> Problem {
    not_allowed(&method, &uri)
}

pub(super) fn not_allowed(method: &Method, uri: &Uri) -> Problem {
    let detail = format!("{} does not support {method}", uri.path());
    Problem::new(StatusCode::METHOD_NOT_ALLOWED, "method", "Method not allowed", detail)
}
