//! The limits of the residual, the path and the readings.

use crate::maths::window_for;
use serde::{Deserialize, Serialize};

use super::{AxisCalibration, Profile, SensorCalibration};

/// The chapter's fault limit, m/s² (application 3).
const TEXTBOOK_LIMIT_M_S2: f64 = 0.01;

/// Standard errors of the residual within the limit. Correlated readings make the
/// white-noise error too small by a factor of about two.
const ERROR_FACTOR: f64 = 6.0;

/// Standard deviations of the healthy residual within the limit, for a learnt rig.
/// Chosen.
const HEALTHY_FACTOR: f64 = 5.0;

/// Recent outliers above twice the healthy count from which on the sensor fails. Chosen.
const FEW_OUTLIERS: f64 = 4.0;
/// Recent outliers from which on the sensor of a rig that is not learnt fails: no healthy
/// sensor with four in ten seconds is known.
const UNKNOWN_OUTLIERS: f64 = 4.0;
/// Factor on the outliers of the healthy sensor. Chosen.
const OUTLIERS_FACTOR: f64 = 2.0;
/// Time without a ball from which on the sensor fails, s: no healthy tracker of a rig
/// that is not learnt has lost it for as long.
const UNSEEN_S: f64 = 0.3;
/// Factor on the longest healthy time without a ball. Chosen.
const UNSEEN_FACTOR: f64 = 1.5;
/// Factor on the largest scatter that healthy readings have shown for a while. Chosen.
const SCATTER_FACTOR: f64 = 1.25;
/// Scatter up to which no sensor is blamed if the healthy scatter is unknown, m: that of
/// a tracker accurate to a pixel.
const UNKNOWN_SCATTER_M: f64 = 1e-3;
/// Least scatter for which a sensor is blamed, m: the roughness of a plate.
const LEAST_SCATTER_M: f64 = 1e-4;

/// The limits of the readings themselves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorLimits {
    /// Recent outliers.
    pub outliers: f64,
    /// Time without a ball, s.
    pub unseen_s: f64,
    /// Scatter about the motion that does not count as noise, m.
    pub scatter_m: f64,
}

impl SensorLimits {
    #[must_use]
    pub fn new(learnt: Option<&SensorCalibration>) -> Self {
        let outliers =
            learnt.map_or(UNKNOWN_OUTLIERS, |l| FEW_OUTLIERS + OUTLIERS_FACTOR * l.most_outliers);
        let unseen_s = learnt.map_or(0.0, |l| UNSEEN_FACTOR * l.longest_unseen_s).max(UNSEEN_S);
        let most_m = learnt.map(|l| l.most_scatter_m).filter(|&most_m| most_m > 0.0);
        let scatter_m =
            most_m.map_or(UNKNOWN_SCATTER_M, |m| (SCATTER_FACTOR * m).max(LEAST_SCATTER_M));
        Self { outliers, unseen_s, scatter_m }
    }
}

/// The limits of one axis. That of the residual adapts: J0 + J1·|predicted| + J3·σ_a.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// J0, m/s².
    floor_m_s2: f64,
    /// J1, the fraction of the predicted acceleration that may be model error.
    share: f64,
    /// J3, in standard errors.
    errors: f64,
    /// Acceleration that a ball at rest withstands, m/s².
    pub breakaway_m_s2: f64,
    /// Deceleration of a rolling ball that nothing drives, m/s²: half of what a ball at
    /// rest withstands.
    pub rolls_out_m_s2: f64,
    /// Standard deviation of the healthy residual, m/s².
    pub residual_m_s2: f64,
    /// Standard deviation of healthy readings, m; `None` if the axis has no readings.
    pub noise_m: Option<f64>,
    /// Time for which readings of a ball that is asked to move, or moved, may be
    /// identical, s.
    pub repeat_s: f64,
    /// Time for which readings of a ball that may be at rest may be identical, s; `None`
    /// if unknown.
    pub rest_repeat_s: Option<f64>,
    /// Evidence of the path from which on the servo fails, nats; `None` if unknown.
    pub path_nats: Option<f64>,
}

/// Acceleration that counts as asking a ball to move on any rig, m/s²: one degree of
/// tilt.
const LEAST_PRESS_M_S2: f64 = 0.12;

/// Shortest duration of identical readings that count as frozen, s: longer than any
/// refresh seen (0.2 s).
pub(super) const LEAST_REPEAT_S: f64 = 0.3;
/// Shortest duration of identical readings that count as frozen if the ball may be at
/// rest, s. Chosen.
const LEAST_REST_REPEAT_S: f64 = 2.0;
/// Factor on the longest healthy repeat. Chosen.
const REPEAT_FACTOR: f64 = 2.0;
/// Factor on the longest healthy repeat if the ball may be at rest. Chosen.
const REST_REPEAT_FACTOR: f64 = 3.0;
/// Duration of identical readings that count as frozen if nothing is learnt, s: healthy
/// ones of 1.8 s have been seen.
const UNKNOWN_REPEAT_S: f64 = 3.0;
/// Duration of one rest, s, from which on the repeats of readings at rest are known, if
/// it is also longer than [`REST_SEEN_REPEATS`] of them: a sensor that holds its value at
/// rest repeats it for as long as the ball rests. Chosen.
const REST_SEEN_S: f64 = 3.0;
/// Least duration of one rest in longest repeats. A sensor with steps larger than its noise repeats a
/// reading for seconds or for ever, depending on where the ball rests. Chosen on 36 simulated rigs with
/// the properties of real ones: with 5, one such rig had 35 false alarms in 2 h, with 10 none, and 86
/// and 83 of 144 frozen readings were found; with 40, 75.
const REST_SEEN_REPEATS: f64 = 10.0;

