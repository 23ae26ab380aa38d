//! The scatter of readings about their neighbours.
//!
//! Each reading is compared with the line between its predecessor and its successor. The
//! residual is noise, since a ball's path hardly bends between three readings. Unlike the
//! scatter about a curve over a whole window, it does not take a push for noise, which
//! bends the path at one reading only.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use serde::{Deserialize, Serialize};

/// Time constant, s: several readings of a slow camera. Chosen.
const SCATTER_MEMORY_S: f64 = 0.4;

/// Standard deviation over mean absolute value of a normal distribution: √(π/2).
const DEVIATION_PER_MEAN: f64 = 1.253_314_137_315_500_3;

/// Most that one reading contributes, in multiples of the scatter's limit. Chosen, so
/// that no single reading exceeds the limit.
const MOST_OF_ONE_READING: f64 = 2.0;

/// Accumulated weight from which on the scatter is reported. Chosen.
const LEAST_WEIGHT: f64 = 0.5;

/// Standard deviation of the time of a reading, in sample periods. Assumed: the simulated
/// rigs of `offbd soak` draw up to 0.15 (`simulation::variety`).
const TIMING_SHARE: f64 = 0.1;
/// Standard deviation of the time of a reading of a sensor that is slower than its log,
/// in sample periods: 1/√12, because the reading waits for the next row for any fraction
/// of a period.
const HELD_SHARE: f64 = 0.29;
/// Scatter caused by acceleration, as a fraction of a·T² for readings T apart whose path
/// bends by a. Chosen: 1/√6 = 0.41 would be a path that bends by a all the time.
const BEND_SHARE: f64 = 0.25;

/// Returns the blur of a reading of a ball at `speed_m_s`, m: how far it moves within the
/// uncertainty of the reading's time. `held` readings wait for the next row.
#[must_use]
pub fn blur_m(speed_m_s: f64, period_s: f64, held: bool) -> f64 {
    speed_m_s * period_s * if held { HELD_SHARE } else { TIMING_SHARE }
}

/// Returns the bend of the path between three readings, m, if the ball's acceleration
/// differs from the twin's by `off_m_s2`.
#[must_use]
pub fn bend_m(off_m_s2: f64, period_s: f64) -> f64 {
    BEND_SHARE * off_m_s2 * period_s * period_s
}

/// The scatter of the readings of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scatter {
    before: Option<(f64, f64)>,
    last: Option<(f64, f64)>,
    /// Weighted mean absolute residual, m, with fading memory, and its weight.
    size_m: f64,
    weight: f64,
}

impl Scatter {
    /// Takes the deviation of a reading at `t` s from the prediction, m. The residual
    /// counts as at most twice the limit of the scatter, so that no single reading makes
    /// noise.
    pub fn take(&mut self, t: f64, deviation_m: f64, limit_m: f64) {
        if let (Some((t0, y0)), Some((t1, y1))) = (self.before, self.last) {
            let (early, late) = (t1 - t0, t - t1);
            let (u, v) = (late / (early + late), early / (early + late));
            // The variance of the residual, in variances of a reading.
            let share = (1.0 + u * u + v * v).sqrt();
            let left =
                (y1 - u * y0 - v * deviation_m).abs().min(share * MOST_OF_ONE_READING * limit_m)
                    / share;
            let fade = SCATTER_MEMORY_S / (SCATTER_MEMORY_S + late);
            self.size_m = fade * self.size_m + (1.0 - fade) * left;
            self.weight = fade * self.weight + (1.0 - fade);
        }
        (self.before, self.last) = (self.last, Some((t, deviation_m)));
    }

    /// Standard deviation of the readings, m; `None` for too few readings.
    #[must_use]
    pub fn deviation_m(&self) -> Option<f64> {
        (self.weight > LEAST_WEIGHT).then(|| DEVIATION_PER_MEAN * self.size_m / self.weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The scatter found for a path with uniform noise of standard deviation `noise`.
    fn of(noise: f64, path: impl Fn(f64) -> f64) -> f64 {
        let mut scatter = Scatter::default();
        for i in 0..200 {
            let t = f64::from(i) * 0.01;
            // Uniform over ±√3, which has unit deviation.
            let unit = 2.0 * ((f64::from(i) * 12.9898).sin() * 43_758.545).rem_euclid(1.0) - 1.0;
            scatter.take(t, path(t) + noise * 3.0_f64.sqrt() * unit, 5.0 * noise);
        }
        scatter.deviation_m().unwrap()
    }

    #[test]
    fn validate_the_deviation_of_known_noise() {
        let found = of(1e-3, |_| 0.0);
        // Forty readings, each in three of the differences.
        assert!((found / 1e-3 - 1.0).abs() < 0.3, "{found}");
    }

    #[test]
    fn a_push_and_a_bend_are_not_noise() {
        let bent = of(1e-4, |t| t * t / 2.0);
        let pushed = of(1e-4, |t| 0.5 * (t - 1.9).max(0.0));
        assert!(bent < 1.5e-4 && pushed < 1.5e-4, "{bent} {pushed}");
    }
}
