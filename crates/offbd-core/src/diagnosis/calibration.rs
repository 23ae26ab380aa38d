//! The parameters learnt of a rig from healthy sessions.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, FaultCode, PerAxis};
use core::fmt;
use serde::{Deserialize, Serialize};

/// Acceleration that the twin does not explain on the best and on the worst simulated
/// rigs, m/s².
const LEAST_MODEL_ERROR_M_S2: f64 = 0.015;
pub(super) const MOST_MODEL_ERROR_M_S2: f64 = 0.04;

/// The learnt parameters of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisCalibration {
    /// Measured over modelled acceleration, dimensionless.
    pub gain: f64,
    /// Time from a command to the servo's first movement, s.
    pub dead_time_s: f64,
    /// First-order lag of the servo, s.
    pub lag_s: f64,
    /// Angle by which plate or servo horn is off level, rad: the mean over sessions.
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
    /// Longest time for which healthy readings were bit-identical, s.
    pub longest_repeat_s: f64,
    /// Longest time for which the ball was seen at rest, s.
    pub rest_s: f64,
    /// Robust standard deviation of the acceleration residual, m/s².
    pub residual_m_s2: f64,
    /// Acceleration that the twin does not explain, over half a second, m/s².
    pub model_error_m_s2: f64,
    /// Largest evidence against the servo while it was healthy, nats.
    pub most_nats: f64,
    /// Largest evidence of the path against the servo while it was healthy, nats; `None` if
    /// unknown.
    pub most_path_nats: Option<f64>,
    /// The 95 % quantile of the accelerations in the recording, m/s²: beyond it gain and
    /// delay are less well known. Infinite if not learnt.
    pub familiar_m_s2: f64,
}

impl AxisCalibration {
    /// Standard deviation of the level from session to session over a population of rigs,
    /// rad: 1.1° within a day on one real rig, 0.9° between days on another.
    pub const POPULATION_LEVEL_SPREAD_RAD: f64 = 0.02;
    /// Standard deviation of the gain from session to session over a population of rigs,
    /// as a fraction. Assumed: no rig with enough sessions under a known gain is
    /// available.
    pub const POPULATION_GAIN_SPREAD: f64 = 0.07;
    /// The acceleration that the twin does not explain, m/s², assumed for a rig of which
    /// only `residual_m_s2` is known: from that of the best simulated rigs to that of the
    /// worst.
    #[must_use]
    pub const fn assumed_model_error_m_s2(residual_m_s2: f64) -> f64 {
        residual_m_s2.clamp(LEAST_MODEL_ERROR_M_S2, MOST_MODEL_ERROR_M_S2)
    }
}

/// The estimates of one session for one axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SessionEstimate {
    /// Angle by which plate or servo horn is off level, rad.
    pub level_rad: f64,
    pub level_error_rad: f64,
    /// Gain and its standard error; `None` if the ball did not move.
    pub gain: Option<(f64, f64)>,
}

/// The learnt properties of the sensor, which reads both axes at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SensorCalibration {
    /// Time between two readings of a sensor that is slower than its log, s; zero for one
    /// that is not.
    pub refresh_s: f64,
    /// Largest count of recent outliers, as counted by [`super::Stillness`].
    pub most_outliers: f64,
    /// Largest scatter about the motion that persisted, m; zero if none stood out.
    pub most_scatter_m: f64,
    /// Longest time for which no ball was seen on the plate, s.
    pub longest_unseen_s: f64,
}

/// How soon a fault of one servo would be confirmed, and how small a fault is found;
/// `None` if fewer than half of the trials found it within 10 s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ServoProspects {
    /// Median delay for a servo that does not answer, s.
    pub dead_s: Option<f64>,
    /// Median delay for a servo that answers half, s.
    pub half_gain_s: Option<f64>,
    /// Median delay for a servo whose horn has slipped by 1°, s.
    pub offset_1deg_s: Option<f64>,
    /// Smallest tried loss of gain that is found, as a fraction.
    pub least_gain_loss: Option<f64>,
    /// Smallest tried slip of the horn that is found, rad.
    pub least_offset_rad: Option<f64>,
}