/// Least limit of the residual, m/s². Chosen.
pub(super) const LEAST_FLOOR_M_S2: f64 = 0.15;
/// Fraction of the predicted acceleration that may be model error on a learnt rig.
/// Chosen.
const LEARNT_MODEL_SHARE: f64 = 0.2;
/// Fraction of the predicted acceleration that may be model error on a rig that is not
/// learnt: healthy gains from 0.5 on have been seen.
const UNKNOWN_MODEL_SHARE: f64 = 0.5;
/// Level assumed before anything is learnt, rad: 1.7° has been seen on a healthy rig.
const UNKNOWN_LEVEL_RAD: f64 = 0.03;
/// Breakaway assumed before anything is learnt, rad: balls that stand at 1° have been
/// seen on healthy rigs.
const UNKNOWN_BREAKAWAY_RAD: f64 = 0.0175;
/// Noise assumed before anything is learnt, m: that of a coarse camera.
const UNKNOWN_READING_NOISE_M: f64 = 2e-3;
/// Factor on the learnt breakaway: friction varies over a plate. Chosen.
const BREAKAWAY_FACTOR: f64 = 1.5;
/// Fraction of the learnt breakaway that is taken to brake a rolling ball. Chosen.
const ROLL_OUT_SHARE: f64 = 0.5;

/// Evidence of the path that healthy servos show now and then, nats. Chosen: sessions of half
/// a minute of simulated rigs whose misfit differs from session to session have 1 nat in the
/// median and 3 nats in the upper quartile.
const USUAL_PATH_NATS: f64 = 2.0;
/// Evidence of the path beyond the largest healthy one from which on a servo fails, nats: a
/// fault that is twenty times likelier than what the healthy rig has shown. Chosen
/// beforehand.
const PATH_MARGIN_NATS: f64 = 3.0;

impl Limits {
    /// Returns the limits of `profile` for an axis, learnt or not. A tilt of one radian
    /// accelerates the ball by `slope_m_s2`. An `absent` axis has no readings.
    #[must_use]
    pub fn new(
        profile: Profile,
        learnt: Option<&AxisCalibration>,
        absent: bool,
        slope_m_s2: f64,
    ) -> Self {
        // The limits before anything is learnt.
        let wide = Self {
            floor_m_s2: UNKNOWN_LEVEL_RAD * slope_m_s2 + LEAST_FLOOR_M_S2,
            share: UNKNOWN_MODEL_SHARE,
            errors: ERROR_FACTOR,
            breakaway_m_s2: UNKNOWN_BREAKAWAY_RAD * slope_m_s2,
            rolls_out_m_s2: 0.0,
            residual_m_s2: 0.0,
            noise_m: (!absent).then_some(UNKNOWN_READING_NOISE_M),
            repeat_s: UNKNOWN_REPEAT_S,
            rest_repeat_s: None,
            path_nats: None,
        };
        let known = learnt.map_or(wide, |l| Self {
            floor_m_s2: (HEALTHY_FACTOR * l.residual_m_s2).max(LEAST_FLOOR_M_S2),
            share: LEARNT_MODEL_SHARE,
            errors: ERROR_FACTOR,
            // The breakaway of a ball that never rested is not known.
            breakaway_m_s2: match l.rest_s > 0.0 {
                true => BREAKAWAY_FACTOR * l.breakaway_rad * slope_m_s2,
                false => wide.breakaway_m_s2,
            },
            rolls_out_m_s2: ROLL_OUT_SHARE * l.breakaway_rad * slope_m_s2,
            residual_m_s2: l.residual_m_s2,
            noise_m: Some(l.noise_m),
            repeat_s: (REPEAT_FACTOR * l.longest_repeat_s).max(LEAST_REPEAT_S),
            rest_repeat_s: (l.rest_s >= REST_SEEN_S.max(REST_SEEN_REPEATS * l.longest_repeat_s))
                .then(|| (REST_REPEAT_FACTOR * l.longest_repeat_s).max(LEAST_REST_REPEAT_S)),
            path_nats: l.most_path_nats.map(|most| most.max(USUAL_PATH_NATS) + PATH_MARGIN_NATS),
        });
        match profile {
            Profile::Default => known,
            Profile::Textbook => {
                Self { floor_m_s2: TEXTBOOK_LIMIT_M_S2, share: 0.0, errors: 0.0, ..known }
            }
        }
    }

    /// Returns the limits with those of the residual and of the path multiplied by `factor`.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            floor_m_s2: factor * self.floor_m_s2,
            share: factor * self.share,
            errors: factor * self.errors,
            path_nats: self.path_nats.map(|nats| factor * nats),
            ..*self
        }
    }

    /// Acceleration from which on a ball at rest counts as asked to move, m/s².
    #[must_use]
    pub const fn pressing_m_s2(&self) -> f64 {
        self.breakaway_m_s2.max(LEAST_PRESS_M_S2)
    }

    /// Returns the window, s, with which noise adds `share` of the floor to the limit,
    /// for readings `period_s` apart.
    #[must_use]
    pub fn window_s(&self, share: f64, period_s: f64) -> f64 {
        window_for(self.noise_m.unwrap_or(0.0), period_s, share * self.floor_m_s2 / self.errors)
    }

    /// Returns the limit of the residual, m/s², for a predicted acceleration and the
    /// standard error of the residual.
    #[must_use]
    pub fn at(&self, predicted_m_s2: f64, error_m_s2: f64) -> f64 {
        self.floor_m_s2 + self.share * predicted_m_s2.abs() + self.errors * error_m_s2
    }
}
