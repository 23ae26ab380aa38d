//! Remarks on a moment or a stretch of a session.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a person has noted on a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RemarkView {
    pub id: String,
    pub text: String,
    /// Who wrote it.
    pub by: String,
    /// Time that it is about, or start of the stretch, s on the device's clock.
    pub from_s: f64,
    /// End of the stretch, s; equal to `from_s` for a moment.
    pub to_s: f64,
    /// When it was written, RFC 3339.
    pub at: String,
}

/// A remark to keep.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewRemarkView {
    /// 1 to 2000 bytes.
    #[schema(min_length = 1, max_length = 2000)]
    pub text: String,
    /// Time that it is about, or start of the stretch, s on the device's clock.
    pub from_s: f64,
    /// End of the stretch, s, not before `from_s`; without it the remark is about a moment.
    #[serde(default)]
    pub to_s: Option<f64>,
}
