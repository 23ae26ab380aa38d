//! Preset rigs, each typical of a kind that people build. Their numbers lie in the
//! ranges observed on real rigs: off level by 0.2–1.7°, a lag of 80–300 ms from command
//! to acceleration, stiction up to 0.5–1° of command.

use std::fmt;
use std::str::FromStr;

use super::ball::Surface;
use super::controller::ControllerModel;
use super::model::{RigModel, SessionSpread};
use super::refresh::Refresh;
use super::sensor::SensorModel;
use super::servo::ServoTruth;
use offbd_core::engine::{Rig, ServoSpec};
use offbd_core::plant::{Ball, Plate, PlateShape};
use offbd_core::vocabulary::{Invalid, PerAxis, UnknownWord};

/// A named rig.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// The chapter's plate and steel ball, a camera at 100 Hz, 0.1 mm.
    #[default]
    Chapter,
    /// A square plate, a ping-pong ball, a camera at 30 Hz, 1 mm pixels,
    /// commands in steps of half a degree.
    Pingpong,
    /// A seven-inch touch panel logged at 120 Hz, refreshed at 60 Hz.
    Touch,
}

impl Preset {
    pub const ALL: [Self; 3] = [Self::Chapter, Self::Pingpong, Self::Touch];

    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Chapter => "chapter",
            Self::Pingpong => "pingpong",
            Self::Touch => "touch",
        }
    }

    /// Returns the rig of this name.
    ///
    /// # Errors
    /// [`Invalid`] if its numbers are out of range; those of the presets are not.
    pub fn model(self) -> Result<RigModel, Invalid> {
        match self {
            Self::Chapter => Ok(chapter()),
            Self::Pingpong => pingpong(),
            Self::Touch => touch(),
        }
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl FromStr for Preset {
    type Err = UnknownWord;
    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        Self::ALL.into_iter().find(|p| p.as_str() == word).ok_or_else(|| UnknownWord {
            word: word.to_owned(),
            expected: "chapter, pingpong, touch".to_owned(),
        })
    }
}

/// The origin of the readings at the plate's centre.
const CENTRED: PerAxis<f64> = PerAxis { x: 0.0, y: 0.0 };

/// Returns a critically damped controller. The presets' bandwidths make the loop slower
/// than sensor and servo by a factor of three or more, and filter the derivative over a
/// few readings.
fn controller(limit_rad: f64, bandwidth_rad_s: f64, derivative_filter_s: f64) -> ControllerModel {
    ControllerModel {
        bandwidth_rad_s,
        damping: 1.0,
        integral: 0.12,
        derivative_filter_s,
        limit_rad,
        feedforward: 0.0,
        turn_per_period_rad: ControllerModel::UNTUNED_RAD,
        resolution_rad: 0.0,
    }
}

fn chapter() -> RigModel {
    let servo = ServoTruth {
        dead_time_s: 0.03,
        lag_s: 0.05,
        rate_limit_rad_s: 8.0,
        gain: 1.0,
        level_rad: 0.008,
        play_rad: 0.001,
    };
    let rig = Rig::chapter("chapter");
    RigModel {
        controller: controller(rig.servo.angle_limit_rad, 3.0, 0.05),
        rig,
        servos: PerAxis { x: servo, y: ServoTruth { gain: 0.96, level_rad: -0.005, ..servo } },
        surface: Surface { breakaway_rad: 0.004, rolling_rad: 0.001, restitution: 0.5 },
        one_axis: false,
        spread: SessionSpread::default(),
        sensor: SensorModel {
            refresh: Refresh::Rows(1),
            latency_s: 0.005,
            noise_m: 2e-4,
            quantum_m: 1e-4,
            dead_band_m: 0.0,
            origin_m: CENTRED,
            missing: 0.001,
            outliers: 2e-4,
            jitter: 0.03,
        },
    }
}

fn pingpong() -> Result<RigModel, Invalid> {
    let servo = ServoTruth {
        dead_time_s: 0.06,
        lag_s: 0.08,
        rate_limit_rad_s: 5.0,
        gain: 0.9,
        level_rad: -0.012,
        play_rad: 0.003,
    };
    let shape = PlateShape::Rectangle { length_m: 0.3, width_m: 0.3 };
    let rig = Rig {
        sample_rate_hz: 30.0,
        ball: Ball::new(0.02, 0.0027, 2.0 / 3.0)?,
        plate: Plate::new(shape, 0.02, true)?,
        ..Rig::chapter("pingpong")
    };
    let continuous = controller(rig.servo.angle_limit_rad, 1.8, 0.1);
    Ok(RigModel {
        // Half a degree: the resolution of a servo library with steps of a microsecond.
        controller: ControllerModel { resolution_rad: 0.5_f64.to_radians(), ..continuous },
        rig,
        servos: PerAxis { x: servo, y: ServoTruth { level_rad: 0.02, ..servo } },
        surface: Surface { breakaway_rad: 0.006, rolling_rad: 0.002, restitution: 0.6 },
        one_axis: false,
        spread: SessionSpread::default(),
        sensor: SensorModel {
            refresh: Refresh::Rows(1),
            latency_s: 0.02,
            noise_m: 4e-4,
            quantum_m: 1e-3,
            dead_band_m: 0.0,
            origin_m: CENTRED,
            missing: 0.005,
            outliers: 1e-3,
            jitter: 0.1,
        },
    })
}

fn touch() -> Result<RigModel, Invalid> {
    let servo = ServoTruth {
        dead_time_s: 0.04,
        lag_s: 0.05,
        rate_limit_rad_s: 6.0,
        gain: 1.05,
        level_rad: 0.0077,
        play_rad: 0.002,
    };
    let shape = PlateShape::Rectangle { length_m: 0.158, width_m: 0.095 };
    let rig = Rig {
        sample_rate_hz: 120.0,
        ball: Ball::new(0.0127, 0.067, 0.4)?,
        plate: Plate::new(shape, 0.006, true)?,
        servo: ServoSpec { angle_limit_rad: 0.109, ..ServoSpec::default() },
        ..Rig::chapter("touch")
    };
    Ok(RigModel {
        controller: controller(rig.servo.angle_limit_rad, 2.5, 0.06),
        rig,
        servos: PerAxis { x: servo, y: ServoTruth { level_rad: -0.0042, ..servo } },
        surface: Surface { breakaway_rad: 0.007, rolling_rad: 0.002, restitution: 0.4 },
        one_axis: false,
        spread: SessionSpread::default(),
        sensor: SensorModel {
            refresh: Refresh::Hz(60.0),
            latency_s: 0.004,
            noise_m: 3e-5,
            quantum_m: 3e-5,
            dead_band_m: 0.0,
            origin_m: CENTRED,
            missing: 5e-4,
            outliers: 2e-4,
            jitter: 0.05,
        },
    })
}
