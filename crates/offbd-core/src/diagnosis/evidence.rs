//! What speaks for a fault: the numbers at one moment, and the suspicion that
//! they lead to.

use super::{Answer, Step};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, FaultCode, FaultKind, PerAxis, SimTime};

/// One axis at one moment. Accelerations are over the estimation window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisEvidence {
    /// Command in force, rad.
    pub command_rad: Option<f64>,
    /// Measured position, m, from the fit over the window.
    pub position_m: Option<f64>,
    /// Measured velocity, m/s, from the same fit.
    pub velocity_m_s: Option<f64>,
    /// Measured acceleration, m/s².
    pub measured_m_s2: Option<f64>,
    /// The twin's acceleration through the same filter, m/s².
    pub twin_m_s2: Option<f64>,
    /// Residual limit in force, m/s².
    pub limit_m_s2: f64,
    /// Whether the enable condition holds: the residual may be judged.
    pub enabled: bool,
    /// Evidence for a fault of the servo: logarithm of how much likelier the
    /// motion is if it is broken, nats.
    pub nats: f64,
    /// How far the path of the last two seconds bends from the twin's, root mean
    /// square, m; none where that is not testable.
    pub path_error_m: Option<f64>,
    /// The most that it bends on the healthy rig, m; none where that is not known.
    pub path_limit_m: Option<f64>,
    /// How the servo has answered its command of late.
    pub answer: Option<Answer>,
    /// Seconds for which the readings along this axis have been bit-identical.
    pub identical_s: f64,
}

impl AxisEvidence {
    /// Measured − twin acceleration, m/s²; none where it is not testable.
    #[must_use]
    pub fn residual_m_s2(&self) -> Option<f64> {
        Some(self.measured_m_s2? - self.twin_m_s2?)
    }

    /// Whether the path bends from the twin's by more than the limit.
    #[must_use]
    pub fn is_off_path(&self) -> bool {
        self.path_share().is_some_and(|share| share >= 1.0)
    }

    /// How far the path bends from the twin's, as a share of the limit; none where
    /// either is not known.
    #[must_use]
    pub fn path_share(&self) -> Option<f64> {
        Some(self.path_error_m? / self.path_limit_m?)
    }

    /// Whether the axis is enabled and its residual beyond the limit.
    #[must_use]
    pub fn violates(&self) -> bool {
        self.enabled && self.residual_m_s2().is_some_and(|r| r.abs() >= self.limit_m_s2)
    }
}

/// The numbers at one moment: an innovation record, and the freeze frame of a
/// fault when it is kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evidence {
    /// The judged sample's time.
    pub at: Option<SimTime>,
    /// Length of the estimation window that was available, s.
    pub window_s: f64,
    pub axes: PerAxis<AxisEvidence>,
    /// Seconds for which no ball has been seen.
    pub unseen_s: f64,
    /// Share of the samples of the last seconds without a ball, 0 to 1.
    pub missing_share: f64,
    /// Seconds for which the readings have been bit-identical.
    pub identical_s: f64,
    /// Seconds for which the ball has stood still within the noise.
    pub still_s: f64,
    /// Lone readings set aside as outliers in the last ten seconds.
    pub outliers: u32,
    /// Standard deviation of the readings about their fit, m.
    pub scatter_m: Option<f64>,
    /// The same of healthy readings, the worse of both axes, m: learnt, or
    /// assumed on a rig that is not.
    pub healthy_scatter_m: f64,
    /// The step of the readings that the sensor is blamed for, if one is.
    pub jump: Option<Step>,
}

/// One possible cause and how much of the evidence speaks for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    pub code: FaultCode,
    pub kind: Option<FaultKind>,
    /// In (0, 1]; the weights of a suspicion sum to one.
    pub weight: f64,
}

/// What is suspected: since when, in which way, and what else it may be.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Suspicion {
    /// When the deviation began, as far as the evidence says.
    pub onset: Option<SimTime>,
    pub kind: Option<FaultKind>,
    /// Causes that read alike, heaviest first; empty where only one does.
    pub candidates: Vec<Candidate>,
}

/// A change of one code's status byte.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    /// The sample at which it changed.
    pub at: SimTime,
    pub code: FaultCode,
    pub status: crate::vocabulary::FaultStatus,
    pub byte: super::StatusByte,
    pub suspicion: Suspicion,
    pub evidence: Evidence,
}

impl Transition {
    /// The axis to blame, for the servo codes.
    #[must_use]
    pub const fn axis(&self) -> Option<Axis> {
        self.code.axis()
    }
}
