//! A motion as a table of commands and set points with feedback gains, in the numbers of
//! a device.

use super::motion::DriveMotion;
use super::search::Search;
use super::{DriveCycle, Feedback};
use crate::engine::AxisMapping;
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, PerAxis, Sample};

/// Most rows per second; a faster device uses each row repeatedly. Chosen.
const MAX_ROWS_HZ: f64 = 100.0;
/// Bandwidth of the correction times the delay of the loop: as in the loops of the
/// simulated rigs.
const LOOP_SHARE: f64 = 0.25;
/// Largest bandwidth of the correction, rad/s: as in the loops of the simulated rigs.
const MOST_RAD_S: f64 = 3.0;
/// Delay of the loop in sample periods: one to respond, and half of one in which a
/// command is held.
const LOOP_PERIODS: f64 = 1.5;
/// Damping ratio of the correction. Chosen.
const LOOP_DAMPING: f64 = 0.9;
/// Integral gain in terms of the bandwidth. Chosen.
const INTEGRAL_SHARE: f64 = 0.25;
/// Shortest time constant of the derivative's filter, s. Chosen.
const FILTER_S: f64 = 0.05;
/// Shortest time constant of the derivative's filter in sample periods. Chosen.
const FILTER_PERIODS: f64 = 2.0;

impl Search {
    /// Returns `motion` as a table for a device with the given `mapping`.
    pub(super) fn cycle(&self, motion: &DriveMotion, mapping: &AxisMapping) -> DriveCycle {
        let rig = &self.setup.rig;
        let rate_hz = rig.sample_rate_hz.min(MAX_ROWS_HZ);
        let duration_s = motion.duration_s();
        let n = (duration_s * rate_hz).ceil() as u32;
        let row = |i: u32| self.row(motion, mapping, f64::from(i) / rate_hz);
        DriveCycle {
            duration_s,
            period_s: motion.period_s,
            repeats: motion.repeats,
            order: motion.order,
            amplitude_m: motion.amplitude_m,
            tilt_rad: PerAxis::from_fn(|axis| self.tilt_rad(motion, axis)),
            rate_hz,
            rows: (0..=n).map(row).collect(),
            feedback: self.feedback(mapping),
            filter_s: FILTER_S.max(FILTER_PERIODS / rig.sample_rate_hz),
            level_within_rad: PerAxis::default(),
            limit: rig.servo.angle_limit_rad / mapping.command_unit_rad,
            monitors: Vec::new(),
            faults: Vec::new(),
        }
    }

    fn row(&self, motion: &DriveMotion, mapping: &AxisMapping, t_s: f64) -> Sample {
        let command = |axis: Axis| {
            let learnt = self.learnt(axis)?;
            // Feedforward by the delay of the servo.
            let ahead_s = learnt.dead_time_s + learnt.lag_s;
            let wanted = motion.acceleration_m_s2(axis, t_s + ahead_s) / self.slope_m_s2(axis);
            Some((wanted - learnt.level_rad) / mapping.command_unit_rad)
        };
        let position = PerAxis::from_fn(|axis| {
            self.learnt(axis)?;
            let unit_m = mapping.position_unit_m * mapping.sign[axis];
            Some((motion.position_m(axis, t_s) + mapping.origin_m[axis]) / unit_m)
        });
        let (x_m, y_m) = match mapping.swap {
            true => (position.y, position.x),
            false => (position.x, position.y),
        };
        let (cmd_qx_rad, cmd_qy_rad) = (command(Axis::Y), command(Axis::X));
        Sample { seq: None, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m }
    }

    /// Pole placement for ẍ = slope·command, as fast as the delays allow.
    fn feedback(&self, mapping: &AxisMapping) -> PerAxis<Option<Feedback>> {
        let rig = &self.setup.rig;
        let refresh_s = rig.calibration.as_ref().map_or(0.0, |c| c.sensor.refresh_s);
        let late_s = |axis: Axis| self.learnt(axis).map_or(0.0, |l| l.dead_time_s + l.lag_s);
        let late_s = late_s(Axis::X).max(late_s(Axis::Y));
        let delay_s = late_s + refresh_s + LOOP_PERIODS / rig.sample_rate_hz;
        let w = (LOOP_SHARE / delay_s).min(MOST_RAD_S);
        PerAxis::from_fn(|axis| {
            self.learnt(axis)?;
            let metres = mapping.position_unit_m * mapping.sign[axis];
            let per_m = metres / self.slope_m_s2(axis) / mapping.command_unit_rad;
            Some(Feedback {
                reading: if mapping.swap { axis.other() } else { axis },
                proportional: w * w * per_m,
                integral: INTEGRAL_SHARE * w * w * w * per_m,
                derivative: 2.0 * LOOP_DAMPING * w * per_m,
            })
        })
    }
}
