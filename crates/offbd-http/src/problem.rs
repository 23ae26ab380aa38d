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

use super::retry::retry_after_s;
use offbd_core::vocabulary::Invalid;
use offbd_net::coding::{ACCEPTED_CODINGS, BodyError, UnsupportedCoding};
use offbd_service::{EntityTag, RETRY_AFTER_S, ServiceError};
use offbd_wire::problem::{self as types, ProblemType};
use offbd_wire::sovd::SovdErrorView;
use offbd_wire::telemetry::BatchError;

/// An error (`application/problem+json`, RFC 9457).
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct Problem {
    /// URI of the problem type, one of those in `docs/operations/problems.md`.
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
    /// Returns a problem of the type `kind`.
    pub fn new(kind: &ProblemType, detail: impl Into<String>) -> Self {
        Self {
            kind: kind.uri().into(),
            title: kind.title,
            status: kind.status,
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
        if *self.kind == *types::CONTENT_CODING.uri() {
            headers.insert(ACCEPT_ENCODING, HeaderValue::from_static(ACCEPTED_CODINGS));
        }
        response.extensions_mut().insert(self);
        response
    }
}

impl From<UnsupportedCoding> for Problem {
    fn from(error: UnsupportedCoding) -> Self {
        Self::new(types::CONTENT_CODING, error.to_string())
    }
}

impl From<BodyError> for Problem {
    fn from(error: BodyError) -> Self {
        let kind = match error {
            BodyError::TooLong { .. } => types::TOO_LARGE,
            BodyError::Incomplete(_) | BodyError::Undecodable(_) => types::MALFORMED,
        };
        Self::new(kind, error.to_string())
    }
}

impl From<ServiceError> for Problem {
    fn from(error: ServiceError) -> Self {
        use ServiceError as E;
        let detail = error.to_string();
        let new = |kind| Self::new(kind, detail.clone());
        match error {
            E::UnknownAsset { .. } => new(types::UNKNOWN_ASSET),
            E::UnknownSession { .. } => new(types::UNKNOWN_SESSION),
            E::UnknownReplay { .. } => new(types::UNKNOWN_REPLAY),
            E::UnknownRemark { .. } => new(types::UNKNOWN_REMARK),
            E::UnknownCalibration { .. } => new(types::UNKNOWN_CALIBRATION),
            E::UnknownToken { .. } => new(types::UNKNOWN_TOKEN),
            E::UnknownChannel { .. } => new(types::UNKNOWN_CHANNEL),
            E::UnknownRule { .. } => new(types::UNKNOWN_RULE),
            E::UnknownDelivery { .. } => new(types::UNKNOWN_DELIVERY),
            E::ChannelExists { .. } => new(types::CHANNEL_EXISTS),
            E::ChannelInUse { .. } => new(types::CHANNEL_IN_USE),
            E::TooManySettings { .. } => new(types::TOO_MANY_SETTINGS),
            E::UnknownCode(_) => new(types::UNKNOWN_CODE),
            E::NoRecording { .. } => new(types::NO_RECORDING),
            E::AssetExists { .. } => new(types::ASSET_EXISTS),
            E::TokenExists { .. } => new(types::TOKEN_EXISTS),
            E::SessionExists { .. } => new(types::SESSION_EXISTS),
            E::SessionEnded { .. } => new(types::SESSION_ENDED),
            E::NothingToAcknowledge { .. } => new(types::NOTHING_TO_ACKNOWLEDGE),
            E::NoDriveCycle(_) => new(types::NO_DRIVE_CYCLE),
            E::JobEnded { .. } => new(types::JOB_ENDED),
            E::NotDone { .. } => new(types::NOT_DONE),
            E::NothingOffered { .. } => new(types::NOTHING_OFFERED),
            E::AlreadyLearnt { .. } => new(types::ALREADY_LEARNT),
            E::Changed { now } => {
                let etag = now.map(Box::new);
                Self { etag, ..new(types::CHANGED) }
            }
            E::Invalid(invalid) => Self::from(invalid),
            E::Batch(batch) => Self::from(batch),
            E::TooMany { .. } => new(types::TOO_LARGE),
            E::RegistryFull { .. } => new(types::REGISTRY_FULL),
            E::Busy { .. } => {
                let retry_after_s = retry_after_s();
                Self { retry_after_s, ..new(types::BUSY) }
            }
            E::Unavailable { .. } | E::Outage { .. } | E::Stalled { .. } => new(types::UNAVAILABLE),
            E::Rebuilding { retry_after_s } => {
                let retry_after_s = u32::try_from(retry_after_s).unwrap_or(u32::MAX);
                Self { retry_after_s, ..new(types::REBUILDING) }
            }
            E::Moving => new(types::MOVING),
            E::NotStored { .. } => new(types::STORE),
            E::Store(_) => {
                tracing::error!(error = detail, "the store failed");
                let detail = "the store failed; unacknowledged data were not stored, retry";
                Self::new(types::STORE, detail)
            }
            E::Corrupt { .. } => {
                tracing::error!(error = detail, "the store is corrupt");
                new(types::CORRUPT)
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
            let problem = Self::new(types::MALFORMED_QUERY, detail);
            return Self { parameter: Some(parameter.into()), ..problem };
        }
        if invalid.element.is_empty() {
            let detail = invalid.reason;
            return Self::new(types::MALFORMED, detail).at("");
        }
        Self::new(types::INVALID, detail).at(&invalid.element)
    }
}

impl From<BatchError> for Problem {
    fn from(error: BatchError) -> Self {
        let detail = error.to_string();
        match error {
            BatchError::Malformed { pointer, .. } => {
                Self::new(types::MALFORMED, detail).at(&pointer)
            }
            BatchError::TooMany { .. } => Self::new(types::TOO_LARGE, detail),
        }
    }
}

impl From<QueryRejection> for Problem {
    fn from(rejection: QueryRejection) -> Self {
        tracing::debug!(%rejection, "the description permits a query that is not understood");
        Self::new(types::MALFORMED_QUERY, "the query cannot be understood")
    }
}

impl From<PathRejection> for Problem {
    fn from(rejection: PathRejection) -> Self {
        tracing::debug!(%rejection, "invalid path");
        Self::new(types::MALFORMED_PATH, "the path is not valid UTF-8")
    }
}

pub(super) async fn not_found(uri: Uri) -> Problem {
    let detail = format!("no route matches {}; see /openapi.yaml", uri.path());
    Problem::new(types::UNKNOWN_PATH, detail)
}

pub(super) async fn method_not_allowed(method: Method, uri: Uri) -> Problem {
    not_allowed(&method, &uri)
}

pub(super) fn not_allowed(method: &Method, uri: &Uri) -> Problem {
    let detail = format!("{} does not support {method}", uri.path());
    Problem::new(types::METHOD_NOT_ALLOWED, detail)
}
