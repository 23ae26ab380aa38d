//! The rows, as the tables have them. Documents are JSON text.

use super::from_row::from_row;
use std::fmt;
use std::str::FromStr;

use super::StoreError;

/// A moment: microseconds since 1970-01-01 UTC.
pub type Micros = i64;

#[derive(Clone, Debug, PartialEq)]
pub struct AssetRow {
    pub name: String,
    /// The asset file.
    pub document: String,
    /// Counts the changes of the document, from 1.
    pub revision: i64,
    pub created_at: Micros,
    pub updated_at: Micros,
}

from_row!(AssetRow { name, document, revision, created_at, updated_at });

/// How far a session's recording has come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    pub n_samples: i64,
    /// Rows that were no samples.
    pub n_rejected: i64,
    /// The earliest and the latest `t_s` of the samples that were judged.
    pub first_t_s: Option<f64>,
    pub last_t_s: Option<f64>,
    /// The highest `seq`.
    pub last_seq: Option<i64>,
}

from_row!(Progress { n_samples, n_rejected, first_t_s, last_t_s, last_seq });

impl Progress {
    /// Whether `other` is of an earlier moment of the same session.
    #[must_use]
    pub(super) const fn is_beyond(&self, other: &Self) -> bool {
        self.n_samples + self.n_rejected > other.n_samples + other.n_rejected
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct SessionRow {
    pub id: String,
    pub asset: String,
    pub name: String,
    /// `open` or `ended`.
    pub state: String,
    pub opened_at: Micros,
    pub ended_at: Option<Micros>,
    /// The asset file as of opening.
    pub setup: String,
    /// The fault memory as of opening.
    pub baseline: String,
    pub progress: Progress,
    /// Once ended.
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
        verdict,
        verdict_hash
    }[progress]
);

impl SessionRow {
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.state == "open"
    }
}

/// What a person did about a code.
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
            _ => Err(StoreError::Word { column: "action.kind", found: word.to_owned() }),
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct ActionRow {
    /// Given by the writer.
    pub id: i64,
    pub asset: String,
    pub session: Option<String>,
    /// Samples of the session recorded by then.
    pub after_index: i64,
    pub kind: String,
    pub code: String,
    pub actor: String,
    pub at: Micros,
    /// The event of a change that is in no session.
    pub event: Option<String>,
}

from_row!(ActionRow { id, asset, session, after_index, kind, code, actor, at, event });

#[derive(Clone, Debug, PartialEq)]
pub struct TransitionRow {
    /// Given by the writer; the id of the event.
    pub id: i64,
    pub asset: String,
    pub session: String,
    /// Counts the session's transitions from 0.
    pub ordinal: i64,
    pub t_s: f64,
    pub code: String,
    pub status: String,
    pub at: Micros,
    /// The fault line.
    pub document: String,
}

from_row!(TransitionRow { id, asset, session, ordinal, t_s, code, status, at, document });

/// Something to be told: a transition, or an act that changed a code while no
/// session was open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EventRow {
    /// Rises with every event, never given twice.
    pub id: i64,
    pub asset: String,
    pub session: Option<String>,
    pub document: String,
}

from_row!(EventRow { id, asset, session, document });

#[derive(Clone, Debug, PartialEq)]
pub struct FaultRow {
    pub asset: String,
    pub code: String,
    pub status: String,
    /// 1 once the current occurrence is acknowledged.
    pub acknowledged: i64,
    pub changed_at: Micros,
    pub record: String,
    /// What is known beside the record.
    pub provenance: String,
}

from_row!(FaultRow { asset, code, status, acknowledged, changed_at, record, provenance });

/// Where a background job stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobState {
    Queued,
    Running,
    Done,
    Failed,
}

impl JobState {
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Done => "done",
            Self::Failed => "failed",
        }
    }
}

impl fmt::Display for JobState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct ReplayRow {
    pub id: String,
    pub session: String,
    pub state: String,
    pub settings: String,
    pub created_at: Micros,
    pub finished_at: Option<Micros>,
    /// Once done.
    pub result: Option<String>,
    /// Once failed.
    pub error: Option<String>,
}

from_row!(ReplayRow { id, session, state, settings, created_at, finished_at, result, error });

#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationRow {
    pub id: String,
    pub asset: String,
    pub state: String,
    /// JSON array of the sessions it learns from.
    pub sessions: String,
    pub made_at: Micros,
    /// 1 for the one in force.
    pub active: i64,
    pub document: Option<String>,
    pub error: Option<String>,
}

from_row!(CalibrationRow { id, asset, state, sessions, made_at, active, document, error });

/// What a session estimated of the servo behind an axis.
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
    /// Motion that it rests on, s.
    pub motion_s: f64,
    /// What the sessions up to this one lead to.
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

/// The same with the session's name.
#[derive(Clone, Debug, PartialEq)]
pub struct TrendEntry {
    pub session_name: String,
    pub row: TrendRow,
}

from_row!(TrendEntry { session_name }[row]);

/// The warnings of an axis as of the last session that estimated it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WarningRow {
    pub asset: String,
    pub calibration_id: Option<String>,
    pub warnings: String,
}

from_row!(WarningRow { asset, calibration_id, warnings });
