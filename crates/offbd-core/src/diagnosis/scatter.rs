//! How far readings scatter about their neighbours.
//!
//! Each reading is held against the line between the one before and the one
//! after it: what is left is noise, for a ball's path hardly bends between
//! three readings. Unlike the scatter about a curve over a whole window it does
//! not take a push for noise, which bends the path at one reading only.

#[cfg(not(feature = "std"))]
use crate::no_std::*;

/// Memory, s: several readings of a slow camera.
const MEMORY_S: f64 = 0.4;

/// Standard deviation of a normal error over its mean size.
const NORMAL: f64 = 1.253_314_137_315_500_3;

/// What one reading may add to the scatter, in limits of it.
const MOST_OF_ONE: f64 = 2.0;

/// Uncertainty of the time of a reading, in sample periods. Assumed: the varied
/// rigs that are soaked draw one of up to 0.15 (`simulation::variety`).
const TIMING_SHARE: f64 = 0.1;
/// The same of a sensor that is logged faster than it reads: its readings wait for
/// the next row, any share of a period, of which 1/√12 is the standard deviation.
const HELD_SHARE: f64 = 0.29;
/// Share of a·T² that is scatter, for readings T apart on a path that bends by a
/// between three of them: 0.41 if it did so all the time.
const BEND_SHARE: f64 = 0.25;

/// By how far a reading blurs, m, of a ball at `speed_m_s`: as far as it moves within
/// the uncertainty of the reading's time. `held` readings wait for the next row.
#[must_use]
pub fn blur_m(speed_m_s: f64, period_s: f64, held: bool) -> f64 {
    speed_m_s * period_s * if held { HELD_SHARE } else { TIMING_SHARE }
}

/// By how much the path may bend between three readings, m, where the ball's
/// acceleration is off the twin's by `off_m_s2`.
#[must_use]
pub fn bend_m(off_m_s2: f64, period_s: f64) -> f64 {
    BEND_SHARE * off_m_s2 * period_s * period_s
}

/// The scatter of one axis' readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scatter {
    before: Option<(f64, f64)>,
    last: Option<(f64, f64)>,
    /// Mean size of what is left, m, with fading memory, and its weight.
    size_m: f64,
    weight: f64,
}

impl Scatter {
    /// Takes the deviation of a reading at `t` s from what was expected, m. What
    /// is left counts as twice the limit of the scatter at most, so that no single
    /// reading makes a noise.
    pub fn take(&mut self, t: f64, deviation_m: f64, limit_m: f64) {
        if let (Some((t0, y0)), Some((t1, y1))) = (self.before, self.last) {
            let (early, late) = (t1 - t0, t - t1);
            let (u, v) = (late / (early + late), early / (early + late));
            // The variance of what is left, in variances of a reading.
            let share = (1.0 + u * u + v * v).sqrt();
            let left =
                (y1 - u * y0 - v * deviation_m).abs().min(share * MOST_OF_ONE * limit_m) / share;
            let fade = MEMORY_S / (MEMORY_S + late);
            self.size_m = fade * self.size_m + (1.0 - fade) * left;
            self.weight = fade * self.weight + (1.0 - fade);
        }
        (self.before, self.last) = (self.last, Some((t, deviation_m)));
    }

    /// Standard deviation of the readings, m; none from too few.
    #[must_use]
    pub fn deviation_m(&self) -> Option<f64> {
        (self.weight > 0.5).then(|| NORMAL * self.size_m / self.weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The scatter of a path read with ±`noise` in turns of three.
    fn of(noise: f64, path: impl Fn(f64) -> f64) -> f64 {
        let mut scatter = Scatter::default();
        for i in 0..200 {
            let t = f64::from(i) * 0.01;
            // Uniform over [−√3, √3] noise deviations: deviation one.
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
    fn a_push_and_a_bend_are_no_noise() {
        let bent = of(1e-4, |t| t * t / 2.0);
        let pushed = of(1e-4, |t| 0.5 * (t - 1.9).max(0.0));
        assert!(bent < 1.5e-4 && pushed < 1.5e-4, "{bent} {pushed}");
    }
}
