//! Trends over sessions: a line through the estimates of each session, and a warning
//! before it crosses the limit at which a fault is confirmed.
//!
//! The line is that of Theil and Sen: the median of the slopes between all pairs of
//! sessions, which is robust against outliers (breakdown point 29 %). Its confidence
//! interval is Student's, from the scatter of the sessions about the line; as long as these
//! are few, the usual scatter of sessions counts too. Independent of rigs: the input is one
//! number per session.

mod drift;

#[cfg(not(feature = "std"))]
use crate::no_std::*;
pub use drift::{Drift, HORIZON_SESSIONS, Parameter, drift};

use crate::maths::{median, robust_deviation};

/// Most sessions in a trend; of more, the last count. The work grows with their square,
/// since every pair has a slope. Chosen.
pub const MAX_SESSIONS: usize = 200;

/// Fewest sessions that make a trend. Chosen: a drift of 2 % a session, which reaches its
/// limit with the fifteenth, is then found while there is time to act.
pub const LEAST_SESSIONS: usize = 6;

/// Quantile of the normal distribution for a two-sided confidence of 99.9 %. It is that
/// high because a rig has six parameters, each tested after every session, and a false
/// drift of a noisy one extrapolates to its limit.
const QUANTILE: f64 = 3.291;

/// Number of sessions as which the usual scatter counts. Chosen: as many as make a trend.
const USUAL_COUNTS: f64 = 6.0;

/// Variance of a slope by least squares over that of Theil and Sen, for normal values and
/// many sessions: 3/π (Sen 1968, section 5).
const EFFICIENCY: f64 = 0.955;

/// Standard error of a median over that of a mean, for normal values: √(π/2).
const MEDIAN_ERROR: f64 = 1.2533;

/// Fraction of the limit beyond which a deviation is warned of, however slow it is.
/// Chosen.
const DRIFT_SHARE: f64 = 0.5;

/// A straight line over sessions, numbered from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trend {
    /// Change per session.
    pub slope: f64,
    /// Bounds of the slope with a confidence of 99.9 %.
    pub slope_low: f64,
    pub slope_high: f64,
    /// Value of the line at the last session, and its standard error.
    pub level: f64,
    pub level_error: f64,
    pub n_sessions: usize,
}

impl Trend {
    /// Fits the line to `values`, one per session, oldest first, which usually scatter by
    /// `usual_scatter` (> 0, their unit) about their line; `None` for fewer than
    /// [`LEAST_SESSIONS`]. Values that are not finite do not count.
    #[must_use]
    pub fn of(values: &[f64], usual_scatter: f64) -> Option<Self> {
        let values = &values[values.len().saturating_sub(MAX_SESSIONS)..];
        let points: Vec<(f64, f64)> = values
            .iter()
            .enumerate()
            .map(|(i, &value)| (i as f64, value))
            .filter(|(_, value)| value.is_finite())
            .collect();
        if points.len() < LEAST_SESSIONS {
            return None;
        }
        let n = points.len() as f64;
        let slope = median(&mut slopes(&points))?;
        let last = values.len() as f64 - 1.0;
        let mut levels: Vec<f64> = points.iter().map(|(i, v)| v + slope * (last - i)).collect();
        let slope_error = slope_error(&points, &levels, usual_scatter);
        let level = median(&mut levels)?;
        let scattered = MEDIAN_ERROR * robust_deviation(&mut levels)? / n.sqrt();
        let level_error = scattered.hypot(slope_error * last / 2.0);
        let reach = student_quantile(USUAL_COUNTS + n - 2.0) * slope_error;
        let (slope_low, slope_high) = (slope - reach, slope + reach);
        Some(Self { slope, slope_low, slope_high, level, level_error, n_sessions: points.len() })
    }

