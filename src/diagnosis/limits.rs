//! How far measured and predicted acceleration may differ.

use crate::maths::window_for;

use super::{AxisCalibration, Profile};

/// The chapter's fault limit, m/s² (application 3).
const TEXTBOOK_LIMIT_M_S2: f64 = 0.01;

/// Standard errors of the estimate that are always allowed. Coloured readings
/// make the white-noise error too small by about two.
const ERROR_FACTOR: f64 = 6.0;

/// Healthy residual deviations that are allowed once they are known.
const HEALTHY_FACTOR: f64 = 5.0;

/// The limits of one axis; an adaptive limit J0 + J1·|predicted| + J3·σ_a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// J0, m/s².
    floor_m_s2: f64,
    /// J1, the share of the predicted acceleration that may be model error.
    share: f64,
    /// J3, in standard errors.
    errors: f64,
    /// Acceleration that a ball at rest resists, m/s².
    pub breakaway_m_s2: f64,
    /// Standard deviation of healthy readings, m.
    pub noise_m: f64,
}

impl Limits {
    /// The limits of `profile` for an axis, learnt or not, on a rig where a
    /// tilt of one radian would accelerate the ball by `slope_m_s2`.
    #[must_use]
    pub fn new(profile: Profile, learnt: Option<&AxisCalibration>, slope_m_s2: f64) -> Self {
        // Not learnt: a plate 1.7° off level and balls that stand at 1° have
        // been seen on healthy rigs, and 2 mm is a coarse camera.
        let wide = Self {
            floor_m_s2: 0.03 * slope_m_s2 + 0.15,
            share: 0.5,
            errors: ERROR_FACTOR,
            breakaway_m_s2: 0.0175 * slope_m_s2,
            noise_m: 2e-3,
        };
        let known = learnt.map_or(wide, |l| Self {
            floor_m_s2: (HEALTHY_FACTOR * l.residual_m_s2).max(0.15),
            share: 0.2,
            errors: ERROR_FACTOR,
            // Half again as much as learnt: friction varies over a plate.
            breakaway_m_s2: 1.5 * l.breakaway_rad * slope_m_s2,
            noise_m: l.noise_m,
        });
        match profile {
            Profile::Default => known,
            Profile::Textbook => {
                Self { floor_m_s2: TEXTBOOK_LIMIT_M_S2, share: 0.0, errors: 0.0, ..known }
            }
        }
    }

    /// The window, s, in which noise adds `share` of the floor to the limit,
    /// for readings `period_s` apart.
    #[must_use]
    pub fn window_s(&self, share: f64, period_s: f64) -> f64 {
        window_for(self.noise_m, period_s, share * self.floor_m_s2 / self.errors)
    }

    /// The limit, m/s², for a predicted acceleration and the standard error of
    /// the residual.
    #[must_use]
    pub fn at(&self, predicted_m_s2: f64, error_m_s2: f64) -> f64 {
        self.floor_m_s2 + self.share * predicted_m_s2.abs() + self.errors * error_m_s2
    }
}
