//! The diagnosis: from measured and predicted motion to faults.
//!
//! Compares the measured motion with the twin's prediction under the same commands.
//! Independent of the plant model and of the source of the samples.

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
    AxisCalibration, Calibration, CalibrationOrigin, Contradiction, LeftOut, MonitorCertificate,
    Prospects, SensorCalibration, ServoProspects, SessionEstimate,
};
pub use debounce::{Debounce, DebounceTimes, Qualified, Test};
pub use evaluator::{Evaluator, Finding, LearntLimit, Rival, RivalPart, Surroundings};
pub use evidence::{AxisEvidence, Candidate, Evidence, SURE_KIND, Suspicion, Transition};
pub use limits::{Limits, SensorLimits};
pub use memory::{FaultMemory, FaultRecord, InUse, MemoryRules};
pub use outlier::{GateOutcome, OutlierGate, PositionJump, UNKNOWN_NOISE_M};
pub use scatter::{Scatter, bend_m, blur_m};
pub use servo::{AxisPrior, LearntPrior, ServoAnswer, ServoEstimate, ServoFilterBank, TwinPath};
pub use settings::{LONGEST_GAP_S, Profile, Settings};
pub use status::StatusByte;
pub use stillness::{AxisStillness, Reading, Stillness};
