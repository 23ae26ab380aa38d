//! The drive cycle of a rig: the shortest motion in which every monitor has a result and
//! every detectable fault is found.
//!
//! Vehicles have drive cycles for readiness. Here the motion is chosen from a small
//! family ([`motion`]) by simulating its members on the learnt rig ([`trial`]), the
//! shortest first. On the healthy rig, in sessions that differ as much as was learnt, no
//! test may fail and the ball may not reach the edge. Then each fault is present from the
//! start ([`fault`]). The member in which most monitors pass and most faults are found is
//! taken, the shortest of equally good ones. What no member achieves is reported. The
//! search is deterministic and bounded.

mod fault;
mod law;
mod motion;
mod noise;
mod search;
mod table;
mod trial;

#[cfg(not(feature = "std"))]
use crate::no_std::*;
pub use fault::TriedFault;
pub use law::DriveLaw;
pub use motion::Order;

use search::{Best, Search};

use super::Rig;
use crate::vocabulary::{Axis, FaultCode, Invalid, PerAxis, Sample};

/// The gains of the correction of one command, in the numbers of the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// Which of the device's readings is used: the axes may be swapped.
    pub reading: Axis,
    /// Command per distance from the set point (set point − reading); signed.
    pub proportional: f64,
    /// Command per integral of that distance over time, 1/s; signed.
    pub integral: f64,
    /// Command per rate of change of that distance, s; signed.
    pub derivative: f64,
}

/// Why a monitor has no result on the healthy rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotReached {
    /// The rig has no such servo, or no readings along its axis.
    NoSuchAxis,
    /// No motion within the plate and the servos' limits lets it judge for long
    /// enough.
    TooLittleMotion,
}

/// When the monitor of a code passes on the healthy rig, s after the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonitorVerdict {
    pub code: FaultCode,
    pub passed: Result<f64, NotReached>,
}

/// Whether and when a fault that is present from the start is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultVerdict {
    pub fault: TriedFault,
    /// Time of confirmation in the slowest trial, s after the start; `None` unless every
    /// trial confirmed it.
    pub after_s: Option<f64>,
    /// A rival cause that is named as well; not both servos at once, as no motion of the plate
    /// tells these from a ball that stands.
    pub beside: Option<FaultCode>,
}

/// A drive cycle in the numbers of the device: its axes, signs and units.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveCycle {
    pub duration_s: f64,
    /// Duration of one motion to both sides and back, s.
    pub period_s: f64,
    /// Number of such motions along each axis.
    pub repeats: u32,
    pub order: Order,
    /// Largest distance of the set points from the plate's middle, m, per plate axis;
    /// zero along an axis that the rig lacks.
    pub amplitude_m: PerAxis<f64>,
    /// Largest feedforward tilt, rad, per plate axis.
    pub tilt_rad: PerAxis<f64>,
    /// Largest difference of a session's level from the learnt one that was tried, rad,
    /// per plate axis.
    pub level_within_rad: PerAxis<f64>,
    /// Rows per second.
    pub rate_hz: f64,
    /// Commands and set points over time, evenly spaced from zero to the end.
    pub rows: Vec<Sample>,
    /// The gains of each correction; `None` for an axis without a servo.
    pub feedback: PerAxis<Option<Feedback>>,
    /// Time constant of the filter of the derivative part, s.
    pub filter_s: f64,
    /// Largest command in either direction.
    pub limit: f64,
    /// One per code, in the order of [`FaultCode::ALL`].
    pub monitors: Vec<MonitorVerdict>,
    /// The faults, the hardest to find first.
    pub faults: Vec<FaultVerdict>,
}

/// Why there is no drive cycle for a rig.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoDriveCycle {
    #[error(transparent)]
    Invalid(#[from] Invalid),
    #[error(
        "/calibration: the rig is not calibrated, so neither its servos nor its ball can be tested; \
         calibrate it on a minute or two in which the ball rolls, then ask again"
    )]
    NotLearnt,
    #[error(
        "/plate: the ball has {:.1} mm to roll along {axis}, less than the motion needs",
        1e3 * room_m, axis = axis.as_str()
    )]
    NoRoom { axis: Axis, room_m: f64 },
    #[error(
        "/servo/angle_limit_rad: no motion within this limit and the plate tilts enough to overcome \
         the friction of the ball"
    )]
    TooLittleTilt,
    #[error(
        "no motion within the limits of plate and servos keeps a healthy ball clear of the edge \
         without a failed test"
    )]
    NotSafe,
}

impl DriveCycle {
    /// The commands before the first reading.
    fn first_commands(&self) -> PerAxis<Option<f64>> {
        let first = self.rows.first();
        PerAxis::from_fn(|axis| first.and_then(|row| row.command(axis)))
    }

    /// The axes that the rig has.
    fn axes(&self) -> PerAxis<bool> {
        PerAxis::from_fn(|axis| self.feedback[axis].is_some())
    }
}

/// Returns the drive cycle of `rig`.
///
/// # Errors
/// [`NoDriveCycle`], which says what to change.
pub fn drive_cycle(rig: &Rig) -> Result<DriveCycle, NoDriveCycle> {
    let search = Search::new(rig)?;
    let family = search.family()?;
    let Best { motion, spread, found } = search.best(&family).ok_or(NoDriveCycle::NotSafe)?;
    let mut cycle = search.cycle(&motion, &rig.mapping);
    cycle.level_within_rad = PerAxis::from_fn(|axis| {
        search.learnt(axis).map_or(0.0, |learnt| spread * learnt.level_spread_rad)
    });
    (cycle.monitors, cycle.faults) = (found.monitors, found.faults);
    Ok(cycle)
}

#[cfg(test)]
mod tests;
