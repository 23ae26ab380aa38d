//! Judgement: from measured and predicted motion to faults.
//!
//! Sees what was measured, what the twin predicts and what was commanded, and
//! decides. Does not know which plant it watches, nor where samples come from.

mod calibration;
mod evidence;
mod memory;
mod settings;
mod status;

pub use calibration::{AxisCalibration, Calibration};
pub use evidence::{AxisEvidence, Candidate, Evidence, MAX_CANDIDATES, Suspicion, Transition};
pub use memory::{FaultMemory, FaultRecord, MemoryRules};
pub use settings::{Profile, Settings};
pub use status::StatusByte;
