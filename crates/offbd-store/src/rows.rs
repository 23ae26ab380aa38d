//! Row types, with the columns of the tables. Documents are JSON text.

use super::from_row::from_row;
use std::str::FromStr;

use super::StoreError;

/// A time: microseconds since 1970-01-01 UTC.
pub type Micros = i64;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct AssetRow {
    pub name: String,
    /// The asset file (JSON).
    pub document: String,
    /// Number of the document's version, from 1.
    pub revision: i64,
    pub created_at: Micros,
    pub updated_at: Micros,
}

from_row!(AssetRow { name, document, revision, created_at, updated_at });

/// The progress of a session's recording.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SessionProgress {
    pub n_samples: i64,
    /// Rejected rows.
    pub n_rejected: i64,
    /// The earliest `t_s` of the judged samples.
    pub first_t_s: Option<f64>,
    /// The latest `t_s` of the judged samples.
    pub last_t_s: Option<f64>,
    /// The highest `seq` of the session; `None` if no sample has one.
    pub last_seq: Option<i64>,
}

from_row!(SessionProgress { n_samples, n_rejected, first_t_s, last_t_s, last_seq });

impl SessionProgress {
    /// Returns whether this is later than `other` of the same session.
    #[must_use]
    pub(super) const fn is_beyond(&self, other: &Self) -> bool {
        self.n_samples + self.n_rejected > other.n_samples + other.n_rejected
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct SessionRow {
    pub id: String,
    pub asset: String,
    pub name: String,
    /// `open` or `ended`.
    pub state: String,
    pub opened_at: Micros,
    pub ended_at: Option<Micros>,
    /// The asset file when the session was opened.
    pub setup: String,
    /// The fault memory when the session was opened.
    pub baseline: String,
    pub progress: SessionProgress,
    /// 1 for a recording that is being imported, 0 otherwise.
    pub importing: i64,
    /// Number of the part, from 1, of a session that continues in another one.
    pub part: i64,
    /// The id of the first part; `None` in that itself.
    pub first_part: Option<String>,
    /// `None` while the session is open; so is the hash.
    pub verdict: Option<String>,
    pub verdict_hash: Option<String>,
}

from_row!(
    SessionRow {
        id,
        asset,
        name,
        state,
        opened_at,
        ended_at,
        setup,
        baseline,
        importing,
        part,
        first_part,
        verdict,
        verdict_hash
    }[progress]
);

/// What is stored when a session ends.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SessionEnd {
    pub session: String,
    pub ended_at: Micros,
    pub verdict: String,
    pub hash: String,
    /// Whether the verdict has a confirmed fault.
    pub found_fault: bool,
}

impl SessionRow {
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.state == "open"
    }

    /// Returns the id of the first part of the session.
    #[must_use]
    pub fn first_part(&self) -> &str {
        self.first_part.as_deref().unwrap_or(&self.id)
    }
}

/// The kind of an action of a person on a fault code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActionKind {
    Clear,
    Acknowledge,
}

impl ActionKind {
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Clear => "clear",
            Self::Acknowledge => "acknowledge",
        }
    }
}

impl FromStr for ActionKind {
    type Err = StoreError;
    fn from_str(word: &str) -> Result<Self, StoreError> {
        match word {
            "clear" => Ok(Self::Clear),
            "acknowledge" => Ok(Self::Acknowledge),
            _ => Err(StoreError::UnknownValue { column: "action.kind", found: word.to_owned() }),
        }
    }
}

/// An action of a person on a fault code.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionRow {
    /// Assigned by the writer.
    pub id: i64,
    pub asset: String,
    pub session: Option<String>,
    /// Number of samples of the session that were recorded before the action.
    pub after_index: i64,
    pub kind: String,
    pub code: String,
    pub actor: String,
    pub at: Micros,
    /// The event, if the action changed a fault while no session was open.
    pub event: Option<String>,
}

from_row!(ActionRow { id, asset, session, after_index, kind, code, actor, at, event });

