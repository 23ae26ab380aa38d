//! How a healthy rig scatters about its calibrated twin: noise, residual, and
//! the tilt that a ball at rest withstands.

use super::fit::Fitter;
use super::recording::Recording;
use crate::maths::{SlidingQuadratic, median, quantile, robust_deviation};
use crate::vocabulary::Axis;

/// A ball whose readings span less than this over a while is at rest, m.
const REST_SPAN_M: f64 = 0.003;

/// How a healthy rig scatters about the twin.
pub(super) struct Healthy {
    pub(super) noise_m: f64,
    pub(super) residual_m_s2: f64,
    pub(super) breakaway_rad: f64,
    pub(super) familiar_m_s2: f64,
}

/// Window of the residual, s: the one that the default profile judges by.
const RESIDUAL_WINDOW_S: f64 = 0.5;
/// Samples that a window holds at least, as when it is judged.
const LEAST_SAMPLES: f64 = 8.0;
/// Rest after which the plate's tilt counts as withstood, s.
const REST_S: f64 = 0.5;
/// Share of the withstood tilts that the breakaway angle covers.
const REST_SHARE: f64 = 0.95;
/// Share of the accelerations that count as familiar.
const FAMILIAR_SHARE: f64 = 0.95;

pub(super) fn healthy_spread(
    fitter: &Fitter,
    dead: f64,
    lag: f64,
    gain: f64,
    level: f64,
    resistance_m_s2: f64,
) -> Healthy {
    let (mut scatters, mut residuals, mut withstood) = (Vec::new(), Vec::new(), Vec::new());
    let mut driven = Vec::new();
    let axis = fitter.axis;
    for recording in fitter.recordings {
        let Some(model) = fitter.model(dead, lag, gain, level, resistance_m_s2) else { continue };
        let path = recording.twin_path(&model, axis);
        let mut filter = SlidingQuadratic::default();
        let window_s = RESIDUAL_WINDOW_S.max(LEAST_SAMPLES * recording.period_s);
        for (m, &z) in recording.moments.iter().zip(&path) {
            let stale = filter.newest().is_some_and(|n| m.at.seconds() - n > recording.gap_s);
            if stale {
                filter.clear();
            }
            let Some(position) = m.position[axis] else { continue };
            filter.push(m.at.seconds(), position, z, window_s);
            let Some(fit) = filter.fit().filter(|f| f.span_s > 0.8 * window_s) else {
                continue;
            };
            // A ball at rest answers nothing, and its readings err least.
            if fit.measured.velocity.abs() * window_s > REST_SPAN_M {
                scatters.push(fit.scatter);
                residuals.push(fit.deviation.acceleration);
                driven.push((fit.measured.acceleration - fit.deviation.acceleration).abs());
            }
        }
        withstood.extend(tilts_at_rest(recording, axis, level, dead + lag));
    }
    Healthy {
        noise_m: median(&mut scatters).unwrap_or(0.0),
        residual_m_s2: robust_deviation(&mut residuals).unwrap_or(0.0),
        breakaway_rad: quantile(&mut withstood, REST_SHARE).unwrap_or(0.0),
        familiar_m_s2: quantile(&mut driven, FAMILIAR_SHARE).unwrap_or(0.0),
    }
}

/// Tilts, rad, that a ball at rest has withstood: the command of a delay ago
/// plus the level, while the readings stay within [`REST_SPAN_M`].
fn tilts_at_rest(recording: &Recording, axis: Axis, level: f64, delay_s: f64) -> Vec<f64> {
    let moments = &recording.moments;
    let mut tilts = Vec::new();
    let (mut anchor, mut anchor_at, mut delayed) = (f64::INFINITY, None, 0);
    for m in moments {
        let Some(position) = m.position[axis] else { continue };
        if (position - anchor).abs() > REST_SPAN_M / 2.0 {
            (anchor, anchor_at) = (position, Some(m.at));
        }
        while delayed + 1 < moments.len() && m.at - moments[delayed + 1].at >= delay_s {
            delayed += 1;
        }
        let rested = anchor_at.is_some_and(|since| m.at - since > REST_S);
        if let (true, Some(command)) = (rested, moments[delayed].command[axis]) {
            tilts.push((command + level).abs());
        }
    }
    tilts
}
