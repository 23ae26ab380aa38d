//! The description of a rig, and the setup of an engine.

use crate::diagnosis::{Calibration, Profile, Settings};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::plant::{
    Ball, Contact, LONGEST_DEAD_TIME_S, Ladder, Plate, ServoModel, TwinAxis, TwinModel,
};
use crate::vocabulary::{Axis, Invalid, PerAxis, in_range, positive};
use serde::{Deserialize, Serialize};

/// How a device's numbers relate to the plate frame. Applied when a sample is judged; the
/// recording keeps the numbers as sent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisMapping {
    /// Whether the device's x is the plate's y and vice versa.
    pub swap: bool,
    /// Sign of the readings along each plate axis, +1 or −1.
    pub sign: PerAxis<f64>,
    /// Metres per unit of the readings.
    pub position_unit_m: f64,
    /// The reading at the middle of the plate, m in the plate frame, −10 to 10:
    /// subtracted from every reading.
    pub origin_m: PerAxis<f64>,
    /// Radians per unit of the commands.
    pub command_unit_rad: f64,
}

impl Default for AxisMapping {
    fn default() -> Self {
        let sign = PerAxis { x: 1.0, y: 1.0 };
        let origin_m = PerAxis::default();
        Self { swap: false, sign, position_unit_m: 1.0, origin_m, command_unit_rad: 1.0 }
    }
}

/// The parameters of the servos as known to the owner; the same for both.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ServoSpec {
    pub angle_limit_rad: f64,
    pub dead_time_s: f64,
    pub lag_s: f64,
    pub rate_limit_rad_s: f64,
}

impl Default for ServoSpec {
    /// ±0.2 rad as in the chapter. A dead time of 40 ms and a lag of 60 ms make
    /// 100 ms, near the lower end of the 80 to 300 ms seen on real rigs; 10 rad/s is a
    /// standard hobby servo (0.1 s per 60°).
    fn default() -> Self {
        Self { angle_limit_rad: 0.2, dead_time_s: 0.04, lag_s: 0.06, rate_limit_rad_s: 10.0 }
    }
}

/// The owner's requirements on the diagnosis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DiagnosticsSpec {
    pub profile: Profile,
    /// Wanted false alarms per rig and year, above zero.
    pub false_alarms_per_rig_year: Option<f64>,
    /// Time of failure before a test fails, s; for servos, ball and sensor.
    pub debounce_s: Option<f64>,
}

/// A rig as described by its asset file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rig {
    pub name: String,
    pub sample_rate_hz: f64,
    pub ball: Ball,
    pub plate: Plate,
    /// The contact of ball and plate; the lockstep twin uses its friction.
    pub contact: Contact,
    pub servo: ServoSpec,
    pub mapping: AxisMapping,
    pub diagnostics: DiagnosticsSpec,
    /// Boxed: it is most of a rig, and many rigs have none.
    pub calibration: Option<Box<Calibration>>,
    /// Which columns of the rig's files are which quantities, for the readers of files. No part of
    /// the state of an engine.
    #[serde(skip)]
    pub columns: Option<Box<str>>,
}

/// Distance between ball and edge at which contact may begin, m. Chosen.
const EDGE_MARGIN_M: f64 = 0.006;

/// Longest name of a rig, bytes.
pub const MAX_NAME: usize = 128;

