//! A position servo: angle limit, first-order lag, rate limit.
//!
//! `q̇ = clamp((clamp(u, ±limit) − q)/lag, ±rate limit)`, solved exactly for a command
//! held over the step. The caller delays commands by the dead time.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Invalid, in_range, positive};
use serde::{Deserialize, Serialize};

/// The parameters of a servo; immutable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ServoModel {
    angle_limit_rad: f64,
    lag_s: f64,
    rate_limit_rad_s: f64,
}

impl ServoModel {
    /// A servo with an angle limit in (0, π/2] rad, a lag in [0, 10] s and a
    /// rate limit in (0, 1000] rad/s.
    ///
    /// # Errors
    /// [`Invalid`] naming the element under `/servo`.
    pub fn new(angle_limit_rad: f64, lag_s: f64, rate_limit_rad_s: f64) -> Result<Self, Invalid> {
        Ok(Self {
            angle_limit_rad: positive(
                "/servo/angle_limit_rad",
                angle_limit_rad,
                core::f64::consts::FRAC_PI_2,
            )?,
            lag_s: in_range("/servo/lag_s", lag_s, 0.0..=10.0)?,
            rate_limit_rad_s: positive("/servo/rate_limit_rad_s", rate_limit_rad_s, 1000.0)?,
        })
    }

    #[must_use]
    pub const fn angle_limit_rad(&self) -> f64 {
        self.angle_limit_rad
    }

    #[must_use]
    pub const fn lag_s(&self) -> f64 {
        self.lag_s
    }

    #[must_use]
    pub const fn rate_limit_rad_s(&self) -> f64 {
        self.rate_limit_rad_s
    }

    /// Returns the servo's state after `h` seconds of the held command `command_rad`.
    #[must_use]
    pub fn advance(&self, servo: &ServoState, command_rad: f64, h: f64) -> ServoState {
        self.sweep(servo, command_rad, h).servo
    }

    /// Like [`advance`](Self::advance), with the integrals of the angle over the step.
    #[must_use]
    #[inline]
    pub fn sweep(&self, servo: &ServoState, command_rad: f64, h: f64) -> Sweep {
        let target = command_rad.min(self.angle_limit_rad).max(-self.angle_limit_rad);
        // While the lag asks for more than the rate limit the angle changes at a constant
        // rate; the rest of the step decays exponentially.
        let beyond = (target - servo.angle).abs() - self.linear_band_rad();
        if beyond <= 0.0 {
            return self.decay(servo.angle, target, h);
        }
        let ramp_s = (beyond / self.rate_limit_rad_s).min(h);
        let ramped = self.ramp(servo.angle, target, ramp_s);
        if ramp_s == h {
            return ramped;
        }
        ramped.then(&self.decay(ramped.servo.angle, target, h - ramp_s), h - ramp_s)
    }

    /// Distance from the target, rad, below which the rate limit does not act.
    fn linear_band_rad(&self) -> f64 {
        self.rate_limit_rad_s * self.lag_s
    }

    /// Moves from `angle` towards `target` at the rate limit for `h` seconds.
    fn ramp(&self, angle: f64, target: f64, h: f64) -> Sweep {
        let rate = self.rate_limit_rad_s.copysign(target - angle);
        Sweep {
            servo: ServoState { angle: angle + rate * h, rate, acceleration: 0.0 },
            once: (angle + rate * h / 2.0) * h,
            twice: (angle + rate * h / 3.0) * h * h / 2.0,
        }
    }

    /// Decays exponentially from `angle` towards `target` for `h` seconds.
    #[inline]
    fn decay(&self, angle: f64, target: f64, h: f64) -> Sweep {
        let (error, lag) = (target - angle, self.lag_s);
        if lag == 0.0 {
            let servo = ServoState { angle: target, ..ServoState::default() };
            return Sweep { servo, once: target * h, twice: target * h * h / 2.0 };
        }
        let left = error * (-h / lag).exp();
        let (rate, decayed) = (left / lag, lag * (error - left));
        Sweep {
            servo: ServoState { angle: target - left, rate, acceleration: -rate / lag },
            once: target * h - decayed,
            twice: target * h * h / 2.0 - lag * (error * h - decayed),
        }
    }
}

