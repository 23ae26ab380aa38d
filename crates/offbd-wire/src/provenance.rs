//! Sessions and people behind a fault record: where and when the fault occurred, who
//! acknowledged or cleared it. The engine knows neither.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::stored::{StoredAct, StoredOccurrence, StoredProvenance};

/// Where and when the fault occurred, and who acknowledged or cleared it.
// Occurrences are boxed: most codes of most assets have none.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ProvenanceView {
    /// The first occurrence since the last clear; null if there is none.
    #[serde(default)]
    pub first_occurrence: Option<Box<OccurrenceView>>,
    /// The last occurrence, which may be the first; null if there is none.
    #[serde(default)]
    pub last_occurrence: Option<Box<OccurrenceView>>,
    /// Who acknowledged the current occurrence, and when; null if nobody has.
    #[serde(default)]
    pub acknowledgement: Option<ActView>,
    /// Who last cleared the code, and when; null if nobody ever has.
    #[serde(default)]
    pub cleared: Option<ActView>,
}

/// An occurrence of a fault.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct OccurrenceView {
    /// The session's name.
    pub session: String,
    /// The service's id of the session, which may have been deleted since.
    pub session_id: String,
    /// Time at which the service judged the sample at which the test failed, RFC 3339.
    pub noted_at: String,
    /// Id of the calibration that was used; null if the rig was not calibrated.
    pub calibration_id: Option<String>,
    /// Id of the profile, settings and rig description that were used.
    pub settings_id: String,
}

/// An action of a person.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ActView {
    /// Name of the principal, or the request's `by` if the service requires no token.
    pub by: String,
    /// Time of the action, RFC 3339.
    pub at: String,
}

impl From<StoredProvenance> for ProvenanceView {
    fn from(stored: StoredProvenance) -> Self {
        let occurrence = |stored: Box<StoredOccurrence>| Box::new(OccurrenceView::from(*stored));
        Self {
            first_occurrence: stored.first_occurrence.map(occurrence),
            last_occurrence: stored.last_occurrence.map(occurrence),
            acknowledgement: stored.acknowledgement.map(|act| ActView::from(*act)),
            cleared: stored.cleared.map(|act| ActView::from(*act)),
        }
    }
}

impl From<StoredOccurrence> for OccurrenceView {
    fn from(stored: StoredOccurrence) -> Self {
        let StoredOccurrence { session, session_id, noted_at, calibration_id, settings_id } =
            stored;
        Self { session, session_id, noted_at, calibration_id, settings_id }
    }
}

impl From<StoredAct> for ActView {
    fn from(StoredAct { by, at }: StoredAct) -> Self {
        Self { by, at }
    }
}
