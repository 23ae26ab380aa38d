//! The true state of the rig, and the time at which a fault first became detectable.
//!
//! A fault without an effect (a dead servo without commands) cannot be detected; detection
//! delays therefore count from its *first chance*, when its effect first exceeds a
//! limit.

use std::collections::VecDeque;

use nalgebra::Vector2;

use super::fault::{Fault, FaultEffect, Reading};
use super::model::RigModel;
use offbd_core::vocabulary::{Axis, PerAxis};

/// The true state of the rig at one time, known to the simulation alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// The rig's clock, s.
    pub t_s: f64,
    /// The ball's centre in the plate frame, m.
    pub position: Vector2<f64>,
    pub velocity: Vector2<f64>,
    /// Whether the ball has fallen off the plate.
    pub lost: bool,
    /// Angle of the plate by the servo of each axis, rad.
    pub plate_rad: PerAxis<f64>,
    /// The angle with a healthy servo under the same commands, rad.
    pub healthy_rad: PerAxis<f64>,
}

/// A fault and its first chance of being detected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultTruth {
    pub fault: Fault,
    /// Time at which its effect first became detectable, s; `None`: not so far.
    pub chance_s: Option<f64>,
}

/// Mean error of the plate's angle over [`WINDOW_S`] from which on a servo fault is
/// detectable, rad; chosen.
const STANDS_OUT_RAD: f64 = 0.015;
/// Window of that mean, s; chosen.
const WINDOW_S: f64 = 0.3;
/// Tilt from which on a stuck ball is detectable, in breakaway tilts; chosen: a healthy
/// ball would move.
const MOVING_BREAKAWAYS: f64 = 2.0;
/// Minimum error of a frozen reading from which on the fault is detectable, m; chosen.
const OFF_M: f64 = 0.003;
/// The same error in standard deviations of the sensor's noise, in addition to its dead
/// band; chosen: hardly any noise is as large.
const OFF_DEVIATIONS: f64 = 4.0;

/// Observes one fault to find its first chance.
#[derive(Clone, Debug)]
pub(super) struct FaultObserver {
    truth: FaultTruth,
    errors: VecDeque<(f64, f64)>,
    sum: f64,
}

impl FaultObserver {
    pub(super) fn new(fault: Fault) -> Self {
        let truth = FaultTruth { fault, chance_s: None };
        Self { truth, errors: VecDeque::new(), sum: 0.0 }
    }

    pub(super) const fn truth(&self) -> &FaultTruth {
        &self.truth
    }

    pub(super) const fn fault(&self) -> &Fault {
        &self.truth.fault
    }

    /// Ends the fault at `at_s`; a fault with a later onset never begins.
    pub(super) fn end(&mut self, at_s: f64) {
        let fault = &mut self.truth.fault;
        if fault.end_s.is_none_or(|end_s| end_s > at_s) {
            fault.end_s = Some(at_s.max(fault.onset_s));
        }
    }

    /// Takes the state of the rig `model` at one time.
    pub(super) fn observe(&mut self, truth: &Truth, latest: &Reading, model: &RigModel) {
        if self.truth.chance_s.is_some() || !self.truth.fault.active(truth.t_s) {
            return;
        }
        let (sensor, breakaway_rad) = (&model.sensor, model.surface.breakaway_rad);
        let off_m = OFF_M.max(OFF_DEVIATIONS * sensor.noise_m + sensor.dead_band_m);
        let off = |axis: Axis| {
            let centred = latest[axis].map(|m| m - sensor.origin_m[axis]);
            centred.map_or(0.0, |m| (m - truth.position[axis as usize]).abs())
        };
        let stands_out = match self.truth.fault.effect {
            FaultEffect::Servo(axis, _) => {
                self.mean_error(truth.t_s, (truth.plate_rad[axis] - truth.healthy_rad[axis]).abs())
                    > STANDS_OUT_RAD
            }
            FaultEffect::Ball(_) => {
                truth.plate_rad.x.hypot(truth.plate_rad.y) > MOVING_BREAKAWAYS * breakaway_rad
            }
            FaultEffect::Sensor(fault) => fault.hidden_m(off).is_none_or(|m| m > off_m),
        };
        if stands_out {
            self.truth.chance_s = Some(truth.t_s);
        }
    }

    /// Returns the mean over the window that ends at `at_s`; zero until the window is full.
    fn mean_error(&mut self, at_s: f64, error: f64) -> f64 {
        self.errors.push_back((at_s, error));
        self.sum += error;
        let mut full = false;
        while self.errors.front().is_some_and(|&(t, _)| at_s - t > WINDOW_S) {
            self.sum -= self.errors.pop_front().map_or(0.0, |(_, e)| e);
            full = true;
        }
        if full { self.sum / self.errors.len() as f64 } else { 0.0 }
    }
}
