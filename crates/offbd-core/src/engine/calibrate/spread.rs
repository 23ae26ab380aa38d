//! The scatter of a healthy rig about its calibrated twin: noise, residual, and the tilt
//! that a ball at rest withstands.

use super::fit::Fitter;
use super::recording::Recording;
use super::sessions::Estimate;
use crate::diagnosis::Settings;
use crate::engine::pipeline::{FULL_WINDOW_SHARE, LEAST_SAMPLES};
use crate::maths::{SlidingQuadratic, median, quantile, robust_deviation};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::Axis;

/// Span of the readings below which a ball counts as at rest, m. Chosen.
const REST_SPAN_M: f64 = 0.003;

/// The scatter of a healthy rig about the twin.
pub(super) struct Healthy {
    pub(super) noise_m: f64,
    pub(super) residual_m_s2: f64,
    pub(super) breakaway_rad: f64,
    pub(super) familiar_m_s2: f64,
    pub(super) longest_repeat_s: f64,
    pub(super) rest_s: f64,
}

/// Time of rest after which the plate's tilt counts as withstood, s. Chosen.
const REST_S: f64 = 0.5;
/// Quantile of the withstood tilts that is the breakaway angle. Chosen.
const REST_SHARE: f64 = 0.95;
/// Quantile of the accelerations up to which they are familiar. Chosen.
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
            let Some(fit) = filter.fit().filter(|f| f.span_s > FULL_WINDOW_SHARE * window_s) else {
                continue;
            };
            // A ball at rest does not respond, and its readings have the least errors.
            if fit.measured.velocity.abs() * window_s > REST_SPAN_M {
                scatters.push(fit.scatter);
                residuals.push(fit.deviation.acceleration);
                driven.push((fit.measured.acceleration - fit.deviation.acceleration).abs());
            }
        }
        let rest = RestStatistics::of(recording, axis, Some(level), dead + lag);
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

/// Standard deviation of the tilt of a plate on which a ball rests, rad, before that of
/// the rig is known. Chosen.
const RESTING_TILT_RAD: f64 = 0.01;
/// Duration of rest that counts as one independent estimate, s. Chosen.
const REST_COUNTS_S: f64 = 2.0;
/// Least number of estimates that the error of a level is based on. Chosen.
const LEAST_RESTS: f64 = 0.25;

/// Returns the level that balances the commands while the ball of `recording` rests, if
/// it has rested.
pub(super) fn level_at_rest(recording: &Recording, axis: Axis, delay_s: f64) -> Option<Estimate> {
    let mut rest = RestStatistics::of(recording, axis, None, delay_s);
    let n = rest.seconds / REST_COUNTS_S;
    let command = median(&mut rest.commands).filter(|_| n > 0.0)?;
    Some(Estimate { value: -command, error: RESTING_TILT_RAD / n.max(LEAST_RESTS).sqrt() })
}

/// A ball at rest: duration, commands, and the tilts, rad, that it has withstood.
#[derive(Default)]
struct RestStatistics {
    /// The commands one delay earlier, rad.
    commands: Vec<f64>,
    tilts: Vec<f64>,
    seconds: f64,
    /// The longest single rest, s.
    longest_s: f64,
}

impl RestStatistics {
    /// Collects the rests in a recording, in which the readings stay within
    /// [`REST_SPAN_M`]. The tilt is the command one delay earlier plus the level; beyond
    /// [`MOST_BREAKAWAY_RAD`] something else holds the ball.
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

/// Largest tilt that a ball withstands by itself, rad: light balls with servos that move
/// in whole degrees have been seen to stand at nearly 3°.
pub(super) const MOST_BREAKAWAY_RAD: f64 = 0.055;
