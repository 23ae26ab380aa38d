//! What the service says of itself: sessions, faults of the fleet, the state
//! of a twin, replays, calibrations.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::difference::{ComparedView, TallyView};
use super::learning::{LearningState, LearningView};
use super::memory::FaultRecordView;
use super::provenance::ProvenanceView;
use super::trace::TraceView;
use super::trend::TrendWarningView;
use super::verdict::{EvidenceView, FaultView, SummaryView, evidence_view};
use offbd_core::diagnosis::StatusByte;
use offbd_core::engine::{MonitorState, State};
use offbd_core::vocabulary::{Axis, FaultCode, FaultStatus, PerAxis};

/// A page of a list.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct Page<T> {
    pub items: Vec<T>,
    /// Opaque; give it as `cursor` for the next page. Null on the last one.
    pub next: Option<String>,
}

/// A session.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SessionView {
    /// The service's id.
    pub id: String,
    pub asset: String,
    /// The device's name of it, or the moment of its opening.
    pub name: String,
    /// `open` or `ended`.
    pub state: String,
    /// RFC 3339.
    pub opened_at: String,
    pub ended_at: Option<String>,
    /// Samples recorded.
    pub samples: u64,
    /// Rows that were no samples.
    pub rejected: u64,
    pub first_t_s: Option<f64>,
    pub last_t_s: Option<f64>,
    /// The highest `seq`.
    pub last_seq: Option<u64>,
    /// Once ended.
    pub verdict: Option<SummaryView>,
}

/// A fault of the fleet: what is remembered of one code of one asset.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FaultEntryView {
    pub asset: String,
    /// RFC 3339: when the record last changed.
    pub changed_at: String,
    #[serde(flatten)]
    pub record: FaultRecordView,
    #[serde(flatten)]
    pub provenance: ProvenanceView,
    /// The monitor as it stands in the open session, debounce counter and
    /// readiness; null without one, and in lists across the fleet.
    pub monitor: Option<MonitorView>,
}

/// An event: a person cleared a code while no session was open. It has the
/// keys of a fault line, without a session and a time on the device's clock.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ClearedView {
    /// Always `fault`.
    #[serde(rename = "type")]
    pub line: String,
    /// Always null, as `session_id` is.
    pub session: Option<String>,
    /// Always null.
    pub t_s: Option<f64>,
    pub code: String,
    /// Always null.
    pub kind: Option<String>,
    /// Always `cleared`.
    pub status: String,
    /// ISO 14229 status byte, two hexadecimal digits.
    pub status_byte: String,
    pub axis: Option<String>,
    pub command: Option<String>,
    /// Who cleared it.
    pub by: String,
    /// The same in one sentence.
    pub summary: String,
}

/// What an event tells.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct EventView {
    pub asset: String,
    /// The service's id of the session; null if none was open.
    pub session_id: Option<String>,
    #[serde(flatten)]
    pub change: ChangeView,
}

/// What has changed.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum ChangeView {
    /// In a session.
    Fault(Box<FaultView>),
    /// By hand, while no session was open.
    Cleared(Box<ClearedView>),
}

/// The event of `code` cleared by `by` while no session was open.
#[must_use]
pub fn cleared_view(code: FaultCode, by: &str) -> ClearedView {
    ClearedView {
        line: "fault".to_owned(),
        session: None,
        t_s: None,
        code: code.to_string(),
        kind: None,
        status: FaultStatus::Cleared.to_string(),
        status_byte: StatusByte::default().to_string(),
        axis: code.axis().map(|a| a.as_str().to_owned()),
        command: code.axis().map(|a| a.command().to_owned()),
        by: by.to_owned(),
        summary: format!("{code} cleared by {by}: nothing of it is on record"),
    }
}

