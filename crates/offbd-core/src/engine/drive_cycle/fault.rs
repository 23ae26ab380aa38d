//! The faults that a drive cycle is tested with.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, FaultCode, FaultKind, PerAxis};

/// A fault that is present from the start of the cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TriedFault {
    /// A servo answers half of its command.
    HalfGain(Axis),
    /// A servo does not answer.
    Dead(Axis),
    /// The ball is stuck to the plate.
    Stuck,
    /// The readings are bit-identical.
    Frozen,
    /// No ball is seen.
    Unseen,
    /// The readings scatter `TRIED_NOISE_FACTOR` times as far as healthy ones.
    Noise,
    /// One reading in five is anywhere on the plate.
    Spikes,
}

/// Ratio of a noisy sensor's scatter to the healthy one. Chosen.
pub(super) const TRIED_NOISE_FACTOR: f64 = 12.0;
/// Fraction of a spiky sensor's readings that are anywhere on the plate. Chosen.
pub(super) const SPIKE_SHARE: f64 = 0.2;

impl TriedFault {
    /// Returns all faults that a rig with these axes can have, the hardest to find first.
    pub fn of(axes: PerAxis<bool>) -> Vec<Self> {
        let has = |axis: &Axis| axes[*axis];
        let servos = |fault: fn(Axis) -> Self| Axis::ALL.into_iter().filter(has).map(fault);
        let others = [Self::Noise, Self::Stuck, Self::Spikes, Self::Frozen, Self::Unseen];
        servos(Self::HalfGain).chain(servos(Self::Dead)).chain(others).collect()
    }

    /// The code that should report it.
    #[must_use]
    pub const fn code(self) -> FaultCode {
        match self {
            Self::HalfGain(axis) | Self::Dead(axis) => FaultCode::servo(axis),
            Self::Stuck => FaultCode::StuckBall,
            Self::Frozen | Self::Unseen | Self::Noise | Self::Spikes => FaultCode::Sensor,
        }
    }

    /// The kind that should be reported; `None` for the ball, which has only one.
    #[must_use]
    pub const fn kind(self) -> Option<FaultKind> {
        match self {
            Self::HalfGain(_) => Some(FaultKind::Gain),
            Self::Dead(_) => Some(FaultKind::Dead),
            Self::Stuck => None,
            Self::Frozen => Some(FaultKind::Frozen),
            Self::Unseen => Some(FaultKind::Dropout),
            Self::Noise => Some(FaultKind::Noise),
            Self::Spikes => Some(FaultKind::Spikes),
        }
    }

    /// A description for people.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::HalfGain(Axis::X) => "the x servo answers half",
            Self::HalfGain(Axis::Y) => "the y servo answers half",
            Self::Dead(Axis::X) => "the x servo does not answer",
            Self::Dead(Axis::Y) => "the y servo does not answer",
            Self::Stuck => "the ball is stuck",
            Self::Frozen => "the readings are frozen",
            Self::Unseen => "no ball is seen",
            Self::Noise => "the readings scatter twelve times as far",
            Self::Spikes => "one reading in five is far off",
        }
    }
}
