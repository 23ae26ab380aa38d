//! What happens to a healthy rig: hands push the ball, air moves it.

use nalgebra::Vector2;

use super::noise::{Noise, Purpose};
use offbd_core::plant::Ball;

/// How often it happens; immutable.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Disturbances {
    /// Pushes by hand, of 0.1 s each.
    pub pushes_per_minute: f64,
    /// Gusts of one to three seconds.
    pub gusts_per_minute: f64,
}

/// A push lasts as long as the chapter's impulse, s.
const PUSH_S: f64 = 0.1;
/// Change of the ball's speed by a push, m/s: a nudge to a shove.
const PUSH_M_S: [f64; 2] = [0.05, 0.2];
const GUST_S: [f64; 2] = [1.0, 3.0];
/// A fan at arm's length to an open window, m/s² on a ping-pong ball.
const GUST_M_S2: [f64; 2] = [0.03, 0.12];

/// A constant acceleration for a while.
#[derive(Clone, Copy, Debug)]
struct Push {
    until_s: f64,
    acceleration: Vector2<f64>,
}

/// The disturbances in progress and to come.
#[derive(Clone, Debug)]
pub(super) struct DisturbanceState {
    rates: Disturbances,
    /// How easily air moves the ball.
    sail: f64,
    noise: Noise,
    next_push_s: f64,
    next_gust_s: f64,
    in_force: Vec<Push>,
}

impl DisturbanceState {
    pub(super) fn new(rates: Disturbances, ball: &Ball, seed: u64) -> Self {
        let mut noise = Noise::new(seed, Purpose::Disturbance);
        let next_push_s = noise.waiting_s(rates.pushes_per_minute);
        let next_gust_s = noise.waiting_s(rates.gusts_per_minute);
        Self {
            rates,
            sail: ball.sail_share(),
            noise,
            next_push_s,
            next_gust_s,
            in_force: Vec::new(),
        }
    }

    /// The acceleration of a free ball at `at_s`, m/s².
    pub(super) fn at(&mut self, at_s: f64) -> Vector2<f64> {
        if at_s >= self.next_push_s {
            let speed = self.noise.uniform(PUSH_M_S[0], PUSH_M_S[1]);
            self.somewhere(speed / PUSH_S, at_s + PUSH_S);
            self.next_push_s = at_s + self.noise.waiting_s(self.rates.pushes_per_minute);
        }
        if at_s >= self.next_gust_s {
            let strength = self.sail * self.noise.uniform(GUST_M_S2[0], GUST_M_S2[1]);
            let until_s = at_s + self.noise.uniform(GUST_S[0], GUST_S[1]);
            self.somewhere(strength, until_s);
            self.next_gust_s = at_s + self.noise.waiting_s(self.rates.gusts_per_minute);
        }
        self.in_force.retain(|p| at_s < p.until_s);
        self.in_force.iter().map(|p| p.acceleration).sum()
    }

    /// A push from outside.
    pub(super) fn push(&mut self, acceleration: Vector2<f64>, until_s: f64) {
        self.in_force.push(Push { until_s, acceleration });
    }

    fn somewhere(&mut self, strength: f64, until_s: f64) {
        let angle = self.noise.uniform(0.0, std::f64::consts::TAU);
        self.push(Vector2::new(angle.cos(), angle.sin()) * strength, until_s);
    }
}
