//! Disturbances of a healthy rig: pushes of the ball by hand, and gusts.

use nalgebra::Vector2;

use super::noise::{Noise, Purpose};
use offbd_core::plant::Ball;

/// Mean rates of the disturbances; immutable.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Disturbances {
    /// Pushes by hand, of 0.1 s each.
    pub pushes_per_minute: f64,
    /// Gusts of one to three seconds.
    pub gusts_per_minute: f64,
}

/// Duration of a push, s: that of the chapter's impulse.
const PUSH_S: f64 = 0.1;
/// Range of the velocity change of a free ball by a push, m/s; chosen: from a nudge to a
/// shove.
const PUSH_M_S: [f64; 2] = [0.05, 0.2];
/// Range of the duration of a gust, s; chosen.
const GUST_S: [f64; 2] = [1.0, 3.0];
/// Range of the acceleration of a ping-pong ball by a gust, m/s²; chosen: from a fan at
/// arm's length to an open window.
const GUST_M_S2: [f64; 2] = [0.03, 0.12];

/// A constant acceleration for a limited time.
#[derive(Clone, Copy, Debug)]
struct ActiveDisturbance {
    until_s: f64,
    acceleration: Vector2<f64>,
}

/// The active disturbances, and the times of the next ones.
#[derive(Clone, Debug)]
pub(super) struct DisturbanceState {
    rates: Disturbances,
    /// Acceleration by a gust relative to that of a ping-pong ball.
    sail: f64,
    noise: Noise,
    next_push_s: f64,
    next_gust_s: f64,
    in_force: Vec<ActiveDisturbance>,
}

impl DisturbanceState {
    pub(super) fn new(rates: Disturbances, ball: &Ball, seed: u64) -> Self {
        let mut noise = Noise::new(seed, Purpose::Disturbance);
        let next_push_s = noise.waiting_s(rates.pushes_per_minute);
        let next_gust_s = noise.waiting_s(rates.gusts_per_minute);
        Self {
            rates,
            sail: ball.air_drag_ratio(),
            noise,
            next_push_s,
            next_gust_s,
            in_force: Vec::new(),
        }
    }

    /// Returns the acceleration of a free ball at `at_s`, m/s².
    pub(super) fn at(&mut self, at_s: f64) -> Vector2<f64> {
        if at_s >= self.next_push_s {
            let speed = self.noise.uniform(PUSH_M_S[0], PUSH_M_S[1]);
            self.push_at_random_angle(speed / PUSH_S, at_s + PUSH_S);
            self.next_push_s = at_s + self.noise.waiting_s(self.rates.pushes_per_minute);
        }
        if at_s >= self.next_gust_s {
            let strength = self.sail * self.noise.uniform(GUST_M_S2[0], GUST_M_S2[1]);
            let until_s = at_s + self.noise.uniform(GUST_S[0], GUST_S[1]);
            self.push_at_random_angle(strength, until_s);
            self.next_gust_s = at_s + self.noise.waiting_s(self.rates.gusts_per_minute);
        }
        self.in_force.retain(|p| at_s < p.until_s);
        self.in_force.iter().map(|p| p.acceleration).sum()
    }

    /// Adds a push until `until_s`.
    pub(super) fn push(&mut self, acceleration: Vector2<f64>, until_s: f64) {
        self.in_force.push(ActiveDisturbance { until_s, acceleration });
    }

    fn push_at_random_angle(&mut self, strength: f64, until_s: f64) {
        let angle = self.noise.uniform(0.0, std::f64::consts::TAU);
        self.push(Vector2::new(angle.cos(), angle.sin()) * strength, until_s);
    }
}
