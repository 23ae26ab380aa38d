//! One row of telemetry.

use super::Axis;
use serde::{Deserialize, Serialize};

/// What a device reports at one moment: the commanded plate angles in force and the
/// measured position of the ball.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Sample {
    /// Sequence number within the session, if the device counts.
    pub seq: Option<u64>,
    /// Seconds on the device's clock at which the sample was valid.
    pub t_s: f64,
    /// Commanded plate angle about x, radians; `None` if the axis has no servo.
    pub cmd_qx_rad: Option<f64>,
    /// Commanded plate angle about y, radians; `None` if the axis has no servo.
    pub cmd_qy_rad: Option<f64>,
    /// Measured x, metres; `None` if no ball was seen.
    pub x_m: Option<f64>,
    /// Measured y, metres; `None` if no ball was seen.
    pub y_m: Option<f64>,
}

impl Sample {
    /// Returns the command of the servo that drives `axis`: qy for x, qx for y.
    #[must_use]
    pub const fn command(&self, axis: Axis) -> Option<f64> {
        match axis {
            Axis::X => self.cmd_qy_rad,
            Axis::Y => self.cmd_qx_rad,
        }
    }

    /// Returns the measured position along `axis`.
    #[must_use]
    pub const fn position(&self, axis: Axis) -> Option<f64> {
        match axis {
            Axis::X => self.x_m,
            Axis::Y => self.y_m,
        }
    }
}
