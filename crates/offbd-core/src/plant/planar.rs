//! The planar model: each axis by itself, for small angles, solved exactly for an angle
//! held over the step.
//!
//! The rolling model to first order in the plate's angles and rates, with q the angle
//! that drives the axis (qy for x, −qx for y):
//!
//! ```text
//! (1 + κ)·ẍ = g·q − (cgap + κ·r)·q̈
//! ```
//!
//! With ξ = x + c·q, c = (cgap + κ·r)/(1 + κ), this is ξ̈ = g/(1 + κ)·q, a double
//! integrator whose step under a held q is exact (zero-order hold). It needs the plate's
//! angle only, not its rates.
//!
//! Valid for small angles and rates: it neglects tan q − q and the centrifugal, Coriolis
//! and Euler terms, all of second order. [`Planar::left_out`] bounds them.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::servo::{ServoState, Sweep};
use super::tilt::Tilt;
use super::{Ball, GRAVITY_M_S2, Plate, RollingState};

/// The planar model of one ball on one plate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Planar {
    gain: f64,
    offset: f64,
    reach: f64,
}

impl Planar {
    #[must_use]
    pub fn new(ball: &Ball, plate: &Plate) -> Self {
        let kappa = ball.inertia_factor();
        let gap = plate.centre_gap_m(ball);
        Self {
            gain: ball.rolling_gravity(),
            offset: (gap + kappa * ball.radius_m()) / (1.0 + kappa),
            reach: gap,
        }
    }

    /// Returns ξ and its rate for a ball in `state` on a plate moving as `tilt`.
    #[must_use]
    pub fn enter(&self, state: &RollingState, tilt: &Tilt) -> [Vector2<f64>; 2] {
        let (angle, rate) = (drive(&tilt.angle), drive(&tilt.rate));
        [state.position + self.offset * angle, state.velocity + self.offset * rate]
    }

    /// Returns the ball's position and velocity for ξ on a plate moving as `tilt`.
    #[must_use]
    pub fn leave(&self, xi: &[Vector2<f64>; 2], tilt: &Tilt) -> RollingState {
        RollingState {
            position: xi[0] - self.offset * drive(&tilt.angle),
            velocity: xi[1] - self.offset * drive(&tilt.rate),
            spin: 0.0,
        }
    }

    /// Returns ξ after `h` seconds at held plate angles (qx, qy); exact.
    #[must_use]
    #[inline]
    pub fn hold(&self, xi: &[Vector2<f64>; 2], angle: &Vector2<f64>, h: f64) -> [Vector2<f64>; 2] {
        let a = drive(angle) * self.gain;
        [xi[0] + (xi[1] + a * (h / 2.0)) * h, xi[1] + a * h]
    }

    /// Acceleration of the ball, m/s².
    #[must_use]
    pub fn acceleration(&self, tilt: &Tilt) -> Vector2<f64> {
        drive(&tilt.angle) * self.gain - drive(&tilt.acceleration) * self.offset
    }

    /// Returns what a servo that moves from `before` through `swept` in `h` seconds adds
    /// to the path of a ball at rest, on an axis `level_rad` off level; exact.
    ///
    /// The rate of a servo modelled as a lag jumps with its command, and so does the
    /// velocity of the ball: x = ξ − c·q holds throughout.
    #[must_use]
    #[inline]
    pub fn path_increment(
        &self,
        before: &ServoState,
        swept: &Sweep,
        level_rad: f64,
        h: f64,
    ) -> PathIncrement {
        let turned = swept.servo.angle - before.angle - before.rate * h;
        let faster = swept.servo.rate - before.rate;
        PathIncrement {
            position_m: self.gain * (swept.twice + level_rad * h * h / 2.0) - self.offset * turned,
            velocity_m_s: self.gain * (swept.once + level_rad * h) - self.offset * faster,
            acceleration_m_s2: self.gain * (swept.servo.angle + level_rad),
        }
    }

    /// Friction force needed for rolling on a plate held at `angle`, over the ball's
    /// weight: κ/(1 + κ) of the larger angle.
    #[must_use]
    pub fn friction_part(&self, angle: &Vector2<f64>) -> f64 {
        angle.amax() * (1.0 - self.gain / GRAVITY_M_S2)
    }

    /// Bound of the acceleration that the model neglects, m/s²: the terms of second order
    /// in the motion, and q − sin q·cos q of gravity.
    #[must_use]
    pub fn left_out(&self, state: &RollingState, tilt: &Tilt) -> f64 {
        // The sum of the components bounds the length and needs no square root.
        let length = |v: &Vector2<f64>| v.x.abs() + v.y.abs();
        let (angle, rate) = (length(&tilt.angle), length(&tilt.rate));
        let away = length(&state.position);
        // sin and cos to third order: in the worst direction, about 50° off the axes,
        // 0.245 of the cube is neglected.
        let gravity = self.gain * angle * angle * angle / 4.0;
        let turning = rate * rate * (away + self.reach)
            + 2.0 * rate * angle * length(&state.velocity)
            + length(&tilt.acceleration) * angle * (away + self.reach * angle);
        gravity + turning
    }
}

/// What one servo adds to the ball's path over a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PathIncrement {
    pub position_m: f64,
    pub velocity_m_s: f64,
    /// Acceleration by gravity at the end of the step, m/s².
    pub acceleration_m_s2: f64,
}

/// The angles that drive the ball along x and y.
fn drive(about: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(about.y, -about.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::Rolling;
    use proptest::prelude::*;

    fn models() -> (Planar, Rolling) {
        let (ball, plate) = (Ball::default(), Plate::default());
        (Planar::new(&ball, &plate), Rolling::new(&ball, &plate))
    }

    #[test]
    fn validate_a_held_angle_against_the_parabola() {
        let (planar, _) = models();
        let start = RollingState { velocity: Vector2::new(0.1, 0.0), ..Default::default() };
        let tilt = Tilt::constant(0.0, 0.02);
        let xi = planar.hold(&planar.enter(&start, &tilt), &tilt.angle, 0.5);
        let end = planar.leave(&xi, &tilt);
        let a = 5.0 / 7.0 * 9.81 * 0.02;
        assert!((end.position.x - (0.1 * 0.5 + a * 0.125)).abs() < 1e-16);
        assert!((end.velocity.x - (0.1 + a * 0.5)).abs() < 1e-16);
    }

    proptest! {
        /// The neglected acceleration stays within the stated bound.
        #[test]
        fn the_bound_holds_against_the_rolling_model(
            q in prop::array::uniform2(-0.3..0.3_f64), rate in prop::array::uniform2(-3.0..3.0_f64),
            acceleration in prop::array::uniform2(-30.0..30.0_f64),
            p in prop::array::uniform2(-0.2..0.2_f64), v in prop::array::uniform2(-1.0..1.0_f64),
        ) {
            let (planar, rolling) = models();
            let tilt = Tilt { angle: q.into(), rate: rate.into(), acceleration: acceleration.into() };
            let state = RollingState { position: p.into(), velocity: v.into(), spin: 0.0 };
            let (truth, _) = rolling.acceleration(&state, &tilt.motion());
            let error = (planar.acceleration(&tilt) - truth).norm();
            let bound = planar.left_out(&state, &tilt);
            prop_assert!(error <= bound, "{error} above {bound}");
        }
    }
}