/// How soon each fault would be confirmed on this rig if it occurred during the healthy
/// recording; `None` as in [`ServoProspects`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Prospects {
    /// Number of times at which each fault was injected.
    pub n_trials: usize,
    /// Per axis; `None` if the axis was not learnt.
    pub servos: PerAxis<Option<ServoProspects>>,
    /// Median delay for a ball that sticks, s.
    pub stuck_s: Option<f64>,
    /// Median delay for readings that freeze, s.
    pub frozen_s: Option<f64>,
    /// Median delay for a ball that is not seen, s.
    pub unseen_s: Option<f64>,
}

impl Prospects {
    /// Whether no fault of a servo that was tried would be found.
    #[must_use]
    pub fn are_blind(&self) -> bool {
        let finds = |servo: &ServoProspects| {
            servo.dead_s.or(servo.half_gain_s).or(servo.offset_1deg_s).is_some()
        };
        !Axis::ALL.into_iter().filter_map(|axis| self.servos[axis].as_ref()).any(finds)
    }
}

/// Test result of one monitor on healthy recordings that were not used to learn, and the
/// expected false alarms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MonitorCertificate {
    /// Time for which the monitor could judge, s.
    pub judged_s: f64,
    /// Closest approach to an alarm, as a fraction of what confirms a fault, 0 to 1.
    pub nearest: f64,
    /// Expected false alarms per hour of operation: the mean over rigs like this one; `None` if
    /// the monitor could not judge.
    pub alarms_per_hour: Option<f64>,
    /// False alarms per hour that nine of ten such rigs stay below; `None` if unknown.
    pub most_alarms_per_hour: Option<f64>,
}

/// What a calibration comes from, as its maker states it. Not interpreted here: it is
/// carried along so that a verdict can name the calibration that it rests on.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CalibrationOrigin {
    /// SHA-256 of the data, lower-case hexadecimal; empty if not stated.
    pub data_sha256: String,
    /// Time of creation, RFC 3339; empty if not stated.
    pub made_at: String,
}

/// Why a moment contradicts the rest of the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Contradiction {
    /// The readings jumped farther than a ball can move.
    Jumped,
    /// The readings repeated the last one, or were missing, and then jumped.
    Held,
    /// The ball stood where the plate would have moved it.
    Stood,
}

/// A moment of the data that contradicts the rest and was not learnt from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Number of the session among those given, from 1 on.
    pub session: usize,
    /// Start of the moment on the session's clock, s.
    pub from_s: f64,
    /// End of the moment on the session's clock, s.
    pub to_s: f64,
    pub reason: Contradiction,
}

impl LeftOut {
    /// Whether the moment includes the time `t_s`.
    #[must_use]
    pub fn contains(&self, t_s: f64) -> bool {
        (self.from_s..=self.to_s).contains(&t_s)
    }
}

impl fmt::Display for Contradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Jumped => "readings jumped",
            Self::Held => "readings were held or missing, then jumped",
            Self::Stood => "the ball stood on a tilted plate, as if something held it",
        })
    }
}

/// A calibration: the parameters learnt per axis, and the data they come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Per axis; `None` if the rig has no such servo or no such readings.
    pub axes: PerAxis<Option<AxisCalibration>>,
    pub sensor: SensorCalibration,
    /// The estimates of each session, in the order in which the sessions were given.
    pub sessions: Vec<PerAxis<Option<SessionEstimate>>>,
    pub origin: CalibrationOrigin,
    /// Number of samples in the data.
    pub n_samples: u64,
    /// Duration of the data, s.
    pub duration_s: f64,
    /// The test results of the monitors, in the order of
    /// [`FaultCode::ALL`](crate::vocabulary::FaultCode::ALL); `None` if not tested.
    pub certificate: Option<[MonitorCertificate; FaultCode::COUNT]>,
    /// Which faults would be found and how soon; `None` if not tried.
    pub prospects: Option<Prospects>,
    /// The moments that were not learnt from, in order.
    pub left_out: Vec<LeftOut>,
}
