//! By how much a rig varies more than its recordings taught: factors on what was
//! learnt, widened step by step until a healthy session is quiet.

use super::self_test::{Accusation, SelfTest};
use super::spread::MOST_BREAKAWAY_RAD;
use crate::diagnosis::{AxisCalibration, Calibration};
use crate::vocabulary::{Axis, FaultCode, FaultKind, PerAxis};

/// By how much at a time.
const STEP: f64 = 1.25;
/// Most evidence against a healthy servo, nats: what confirms a fault is kept
/// within what a monitor can gather.
const MOST_HEALTHY_NATS: f64 = 22.0;
/// What the twin may leave out at most, m/s²: beyond it nothing is found.
const MOST_ERROR_M_S2: f64 = 0.4;
/// Most standard deviation of the readings, m: twice that of the worst
/// ultrasonic sensor seen.
const MOST_NOISE_M: f64 = 0.03;
/// Least tilt that a ball withstands once it has withstood more than was learnt,
/// rad.
const LEAST_BREAKAWAY_RAD: f64 = 0.008;
/// Least repeat that is widened, s.
const LEAST_REPEAT_S: f64 = 0.1;
/// Scatter that lasts without being noise, in deviations of a reading: just
/// below what the evaluator takes for noise.
const LASTING_DEVIATIONS: f64 = 2.8;
/// Stillness below which a ball that was called stuck was held back, s.
const STOOD_S: f64 = 0.2;

/// The factors of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct AxisWidening {
    model_error: f64,
    residual: f64,
    breakaway: f64,
    noise: f64,
    repeat: f64,
}

impl Default for AxisWidening {
    fn default() -> Self {
        Self { model_error: 1.0, residual: 1.0, breakaway: 1.0, noise: 1.0, repeat: 1.0 }
    }
}

impl AxisWidening {
    fn of(&self, learnt: AxisCalibration) -> AxisCalibration {
        let breakaway_rad = match self.breakaway > 1.0 {
            true => self.breakaway * learnt.breakaway_rad.max(LEAST_BREAKAWAY_RAD),
            false => learnt.breakaway_rad,
        };
        let longest_repeat_s = match self.repeat > 1.0 {
            true => self.repeat * learnt.longest_repeat_s.max(LEAST_REPEAT_S),
            false => learnt.longest_repeat_s,
        };
        AxisCalibration {
            model_error_m_s2: self.model_error * learnt.model_error_m_s2,
            residual_m_s2: self.residual * learnt.residual_m_s2,
            noise_m: self.noise * learnt.noise_m,
            breakaway_rad,
            longest_repeat_s,
            ..learnt
        }
    }
}

/// The factors of a rig, and what is added to the sensor's limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Widening {
    axes: PerAxis<AxisWidening>,
    outliers: f64,
    unseen_s: f64,
    /// A factor on the scatter that lasts; zero where that was not widened.
    scatter: f64,
}

impl Widening {
    /// `learnt`, as wide as this.
    pub(super) fn of(&self, learnt: &Calibration) -> Calibration {
        let mut wide = learnt.clone();
        for axis in Axis::ALL {
            wide.axes[axis] = learnt.axes[axis].map(|a| self.axes[axis].of(a));
        }
        let noises = [wide.axes.x, wide.axes.y].into_iter().flatten().map(|a| a.noise_m);
        let scatter_m = self.scatter * LASTING_DEVIATIONS * noises.fold(0.0, f64::max);
        let sensor = &mut wide.sensor;
        sensor.most_outliers += self.outliers;
        sensor.most_scatter_m = sensor.most_scatter_m.max(scatter_m);
        sensor.longest_unseen_s = sensor.longest_unseen_s.max(self.unseen_s);
        wide
    }

    /// Widens what `test` asks for. Returns whether it asked for anything.
    pub(super) fn widen(&mut self, test: &SelfTest) -> bool {
        let mut asked = false;
        for axis in Axis::ALL {
            if test.most_nats[axis].0 > MOST_HEALTHY_NATS {
                self.axes[axis].model_error *= STEP;
                asked = true;
            }
        }
        if let Some(alarm) = &test.alarm {
            self.silence(alarm);
        }
        asked || test.alarm.is_some()
    }

    fn silence(&mut self, alarm: &Accusation) {
        let axes = &mut self.axes;
        let mut each =
            |f: fn(&mut AxisWidening)| Axis::ALL.into_iter().for_each(|a| f(&mut axes[a]));
        match (alarm.code, alarm.kind) {
            (FaultCode::XServo, _) => axes.x.residual *= STEP,
            (FaultCode::YServo, _) => axes.y.residual *= STEP,
            (FaultCode::StuckBall, _) if alarm.still_s < STOOD_S => each(|a| a.model_error *= STEP),
            (FaultCode::StuckBall, _) => each(|a| a.breakaway *= STEP),
            (FaultCode::Sensor, Some(FaultKind::Frozen)) => each(|a| a.repeat *= STEP),
            (FaultCode::Sensor, Some(FaultKind::Spikes)) => self.outliers += 1.0,
            (FaultCode::Sensor, Some(FaultKind::Dropout)) => {
                self.unseen_s = STEP * self.unseen_s.max(alarm.unseen_s);
            }
            (FaultCode::Sensor, Some(FaultKind::Noise)) => {
                self.scatter = STEP * self.scatter.max(1.0);
            }
            (FaultCode::Sensor, _) => each(|a| a.noise *= STEP),
        }
    }

    /// Whether a rig as wide as that would be judged by nothing.
    pub(super) fn is_beyond(&self, learnt: &Calibration) -> bool {
        let wide = self.of(learnt);
        let beyond = |a: &AxisCalibration| {
            a.model_error_m_s2 > MOST_ERROR_M_S2
                || a.breakaway_rad > MOST_BREAKAWAY_RAD
                || a.noise_m > MOST_NOISE_M
        };
        [wide.axes.x, wide.axes.y].iter().flatten().any(beyond)
    }
}