impl Rig {
    /// Returns the chapter's rig with the given name.
    #[must_use]
    pub fn chapter(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            sample_rate_hz: 100.0,
            ball: Ball::default(),
            plate: Plate::default(),
            contact: Contact::default(),
            servo: ServoSpec::default(),
            mapping: AxisMapping::default(),
            diagnostics: DiagnosticsSpec::default(),
            calibration: None,
            columns: None,
        }
    }

    /// Checks what the constructors of the parts have not checked.
    ///
    /// # Errors
    /// [`Invalid`] naming the element.
    pub fn check(&self) -> Result<(), Invalid> {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        // Clients remove the path segments `.` and `..` from URLs.
        let is_path = self.name == "." || self.name == "..";
        if self.name.is_empty()
            || self.name.len() > MAX_NAME
            || !self.name.chars().all(plain)
            || is_path
        {
            let reason = format!(
                "must be 1 to {MAX_NAME} of the characters A-Z, a-z, 0-9, `-`, `_` and `.`, and not \
                 `.` or `..`"
            );
            return Err(Invalid::new("/name", reason));
        }
        positive("/sample_rate_hz", self.sample_rate_hz, 100_000.0)?;
        in_range("/servo/dead_time_s", self.servo.dead_time_s, 0.0..=LONGEST_DEAD_TIME_S)?;
        self.servo_model()?;
        positive("/axes/position_unit_m", self.mapping.position_unit_m, 1000.0)?;
        in_range("/axes/x_offset_m", self.mapping.origin_m.x, -10.0..=10.0)?;
        in_range("/axes/y_offset_m", self.mapping.origin_m.y, -10.0..=10.0)?;
        positive("/axes/command_unit_rad", self.mapping.command_unit_rad, 1000.0)?;
        self.settings(self.diagnostics.profile)?;
        Ok(())
    }

    /// Distance of the ball's centre from the edge within which the edge may act, m: a
    /// rim touches the side of the ball; without a rim the centre must leave the plate.
    pub(super) fn contact_room_m(&self) -> f64 {
        let side_m = if self.plate.rim() { self.ball.radius_m() } else { 0.0 };
        side_m + EDGE_MARGIN_M
    }

    fn servo_model(&self) -> Result<ServoModel, Invalid> {
        ServoModel::new(self.servo.angle_limit_rad, self.servo.lag_s, self.servo.rate_limit_rad_s)
    }

    /// Returns the models of this rig's ball with the accuracy of `profile`.
    pub(super) fn ladder(&self, profile: Profile) -> Ladder {
        let accuracy_m_s2 = Settings::of(profile).twin_accuracy_m_s2;
        Ladder::new(&self.ball, &self.plate, self.contact.friction(), accuracy_m_s2)
    }

    /// Returns the settings of `profile` with the owner's requirements.
    ///
    /// # Errors
    /// [`Invalid`] naming the element under `/diagnostics`.
    pub fn settings(&self, profile: Profile) -> Result<Settings, Invalid> {
        let settings = Settings::of(profile);
        if profile != Profile::Default {
            return Ok(settings);
        }
        let DiagnosticsSpec { false_alarms_per_rig_year, debounce_s, .. } = self.diagnostics;
        let settings = match false_alarms_per_rig_year {
            Some(per_year) => settings.with_false_alarms(per_year)?,
            None => settings,
        };
        debounce_s.map_or(Ok(settings), |debounce_s| settings.with_debounce(debounce_s))
    }
}

/// Everything that an engine needs to judge one rig; immutable.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Setup {
    pub rig: Rig,
    pub settings: Settings,
    pub twin: TwinModel,
}

impl Setup {
    /// Builds the setup of `rig` with `profile`, or with the owner's if `None`.
    ///
    /// # Errors
    /// [`Invalid`] naming the first invalid element of the rig.
    pub fn new(rig: Rig, profile: Option<Profile>) -> Result<Self, Invalid> {
        rig.check()?;
        let settings = rig.settings(profile.unwrap_or(rig.diagnostics.profile))?;
        let nominal = TwinAxis::new(rig.servo_model()?, rig.servo.dead_time_s);
        let mut twin = TwinModel::new(rig.ladder(settings.profile), nominal);
        for axis in Axis::ALL {
            let learnt = rig.calibration.as_ref().and_then(|c| c.axes[axis]);
            if let Some(learnt) = learnt {
                let (limit, rate) = (rig.servo.angle_limit_rad, rig.servo.rate_limit_rad_s);
                let servo = ServoModel::new(limit, learnt.lag_s, rate)?;
                twin.axes[axis] = TwinAxis {
                    gain: learnt.gain,
                    level_rad: learnt.level_rad,
                    resistance_m_s2: learnt.resistance_m_s2,
                    ..TwinAxis::new(servo, learnt.dead_time_s)
                };
            }
        }
        Ok(Self { rig, settings, twin })
    }
}
