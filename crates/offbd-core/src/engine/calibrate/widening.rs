//! Factors on the learnt parameters, widened step by step until a healthy session gives
//! no alarm: the rig varies more than its recordings showed.

use super::self_test::{Accusation, SelfTest};
use super::spread::MOST_BREAKAWAY_RAD;
use crate::diagnosis::{AxisCalibration, Calibration, LearntLimit};
use crate::vocabulary::{Axis, FaultCode, PerAxis};

/// Factor of one step. Chosen.
const WIDENING_STEP: f64 = 1.25;
/// Largest evidence against a healthy servo, nats. Chosen: what confirms a fault stays
/// within what a monitor can accumulate.
const MOST_HEALTHY_NATS: f64 = 22.0;
/// Largest model error, m/s². Chosen: beyond it nothing is found.
const MOST_ERROR_M_S2: f64 = 0.4;
/// Least breakaway that is widened, rad. Chosen.
const LEAST_BREAKAWAY_RAD: f64 = 0.008;
/// Least repeat that is widened, s. Chosen.
const LEAST_WIDENED_REPEAT_S: f64 = 0.1;
/// Persistent scatter that is not noise, in standard deviations of a reading. Chosen: one
/// step of widening below what the evaluator takes for noise.
const LASTING_DEVIATIONS: f64 = 2.8;
/// Time of stillness below which a ball called stuck was only held back, s. Chosen.
pub(super) const STOOD_S: f64 = 0.2;

/// The factors of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct AxisWidening {
    model_error: f64,
    residual: f64,
    breakaway: f64,
    repeat: f64,
}

impl Default for AxisWidening {
    fn default() -> Self {
        Self { model_error: 1.0, residual: 1.0, breakaway: 1.0, repeat: 1.0 }
    }
}

impl AxisWidening {
    fn of(&self, learnt: AxisCalibration) -> AxisCalibration {
        let breakaway_rad = match self.breakaway > 1.0 {
            true => self.breakaway * learnt.breakaway_rad.max(LEAST_BREAKAWAY_RAD),
            false => learnt.breakaway_rad,
        };
        let longest_repeat_s = match self.repeat > 1.0 {
            true => self.repeat * learnt.longest_repeat_s.max(LEAST_WIDENED_REPEAT_S),
            false => learnt.longest_repeat_s,
        };
        AxisCalibration {
            model_error_m_s2: self.model_error * learnt.model_error_m_s2,
            residual_m_s2: self.residual * learnt.residual_m_s2,
            breakaway_rad,
            longest_repeat_s,
            ..learnt
        }
    }
}

/// The factors of a rig, and additions to the sensor's limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Widening {
    axes: PerAxis<AxisWidening>,
    outliers: f64,
    unseen_s: f64,
    /// Factor on the persistent scatter; zero until widened.
    scatter: f64,
}

impl Widening {
    /// Returns `learnt` widened by these factors.
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

    /// Widens what `test` requires. Returns whether it required anything.
    pub(super) fn widen(&mut self, test: &SelfTest) -> bool {
        let mut asked = false;
        for axis in Axis::ALL {
            if test.most_nats[axis].0 > MOST_HEALTHY_NATS {
                self.axes[axis].model_error *= WIDENING_STEP;
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
        match (alarm.code, alarm.kind.and_then(LearntLimit::of)) {
            (FaultCode::XServo, _) => axes.x.residual *= WIDENING_STEP,
            (FaultCode::YServo, _) => axes.y.residual *= WIDENING_STEP,
            (FaultCode::StuckBall, _) if alarm.still_s < STOOD_S => {
                each(|a| a.model_error *= WIDENING_STEP)
            }
            (FaultCode::StuckBall, _) => each(|a| a.breakaway *= WIDENING_STEP),
            (FaultCode::Sensor, Some(LearntLimit::Repeat)) => each(|a| a.repeat *= WIDENING_STEP),
            (FaultCode::Sensor, Some(LearntLimit::Outliers)) => self.outliers += 1.0,
            (FaultCode::Sensor, Some(LearntLimit::Unseen)) => {
                self.unseen_s = WIDENING_STEP * self.unseen_s.max(alarm.unseen_s);
            }
            (FaultCode::Sensor, Some(LearntLimit::Scatter)) => {
                self.scatter = WIDENING_STEP * self.scatter.max(1.0);
            }
            (FaultCode::Sensor, None) => {}
        }
    }

    /// Whether a rig that is widened so far cannot be diagnosed.
    pub(super) fn is_beyond(&self, learnt: &Calibration) -> bool {
        let wide = self.of(learnt);
        let beyond = |a: &AxisCalibration| {
            a.model_error_m_s2 > MOST_ERROR_M_S2 || a.breakaway_rad > MOST_BREAKAWAY_RAD
        };
        [wide.axes.x, wide.axes.y].iter().flatten().any(beyond)
    }
}