#[derive(Clone, Debug, PartialEq)]
pub struct TransitionRow {
    /// Assigned by the writer; also the id of the event.
    pub id: i64,
    pub asset: String,
    pub session: String,
    /// Index among the session's transitions, from 0.
    pub ordinal: i64,
    pub t_s: f64,
    pub code: String,
    pub status: String,
    pub at: Micros,
    /// The fault line (JSON).
    pub document: String,
}

from_row!(TransitionRow { id, asset, session, ordinal, t_s, code, status, at, document });

/// An event: a transition, or an action that changed a fault while no session was open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EventRow {
    /// Increases with every event, and is never used twice.
    pub id: i64,
    /// `fault` or `communication`.
    pub kind: String,
    pub asset: String,
    pub session: Option<String>,
    pub document: String,
}

from_row!(EventRow { id, kind, asset, session, document });

#[derive(Clone, Debug, PartialEq)]
pub struct FaultRow {
    pub asset: String,
    pub code: String,
    pub status: String,
    /// 1 if the current occurrence is acknowledged, else 0.
    pub acknowledged: i64,
    pub changed_at: Micros,
    pub record: String,
    /// What the service knows of the fault besides the engine's record (JSON).
    pub provenance: String,
}

from_row!(FaultRow { asset, code, status, acknowledged, changed_at, record, provenance });

#[derive(Clone, Debug, PartialEq)]
pub struct ReplayRow {
    pub id: String,
    pub session: String,
    pub state: String,
    pub settings: String,
    pub created_at: Micros,
    pub finished_at: Option<Micros>,
    /// The result of a job that is done.
    pub result: Option<String>,
    /// The reason why a job has failed.
    pub error: Option<String>,
}

from_row!(ReplayRow { id, session, state, settings, created_at, finished_at, result, error });

#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationRow {
    pub id: String,
    pub asset: String,
    pub state: String,
    /// The sessions to learn from (JSON array).
    pub sessions: String,
    pub made_at: Micros,
    /// 1 for the active calibration of the asset, else 0.
    pub active: i64,
    pub document: Option<String>,
    pub error: Option<String>,
    /// Who made it; `None` if nobody is known.
    pub made_by: Option<String>,
    /// Who activated it last, and when; `None` if nobody is known, or it never was.
    pub activated_by: Option<String>,
    pub activated_at: Option<Micros>,
}

from_row!(CalibrationRow {
    id,
    asset,
    state,
    sessions,
    made_at,
    active,
    document,
    error,
    made_by,
    activated_by,
    activated_at,
});

/// The estimate of the servo of an axis from one session.
#[derive(Clone, Debug, PartialEq)]
pub struct TrendRow {
    pub session: String,
    /// `x` or `y`.
    pub axis: String,
    pub asset: String,
    pub ended_at: Micros,
    pub n_samples: i64,
    pub calibration_id: Option<String>,
    pub gain: f64,
    pub gain_error: f64,
    pub offset_m_s2: f64,
    pub offset_error_m_s2: f64,
    pub delay_s: f64,
    pub delay_error_s: f64,
    /// Duration of the motion that the estimate is based on, s.
    pub motion_s: f64,
    /// The drift warnings from the sessions up to this one (JSON).
    pub warnings: Option<String>,
}

from_row!(TrendRow {
    session,
    axis,
    asset,
    ended_at,
    n_samples,
    calibration_id,
    gain,
    gain_error,
    offset_m_s2,
    offset_error_m_s2,
    delay_s,
    delay_error_s,
    motion_s,
    warnings
});

/// A [`TrendRow`] with the name of its session.
#[derive(Clone, Debug, PartialEq)]
pub struct TrendEntry {
    pub session_name: String,
    pub row: TrendRow,
}

from_row!(TrendEntry { session_name }[row]);

/// The drift warnings of an axis from the last session that estimated it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WarningRow {
    pub asset: String,
    pub calibration_id: Option<String>,
    pub warnings: String,
}

from_row!(WarningRow { asset, calibration_id, warnings });

/// Returns the name of the counter of the last event that was published on a bus.
pub(super) fn published_counter(bus: &str) -> String {
    format!("published_{bus}")
}
