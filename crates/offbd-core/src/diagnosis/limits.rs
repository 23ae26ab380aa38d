//! How far measured and predicted acceleration may differ.

use crate::maths::window_for;

use super::{AxisCalibration, Profile, SensorCalibration};

/// The chapter's fault limit, m/s² (application 3).
const TEXTBOOK_LIMIT_M_S2: f64 = 0.01;

/// Standard errors of the estimate that are always allowed. Coloured readings
/// make the white-noise error too small by about two.
const ERROR_FACTOR: f64 = 6.0;

/// Healthy residual deviations that are allowed once they are known.
const HEALTHY_FACTOR: f64 = 5.0;

/// Outliers of late that are too many: those of a healthy sensor, twice, and
/// some. Not learnt: of four in ten seconds no healthy sensor is known.
const FEW_OUTLIERS: f64 = 4.0;
const UNKNOWN_OUTLIERS: f64 = 4.0;
const OUTLIERS_FACTOR: f64 = 2.0;
/// Seconds without a ball for which no healthy tracker that is not learnt loses
/// it; one that is learnt may for longer than it ever did.
const UNSEEN_S: f64 = 0.3;
const UNSEEN_FACTOR: f64 = 1.5;
/// Times the most scatter that healthy readings have shown for a while.
const SCATTER_FACTOR: f64 = 1.25;
/// Scatter for which no sensor is blamed where that is not known, m: a tracker
/// good to a pixel.
const UNKNOWN_SCATTER_M: f64 = 1e-3;
/// Least scatter for which a sensor is blamed, m: the roughness of a plate.
const LEAST_SCATTER_M: f64 = 1e-4;

/// The limits of what the readings themselves show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorLimits {
    /// Outliers of late.
    pub outliers: f64,
    /// Time without a ball, s.
    pub unseen_s: f64,
    /// Scatter about the motion that is no noise, m.
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
    /// Deceleration of a ball that rolls out as far as it is known, m/s²: half of
    /// what holds it.
    pub rolls_out_m_s2: f64,
    /// Standard deviation of the healthy residual, m/s².
    pub residual_m_s2: f64,
    /// Standard deviation of healthy readings, m; none where the axis has no
    /// readings.
    pub noise_m: Option<f64>,
    /// Time for which readings of a ball that is asked to move, or moved, may be
    /// the same, s.
    pub repeat_s: f64,
    /// The same for a ball that may be at rest; none if that is not known.
    pub rest_repeat_s: Option<f64>,
    /// The most that the path bends from the twin's over two seconds, root mean square,
    /// m; none if that is not known.
    pub path_m: Option<f64>,
}

/// Acceleration that counts as asking a ball to move on any rig, m/s²: one
/// degree of tilt.
const LEAST_PRESS_M_S2: f64 = 0.12;

/// Shortest time for which identical readings are believed to be frozen, s:
/// longer than any refresh seen (0.2 s).
const LEAST_REPEAT_S: f64 = 0.3;
/// The same for a ball that may be at rest, s.
const LEAST_REST_REPEAT_S: f64 = 2.0;
/// Times the longest healthy repeat.
const REPEAT_FACTOR: f64 = 2.0;
const REST_REPEAT_FACTOR: f64 = 3.0;
/// The same where nothing is learnt, s: healthy ones of 1.8 s have been seen.
const UNKNOWN_REPEAT_S: f64 = 3.0;
/// Rest in one piece that must have been seen to know how its readings repeat, s,
/// and as a multiple of the longest repeat: a sensor that holds its value while
/// the ball rests repeats it for as long as that does.
const REST_SEEN_S: f64 = 3.0;
const REST_SEEN_REPEATS: f64 = 5.0;

/// Times the most that a healthy path is expected to bend from the twin's: of 700
/// faults put into servos of real rigs 184 were found with it, 171 with 1.4.
const PATH_FACTOR: f64 = 1.2;
/// What hands bend it by on a rig that bends it less by itself, m: 40 drawn rigs with two
/// pushes a minute had 27 false alarms of servos in 120 h with 4 mm, 23 with 5 mm, and
/// some 80 with 2 mm.
const LEAST_PATH_M: f64 = 5e-3;

impl Limits {
    /// The limits of `profile` for an axis, learnt or not, on a rig where a
    /// tilt of one radian would accelerate the ball by `slope_m_s2`.
    #[must_use]
    pub fn new(
        profile: Profile,
        learnt: Option<&AxisCalibration>,
        absent: bool,
        slope_m_s2: f64,
    ) -> Self {
        // Not learnt: a plate 1.7° off level and balls that stand at 1° have
        // been seen on healthy rigs, and 2 mm is a coarse camera.
        let wide = Self {
            floor_m_s2: 0.03 * slope_m_s2 + 0.15,
            share: 0.5,
            errors: ERROR_FACTOR,
            breakaway_m_s2: 0.0175 * slope_m_s2,
            rolls_out_m_s2: 0.0,
            residual_m_s2: 0.0,
            noise_m: (!absent).then_some(2e-3),
            repeat_s: UNKNOWN_REPEAT_S,
            rest_repeat_s: None,
            path_m: None,
        };
        let known = learnt.map_or(wide, |l| Self {
            floor_m_s2: (HEALTHY_FACTOR * l.residual_m_s2).max(0.15),
            share: 0.2,
            errors: ERROR_FACTOR,
            // Half again as much as learnt: friction varies over a plate. Of a ball
            // that never rested it is not known.
            breakaway_m_s2: match l.rest_s > 0.0 {
                true => 1.5 * l.breakaway_rad * slope_m_s2,
                false => wide.breakaway_m_s2,
            },
            rolls_out_m_s2: 0.5 * l.breakaway_rad * slope_m_s2,
            residual_m_s2: l.residual_m_s2,
            noise_m: Some(l.noise_m),
            repeat_s: (REPEAT_FACTOR * l.longest_repeat_s).max(LEAST_REPEAT_S),
            rest_repeat_s: (l.rest_s >= REST_SEEN_S.max(REST_SEEN_REPEATS * l.longest_repeat_s))
                .then(|| (REST_REPEAT_FACTOR * l.longest_repeat_s).max(LEAST_REST_REPEAT_S)),
            path_m: (l.most_path_error_m > 0.0)
                .then(|| (PATH_FACTOR * l.most_path_error_m).max(LEAST_PATH_M)),
        });
        match profile {
            Profile::Default => known,
            Profile::Textbook => {
                Self { floor_m_s2: TEXTBOOK_LIMIT_M_S2, share: 0.0, errors: 0.0, ..known }
            }
        }
    }

    /// Acceleration that asks a ball at rest to move, m/s².
    #[must_use]
    pub const fn pressing_m_s2(&self) -> f64 {
        self.breakaway_m_s2.max(LEAST_PRESS_M_S2)
    }

    /// The window, s, in which noise adds `share` of the floor to the limit,
    /// for readings `period_s` apart.
    #[must_use]
    pub fn window_s(&self, share: f64, period_s: f64) -> f64 {
        window_for(self.noise_m.unwrap_or(0.0), period_s, share * self.floor_m_s2 / self.errors)
    }

    /// The limit, m/s², for a predicted acceleration and the standard error of
    /// the residual.
    #[must_use]
    pub fn at(&self, predicted_m_s2: f64, error_m_s2: f64) -> f64 {
        self.floor_m_s2 + self.share * predicted_m_s2.abs() + self.errors * error_m_s2
    }
}
