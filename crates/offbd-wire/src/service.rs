//! The resources of the API: sessions, the fleet and its faults, events, the state of a
//! twin, imports, replays, calibrations.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::alarm::MuteView;
use super::difference::{ComparedView, TallyView};
use super::learning::{LearningState, LearningView};
use super::memory::FaultRecordView;
use super::provenance::ProvenanceView;
use super::trace::TraceView;
use super::trend::TrendWarningView;
use super::verdict::{EvidenceView, FaultView, SummaryView, code_title, evidence_view};
use super::words::{
    AxisWord, ChangeWord, CodeWord, CommandWord, HistoryWord, JobKind, JobState, JobWaitReason,
    KindWord, LineWord, ModelWord, ProfileWord, SessionState, StatusWord,
};
use offbd_core::diagnosis::StatusByte;
use offbd_core::engine::{MonitorState, State, Unjudged};
use offbd_core::vocabulary::{Axis, FaultCode, PerAxis, SimTime, TimeRange};

/// One page of a list.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct Page<T> {
    pub items: Vec<T>,
    /// Opaque value of the parameter `cursor` for the next page; null on the last page.
    pub next: Option<String>,
}

/// A session.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SessionView {
    /// The service's id of the session.
    pub id: String,
    pub asset: String,
    /// The device's name for the session, or the time at which it was opened.
    pub name: String,
    pub state: SessionState,
    /// Time at which the session was opened, RFC 3339.
    pub opened_at: String,
    /// Time at which the session was ended, RFC 3339; null while it is open.
    pub ended_at: Option<String>,
    /// Number of recorded samples.
    pub samples: u64,
    /// Number of rejected rows, which are neither recorded nor judged.
    pub rejected: u64,
    /// Earliest time of a sample, s on the device's clock; null without samples.
    pub first_t_s: Option<f64>,
    /// Latest time of a sample, s on the device's clock; null without samples.
    pub last_t_s: Option<f64>,
    /// Highest recorded `seq`; null if no sample has one.
    pub last_seq: Option<u64>,
    /// Number of the part, from 1: a session that has become too long continues in another
    /// one, whose name ends with the number.
    pub part: u64,
    /// The service's id of the first part; null in that itself.
    pub first_part: Option<String>,
    /// The verdict; null while the session is open.
    pub verdict: Option<SummaryView>,
}

/// The calibration that a session is judged with: that of the rig when it was opened.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SessionCalibrationView {
    /// Null if the rig was not calibrated.
    pub calibration: Option<super::asset::CalibrationView>,
}

/// The record of one fault code of one asset.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FaultEntryView {
    pub asset: String,
    /// Time at which the record last changed, RFC 3339.
    pub changed_at: String,
    #[serde(flatten)]
    pub record: FaultRecordView,
    #[serde(flatten)]
    pub provenance: ProvenanceView,
    /// State of the monitor in the open session; null if no session is open, in lists of
    /// several assets, and after a restart until the service has loaded the rig's engine, if
    /// none of its states is stored yet.
    pub monitor: Option<MonitorView>,
    /// Whether the asset has an open session; null in lists of several assets.
    #[serde(default)]
    pub session_open: Option<bool>,
    /// Time at which the last data of the asset arrived, RFC 3339, if data have stopped during an
    /// open session; null otherwise, and in lists of several assets.
    #[serde(default)]
    pub communication_lost_since: Option<String>,
}

/// An event: a person cleared a code while no session was open. It has the keys of a fault
/// line; those of the session and of times on the device's clock are null.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ClearedView {
    /// Always `fault`.
    #[serde(rename = "type")]
    pub line: LineWord,
    /// Always null.
    pub session: Option<String>,
    /// Always null.
    pub t_s: Option<f64>,
    pub code: CodeWord,
    /// Always null.
    pub kind: Option<KindWord>,
    /// Always `cleared`.
    pub status: StatusWord,
    /// ISO 14229 status byte, two hexadecimal digits.
    pub status_byte: String,
    /// Ball axis of a servo fault; null for other codes.
    pub axis: Option<AxisWord>,
    /// Plate angle that the servo turns; null for other codes.
    pub command: Option<CommandWord>,
    /// Name of the person who cleared it.
    pub by: String,
    /// The event in one sentence.
    pub summary: String,
}

/// The data of an event: a transition in a session, or a code cleared by a person while no
/// session was open.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum EventView {
    Fault(FaultEventView),
    Cleared(ClearedEventView),
}

