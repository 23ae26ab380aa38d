//! A position servo: angle limit, first-order lag, rate limit.
//!
//! `q̇ = clamp((clamp(u, ±limit) − q)/lag, ±rate limit)`, advanced exactly for
//! a command held over the step. Dead time is kept by whoever feeds commands.

use crate::vocabulary::{Invalid, in_range, positive};

/// What a servo can do; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
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
                std::f64::consts::FRAC_PI_2,
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

    /// The servo after `h` seconds of the held command `command_rad`.
    #[must_use]
    pub fn advance(&self, servo: &Servo, command_rad: f64, h: f64) -> Servo {
        let target = command_rad.clamp(-self.angle_limit_rad, self.angle_limit_rad);
        let error = target - servo.angle;
        let (rate_limit, lag) = (self.rate_limit_rad_s, self.lag_s);
        // While the lag asks for more than the rate limit the angle runs
        // straight; the rest of the step decays exponentially.
        let linear_band = rate_limit * lag;
        let ramp = ((error.abs() - linear_band) / rate_limit).clamp(0.0, h);
        let left = error - error.signum() * rate_limit * ramp;
        let angle =
            if lag > 0.0 { target - left * (-(h - ramp) / lag).exp() } else { target - left };
        let after = target - angle;
        let rate = if lag > 0.0 { (after / lag).clamp(-rate_limit, rate_limit) } else { 0.0 };
        let ramping = after.abs() > linear_band;
        let acceleration = if lag > 0.0 && !ramping { -rate / lag } else { 0.0 };
        Servo { angle, rate, acceleration }
    }
}

/// Where a servo is: angle rad, rate rad/s, acceleration rad/s².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Servo {
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
        let servo = model.advance(&Servo::default(), 0.1, 0.08);
        assert!((servo.angle - 0.1 * (1.0 - (-0.08_f64 / 0.05).exp())).abs() < 1e-15);
        assert!((servo.rate - 0.1 / 0.05 * (-0.08_f64 / 0.05).exp()).abs() < 1e-13);
    }

    #[test]
    fn validate_rate_limit_then_decay() {
        let model = ServoModel::new(1.0, 0.1, 2.0).unwrap();
        // Error 0.5: straight at 2 rad/s until 0.2 is left, i.e. for 0.15 s.
        let servo = model.advance(&Servo::default(), 0.5, 0.25);
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
            let start = Servo { angle: from, ..Servo::default() };
            let once = model.advance(&start, command, h);
            let twice = model.advance(&model.advance(&start, command, h * split), command, h * (1.0 - split));
            prop_assert!((once.angle - twice.angle).abs() < 1e-12);
        }
    }
}
