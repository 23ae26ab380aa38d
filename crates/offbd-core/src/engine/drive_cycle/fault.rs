//! The faults that a drive cycle is tried with.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, FaultCode, FaultKind, PerAxis};

/// A fault that is there from the start of the cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TriedFault {
    /// A servo answers half of its command.
    HalfGain(Axis),
    /// A servo does not answer.
    Dead(Axis),
    /// The ball is stuck to the plate.
    Stuck,
    /// The readings are all the same to the bit.
    Frozen,
    /// No ball is seen.
    Unseen,
    /// The readings scatter `NOISE` times as far as healthy ones.
    Noise,
    /// One reading in five is anywhere on the plate.
    Spikes,
}

/// Times the healthy scatter of the readings that a noisy sensor has.
pub(super) const NOISE: f64 = 12.0;
/// Share of a spiky sensor's readings that are anywhere on the plate.
pub(super) const SPIKES: f64 = 0.2;

impl TriedFault {
    /// All that a rig with these axes can have, those hardest to find first.
    pub fn of(axes: PerAxis<bool>) -> Vec<Self> {
        let has = |axis: &Axis| axes[*axis];
        let servos = |fault: fn(Axis) -> Self| Axis::ALL.into_iter().filter(has).map(fault);
        let others = [Self::Noise, Self::Stuck, Self::Spikes, Self::Frozen, Self::Unseen];
        servos(Self::HalfGain).chain(servos(Self::Dead)).chain(others).collect()
    }

    /// The code that it should be found by.
    #[must_use]
    pub const fn code(self) -> FaultCode {
        match self {
            Self::HalfGain(axis) | Self::Dead(axis) => FaultCode::servo(axis),
            Self::Stuck => FaultCode::StuckBall,
            Self::Frozen | Self::Unseen | Self::Noise | Self::Spikes => FaultCode::Sensor,
        }
    }

    /// In which way it is wrong; none for the ball, of which there is but one.
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

    /// In plain words.
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
