//! Judgement: from measured and predicted motion to faults.
//!
//! Sees what was measured, what the twin predicts and what was commanded, and
//! decides. Does not know which plant it watches, nor where samples come from.

mod calibration;
mod debounce;
mod evaluator;
mod evidence;
mod limits;
mod memory;
mod outlier;
mod scatter;
mod servo;
mod settings;
mod status;
mod stillness;
pub mod trend;

pub use calibration::{
    AxisCalibration, Calibration, MonitorCertificate, Prospects, SensorCalibration, ServoProspects,
    SessionEstimate,
};
pub use debounce::{Debounce, Pace, Qualified, Test};
pub use evaluator::{Evaluator, Finding, Surroundings};
pub use evidence::{AxisEvidence, Candidate, Evidence, Suspicion, Transition};
pub use limits::{Limits, SensorLimits};
pub use memory::{FaultMemory, FaultRecord, InUse, MemoryRules};
pub use outlier::{Gated, OutlierGate, Step, UNKNOWN_NOISE_M};
pub use scatter::{Scatter, bend_m, blur_m};
pub use servo::{Answer, AxisNature, Course, LearntNature, Servo, ServoEstimate};
pub use settings::{Profile, Settings};
pub use status::StatusByte;
pub use stillness::{AxisStillness, Reading, Stillness};