/// A transition in a session.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct FaultEventView {
    pub asset: String,
    /// The service's id of the session.
    pub session_id: String,
    #[serde(flatten)]
    pub fault: Box<FaultView>,
}

/// A code that a person cleared while no session was open.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ClearedEventView {
    pub asset: String,
    /// Always null.
    pub session_id: Option<String>,
    #[serde(flatten)]
    pub cleared: Box<ClearedView>,
}

/// Returns the event of `code` cleared by `by` while no session was open.
#[must_use]
pub fn cleared_view(code: FaultCode, by: &str) -> ClearedView {
    ClearedView {
        line: LineWord::Fault,
        session: None,
        t_s: None,
        code: code.into(),
        kind: None,
        status: StatusWord::Cleared,
        status_byte: StatusByte::default().to_string(),
        axis: code.axis().map(AxisWord::from),
        command: code.axis().map(CommandWord::from),
        by: by.to_owned(),
        summary: format!("{} cleared by {by}", code_title(code)),
    }
}

/// Summary of one asset of the fleet.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FleetEntryView {
    pub asset: String,
    /// Whether the asset has a calibration.
    pub calibrated: bool,
    /// State of its automatic calibration.
    pub learning: LearningState,
    /// Name of the open session; null if no session is open.
    pub session: Option<String>,
    /// The service's id of the open session; null if no session is open.
    pub session_id: Option<String>,
    /// Number of samples recorded in the open session.
    pub samples: u64,
    /// Time of the last sample, s on the device's clock; null without one.
    pub last_t_s: Option<f64>,
    /// Time at which a sample last arrived, RFC 3339. After a restart of the service, and
    /// until a sample arrives, the time at which the latest session was opened or ended;
    /// null without a session.
    pub last_seen: Option<String>,
    /// Whether a session is open in which no sample has arrived for ten seconds, by the
    /// service's clock.
    #[serde(default)]
    #[schema(required)]
    pub silent: bool,
    /// Delay of the last batch, relative to the smallest delay of a batch in the session, s;
    /// null until a batch arrives.
    pub lag_s: Option<f64>,
    /// How many of its latest samples could not be used, and why, if these are so many that the
    /// rig is not tested at present; else null.
    #[serde(default)]
    pub unjudged: Option<UnjudgedView>,
    /// Pending and confirmed faults, also those of muted monitors.
    pub faults: Vec<FleetFaultView>,
    /// Mutes in force: these monitors count as not tested.
    #[serde(default)]
    pub muted: Vec<MuteView>,
    /// Its tags, in alphabetical order.
    #[serde(default)]
    #[schema(required)]
    pub tags: Vec<String>,
    /// Time at which the last data arrived, RFC 3339, if the data of the rig stay away although
    /// its session is open; null otherwise.
    #[serde(default)]
    pub communication_lost_since: Option<String>,
    /// Warnings of expected faults: drifts of a servo from session to session.
    pub warnings: Vec<TrendWarningView>,
    /// Whether the node that owns the asset did not answer, so that `last_seen`, `silent`,
    /// `lag_s` and `unjudged` are not those of now.
    #[serde(default)]
    #[schema(required)]
    pub stale: bool,
}

/// A page of the fleet.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FleetView {
    pub items: Vec<FleetEntryView>,
    /// Cursor for the next page; null on the last one.
    pub next: Option<String>,
    /// Nodes of the cluster that did not answer in time.
    #[serde(default)]
    #[schema(required)]
    pub missing_nodes: Vec<String>,
}

/// Samples of a rig that are not judged, if they are at least 11 of the last 32.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct UnjudgedView {
    /// Number of samples that have not been judged since they are so many.
    pub samples: u64,
    /// Why the last of them is not judged.
    pub reason: String,
}

/// Returns the view of unjudged samples.
#[must_use]
pub fn unjudged_view(run: Unjudged) -> UnjudgedView {
    UnjudgedView { samples: run.n, reason: run.why.to_string() }
}

/// Summary of an active fault.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FleetFaultView {
    pub code: CodeWord,
    pub kind: Option<KindWord>,
    /// Weight of this kind among the candidates, in (0, 1]; null without a kind.
    #[serde(default)]
    pub kind_weight: Option<f64>,
    /// `pending` or `confirmed`.
    pub status: StatusWord,
    /// Whether the last result of its test is a failure; false for a fault on record whose
    /// test passes again.
    #[serde(default)]
    #[schema(required)]
    pub failing: bool,
    /// Whether this result is one of the last session that was opened; false if the test has had
    /// none in it yet.
    #[serde(default)]
    #[schema(required)]
    pub tested: bool,
    /// Time at which the service judged the sample at which the test last began to fail,
    /// RFC 3339; null if unknown.
    #[serde(default)]
    pub failed_at: Option<String>,
    /// Whether the current occurrence has been acknowledged.
    pub acknowledged: bool,
    /// Time at which the record last changed, RFC 3339.
    pub changed_at: String,
}