/// A servo's motion over a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// The state at the end.
    pub servo: ServoState,
    /// Integral of the angle over the step, rad·s.
    pub once: f64,
    /// Double integral of the angle, rad·s²: the path under unit acceleration per radian.
    pub twice: f64,
}

impl Sweep {
    /// A sweep of zero duration.
    #[must_use]
    pub fn start(servo: ServoState) -> Self {
        Self { servo, once: 0.0, twice: 0.0 }
    }

    /// Appends the sweep `next` of `h` seconds.
    #[must_use]
    pub fn then(&self, next: &Self, h: f64) -> Self {
        Self {
            servo: next.servo,
            once: self.once + next.once,
            twice: self.twice + self.once * h + next.twice,
        }
    }
}

/// The state of a servo: angle (rad), rate (rad/s), acceleration (rad/s²).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ServoState {
    pub angle: f64,
    pub rate: f64,
    pub acceleration: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn validate_step_response_against_the_closed_form() {
        let model = ServoModel::new(0.5, 0.05, 1000.0).unwrap();
        let servo = model.advance(&ServoState::default(), 0.1, 0.08);
        assert!((servo.angle - 0.1 * (1.0 - (-0.08_f64 / 0.05).exp())).abs() < 1e-15);
        assert!((servo.rate - 0.1 / 0.05 * (-0.08_f64 / 0.05).exp()).abs() < 1e-13);
    }

    #[test]
    fn validate_rate_limit_then_decay() {
        let model = ServoModel::new(1.0, 0.1, 2.0).unwrap();
        // Error 0.5: at 2 rad/s until 0.2 is left, that is for 0.15 s.
        let servo = model.advance(&ServoState::default(), 0.5, 0.25);
        assert!((servo.angle - (0.5 - 0.2 * (-1.0_f64).exp())).abs() < 1e-15);
    }

    #[test]
    fn bad_numbers_name_their_element() {
        assert_eq!(
            ServoModel::new(f64::NAN, 0.1, 1.0).unwrap_err().element,
            "/servo/angle_limit_rad"
        );
        assert_eq!(ServoModel::new(0.1, -0.1, 1.0).unwrap_err().element, "/servo/lag_s");
        assert_eq!(ServoModel::new(0.1, 0.1, 0.0).unwrap_err().element, "/servo/rate_limit_rad_s");
    }

    proptest! {
        #[test]
        fn one_step_equals_two(
            limit in 0.01..1.0_f64, lag in 0.0..0.5_f64, rate in 0.1..50.0_f64,
            from in -1.0..1.0_f64, command in -2.0..2.0_f64, h in 0.0..0.5_f64, split in 0.0..1.0_f64,
        ) {
            let model = ServoModel::new(limit, lag, rate).unwrap();
            let start = ServoState { angle: from, ..ServoState::default() };
            let once = model.advance(&start, command, h);
            let twice = model.advance(&model.advance(&start, command, h * split), command, h * (1.0 - split));
            prop_assert!((once.angle - twice.angle).abs() < 1e-12);
        }

        /// The integrals are those of the angle, by Simpson's rule.
        #[test]
        fn a_sweep_integrates_the_angle(
            lag in 0.02..0.5_f64, rate in 0.5..50.0_f64, from in -1.0..1.0_f64,
            command in -1.0..1.0_f64, h in 0.001..0.5_f64,
        ) {
            let model = ServoModel::new(1.0, lag, rate).unwrap();
            let start = ServoState { angle: from, ..ServoState::default() };
            let sweep = model.sweep(&start, command, h);
            let (n, dt) = (1000, h / 1000.0);
            let (mut once, mut twice) = (0.0, 0.0);
            for i in 0..n {
                let t = f64::from(i) * dt;
                let angle = |t: f64| model.advance(&start, command, t).angle;
                let area = |f: &dyn Fn(f64) -> f64| (f(t) + 4.0 * f(t + dt / 2.0) + f(t + dt)) * dt / 6.0;
                once += area(&angle);
                // ∬q = ∫(h − t)·q.
                twice += area(&|t| (h - t) * angle(t));
            }
            prop_assert!((sweep.once - once).abs() < 1e-7 * h, "{} {once}", sweep.once);
            prop_assert!((sweep.twice - twice).abs() < 1e-7 * h * h, "{} {twice}", sweep.twice);
        }
    }
}
