//! What was learnt of one rig from healthy sessions.

use crate::vocabulary::PerAxis;

/// One axis as learnt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisCalibration {
    /// Measured over modelled acceleration, dimensionless.
    pub gain: f64,
    /// From a command to the servo's first movement, s.
    pub dead_time_s: f64,
    /// First-order lag of the servo, s.
    pub lag_s: f64,
    /// Plate and horn off level, rad.
    pub level_rad: f64,
    /// Deceleration of a rolling ball, m/s².
    pub resistance_m_s2: f64,
    /// Standard deviation of the readings about the fitted motion, m.
    pub noise_m: f64,
    /// Tilt below which a ball at rest stays at rest, rad.
    pub breakaway_rad: f64,
    /// Robust standard deviation of the acceleration residual, m/s².
    pub residual_m_s2: f64,
}

/// A calibration: what was learnt per axis, from which data, when.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Per axis; none where the rig has no such servo or no such reading.
    pub axes: PerAxis<Option<AxisCalibration>>,
    /// SHA-256 of the data that it was learnt from, lower-case hexadecimal.
    pub data_sha256: String,
    /// Samples it was learnt from.
    pub n_samples: u64,
    /// Seconds of motion it was learnt from.
    pub duration_s: f64,
    /// When it was made, RFC 3339; told by the caller.
    pub made_at: String,
}
