//! How far a rig is on its way from registration to learnt.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Where a rig stands on its way to being learnt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum LearningState {
    /// More motion is needed.
    Gathering,
    /// A calibration of what was gathered is under way.
    Learning,
    /// A calibration is done; somebody must say that the rig was healthy.
    Offered,
    /// A calibration is in force.
    Learnt,
}

impl LearningState {
    /// The same word as on the wire.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Gathering => "gathering",
            Self::Learning => "learning",
            Self::Offered => "offered",
            Self::Learnt => "learnt",
        }
    }
}

/// How far a rig is on its way to being learnt.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct LearningView {
    pub asset: String,
    pub state: LearningState,
    /// The same in words: what is missing, what is offered, what was learnt.
    pub summary: String,
    /// Motion along each axis with which the rig is learnt, s; more after a refusal.
    pub wanted_s: f64,
    /// Usable motion along x so far, s; null while it has no commands or no positions.
    pub x_s: Option<f64>,
    /// The same along y.
    pub y_s: Option<f64>,
    /// The sessions that teach: gathered, offered, or of the calibration in force.
    /// Empty on a rig that was learnt by hand.
    pub sessions: Vec<TeachingSessionView>,
    /// Sessions from which the calibration in force or on offer was learnt, by hand
    /// too; while gathering, those that count so far.
    pub n_sessions: usize,
    /// Id of the calibration that is under way or on offer.
    pub calibration: Option<String>,
    /// Why the last calibration was refused, if it was.
    pub refused: Option<String>,
    /// Whether the calibration in force is one that the rig learnt by itself.
    pub by_itself: bool,
    /// Whether later healthy sessions refine it.
    pub refines: bool,
}

/// A session that teaches.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct TeachingSessionView {
    pub id: String,
    /// The device's name of it, or the moment of its opening.
    pub name: String,
}