/// One asset of the fleet, at a glance.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FleetEntryView {
    pub asset: String,
    /// Whether it has been learnt from healthy sessions.
    pub calibrated: bool,
    /// How far it is on its way there.
    pub learning: LearningState,
    /// The open session; null if there is none.
    pub session: Option<String>,
    pub session_id: Option<String>,
    /// Samples recorded in it.
    pub samples: u64,
    /// Of the last sample, s on the device's clock.
    pub last_t_s: Option<f64>,
    /// RFC 3339: when a sample last came. Until one comes after a restart of
    /// the service, when the latest session was opened or ended.
    pub last_seen: Option<String>,
    /// How much later than the promptest of the session the last batch came,
    /// s; null until one comes.
    pub lag_s: Option<f64>,
    /// Pending and confirmed ones.
    pub faults: Vec<FleetFaultView>,
    /// Of faults on their way: drifts of a servo over the sessions.
    pub warnings: Vec<TrendWarningView>,
}

/// An active fault, at a glance.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FleetFaultView {
    pub code: String,
    pub kind: Option<String>,
    /// `pending` or `confirmed`.
    pub status: String,
    pub acknowledged: bool,
    /// RFC 3339: when the record last changed.
    pub changed_at: String,
}

/// Something that happened to a code of an asset.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct HistoryView {
    /// Rises with every event and act, over all assets.
    pub id: i64,
    /// RFC 3339.
    pub at: String,
    /// `pending`, `confirmed`, `healed` or `cleared`: the status it changed to;
    /// `acknowledge` or `clear`: what a person did.
    pub what: String,
    /// Who did it, if a person.
    pub by: Option<String>,
    pub session_id: Option<String>,
    /// The fault line of a change of status.
    pub fault: Option<FaultView>,
}

/// What a watcher of an asset is told: where its twin is, and what has been
/// judged since he was last told.
#[derive(Clone, Debug)]
pub struct WatchView {
    pub state: StateView,
    pub trace: TraceView,
    /// Moments told so far, for the next question.
    pub seen: u64,
}

/// One monitor at one moment.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct MonitorView {
    pub code: String,
    /// Fault detection counter, −128 (passed) to 127 (failed).
    pub counter: i8,
    /// Whether it may judge right now.
    pub enabled: bool,
    /// Whether it has come to a result in this session.
    pub complete_this_cycle: bool,
    /// Whether it has come to a result since the code was last cleared.
    pub complete_since_clear: bool,
    /// Seconds of this session in which it could judge.
    #[serde(default)]
    pub judged_s: f64,
    /// The same as a share of the session, from its first sample to its last,
    /// 0 to 1.
    #[serde(default)]
    pub judged_share: f64,
    /// The same as `judged_s`, by the name that it had before.
    pub enabled_s: f64,
}

/// A number for each direction of ball motion.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct XyView {
    pub x: f64,
    pub y: f64,
}

/// The twin beside the rig, after the last judged sample.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct StateView {
    pub asset: String,
    /// The open session; null if there is none, and then all is at rest.
    pub session: Option<String>,
    pub session_id: Option<String>,
    /// Time of the last judged sample.
    pub t_s: Option<f64>,
    /// Samples recorded in this session.
    pub samples: u64,
    /// Samples judged in this session.
    pub judged: u64,
    /// Samples waiting for an earlier one.
    pub waiting: usize,
    pub twin_position_m: XyView,
    pub twin_velocity_m_s: XyView,
    /// The twin's plate angle behind each axis.
    pub plate_angle_rad: XyView,
    /// Measured and twin acceleration, residual, limit and gate, per axis.
    pub evidence: EvidenceView,
    pub monitors: Vec<MonitorView>,
    /// The plant model in use, and why that one.
    pub fidelity: String,
    pub fidelity_reason: String,
    /// How far the rig is on its way to being learnt; null once it is.
    #[serde(default)]
    pub learning: Option<LearningView>,
}

/// The view of an engine's state.
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
        twin_position_m: xy(&state.twin_position_m),
        twin_velocity_m_s: xy(&state.twin_velocity_m_s),
        plate_angle_rad: xy(&state.plate_angle_rad),
        evidence: evidence_view(&state.evidence),
        monitors: monitor_views(state),
        fidelity: state.fidelity.rung.name().to_owned(),
        fidelity_reason: state.fidelity.to_string(),
        learning: None,
    }
}

fn xy(pair: &PerAxis<f64>) -> XyView {
    XyView { x: pair[Axis::X], y: pair[Axis::Y] }
}

