//! Alarms of the fleet, mutes, and lost communication, as the API returns them.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::provenance::ActView;
use super::words::{AlarmChangeWord, AlarmCodeWord, EvidenceWord, KindWord, StatusWord};

/// A mute of a monitor: it is not tested, as far as people are told. The monitor goes on, and
/// the fault memory records what it finds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct MuteView {
    pub asset: String,
    pub code: AlarmCodeWord,
    /// Who has muted it: name of the principal, or the request's `by` if the service requires
    /// no token.
    pub by: String,
    pub reason: String,
    /// Time at which it was muted, RFC 3339.
    pub at: String,
    /// Time at which the mute ends by itself, RFC 3339.
    pub until: String,
    /// Entity tag of the mute, for `If-Match`.
    #[serde(default)]
    #[schema(required)]
    pub etag: String,
}

/// A mute to set.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewMuteView {
    /// Why, 1 to 200 bytes.
    #[schema(min_length = 1, max_length = 200)]
    pub reason: String,
    /// When it ends by itself, RFC 3339; in the future and within a year.
    #[schema(format = DateTime)]
    pub until: String,
}

/// An alarm: a fault on record, or lost communication.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct AlarmView {
    pub asset: String,
    pub code: AlarmCodeWord,
    /// Failure mode; null if the evidence does not determine it.
    pub kind: Option<KindWord>,
    /// Weight of this kind among the candidates, in (0, 1]; null without a kind.
    pub kind_weight: Option<f64>,
    /// Status of the fault; of lost communication `confirmed`, or `healed` once data arrive.
    pub status: StatusWord,
    /// Whether the last result of its test is a failure.
    pub failing: bool,
    /// Whether this result is one of the last session that was opened; false if the test has had
    /// none in it yet.
    pub tested: bool,
    /// Whether the rig has an open session. Without one, the results of its tests are those of
    /// a session that has ended.
    pub session_open: bool,
    /// Time at which the last data of the rig arrived, RFC 3339, if data have stopped during an open
    /// session; null otherwise. What failed then is not known to fail now.
    #[serde(default)]
    #[schema(required)]
    pub communication_lost_since: Option<String>,
    /// Time at which the last occurrence was found, RFC 3339; of lost communication the
    /// arrival of the last data before it. Null if unknown.
    pub since: Option<String>,
    /// Time at which the record last changed, RFC 3339.
    pub changed_at: String,
    /// Occurrences since the last clear.
    pub occurrences: u32,
    /// Who acknowledged the current occurrence, and when; null if nobody has.
    pub acknowledgement: Option<ActView>,
    /// The mute in force; null without one.
    pub muted: Option<MuteView>,
    /// The service's id of the session of the last occurrence; null if unknown.
    pub session_id: Option<String>,
    pub evidence: AlarmEvidenceView,
}

/// What is kept of the last occurrence. A clear removes none of it: the values at each change
/// stay in the history of the code, the recording stays in its session.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct AlarmEvidenceView {
    pub state: EvidenceWord,
    /// Why not everything is there; null if it is complete.
    pub reason: Option<String>,
}

/// A change of whether data of a rig arrive, the data of an event `communication`.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CommunicationView {
    /// Always `communication`.
    #[serde(rename = "type")]
    pub line: String,
    /// Name of the open session; null if it has ended.
    pub session: Option<String>,
    /// Always `communication_lost`.
    pub code: AlarmCodeWord,
    /// `confirmed` when data stop during a session, `passed` when they are back.
    pub status: AlarmChangeWord,
    /// Time at which the last data before the loss arrived, RFC 3339.
    pub since: String,
    /// The event in one sentence.
    pub summary: String,
}

/// The data of an event `communication`.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CommunicationEventView {
    pub asset: String,
    /// The service's id of the session; null if none was open.
    pub session_id: Option<String>,
    #[serde(flatten)]
    pub change: CommunicationView,
}

/// Alarms to acknowledge.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AcknowledgeView {
    /// 1 to 500 alarms.
    #[schema(min_items = 1, max_items = 500)]
    pub alarms: Vec<AlarmKeyView>,
}

/// Names an alarm.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AlarmKeyView {
    pub asset: String,
    pub code: AlarmCodeWord,
}

/// The outcome for each alarm of a request, in its order.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct AcknowledgedView {
    pub items: Vec<AcknowledgeOutcomeView>,
}

/// The outcome for one alarm.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct AcknowledgeOutcomeView {
    pub asset: String,
    pub code: AlarmCodeWord,
    pub acknowledged: bool,
    /// Why it was not acknowledged; null if it was.
    pub reason: Option<String>,
}

/// What to do about an alarm.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct AdviceView {
    pub code: AlarmCodeWord,
    /// The failure mode that the checks are for; null for all others of the code.
    pub kind: Option<KindWord>,
    /// Checks to make, the likeliest cause first.
    pub checks: Vec<String>,
}

/// What to do about each kind of alarm.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct AdviceListView {
    pub items: Vec<AdviceView>,
    /// The owner's own notes, at most one for each code.
    pub notes: Vec<NoteView>,
}

/// The owner's own note on a code.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct NoteView {
    pub code: AlarmCodeWord,
    pub text: String,
    /// Who wrote it.
    pub by: String,
    /// When, RFC 3339.
    pub at: String,
    /// Entity tag of the note, for `If-Match`.
    pub etag: String,
}

/// A note to keep.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewNoteView {
    /// At most 2000 bytes; an empty text removes the note.
    #[schema(max_length = 2000)]
    pub text: String,
}
