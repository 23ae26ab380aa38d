//! One row of telemetry.

use super::Axis;

/// What a device says at one moment: the commanded plate angles in force and
/// the ball's measured position in the plate frame.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Sample {
    /// The device's running number within the session, if it counts.
    pub seq: Option<u64>,
    /// Seconds on the device's clock (its *valid-at* time).
    pub t_s: f64,
    /// Commanded plate angle about x, radians; none: the axis has no servo.
    pub cmd_qx_rad: Option<f64>,
    /// Commanded plate angle about y, radians; none: the axis has no servo.
    pub cmd_qy_rad: Option<f64>,
    /// Measured x, metres; none: no ball seen.
    pub x_m: Option<f64>,
    /// Measured y, metres; none: no ball seen.
    pub y_m: Option<f64>,
}

impl Sample {
    /// The command of the servo that drives `axis`: qy for x, qx for y.
    #[must_use]
    pub const fn command(&self, axis: Axis) -> Option<f64> {
        match axis {
            Axis::X => self.cmd_qy_rad,
            Axis::Y => self.cmd_qx_rad,
        }
    }

    /// The measured position along `axis`.
    #[must_use]
    pub const fn position(&self, axis: Axis) -> Option<f64> {
        match axis {
            Axis::X => self.x_m,
            Axis::Y => self.y_m,
        }
    }
}