/// The views of the monitors, in the order of [`FaultCode::ALL`].
#[must_use]
pub fn monitor_views(state: &State) -> Vec<MonitorView> {
    FaultCode::ALL.iter().zip(&state.monitors).map(monitor_view).collect()
}

fn monitor_view((code, monitor): (&FaultCode, &MonitorState)) -> MonitorView {
    MonitorView {
        code: code.to_string(),
        counter: monitor.counter,
        enabled: monitor.readiness.enabled,
        complete_this_cycle: monitor.readiness.complete_this_cycle,
        complete_since_clear: monitor.readiness.complete_since_clear,
        judged_s: monitor.judged_s,
        judged_share: monitor.judged_share,
        enabled_s: monitor.judged_s,
    }
}

/// What came of an import.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ImportView {
    pub session: SessionView,
    pub accepted: u64,
    pub duplicate: u64,
    /// Samples recorded but not judged.
    pub late: u64,
    pub rejected: u64,
    /// The first rows rejected, with their reasons.
    pub rejections: Vec<super::telemetry::RowView>,
}

/// With which settings a session is judged again.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ReplaySettingsView {
    /// `default` or `textbook`; without it the one of the asset file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    /// Id of a calibration of the asset (of the job that learnt it, or its own)
    /// to be used instead of the one in force when the session was opened.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
    /// Continuous failure before a test fails, in [0, 60] s: of servos, ball and
    /// sensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub debounce_s: Option<f64>,
    /// Wanted false alarms per rig and year, above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub false_alarms_per_rig_year: Option<f64>,
    /// An asset file, or the parts of it that are to be different (JSON merge
    /// patch, RFC 7396), over the one in force when the session was opened.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asset: Option<serde_json::Value>,
}

/// A place where the verdict of a replay and the recorded one differ.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct DifferenceView {
    /// `altered`, `moved`, `only_recorded` or `only_replayed`.
    #[serde(default)]
    pub change: String,
    /// Replayed − recorded, s; above 0 where the replay is later.
    #[serde(default)]
    pub moved_s: Option<f64>,
    /// Null where only the replay has it.
    pub recorded: Option<FaultView>,
    /// Null where only the record has it.
    pub replayed: Option<FaultView>,
}

/// What a replay found.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ReplayResultView {
    pub faults: Vec<FaultView>,
    pub summary: SummaryView,
    /// Hash of the recorded verdict; null while the session is open.
    pub recorded_hash: Option<String>,
    /// Whether the two verdicts are the same, transition by transition.
    pub same: bool,
    /// Every transition of either verdict, in the order of time.
    #[serde(default)]
    pub transitions: Vec<ComparedView>,
    /// How many of them there are of each change.
    #[serde(default)]
    pub tally: TallyView,
    /// The fault lines of those that are not the same.
    pub differences: Vec<DifferenceView>,
    /// Of the calibration that judged in the replay; null on a rig not learnt.
    #[serde(default)]
    pub calibration_id: Option<String>,
    /// Of the profile, the settings and the rig's description that judged.
    #[serde(default)]
    pub settings_id: String,
    /// Whether the verdicts were cut at their limit of 10000 transitions.
    pub truncated: bool,
}

/// A replay.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ReplayView {
    pub id: String,
    pub session_id: String,
    /// `queued`, `running`, `done` or `failed`.
    pub state: String,
    /// Share of the samples judged, 0 to 1.
    pub progress: f64,
    pub settings: ReplaySettingsView,
    pub created_at: String,
    pub finished_at: Option<String>,
    pub result: Option<ReplayResultView>,
    pub error: Option<String>,
}

/// A calibration of an asset: learning it, and what was learnt.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CalibrationJobView {
    pub id: String,
    pub asset: String,
    /// `queued`, `running`, `done` or `failed`.
    pub state: String,
    /// The sessions it learns from.
    pub sessions: Vec<String>,
    pub made_at: String,
    /// Whether it is in the asset file.
    pub active: bool,
    /// Once done.
    pub calibration: Option<super::asset::CalibrationView>,
    /// Once failed: what the data lack.
    pub error: Option<String>,
}