/// A change of status of a fault code, or an action of a person.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct HistoryView {
    /// Number that increases with every event and action over all assets.
    pub id: i64,
    /// Time, RFC 3339.
    pub at: String,
    pub what: HistoryWord,
    /// Name of the person who acted; null for a change found by a monitor.
    pub by: Option<String>,
    /// The service's id of the session; null if no session was open.
    pub session_id: Option<String>,
    /// The fault line of a change of status; null for an action.
    pub fault: Option<FaultView>,
}

/// Live data of an asset for a client: the state of its twin, and what was judged since the
/// last query.
#[derive(Clone, Debug)]
pub struct WatchView {
    pub state: StateView,
    /// What was judged since the last query; `None` if it is not asked for.
    pub trace: Option<TraceView>,
    /// To be passed to the next query.
    pub cursor: Option<TraceCursor>,
}

/// The last point of the trace that a client has got.
#[derive(Clone, Debug, Default)]
pub struct TraceCursor {
    pub session_id: Option<String>,
    /// Number of moments of this session that were returned.
    pub seen: u64,
}

/// The state of one monitor.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct MonitorView {
    pub code: CodeWord,
    /// Fault detection counter, −128 (passed) to 127 (failed).
    pub counter: i8,
    /// Whether its enable condition holds now.
    pub enabled: bool,
    /// Whether it has had a result in this session.
    pub complete_this_cycle: bool,
    /// Whether it has had a result since the code was last cleared.
    pub complete_since_clear: bool,
    /// Time of this session for which it could judge, s.
    #[serde(default)]
    pub judged_s: f64,
    /// That time as a fraction of the session from its first to its last sample, 0 to 1.
    #[serde(default)]
    pub judged_share: f64,
    /// Former name of `judged_s`, with the same value.
    pub enabled_s: f64,
    /// Time of the last judged sample of which this is the state, s on the device's clock; null
    /// before the first. While the service has not loaded the rig's engine, for example after a
    /// restart, this is the last stored state.
    #[serde(default)]
    pub t_s: Option<f64>,
    /// The mute in force: the monitor counts as not tested; null without one.
    #[serde(default)]
    pub muted: Option<Box<MuteView>>,
}

/// One value for each direction of ball motion.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct XyView {
    pub x: f64,
    pub y: f64,
}

/// The state of the twin and the monitors after the last judged sample. While the service has not
/// loaded the rig's engine, for example after a restart, this is the last stored state, that of the
/// time `t_s`; if none is stored, the twin is at rest, and `judged` is 0 although there are samples.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct StateView {
    pub asset: String,
    /// Name of the open session; null if no session is open, and then the twin is at rest.
    pub session: Option<String>,
    /// The service's id of the open session; null if no session is open.
    pub session_id: Option<String>,
    /// Time of the last judged sample, s on the device's clock; null without one.
    pub t_s: Option<f64>,
    /// Number of samples recorded in this session.
    pub samples: u64,
    /// Number of samples judged in this session.
    pub judged: u64,
    /// Number of samples that wait for an earlier one, or until a jump of the clock is
    /// confirmed.
    pub waiting: usize,
    /// How many of its latest samples could not be used, and why, if these are so many that the
    /// rig is not tested at present; the evidence is that of the others. Else null.
    #[serde(default)]
    pub unjudged: Option<UnjudgedView>,
    /// The twin's ball position relative to the plate, m.
    pub twin_position_m: XyView,
    /// The twin's ball velocity relative to the plate, m/s.
    pub twin_velocity_m_s: XyView,
    /// The twin's plate angle that moves the ball along each axis: qy for x, qx for y, rad.
    pub plate_angle_rad: XyView,
    /// The evidence at the last judged sample.
    pub evidence: EvidenceView,
    /// The monitors, one for each fault code. Empty if the service has not loaded the rig's
    /// engine, for example after its process was killed, and no state of the session is stored.
    pub monitors: Vec<MonitorView>,
    /// The plant model in use.
    pub fidelity: ModelWord,
    /// Why this plant model is in use.
    pub fidelity_reason: String,
    /// Progress of the automatic calibration; null once the rig is learnt.
    #[serde(default)]
    pub learning: Option<LearningView>,
}

