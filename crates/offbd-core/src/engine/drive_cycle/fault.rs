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

/// Gain of a servo that answers half. Chosen: a little more than half, since a rig is not
/// exactly its twin.
const HALF_GAIN: f64 = 0.55;
/// Ratio of a noisy sensor's scatter to the healthy one. Chosen.
const TRIED_NOISE_FACTOR: f64 = 12.0;
/// Fraction of a spiky sensor's readings that are anywhere on the plate. Chosen.
const SPIKE_SHARE: f64 = 0.2;

/// How a fault changes the rig of a trial.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effect {
    /// Fraction of its command that each servo answers.
    pub answers: PerAxis<f64>,
    /// Whether the ball stays where it is.
    pub sticks: bool,
    /// Whether the sensor repeats its first reading.
    pub repeats: bool,
    /// Whether the sensor sees no ball.
    pub is_blind: bool,
    /// Ratio of the readings' scatter to the healthy one.
    pub noise_factor: f64,
    /// Fraction of readings that are anywhere on the plate.
    pub spike_share: f64,
}

impl Effect {
    pub(super) const HEALTHY: Self = Self {
        answers: PerAxis { x: 1.0, y: 1.0 },
        sticks: false,
        repeats: false,
        is_blind: false,
        noise_factor: 1.0,
        spike_share: 0.0,
    };

    const fn answers(axis: Axis, share: f64) -> Self {
        let answers = match axis {
            Axis::X => PerAxis { x: share, y: 1.0 },
            Axis::Y => PerAxis { x: 1.0, y: share },
        };
        Self { answers, ..Self::HEALTHY }
    }
}

/// The code and the kind that should be reported (no kind for the ball, which has only one), a
/// description for people, and the effect.
type Row = (FaultCode, Option<FaultKind>, &'static str, Effect);

impl TriedFault {
    /// Returns all faults that a rig with these axes can have, the hardest to find first.
    pub fn of(axes: PerAxis<bool>) -> Vec<Self> {
        let has = |axis: &Axis| axes[*axis];
        let servos = |fault: fn(Axis) -> Self| Axis::ALL.into_iter().filter(has).map(fault);
        let others = [Self::Noise, Self::Stuck, Self::Spikes, Self::Frozen, Self::Unseen];
        servos(Self::HalfGain).chain(servos(Self::Dead)).chain(others).collect()
    }

    const fn row(self) -> Row {
        const ANY: Effect = Effect::HEALTHY;
        match self {
            Self::HalfGain(axis) => {
                let words = ["half response of the x servo", "half response of the y servo"];
                let effect = Effect::answers(axis, HALF_GAIN);
                (FaultCode::servo(axis), Some(FaultKind::Gain), words[axis as usize], effect)
            }
            Self::Dead(axis) => {
                let words = ["no response of the x servo", "no response of the y servo"];
                let effect = Effect::answers(axis, 0.0);
                (FaultCode::servo(axis), Some(FaultKind::Dead), words[axis as usize], effect)
            }
            Self::Stuck => {
                (FaultCode::StuckBall, None, "the ball is stuck", Effect { sticks: true, ..ANY })
            }
            Self::Frozen => {
                let effect = Effect { repeats: true, ..ANY };
                sensor(FaultKind::Frozen, "the readings are frozen", effect)
            }
            Self::Unseen => {
                sensor(FaultKind::Dropout, "no ball is seen", Effect { is_blind: true, ..ANY })
            }
            Self::Noise => {
                let effect = Effect { noise_factor: TRIED_NOISE_FACTOR, ..ANY };
                sensor(FaultKind::Noise, "the readings scatter twelve times as far", effect)
            }
            Self::Spikes => {
                let effect = Effect { spike_share: SPIKE_SHARE, ..ANY };
                sensor(FaultKind::Spikes, "one reading in five is far off", effect)
            }
        }
    }

    /// The code that should report it.
    #[must_use]
    pub const fn code(self) -> FaultCode {
        self.row().0
    }

    /// The kind that should be reported; `None` for the ball, which has only one.
    #[must_use]
    pub const fn kind(self) -> Option<FaultKind> {
        self.row().1
    }

    /// A description for people.
    #[must_use]
    pub const fn words(self) -> &'static str {
        self.row().2
    }

    /// How it changes the rig of a trial.
    pub(super) const fn effect(self) -> Effect {
        self.row().3
    }
}

const fn sensor(kind: FaultKind, words: &'static str, effect: Effect) -> Row {
    (FaultCode::Sensor, Some(kind), words, effect)
}
