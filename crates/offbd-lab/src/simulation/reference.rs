//! Reference motions: the setpoint of the ball over time.

use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;

use nalgebra::Vector2;

use super::noise::{Noise, Purpose};
use offbd_core::vocabulary::UnknownWord;

/// A reference motion. Amplitudes are shares of the ball's reach along each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reference {
    /// The plate's centre.
    Hold,
    /// A step to a random position every 3 s.
    #[default]
    Steps,
    /// A circle with a period of 3.2 s.
    Circle,
    /// A Lissajous figure with periods of 3.2 s along x and 2.4 s along y.
    Lissajous,
}

impl Reference {
    pub const ALL: [Self; 4] = [Self::Hold, Self::Steps, Self::Circle, Self::Lissajous];

    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Steps => "steps",
            Self::Circle => "circle",
            Self::Lissajous => "lissajous",
        }
    }
}

impl fmt::Display for Reference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl FromStr for Reference {
    type Err = UnknownWord;
    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        Self::ALL.into_iter().find(|r| r.as_str() == word).ok_or_else(|| UnknownWord {
            word: word.to_owned(),
            expected: "hold, steps, circle, lissajous".to_owned(),
        })
    }
}

/// Interval between two steps, s. Chosen: three closed-loop time constants of the
/// presets.
const STEP_S: f64 = 3.0;
/// Largest step as a share of the reach. Chosen so that an overshoot of a fifth stays
/// clear of the rim.
const STEP_SHARE: f64 = 0.5;
/// Amplitude of circle and Lissajous figure as a share of the reach; chosen likewise.
const TURN_SHARE: f64 = 0.45;
/// Periods of circle and Lissajous figure, s. Chosen: on half of the chapter's plate they
/// require tilts of 1.5–3°, enough to distinguish a servo's gain from stiction.
const TURN_S: [f64; 2] = [3.2, 2.4];

/// A reference motion with its state.
#[derive(Clone, Debug)]
pub(super) struct ReferenceState {
    reference: Reference,
    reach: Vector2<f64>,
    noise: Noise,
    target: Vector2<f64>,
    next_step_s: f64,
}

impl ReferenceState {
    pub(super) fn new(reference: Reference, reach: Vector2<f64>, seed: u64) -> Self {
        let noise = Noise::new(seed, Purpose::Reference);
        Self { reference, reach, noise, target: Vector2::zeros(), next_step_s: STEP_S }
    }

    /// Returns the reference position at `t_s`, m; times must not decrease.
    pub(super) fn at(&mut self, t_s: f64) -> Vector2<f64> {
        let turn = |period: f64| TAU * t_s / period;
        match self.reference {
            Reference::Hold => Vector2::zeros(),
            Reference::Steps => self.step(t_s),
            Reference::Circle => {
                let radius = self.reach.min() * TURN_SHARE;
                Vector2::new(turn(TURN_S[0]).cos(), turn(TURN_S[0]).sin()) * radius
            }
            Reference::Lissajous => Vector2::new(
                self.reach.x * TURN_SHARE * turn(TURN_S[0]).sin(),
                self.reach.y * TURN_SHARE * turn(TURN_S[1]).sin(),
            ),
        }
    }

    /// Returns the acceleration at the reference position `wanted`, m/s²; zero for steps.
    pub(super) fn acceleration(&self, wanted: Vector2<f64>) -> Vector2<f64> {
        let square = Vector2::from(TURN_S.map(|period| (TAU / period).powi(2)));
        match self.reference {
            Reference::Hold | Reference::Steps => Vector2::zeros(),
            Reference::Circle => wanted * -square[0],
            Reference::Lissajous => -wanted.component_mul(&square),
        }
    }

    fn step(&mut self, t_s: f64) -> Vector2<f64> {
        while t_s >= self.next_step_s {
            self.next_step_s += STEP_S;
            let mut share = || self.noise.uniform(-STEP_SHARE, STEP_SHARE);
            self.target = Vector2::new(share(), share()).component_mul(&self.reach);
        }
        self.target
    }
}