/// Returns the view of an engine's state; `session` is the id, name and number of samples of
/// the open session.
#[must_use]
pub fn state_view(asset: &str, session: Option<(&str, &str, u64)>, state: &State) -> StateView {
    StateView {
        asset: asset.to_owned(),
        session: session.map(|(_, name, _)| name.to_owned()),
        session_id: session.map(|(id, ..)| id.to_owned()),
        t_s: state.at.map(|t| t.seconds()),
        samples: session.map_or(0, |(_, _, samples)| samples),
        judged: state.n_judged,
        waiting: state.n_waiting,
        unjudged: state.unjudged.map(unjudged_view),
        twin_position_m: xy(&state.twin_position_m),
        twin_velocity_m_s: xy(&state.twin_velocity_m_s),
        plate_angle_rad: xy(&state.plate_angle_rad),
        evidence: evidence_view(&state.evidence),
        monitors: monitor_views(state),
        fidelity: state.fidelity.rung.into(),
        fidelity_reason: state.fidelity.to_string(),
        learning: None,
    }
}

fn xy(pair: &PerAxis<f64>) -> XyView {
    XyView { x: pair[Axis::X], y: pair[Axis::Y] }
}

/// Returns the views of the monitors, in the order of [`FaultCode::ALL`].
#[must_use]
pub fn monitor_views(state: &State) -> Vec<MonitorView> {
    let t_s = state.at.map(SimTime::seconds);
    let view = |(code, monitor)| MonitorView { t_s, ..monitor_view(code, monitor) };
    FaultCode::ALL.iter().zip(&state.monitors).map(view).collect()
}

fn monitor_view(code: &FaultCode, monitor: &MonitorState) -> MonitorView {
    MonitorView {
        t_s: None,
        code: (*code).into(),
        counter: monitor.counter,
        enabled: monitor.readiness.enabled,
        complete_this_cycle: monitor.readiness.complete_this_cycle,
        complete_since_clear: monitor.readiness.complete_since_clear,
        judged_s: monitor.judged_s,
        judged_share: monitor.judged_share,
        enabled_s: monitor.judged_s,
        muted: None,
    }
}

/// The result of an import.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ImportView {
    pub session: SessionView,
    /// The sessions of the other runs of the file, whose clock starts again; absent if there are
    /// none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub more_sessions: Vec<SessionView>,
    /// Number of recorded samples, late ones included.
    pub accepted: u64,
    /// Number of samples that were already recorded.
    pub duplicate: u64,
    /// Number of samples recorded but not judged.
    pub late: u64,
    /// Number of rejected rows.
    pub rejected: u64,
    /// The first rejected rows, with their reasons.
    pub rejections: Vec<super::telemetry::RowView>,
}

/// Settings with which a session is judged again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ReplaySettingsView {
    /// Profile of the diagnosis; if absent, that of the asset file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<ProfileWord>,
    /// Id of a calibration of the asset, or of the job that made it, to use instead of the
    /// calibration that was in use when the session was opened.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
    /// Debounce time of all monitors: how long a failure must last before the test fails, in
    /// [0, 60] s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub debounce_s: Option<f64>,
    /// Accepted false alarms per rig and year, above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub false_alarms_per_rig_year: Option<f64>,
    /// Changes to the asset file that was in use when the session was opened, as a JSON merge
    /// patch (RFC 7396).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asset: Option<serde_json::Value>,
}

/// A difference between the replayed and the recorded verdict.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct DifferenceView {
    #[serde(default = "altered")]
    pub change: ChangeWord,
    /// Replayed minus recorded time, s, positive if the replay is later; null if only one
    /// verdict has the transition.
    #[serde(default)]
    pub moved_s: Option<f64>,
    /// The recorded fault line; null if only the replay has the transition.
    pub recorded: Option<FaultView>,
    /// The replayed fault line; null if only the record has the transition.
    pub replayed: Option<FaultView>,
}

/// The default for results stored by versions without this field.
const fn altered() -> ChangeWord {
    ChangeWord::Altered
}

