//! The progress of a rig's automatic calibration.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// State of a rig's automatic calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum LearningState {
    /// More motion is needed before a calibration can start.
    Gathering,
    /// A calibration from the gathered sessions is running.
    Learning,
    /// A calibration is done and waits until a person confirms that the rig was healthy.
    Offered,
    /// A calibration is in use.
    Learnt,
}

impl LearningState {
    /// Returns the word used in JSON.
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

/// Progress of a rig's automatic calibration.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct LearningView {
    pub asset: String,
    pub state: LearningState,
    /// The state in words: what is missing, offered or learnt.
    pub summary: String,
    /// Motion along each axis that a calibration requires, s; it increases after a failed
    /// calibration.
    pub wanted_s: f64,
    /// Usable motion along x so far, s; null if there are no commands or no positions yet.
    pub x_s: Option<f64>,
    /// Usable motion along y so far, s; null if there are no commands or no positions yet.
    pub y_s: Option<f64>,
    /// Time of the last sample of the open session whose motion is counted, s on the device's
    /// clock; null without one. While the service has not loaded the rig's engine, for example
    /// after a restart, the motion is that of the last stored state.
    #[serde(default)]
    pub t_s: Option<f64>,
    /// The sessions gathered so far, or those of the calibration on offer or in use; empty
    /// if a person made the calibration.
    pub sessions: Vec<TeachingSessionView>,
    /// Number of sessions of the calibration in use or on offer, also of one that a person
    /// made; while gathering, the number of sessions so far.
    pub n_sessions: usize,
    /// Id of the calibration that is running or on offer; null otherwise.
    pub calibration: Option<String>,
    /// Why the last calibration failed; null if it did not.
    pub refused: Option<String>,
    /// Whether the calibration in use was made automatically.
    pub by_itself: bool,
    /// Whether later healthy sessions refine the calibration in use.
    pub refines: bool,
}

/// A session that a calibration uses.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct TeachingSessionView {
    pub id: String,
    /// The device's name for the session, or the time at which it was opened.
    pub name: String,
}
