//! Estimates the twin's model error by maximum likelihood.

use super::self_test::judge;
use crate::diagnosis::{AxisCalibration, Calibration};
use crate::engine::{Rig, Setup};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, PerAxis, Sample};

/// Model errors that are tried, m/s²: from the best rigs to the worst, each about half as
/// large again as the one before.
const ERRORS_M_S2: [f64; 9] = [0.01, 0.015, 0.022, 0.033, 0.05, 0.075, 0.11, 0.17, 0.25];

/// Returns `learnt` with the model errors that maximise the likelihood of `sessions`.
pub(super) fn with_model_errors(
    rig: &Rig,
    mut learnt: Calibration,
    sessions: &[Vec<Sample>],
) -> Calibration {
    let mut best = PerAxis { x: f64::NEG_INFINITY, y: f64::NEG_INFINITY };
    let mut tried = learnt.clone();
    for error_m_s2 in ERRORS_M_S2 {
        let with = |a: AxisCalibration| AxisCalibration { model_error_m_s2: error_m_s2, ..a };
        tried.axes = tried.axes.map(|a| a.map(with));
        let Some(nats) = log_likelihood_nats(rig, &tried, sessions) else { return learnt };
        for axis in Axis::ALL {
            if let (true, Some(learnt)) = (nats[axis] > best[axis], &mut learnt.axes[axis]) {
                learnt.model_error_m_s2 = error_m_s2;
                best[axis] = nats[axis];
            }
        }
    }
    learnt
}

/// Log-likelihood of `sessions` of `rig` under what was learnt, nats.
fn log_likelihood_nats(
    rig: &Rig,
    learnt: &Calibration,
    sessions: &[Vec<Sample>],
) -> Option<PerAxis<f64>> {
    let rig = Rig { calibration: Some(Box::new(learnt.clone())), ..rig.clone() };
    let setup = Setup::new(rig, None).ok()?;
    let nats = |session: &Vec<Sample>| judge(&setup, 1, session).log_likelihood_nats;
    let sum = |a: PerAxis<f64>, b: PerAxis<f64>| PerAxis { x: a.x + b.x, y: a.y + b.y };
    sessions.iter().map(nats).reduce(sum)
}
