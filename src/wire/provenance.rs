//! Where and when a fault came up, and what people did about it: what the
//! engine cannot know of a code, for it knows neither sessions nor people.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What is known of a code beside its record.
// Occurrences are boxed: most codes of most assets have none.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ProvenanceView {
    /// The first occurrence since the last clear; null without one.
    #[serde(default)]
    pub first_occurrence: Option<Box<OccurrenceView>>,
    /// The last one; it may be the first.
    #[serde(default)]
    pub last_occurrence: Option<Box<OccurrenceView>>,
    /// Who acknowledged the current occurrence, and when; null until then.
    #[serde(default)]
    pub acknowledgement: Option<ActView>,
    /// Who last cleared the code, and when; null if nobody ever did.
    #[serde(default)]
    pub cleared: Option<ActView>,
}

/// Where and when a code failed anew.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct OccurrenceView {
    /// The session's name.
    pub session: String,
    /// The service's id of the session, which may have been deleted since.
    pub session_id: String,
    /// RFC 3339: when the service judged the sample at which the test failed.
    pub noted_at: String,
    /// Of the calibration that judged; null on a rig not learnt.
    pub calibration_id: Option<String>,
    /// Of the profile, the settings and the rig's description that judged.
    pub settings_id: String,
}

/// What a person did.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ActView {
    /// As `by` said.
    pub by: String,
    /// RFC 3339.
    pub at: String,
}