    /// Whether there is a drift: the confidence interval of the slope excludes zero.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        self.slope_low > 0.0 || self.slope_high < 0.0
    }

    /// Returns the number of sessions until the line reaches the limit in the direction
    /// of its slope, 0 if it is beyond it; `None` if it never does.
    #[must_use]
    pub fn sessions_until(&self, limit: &Band) -> Option<f64> {
        let room = if self.slope > 0.0 { limit.high - self.level } else { self.level - limit.low };
        if room <= 0.0 {
            return Some(0.0);
        }
        (self.slope != 0.0).then(|| room / self.slope.abs())
    }
}

/// The slopes between all pairs of points.
fn slopes(points: &[(f64, f64)]) -> Vec<f64> {
    let mut slopes = Vec::with_capacity(points.len() * (points.len() - 1) / 2);
    for (k, (i, a)) in points.iter().enumerate() {
        slopes.extend(points[k + 1..].iter().map(|(j, b)| (b - a) / (j - i)));
    }
    slopes
}

/// Standard error of the slope through `points`, which the line takes to `levels` at the
/// last session.
fn slope_error(points: &[(f64, f64)], levels: &[f64], usual_scatter: f64) -> f64 {
    let n = points.len() as f64;
    let squares_about_mean = |values: &mut dyn Iterator<Item = f64>| {
        let values: Vec<f64> = values.collect();
        let mean = values.iter().sum::<f64>() / n;
        values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>()
    };
    let left = squares_about_mean(&mut levels.iter().copied());
    let spread = squares_about_mean(&mut points.iter().map(|(i, _)| *i));
    let usual = USUAL_COUNTS * usual_scatter * usual_scatter;
    let variance = (usual + left) / (USUAL_COUNTS + n - 2.0);
    (variance / (EFFICIENCY * spread)).sqrt()
}

/// The quantile of Student's distribution with `freedom` ≥ 10 degrees of freedom for the
/// confidence of [`QUANTILE`], by the first terms of its expansion (Abramowitz & Stegun
/// 1964, 26.7.5).
fn student_quantile(freedom: f64) -> f64 {
    let z = QUANTILE;
    let (z3, z5, z7) = (z.powi(3), z.powi(5), z.powi(7));
    z + (z3 + z) / (4.0 * freedom)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * freedom.powi(2))
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * freedom.powi(3))
}

/// The range of an estimate that is not a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    pub low: f64,
    /// The usual value.
    pub nominal: f64,
    pub high: f64,
}

impl Band {
    /// Shifts the band to another nominal value.
    #[must_use]
    pub fn about(&self, nominal: f64) -> Self {
        let by = nominal - self.nominal;
        Self { low: self.low + by, nominal, high: self.high + by }
    }

    /// Returns how far `value` is from nominal to the limit on its side: 0 to 1, and more
    /// beyond the limit.
    #[must_use]
    pub fn share(&self, value: f64) -> f64 {
        let away = value - self.nominal;
        let room = if away >= 0.0 { self.high - self.nominal } else { self.low - self.nominal };
        if away == 0.0 { 0.0 } else { away / room }
    }
}

/// The reason of a warning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Warning {
    /// The line reaches the limit within so many sessions.
    Crosses { sessions: f64 },
    /// The level has moved by this fraction of the distance to the limit, a half or more,
    /// whether or not it moves on.
    Drifted { share: f64 },
}

/// Returns the warning for a trend with the limits of `band`, looking `horizon` sessions
/// ahead. A slope that is not significant causes none, unless the level is beyond half
/// the limit with confidence.
#[must_use]
pub fn warning(trend: &Trend, band: &Band, horizon: f64) -> Option<Warning> {
    let until = trend.sessions_until(band).filter(|&sessions| sessions <= horizon);
    if let Some(sessions) = until.filter(|_| trend.is_significant()) {
        return Some(Warning::Crosses { sessions });
    }
    // The end of the level's confidence interval nearer to nominal decides.
    let away = trend.level - band.nominal;
    let least = (away.abs() - QUANTILE * trend.level_error).max(0.0) * away.signum();
    let share = band.share(trend.level);
    (band.share(band.nominal + least) > DRIFT_SHARE).then_some(Warning::Drifted { share })
}

#[cfg(test)]
mod tests;
