//! Random numbers: one ChaCha stream per purpose, all derived from one seed.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// The purpose of a random stream; its number selects the stream. Append new purposes at
/// the end, so that a seed keeps reproducing the same numbers.
#[derive(Clone, Copy)]
pub(super) enum Purpose {
    Start,
    Reference,
    Sensor,
    Clock,
    Disturbance,
    ServoX,
    ServoY,
    SensorFault,
    Transport,
    Variety,
    Session,
    RealVariety,
}

/// A seeded source of random numbers.
#[derive(Clone, Debug)]
pub(super) struct Noise(ChaCha8Rng);

impl Noise {
    pub(super) fn new(seed: u64, purpose: Purpose) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(purpose as u64);
        Self(rng)
    }

    /// Draws from the standard normal distribution.
    pub(super) fn normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }

    /// Draws uniformly from [low, high); returns `low` if the range is empty.
    pub(super) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Draws whether an event of probability `p` happens.
    pub(super) fn happens(&mut self, p: f64) -> bool {
        self.0.random::<f64>() < p
    }

    /// Draws +1 or −1.
    pub(super) fn sign(&mut self) -> f64 {
        if self.happens(0.5) { 1.0 } else { -1.0 }
    }

    /// Draws the time to the next event of a Poisson process, s; infinite at rate zero.
    pub(super) fn waiting_s(&mut self, per_minute: f64) -> f64 {
        let uniform = 1.0 - self.0.random::<f64>();
        if per_minute > 0.0 { -uniform.ln() * 60.0 / per_minute } else { f64::INFINITY }
    }
}
