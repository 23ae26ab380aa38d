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

/// Model errors in a row that are better on neither axis, after which larger ones are not
/// tried: the likelihood of a scale has one maximum, but for its noise.
const MOST_WORSE: usize = 2;
/// Length of the excerpts that are judged, s: many times what the engine needs to settle.
const EXCERPT_S: f64 = 20.0;
/// Length of all excerpts together if there is one session, s. Chosen: of some 3000 blocks
/// of readings a standard deviation is known to 1 or 2 %.
const EXCERPTS_S: f64 = 160.0;

/// Returns `learnt` with the model errors that maximise the likelihood of excerpts of
/// `sessions`.
pub(super) fn with_model_errors(
    rig: &Rig,
    mut learnt: Calibration,
    sessions: &[Vec<Sample>],
) -> Calibration {
    let excerpts = excerpts(sessions, learnt.duration_s);
    let mut best = PerAxis { x: f64::NEG_INFINITY, y: f64::NEG_INFINITY };
    let mut tried = learnt.clone();
    let mut n_worse = 0;
    for error_m_s2 in ERRORS_M_S2 {
        let with = |a: AxisCalibration| AxisCalibration { model_error_m_s2: error_m_s2, ..a };
        tried.axes = tried.axes.map(|a| a.map(with));
        let Some(nats) = log_likelihood_nats(rig, &tried, &excerpts) else { return learnt };
        n_worse += 1;
        for axis in Axis::ALL {
            if let (true, Some(learnt)) = (nats[axis] > best[axis], &mut learnt.axes[axis]) {
                learnt.model_error_m_s2 = error_m_s2;
                best[axis] = nats[axis];
                n_worse = 0;
            }
        }
        if n_worse == MOST_WORSE {
            break;
        }
    }
    learnt
}

/// Returns excerpts at even distances of `sessions` that last `duration_s` in all; each
/// session gives the first one at least.
fn excerpts(sessions: &[Vec<Sample>], duration_s: f64) -> Vec<&[Sample]> {
    let n: usize = sessions.iter().map(Vec::len).sum();
    // Counted in samples: times may stand still or go back.
    let rate_hz = n as f64 / duration_s;
    let length = ((EXCERPT_S * rate_hz).ceil() as usize).max(1);
    let distance = (length as f64 * (duration_s / EXCERPTS_S).max(1.0)) as usize;
    let distance = distance.max(length);
    sessions
        .iter()
        .flat_map(|session| session.chunks(distance))
        .map(|chunk| &chunk[..chunk.len().min(length)])
        .collect()
}

/// Log-likelihood of `excerpts` of sessions of `rig` under what was learnt, nats.
fn log_likelihood_nats(
    rig: &Rig,
    learnt: &Calibration,
    excerpts: &[&[Sample]],
) -> Option<PerAxis<f64>> {
    let rig = Rig { calibration: Some(Box::new(learnt.clone())), ..rig.clone() };
    let setup = Setup::new(rig, None).ok()?;
    let nats = |excerpt: &&[Sample]| judge(&setup, 1, excerpt).log_likelihood_nats;
    let sum = |a: PerAxis<f64>, b: PerAxis<f64>| PerAxis { x: a.x + b.x, y: a.y + b.y };
    excerpts.iter().map(nats).reduce(sum)
}
