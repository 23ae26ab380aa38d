//! A plate in closed loop: one PID per axis, held between its turns, through a
//! second-order lag.
//!
//! ```text
//! u = kp·e + ki·∫e − kd·(p − p′)/T      every T, held; e = −p, within ±limit
//! q̈ = (u − q)/τ² − 2·q̇/τ               the plate follows, critically damped
//! ```
//!
//! The derivative acts on the measurement, so that nothing kicks at the start;
//! the integral stands still while the limit holds. The lag is Simscape's
//! second-order input filter, solved in closed form within a hold:
//! q = u + (a + b·s)·exp(−s/τ), s from the hold's start.
//!
//! Gains by pole placement on p̈ = g/(1 + κ)·u, the rolling ball on a plate that
//! follows at once: (s + ω)³ wants kd = 3ω, kp = 3ω², ki = ω³, each over
//! g/(1 + κ). Valid while T/2 + 2τ is short against 1/(3ω).

use std::f64::consts::TAU;

use nalgebra::Vector2;

use super::drive::{Drive, Push, next_push, pushed};
use offbd_core::plant::{Ball, Motion, Tilt};
use offbd_core::vocabulary::Axis;

/// A loop; immutable. Gains in rad/m, rad/(m·s), rad·s/m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loop {
    pub proportional: f64,
    pub integral: f64,
    pub derivative: f64,
    /// Between two turns of the controller, s.
    pub period_s: f64,
    /// Largest command, rad.
    pub limit_rad: f64,
    /// Time constant τ of the plate's lag, s.
    pub lag_s: f64,
}

impl Loop {
    /// The chapter's loop, 10 ms and ±0.2 rad, for `ball`. The triple pole at
    /// 1.5 rad/s and the lag of 30 ms are ours: the delay of 65 ms costs 18° of
    /// 72° at the crossover near 4.7 rad/s; with less lag, or larger gains, the
    /// plate's first swing throws off a ball that starts 9 cm from the joint.
    #[must_use]
    pub fn chapter(ball: &Ball) -> Self {
        let (omega, gain) = (1.5, ball.rolling_gravity());
        Self {
            proportional: 3.0 * omega * omega / gain,
            integral: omega * omega * omega / gain,
            derivative: 3.0 * omega / gain,
            period_s: 0.01,
            limit_rad: 0.2,
            lag_s: 0.03,
        }
    }
}

/// One turn of the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    pub at_s: f64,
    /// Where the ball is, along x and y, m; it is wanted at the centre.
    pub position: Vector2<f64>,
    /// (qx, qy) commanded from now on, rad.
    pub command: Vector2<f64>,
}

/// A plate that follows a loop around the ball.
#[derive(Clone, Debug, PartialEq)]
pub struct Controlled {
    closed: Loop,
    pushes: Vec<Push>,
    axes: [Control; 2],
    lag: [Lag; 2],
    since_s: f64,
    push: Vector2<f64>,
    turns: Vec<Turn>,
}

/// The controller of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Control {
    integral: f64,
    last: Option<f64>,
}

impl Control {
    /// The wish for the ball at `position`, rad along the axis.
    fn turn(&mut self, closed: &Loop, position: f64) -> f64 {
        let change = (position - self.last.unwrap_or(position)) / closed.period_s;
        let free = -closed.proportional * position + self.integral - closed.derivative * change;
        let wish = free.clamp(-closed.limit_rad, closed.limit_rad);
        if wish == free {
            self.integral -= closed.integral * position * closed.period_s;
        }
        self.last = Some(position);
        wish
    }
}

/// One angle within a hold, from its start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Lag {
    command: f64,
    apart: f64,
    drift: f64,
}

impl Lag {
    /// From an angle and its rate toward `command`.
    fn toward(command: f64, [angle, rate]: [f64; 2], tau: f64) -> Self {
        let apart = angle - command;
        Self { command, apart, drift: rate + apart / tau }
    }

    /// Angle, rate and acceleration after `s` seconds.
    fn after(&self, s: f64, tau: f64) -> [f64; 3] {
        let decay = (-s / tau).exp();
        let apart = self.apart + self.drift * s;
        [
            self.command + decay * apart,
            decay * (self.drift - apart / tau),
            decay * (apart / tau - 2.0 * self.drift) / tau,
        ]
    }
}

impl Controlled {
    /// `closed` around a ball that is wanted at the centre, on a plate that
    /// starts level.
    #[must_use]
    pub fn new(closed: Loop, pushes: Vec<Push>) -> Self {
        Self {
            closed,
            pushes,
            axes: [Control::default(); 2],
            lag: [Lag::default(); 2],
            since_s: 0.0,
            push: Vector2::zeros(),
            turns: Vec::new(),
        }
    }

    /// What the controller did, turn by turn.
    #[must_use]
    pub fn turns(&self) -> &[Turn] {
        &self.turns
    }

    fn next_turn_s(&self) -> f64 {
        self.turns.len() as f64 * self.closed.period_s
    }

    fn turn(&mut self, t: f64, at: &Motion) {
        let wish = Axis::ALL.map(|axis| {
            let i = axis as usize;
            self.axes[i].turn(&self.closed, at.position[i]) * axis.drive_sign()
        });
        // The x servo turns qy, the y servo qx.
        let command = Vector2::new(wish[1], wish[0]);
        let (tau, s) = (self.closed.lag_s, t - self.since_s);
        for (lag, &command) in self.lag.iter_mut().zip(command.iter()) {
            let [angle, rate, _] = lag.after(s, tau);
            *lag = Lag::toward(command, [angle, rate], tau);
        }
        self.since_s = t;
        self.turns.push(Turn { at_s: t, position: at.position.xy(), command });
    }
}

impl Drive for Controlled {
    #[inline]
    fn tilt(&self, t: f64) -> Tilt {
        let [x, y] = self.lag.map(|lag| lag.after(t - self.since_s, self.closed.lag_s));
        Tilt::of(x, y)
    }

    fn push(&self) -> Vector2<f64> {
        self.push
    }

    fn is_still(&self) -> bool {
        false
    }

    fn begin(&mut self, t: f64, at: &Motion) -> f64 {
        if self.next_turn_s() <= t {
            self.turn(t, at);
        }
        let end = self.next_turn_s().min(next_push(&self.pushes, t));
        self.push = pushed(&self.pushes, (t + end) / 2.0);
        end
    }

    /// The period of the lag's corner.
    fn shortest_time_s(&self) -> f64 {
        TAU * self.closed.lag_s
    }
}

#[cfg(test)]
mod tests;
