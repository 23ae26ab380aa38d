//! Drift before fault: a line through what each session has estimated, and a
//! warning before the line crosses the limit at which a fault is confirmed.
//!
//! The line is that of Theil and Sen: the median of the slopes between every
//! two sessions, which a few wild sessions do not move (breakdown point 29 %).
//! Its confidence is Sen's, from the distribution of Kendall's S without any
//! drift. Knows no rig: numbers in order of sessions in, a judgement out.

mod drift;

#[cfg(not(feature = "std"))]
use crate::no_std::*;
pub use drift::{Drift, HORIZON_SESSIONS, Parameter, drift};

use crate::maths::{median, robust_deviation};

/// Sessions that a trend looks back over; of more the last count. Every two of
/// them have a slope, so that the work is their square.
pub const MAX_SESSIONS: usize = 200;

/// Fewest sessions that make a trend: with seven, a run that rises or falls
/// throughout has a chance of 2/7! = 0.04 % without any drift; with six, 0.3 %.
pub const LEAST_SESSIONS: usize = 7;

/// The quantile of the normal distribution for a confidence of 99.9 %,
/// two-sided: a rig has six parameters, each looked at after every session, and
/// one that is noisy leads to its limit wherever it is taken to drift.
const QUANTILE: f64 = 3.291;

/// Standard error of a median over that of a mean, of normal values: √(π/2).
const MEDIAN_ERROR: f64 = 1.2533;

/// Share of the limit beyond which a drift is warned of however slow it is.
const DRIFT_SHARE: f64 = 0.5;

/// A straight line over sessions, numbered from 0 in their order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trend {
    /// Change per session.
    pub slope: f64,
    /// The slope lies between these with a confidence of 99.9 %.
    pub slope_low: f64,
    pub slope_high: f64,
    /// What the line says of the last session, and its standard error.
    pub level: f64,
    pub level_error: f64,
    pub n_sessions: usize,
}

impl Trend {
    /// The line through `values`, one for each session, oldest first; none for
    /// fewer than [`LEAST_SESSIONS`]. What is not finite does not count.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
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
        let mut slopes = slopes(&points);
        let slope = median(&mut slopes)?;
        slopes.sort_by(f64::total_cmp);
        let (slope_low, slope_high) = confidence(&slopes, points.len());
        let last = values.len() as f64 - 1.0;
        let mut levels: Vec<f64> = points.iter().map(|(i, v)| v + slope * (last - i)).collect();
        let level = median(&mut levels)?;
        let scattered =
            MEDIAN_ERROR * robust_deviation(&mut levels)? / (points.len() as f64).sqrt();
        let turned = (slope_high - slope_low) / (2.0 * QUANTILE) * last / 2.0;
        let level_error = scattered.hypot(turned);
        Some(Self { slope, slope_low, slope_high, level, level_error, n_sessions: points.len() })
    }

    /// Whether there is a drift at all: the confidence has no zero in it.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        self.slope_low > 0.0 || self.slope_high < 0.0
    }

    /// Sessions until the line reaches `limit` in the direction of its slope, 0
    /// if it is there; none if it does not lead there.
    #[must_use]
    pub fn sessions_until(&self, limit: &Band) -> Option<f64> {
        let room = if self.slope > 0.0 { limit.high - self.level } else { self.level - limit.low };
        if room <= 0.0 {
            return Some(0.0);
        }
        (self.slope != 0.0).then(|| room / self.slope.abs())
    }
}

/// The slopes between every two points.
fn slopes(points: &[(f64, f64)]) -> Vec<f64> {
    let mut slopes = Vec::with_capacity(points.len() * (points.len() - 1) / 2);
    for (k, (i, a)) in points.iter().enumerate() {
        slopes.extend(points[k + 1..].iter().map(|(j, b)| (b - a) / (j - i)));
    }
    slopes
}

/// Sen's interval (Sen 1968, J. Am. Stat. Assoc. 63, eq. 2.6, with the normal
/// approximation of his section 3): the slopes C/2 ranks on either side of the
/// middle, C = z √(n(n−1)(2n+5)/18) being the quantile of Kendall's S.
/// `slopes` are ascending, of `n` points.
fn confidence(slopes: &[f64], n: usize) -> (f64, f64) {
    let n = n as f64;
    let spread = QUANTILE * (n * (n - 1.0) * (2.0 * n + 5.0) / 18.0).sqrt();
    let n_slopes = slopes.len() as f64;
    let below = ((n_slopes - spread) / 2.0).floor();
    let above = ((n_slopes + spread) / 2.0).ceil();
    let at = |rank: f64| slopes[(rank.max(0.0) as usize).min(slopes.len() - 1)];
    (if below < 1.0 { slopes[0] } else { at(below - 1.0) }, at(above))
}

/// Between which an estimate is no fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    pub low: f64,
    /// What it usually is.
    pub nominal: f64,
    pub high: f64,
}

impl Band {
    /// The same room on either side of another nominal value.
    #[must_use]
    pub fn about(&self, nominal: f64) -> Self {
        let by = nominal - self.nominal;
        Self { low: self.low + by, nominal, high: self.high + by }
    }

    /// How far `value` is on its way from nominal to the limit on its side: 0
    /// to 1, and more beyond it.
    #[must_use]
    pub fn share(&self, value: f64) -> f64 {
        let away = value - self.nominal;
        let room = if away >= 0.0 { self.high - self.nominal } else { self.low - self.nominal };
        if away == 0.0 { 0.0 } else { away / room }
    }
}

/// Why a trend is warned of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Warning {
    /// The line reaches the limit within so many sessions.
    Crosses { sessions: f64 },
    /// It has gone this share of the way to the limit, a half or more, whether
    /// or not it goes on.
    Drifted { share: f64 },
}

/// What is to be said of a trend with the limits of `band`, looking `horizon`
/// sessions ahead. A line that may as well be level is said nothing of, unless
/// its level is surely beyond half the limit.
#[must_use]
pub fn warning(trend: &Trend, band: &Band, horizon: f64) -> Option<Warning> {
    let until = trend.sessions_until(band).filter(|&sessions| sessions <= horizon);
    if let Some(sessions) = until.filter(|_| trend.is_significant()) {
        return Some(Warning::Crosses { sessions });
    }
    // The nearer end of the level's confidence decides.
    let away = trend.level - band.nominal;
    let least = (away.abs() - QUANTILE * trend.level_error).max(0.0) * away.signum();
    let share = band.share(trend.level);
    (band.share(band.nominal + least) > DRIFT_SHARE).then_some(Warning::Drifted { share })
}

#[cfg(test)]
mod tests;
