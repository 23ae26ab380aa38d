//! Where the ball is asked to be.

use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;

use nalgebra::Vector2;

use super::noise::{Noise, Purpose};
use offbd_core::vocabulary::UnknownWord;

/// A reference motion. Its amplitudes are shares of the free half extents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reference {
    /// The plate's centre.
    Hold,
    /// A new place, drawn at random, every 3 s.
    #[default]
    Steps,
    /// A circle in 3.2 s.
    Circle,
    /// Two periods, 3.2 s along x and 2.4 s along y.
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

/// Seconds between two steps: three closed-loop time constants of the presets.
const STEP_S: f64 = 3.0;
/// Shares of the free half extent: steps and turns stay clear of the rim while
/// overshooting by a fifth.
const STEP_SHARE: f64 = 0.5;
const TURN_SHARE: f64 = 0.45;
/// Periods of the turns, s: on half of the chapter's plate they ask for tilts of
/// 1.5–3°, enough to tell a servo's gain from stiction.
const TURN_S: [f64; 2] = [3.2, 2.4];

/// The reference in motion.
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

    /// The wanted position at `t_s`, m; times must not go back.
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

    /// The acceleration that goes with it, m/s²; a step has none.
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
