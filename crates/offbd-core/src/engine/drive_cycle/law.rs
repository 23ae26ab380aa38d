//! The control law that runs a drive cycle.
//!
//! Commands alone would let the ball run off: a plate half a degree off level moves it a
//! quarter of a metre in three seconds. So each command is the feedforward of the cycle
//! plus a PID correction of the ball's distance from its set point; the integral finds
//! the session's level. Reads no clock.

use super::{DriveCycle, Feedback};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{PerAxis, Sample};

/// Time for which a correction is held while no ball is seen, s: a single missing reading
/// must not make the plate twitch. Chosen.
const BLIND_S: f64 = 0.3;
/// Limit of the integral part as a fraction of the command's limit. Chosen.
const INTEGRAL_LIMIT_SHARE: f64 = 0.5;

/// The controller's state for one axis.
#[derive(Clone, Copy, Debug, Default)]
struct AxisControl {
    error: Option<f64>,
    rate: f64,
    /// The integral part of the command.
    summed: f64,
    correction: f64,
    unseen_s: f64,
}

/// The controller of a running drive cycle, in the numbers of the device.
#[derive(Clone, Debug, Default)]
pub struct DriveLaw {
    memory: PerAxis<AxisControl>,
    last_s: Option<f64>,
}

impl DriveLaw {
    /// Returns the commands that follow from the reading in `sample`, taken `t_s` seconds
    /// after the start; its commands are ignored. Times must not decrease.
    pub fn command(&mut self, cycle: &DriveCycle, sample: &Sample) -> PerAxis<Option<f64>> {
        let dt = self.last_s.replace(sample.t_s).map_or(0.0, |last_s| sample.t_s - last_s);
        let Some(row) = cycle.row(sample.t_s) else { return PerAxis::default() };
        PerAxis::from_fn(|axis| {
            let feedback = cycle.feedback[axis]?;
            let error = row
                .position(feedback.reading)
                .zip(sample.position(feedback.reading))
                .map(|(wanted, read)| wanted - read);
            let correction = self.memory[axis].correct(error, dt, &feedback, cycle);
            Some((row.command(axis)? + correction).clamp(-cycle.limit, cycle.limit))
        })
    }
}

impl AxisControl {
    fn correct(
        &mut self,
        error: Option<f64>,
        dt: f64,
        gains: &Feedback,
        cycle: &DriveCycle,
    ) -> f64 {
        let Some(error) = error else { return self.blind(dt) };
        let change = self.error.filter(|_| dt > 0.0).map_or(0.0, |last| (error - last) / dt);
        self.rate += (change - self.rate) * dt / (cycle.filter_s + dt);
        let most = INTEGRAL_LIMIT_SHARE * cycle.limit;
        self.summed = (self.summed + gains.integral * error * dt).clamp(-most, most);
        self.error = Some(error);
        self.unseen_s = 0.0;
        self.correction = gains.proportional * error + self.summed + gains.derivative * self.rate;
        self.correction
    }

    fn blind(&mut self, dt: f64) -> f64 {
        let unseen_s = self.unseen_s + dt;
        let correction = if unseen_s > BLIND_S { 0.0 } else { self.correction };
        *self = Self { error: None, rate: 0.0, correction, unseen_s, ..*self };
        correction
    }
}

impl DriveCycle {
    /// Returns the row at `t_s` seconds after the start: the nearest one, the last one
    /// after the end.
    #[must_use]
    pub fn row(&self, t_s: f64) -> Option<&Sample> {
        // Negative and huge times saturate.
        let index = (t_s * self.rate_hz).round() as usize;
        self.rows.get(index.min(self.rows.len().saturating_sub(1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::drive_cycle::Order;
    use crate::vocabulary::Axis;

    /// A cycle without rows.
    fn empty() -> DriveCycle {
        DriveCycle {
            duration_s: 1.0,
            period_s: 1.0,
            repeats: 1,
            order: Order::AtOnce,
            amplitude_m: PerAxis::default(),
            tilt_rad: PerAxis::default(),
            level_within_rad: PerAxis::default(),
            rate_hz: 10.0,
            rows: Vec::new(),
            feedback: PerAxis::default(),
            filter_s: 0.05,
            limit: 1.0,
            monitors: Vec::new(),
            faults: Vec::new(),
        }
    }

    #[test]
    fn a_missing_reading_keeps_the_correction_and_long_darkness_drops_it() {
        let gains =
            Feedback { reading: Axis::X, proportional: 2.0, integral: 0.0, derivative: 0.0 };
        let mut memory = AxisControl::default();
        let cycle = DriveCycle { limit: 10.0, ..empty() };
        let mut correct = |error| memory.correct(error, 0.125, &gains, &cycle);
        assert_eq!(correct(Some(0.5)), 1.0);
        assert_eq!([0; 4].map(|_| correct(None)), [1.0, 1.0, 0.0, 0.0]);
        assert_eq!(correct(Some(0.25)), 0.5);
    }

    #[test]
    fn the_sum_over_time_finds_a_level_up_to_half_of_the_limit() {
        let gains =
            Feedback { reading: Axis::X, proportional: 0.0, integral: 1.0, derivative: 0.0 };
        let mut memory = AxisControl::default();
        let cycle = DriveCycle { limit: 0.5, ..empty() };
        let mut correct = || memory.correct(Some(0.25), 0.5, &gains, &cycle);
        assert_eq!([0; 4].map(|_| correct()), [0.125, 0.25, 0.25, 0.25]);
    }
}