/// The result of a replay.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ReplayResultView {
    /// The fault lines of the replay.
    pub faults: Vec<FaultView>,
    pub summary: SummaryView,
    /// Verdict hash of the record; null while the session is open.
    pub recorded_hash: Option<String>,
    /// Whether the two verdicts are equal, transition by transition.
    pub same: bool,
    /// Every transition of both verdicts, in the order of time.
    #[serde(default)]
    pub transitions: Vec<ComparedView>,
    /// The number of transitions of each change.
    #[serde(default)]
    pub tally: TallyView,
    /// The transitions that differ, with their fault lines.
    pub differences: Vec<DifferenceView>,
    /// Id of the calibration used by the replay; null if the rig was not calibrated.
    #[serde(default)]
    pub calibration_id: Option<String>,
    /// Id of the profile, settings and rig description used by the replay.
    #[serde(default)]
    pub settings_id: String,
    /// Whether the verdicts were truncated to 10 000 transitions.
    pub truncated: bool,
}

/// Why a background job waits.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct JobWaitView {
    pub reason: JobWaitReason,
    /// Number of jobs that run or come before it. Further short ones may pass it.
    pub n_before: usize,
}

/// A background job that runs or waits.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct JobView {
    pub id: String,
    pub kind: JobKind,
    pub asset: String,
    /// The service's id of the session that a replay judges; null for a calibration.
    pub session_id: Option<String>,
    /// Whether the rig started it by itself.
    pub automatic: bool,
    /// `queued` or `running`.
    pub state: JobState,
    /// Progress of a running replay, 0 to 1; null if it is not known.
    pub progress: Option<f64>,
    /// Why it waits; null if it runs.
    pub waits: Option<JobWaitView>,
    /// Time of creation, RFC 3339.
    pub created_at: String,
}

/// A replay job: judging a recorded session again.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ReplayView {
    pub id: String,
    pub session_id: String,
    pub state: JobState,
    /// Why it waits; null unless it is queued.
    pub waits: Option<JobWaitView>,
    /// Fraction of the samples judged so far, 0 to 1.
    pub progress: f64,
    pub settings: ReplaySettingsView,
    /// Time of creation, RFC 3339.
    pub created_at: String,
    /// Time of completion or failure, RFC 3339; null before.
    pub finished_at: Option<String>,
    /// The result; null unless the state is `done`.
    pub result: Option<ReplayResultView>,
    /// Why the replay failed; null unless the state is `failed`.
    pub error: Option<String>,
}

/// Samples that a calibration learns from: a session by its id, or a stretch of one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(
    untagged,
    expecting = "is neither the id of a session nor an object with `session`, `from_s` and `to_s`"
)]
pub enum TrainingDataView {
    /// The id of a session.
    Session(String),
    Stretch(StretchView),
}

/// A stretch of a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StretchView {
    /// Id of the session.
    pub session: String,
    /// First time on the device's clock, s.
    pub from_s: f64,
    /// Last time on the device's clock, s.
    pub to_s: f64,
}

impl TrainingDataView {
    /// The id of the session.
    #[must_use]
    pub fn session(&self) -> &str {
        match self {
            Self::Session(id) => id,
            Self::Stretch(stretch) => &stretch.session,
        }
    }

    /// The range of times; all of the session without one.
    #[must_use]
    pub const fn range(&self) -> TimeRange {
        match *self {
            Self::Session(_) => TimeRange::ALL,
            Self::Stretch(StretchView { from_s, to_s, .. }) => TimeRange { from_s, to_s },
        }
    }
}

/// A calibration job of an asset, with its result.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CalibrationJobView {
    pub id: String,
    pub asset: String,
    pub state: JobState,
    /// Why it waits; null unless it is queued.
    pub waits: Option<JobWaitView>,
    /// The sessions, or stretches of sessions, it learns from.
    pub sessions: Vec<TrainingDataView>,
    /// Time of creation, RFC 3339.
    pub made_at: String,
    /// Who created it: name of the token, or the request's `by` if the service requires none;
    /// `offbd` if the rig learnt by itself. Null if unknown.
    pub made_by: Option<String>,
    /// Whether this calibration is in use: in the asset file.
    pub active: bool,
    /// Who put it into use last, as `made_by`; null if unknown, or if it never was.
    pub activated_by: Option<String>,
    /// Time at which it was put into use last, RFC 3339; null if unknown, or if it never was.
    pub activated_at: Option<String>,
    /// The calibration; null unless the state is `done`.
    pub calibration: Option<super::asset::CalibrationView>,
    /// Why it failed, for example what the data lack; null unless the state is `failed`.
    pub error: Option<String>,
}
