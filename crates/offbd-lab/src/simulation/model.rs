//! The true properties of one simulated rig, and its description by the owner.

use super::ball::Surface;
use super::controller::{ControllerModel, PidGains};
use super::sensor::SensorModel;
use super::servo::ServoTruth;
use offbd_core::engine::Rig;
use offbd_core::vocabulary::{Axis, Invalid, PerAxis, in_range, positive};

/// Standard deviations between the sessions of one rig; immutable.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SessionSpread {
    /// Standard deviation of the level of each axis, rad, 0 to 0.1. Observed on one real
    /// rig: 1.1° within a day.
    pub level_rad: f64,
    /// Standard deviation of the gain of each axis as a share of it, 0 to 0.3.
    pub gain: f64,
}

impl SessionSpread {
    fn check(&self) -> Result<(), Invalid> {
        in_range("/spread/level_rad", self.level_rad, 0.0..=0.1)?;
        in_range("/spread/gain", self.gain, 0.0..=0.3)?;
        Ok(())
    }
}

/// A rig to be simulated; immutable.
#[derive(Clone, Debug, PartialEq)]
pub struct RigModel {
    /// The description by the owner: the asset file.
    pub rig: Rig,
    pub servos: PerAxis<ServoTruth>,
    pub surface: Surface,
    pub sensor: SensorModel,
    pub controller: ControllerModel,
    /// Ball and beam: the ball stays on y = 0, and the log has neither commands nor
    /// positions along y.
    pub one_axis: bool,
    /// Variation between the sessions of this rig.
    pub spread: SessionSpread,
}

impl RigModel {
    /// Highest simulated log rate, rows per second: one row per step of the plant, 1 ms.
    pub const MAX_LOG_HZ: f64 = 1000.0;

    /// Replaces ball, plate, angle limit and sample rate by those of `rig`; keeps sensor,
    /// servos and surface.
    #[must_use]
    pub fn owned_as(mut self, rig: Rig) -> Self {
        self.controller.limit_rad = rig.servo.angle_limit_rad;
        self.rig = rig;
        self
    }

    /// The gains of the rig's controller.
    #[must_use]
    pub fn gains(&self) -> PidGains {
        self.controller.gains(&self.rig.ball, 1.0 / self.rig.sample_rate_hz)
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`Invalid`] naming the element.
    pub fn check(&self) -> Result<(), Invalid> {
        self.rig.check()?;
        positive("/sample_rate_hz", self.rig.sample_rate_hz, Self::MAX_LOG_HZ)?;
        self.surface.check()?;
        self.sensor.check()?;
        self.controller.check()?;
        self.spread.check()?;
        for axis in Axis::ALL {
            let servo = &self.servos[axis];
            in_range("/servo/dead_time_s", servo.dead_time_s, 0.0..=1.0)?;
            in_range("/servo/play_rad", servo.play_rad, 0.0..=0.5)?;
            in_range("/servo/gain", servo.gain, ServoTruth::GAIN)?;
            in_range("/servo/level_rad", servo.level_rad, ServoTruth::LEVEL_RAD)?;
        }
        Ok(())
    }
}
