//! What was learnt of one rig from healthy sessions.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{FaultCode, PerAxis};

/// One axis as learnt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisCalibration {
    /// Measured over modelled acceleration, dimensionless.
    pub gain: f64,
    /// From a command to the servo's first movement, s.
    pub dead_time_s: f64,
    /// First-order lag of the servo, s.
    pub lag_s: f64,
    /// Plate and horn off level, rad: the mean over sessions.
    pub level_rad: f64,
    /// Standard deviation of the level from session to session, rad.
    pub level_spread_rad: f64,
    /// Standard deviation of the gain from session to session, as a share of it.
    pub gain_spread: f64,
    /// Deceleration of a rolling ball, m/s².
    pub resistance_m_s2: f64,
    /// Standard deviation of the readings about the fitted motion, m.
    pub noise_m: f64,
    /// Tilt below which a ball at rest stays at rest, rad.
    pub breakaway_rad: f64,
    /// Longest time for which healthy readings were the same to the bit, s.
    pub longest_repeat_s: f64,
    /// Longest time for which the ball was seen at rest, s.
    pub rest_s: f64,
    /// Robust standard deviation of the acceleration residual, m/s².
    pub residual_m_s2: f64,
    /// Acceleration that the twin leaves out, over half a second, m/s².
    pub model_error_m_s2: f64,
    /// Most evidence against the servo while it was healthy, nats.
    pub most_nats: f64,
    /// The most that the path is expected to bend from the twin's over two seconds while
    /// the servo is healthy, root mean square, m: what tests have shown, and more where
    /// they were few. Zero where that is not known.
    pub most_path_error_m: f64,
    /// Acceleration that nineteen of twenty moments of the recording stayed below,
    /// m/s²: beyond it, gain and delay are not known as well. Infinite where it
    /// was not learnt.
    pub familiar_m_s2: f64,
}

impl AxisCalibration {
    /// Standard deviation of the level from session to session over rigs, rad: 1.1°
    /// within a day on one real rig, 0.9° between days on another.
    pub const POPULATION_LEVEL_SPREAD_RAD: f64 = 0.02;
    /// Standard deviation of the gain from session to session over rigs, as a
    /// share. Assumed: no rig with enough sessions under a known gain is at hand.
    pub const POPULATION_GAIN_SPREAD: f64 = 0.07;
    /// What the twin leaves out on a rig of which only `residual_m_s2` is known,
    /// m/s²: between the best simulated rigs and the worst.
    #[must_use]
    pub const fn assumed_model_error_m_s2(residual_m_s2: f64) -> f64 {
        residual_m_s2.clamp(0.015, 0.04)
    }
}

/// What one session says of one axis by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SessionEstimate {
    /// Plate and horn off level, rad, and its standard error.
    pub level_rad: f64,
    pub level_error_rad: f64,
    /// Gain and its standard error; none where the ball did not move.
    pub gain: Option<(f64, f64)>,
}

/// What was learnt of the sensor, both axes of which are one look at the ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorCalibration {
    /// Time between two readings of a sensor that is logged faster than it reads,
    /// s; zero for one that is not.
    pub refresh_s: f64,
    /// Most outliers within some seconds; as counted by [`super::Stillness`].
    pub most_outliers: f64,
    /// Most scatter about the motion that lasted, m; zero where none stood out.
    pub most_scatter_m: f64,
    /// Longest time for which no ball was seen on the plate, s.
    pub longest_unseen_s: f64,
}

/// How soon a fault of one axis' servo would be confirmed, and how small it may
/// be; none where fewer than half of the trials found it within 10 s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ServoProspects {
    /// Median delay of a servo that does not answer, s.
    pub dead_s: Option<f64>,
    /// Median delay of one that answers half, s.
    pub half_gain_s: Option<f64>,
    /// Median delay of one whose horn has slipped by 1°, s.
    pub offset_1deg_s: Option<f64>,
    /// Smallest share of the gain, of those tried, whose loss is found.
    pub least_gain_loss: Option<f64>,
    /// Smallest slip of the horn, of those tried, that is found, rad.
    pub least_offset_rad: Option<f64>,
}

/// How soon a fault would be confirmed on this rig, had it come during the
/// healthy recording; as for [`ServoProspects`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prospects {
    /// Moments at which each fault was put in.
    pub n_trials: usize,
    /// Per axis; none where nothing was learnt.
    pub servos: PerAxis<Option<ServoProspects>>,
    /// Median delay of a ball that sticks, s.
    pub stuck_s: Option<f64>,
    /// Median delay of readings that freeze, s.
    pub frozen_s: Option<f64>,
    /// Median delay of a ball that is not seen, s.
    pub unseen_s: Option<f64>,
}

/// What the tests of a calibration showed of one monitor on healthy recordings
/// that it had not learnt from, and what follows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MonitorCertificate {
    /// Seconds that it could judge.
    pub judged_s: f64,
    /// The nearest it came to an alarm, as a share of what confirms a fault, 0 to
    /// 1.
    pub nearest: f64,
    /// False alarms to expect per hour of operation; none where it judged nothing.
    pub alarms_per_hour: Option<f64>,
}

/// A calibration: what was learnt per axis, from which data, when.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Per axis; none where the rig has no such servo or no such reading.
    pub axes: PerAxis<Option<AxisCalibration>>,
    pub sensor: SensorCalibration,
    /// What each session says by itself, in the order in which they were given.
    pub sessions: Vec<PerAxis<Option<SessionEstimate>>>,
    /// SHA-256 of the data that it was learnt from, lower-case hexadecimal.
    pub data_sha256: String,
    /// Samples it was learnt from.
    pub n_samples: u64,
    /// Seconds of motion it was learnt from.
    pub duration_s: f64,
    /// When it was made, RFC 3339; told by the caller.
    pub made_at: String,
    /// What its tests showed of each monitor, in the order of
    /// [`FaultCode::ALL`](crate::vocabulary::FaultCode::ALL); none where it was not
    /// tested.
    pub certificate: Option<[MonitorCertificate; FaultCode::COUNT]>,
    /// What can be found by it, how soon; none where that was not tried.
    pub prospects: Option<Prospects>,
}
