//! How a healthy rig scatters about its calibrated twin: noise, residual, and
//! the tilt that a ball at rest withstands.

use super::fit::Fitter;
use super::recording::Recording;
use super::sessions::Estimate;
use crate::diagnosis::Settings;
use crate::engine::pipeline::{FULL_WINDOW, LEAST_SAMPLES};
use crate::maths::{SlidingQuadratic, median, quantile, robust_deviation};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::Axis;

/// A ball whose readings span less than this over a while is at rest, m.
const REST_SPAN_M: f64 = 0.003;

/// How a healthy rig scatters about the twin.
pub(super) struct Healthy {
    pub(super) noise_m: f64,
    pub(super) residual_m_s2: f64,
    pub(super) breakaway_rad: f64,
    pub(super) familiar_m_s2: f64,
    pub(super) longest_repeat_s: f64,
    pub(super) rest_s: f64,
}

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
    levels: &[f64],
    resistance_m_s2: f64,
) -> Healthy {
    let (mut scatters, mut residuals, mut withstood) = (Vec::new(), Vec::new(), Vec::new());
    let mut driven = Vec::new();
    let (mut rest_s, mut longest_repeat_s) = (0.0_f64, 0.0_f64);
    let axis = fitter.axis;
    for (recording, &level) in fitter.recordings.iter().zip(levels) {
        let Some(model) = fitter.model(dead, lag, gain, level, resistance_m_s2) else { continue };
        let path = recording.twin_path(&model, axis);
        let mut filter = SlidingQuadratic::default();
        let window_s = Settings::default().window_s.max(LEAST_SAMPLES * recording.period_s);
        for (m, &z) in recording.moments.iter().zip(&path) {
            let stale = filter.newest().is_some_and(|n| m.at.seconds() - n > recording.gap_s);
            if stale {
                filter.clear();
            }
            let Some(position) = m.position[axis] else { continue };
            filter.push(m.at.seconds(), position, z, window_s);
            let Some(fit) = filter.fit().filter(|f| f.span_s > FULL_WINDOW * window_s) else {
                continue;
            };
            // A ball at rest answers nothing, and its readings err least.
            if fit.measured.velocity.abs() * window_s > REST_SPAN_M {
                scatters.push(fit.scatter);
                residuals.push(fit.deviation.acceleration);
                driven.push((fit.measured.acceleration - fit.deviation.acceleration).abs());
            }
        }
        let rest = Rest::of(recording, axis, Some(level), dead + lag);
        withstood.extend(rest.tilts);
        rest_s = rest.longest_s.max(rest_s);
        longest_repeat_s = longest_repeat_s.max(recording.longest_repeat_s[axis]);
    }
    Healthy {
        noise_m: median(&mut scatters).unwrap_or(0.0),
        residual_m_s2: robust_deviation(&mut residuals).unwrap_or(0.0),
        breakaway_rad: quantile(&mut withstood, REST_SHARE).unwrap_or(0.0),
        familiar_m_s2: quantile(&mut driven, FAMILIAR_SHARE).unwrap_or(0.0),
        longest_repeat_s,
        rest_s,
    }
}

/// Standard deviation of the tilt under which a ball rests, rad, before the rig's
/// own is known, and how long one rest counts once, s.
const RESTING_TILT_RAD: f64 = 0.01;
const REST_COUNTS_S: f64 = 2.0;

/// The level by which the ball of `recording` has rested, if it has: that which
/// balances the commands.
pub(super) fn level_at_rest(recording: &Recording, axis: Axis, delay_s: f64) -> Option<Estimate> {
    let mut rest = Rest::of(recording, axis, None, delay_s);
    let n = rest.seconds / REST_COUNTS_S;
    let command = median(&mut rest.commands).filter(|_| n > 0.0)?;
    Some(Estimate { value: -command, error: RESTING_TILT_RAD / n.max(0.25).sqrt() })
}

/// A ball at rest: for how long, and the tilts, rad, that it has withstood.
#[derive(Default)]
struct Rest {
    /// Commands of a delay ago, rad.
    commands: Vec<f64>,
    tilts: Vec<f64>,
    seconds: f64,
    /// In one piece.
    longest_s: f64,
}

impl Rest {
    /// The tilt is the command of a delay ago plus the level, while the readings
    /// stay within [`REST_SPAN_M`]; one beyond [`MOST_BREAKAWAY_RAD`] is held by
    /// something else.
    fn of(recording: &Recording, axis: Axis, level: Option<f64>, delay_s: f64) -> Self {
        let moments = &recording.moments;
        let mut rest = Self::default();
        let (mut anchor, mut anchor_at, mut delayed) = (f64::INFINITY, None, 0);
        let mut before = None;
        for m in moments {
            let Some(position) = m.position[axis] else { continue };
            let dt = before.replace(m.at).map_or(0.0, |b| m.at - b);
            if (position - anchor).abs() > REST_SPAN_M / 2.0 || dt > recording.gap_s {
                (anchor, anchor_at) = (position, Some(m.at));
            }
            while delayed + 1 < moments.len() && m.at - moments[delayed + 1].at >= delay_s {
                delayed += 1;
            }
            let rested = anchor_at.is_some_and(|since| m.at - since > REST_S);
            if let (true, Some(command)) = (rested, moments[delayed].command[axis]) {
                let tilt = level.map_or(0.0, |level| (command + level).abs());
                if tilt <= MOST_BREAKAWAY_RAD {
                    rest.commands.push(command);
                    rest.tilts.push(tilt);
                    rest.seconds += dt;
                    rest.longest_s =
                        anchor_at.map_or(0.0, |since| m.at - since).max(rest.longest_s);
                }
            }
        }
        rest
    }
}

/// Tilt that no ball withstands by itself, rad: light balls under servos in
/// whole degrees have been seen to stand at nearly 3°.
pub(super) const MOST_BREAKAWAY_RAD: f64 = 0.055;
