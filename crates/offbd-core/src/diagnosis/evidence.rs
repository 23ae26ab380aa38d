//! The evidence for a fault: the quantities at one moment, and the suspicion that follows
//! from them.

use super::{PositionJump, ServoAnswer};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, FaultCode, FaultKind, PerAxis, SimTime};
use serde::{Deserialize, Serialize};

/// The quantities of one axis at one moment. Accelerations are over the estimation
/// window. Faults are stored with it, by the names of its fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
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
    /// Evidence for a fault of the servo, nats: the log-likelihood ratio of a broken to a
    /// healthy servo.
    pub nats: f64,
    /// Evidence of the recent path for a fault of the servo, nats; the scale of the twin's error is
    /// estimated from this session. `None` if not testable.
    pub path_nats: Option<f64>,
    /// Limit of the evidence of the recent path (`path_nats`), nats; `None` if unknown.
    pub path_limit_nats: Option<f64>,
    /// The servo's recent response to its command.
    pub answer: Option<ServoAnswer>,
    /// Time for which the readings along this axis have been bit-identical, s.
    pub identical_s: f64,
}

impl AxisEvidence {
    /// Measured − twin acceleration, m/s²; `None` if not testable.
    #[must_use]
    pub fn residual_m_s2(&self) -> Option<f64> {
        Some(self.measured_m_s2? - self.twin_m_s2?)
    }

    /// Whether the evidence of the path reaches its limit.
    #[must_use]
    pub fn is_off_path(&self) -> bool {
        self.path_nats.zip(self.path_limit_nats).is_some_and(|(nats, limit)| nats >= limit)
    }

    /// Whether the axis is enabled and its residual at or beyond the limit.
    #[must_use]
    pub fn violates(&self) -> bool {
        self.enabled && self.residual_m_s2().is_some_and(|r| r.abs() >= self.limit_m_s2)
    }
}

/// The quantities at one moment; kept with a fault, they are its freeze frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Time of the judged sample.
    pub at: Option<SimTime>,
    /// Length of the estimation window that was available, s.
    pub window_s: f64,
    pub axes: PerAxis<AxisEvidence>,
    /// Time for which no ball has been seen, s.
    pub unseen_s: f64,
    /// Fraction of recent samples without a ball, 0 to 1.
    pub missing_share: f64,
    /// Time for which the readings have been bit-identical, s.
    pub identical_s: f64,
    /// Time for which the ball has stood still within the noise, s.
    pub still_s: f64,
    /// Recent outliers, each fading with a time constant of ten seconds.
    pub outliers: u32,
    /// Standard deviation of the readings about their fit, m.
    pub scatter_m: Option<f64>,
    /// Standard deviation of healthy readings, the larger of both axes, m: learnt, or
    /// assumed if the rig is not learnt.
    pub healthy_scatter_m: f64,
    /// The jump of the readings that the sensor is blamed for, if any.
    pub jump: Option<PositionJump>,
}

/// A possible cause and its weight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    pub code: FaultCode,
    pub kind: Option<FaultKind>,
    /// In (0, 1]; the weights of a suspicion sum to one.
    pub weight: f64,
}

/// Weight from which on a kind is stated as a fact. Chosen: at most one in five of these kinds
/// is another one. The page has the same limit.
pub const SURE_KIND: f64 = 0.8;

/// A suspected fault: its onset, its kind and the causes that may explain it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Suspicion {
    /// Estimated time at which the deviation began.
    pub onset: Option<SimTime>,
    pub kind: Option<FaultKind>,
    /// Causes with the same symptoms, heaviest first; empty if there is only one.
    pub candidates: Vec<Candidate>,
}

impl Suspicion {
    /// The weight of the kind among the candidates, 1 if there are none; `None` without a kind.
    #[must_use]
    pub fn kind_weight(&self) -> Option<f64> {
        let kind = Some(self.kind?);
        if self.candidates.is_empty() {
            return Some(1.0);
        }
        self.candidates.iter().find(|each| each.kind == kind).map(|each| each.weight)
    }

    /// Whether the kind is a fact, and not only probable; never if another code may explain it.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        let codes = || self.candidates.iter().map(|each| each.code);
        self.kind_weight().is_some_and(|weight| weight >= SURE_KIND)
            && codes().all(|code| Some(code) == codes().next())
    }
}

/// A change of one code's status byte.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    /// Time of the sample at which it changed.
    pub at: SimTime,
    pub code: FaultCode,
    pub status: crate::vocabulary::FaultStatus,
    pub byte: super::StatusByte,
    pub suspicion: Suspicion,
    pub evidence: Evidence,
}

impl Transition {
    /// The axis at fault, for the servo codes.
    #[must_use]
    pub const fn axis(&self) -> Option<Axis> {
        self.code.axis()
    }
}
