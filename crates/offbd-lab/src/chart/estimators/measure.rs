//! Measures one estimator against the truth: error, delay and cost.

use std::hint::black_box;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::family::Family;
use super::signal;
use crate::timing::{CpuTime, cpu_time};

/// Settling time of the estimators, not evaluated, s; chosen.
const SETTLE_S: f64 = 5.0;

/// Longest delay searched for, s; chosen.
const LONGEST_S: f64 = 1.2;

/// Number of readings from which the delay is estimated. Chosen: enough to include every
/// step of the signal.
const DELAY_READINGS: usize = 2500;

/// Number of readings in one timed run; chosen.
const TIMED: usize = 2000;

/// A test signal: true and noisy positions at a constant rate.
pub(super) struct TestSignal {
    pub(super) rate_hz: f64,
    pub(super) noise_m: f64,
    truth: Vec<f64>,
    noisy: Vec<f64>,
}

/// Delay and errors of an estimator.
#[derive(Clone, Copy, Debug)]
pub(super) struct EstimatorErrors {
    /// Delay of the truth at which it agrees best with the estimate from noiseless
    /// positions, s.
    pub(super) delay_s: f64,
    /// Rms error against the truth delayed by `delay_s`, m/s².
    pub(super) error: f64,
    /// Rms error against the truth without delay, m/s².
    pub(super) undelayed: f64,
    /// Rms error without noise, m/s².
    pub(super) distortion: f64,
    /// Rms of the noise of the estimate, m/s².
    pub(super) noise: f64,
}

impl TestSignal {
    /// Creates a signal of `seconds` at `rate_hz`, with white noise of `noise_m` rms drawn
    /// by `seed`.
    pub(super) fn new(rate_hz: f64, noise_m: f64, seconds: f64, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let times = (0..(seconds * rate_hz) as usize).map(|k| k as f64 / rate_hz);
        let truth: Vec<f64> = times.map(signal::position).collect();
        let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
        let noisy = truth.iter().map(|x| x + noise_m * noise()).collect();
        Self { rate_hz, noise_m, truth, noisy }
    }

    /// Returns times and values of the estimates from `positions`, after settling.
    fn estimates(&self, family: Family, value: f64, positions: &[f64]) -> Option<Vec<(f64, f64)>> {
        let period_s = 1.0 / self.rate_hz;
        let mut estimator = family.build(value, period_s, self.noise_m)?;
        let timed = positions.iter().enumerate().map(|(k, &x)| (k as f64 * period_s, x));
        let all = timed.filter_map(|(t, x)| Some((t, estimator.update(x)?)));
        Some(all.filter(|(t, _)| *t >= SETTLE_S).collect())
    }

    /// Measures `family` at the tuning `value`; `None` if it cannot be created.
    pub(super) fn measure(&self, family: Family, value: f64) -> Option<EstimatorErrors> {
        let clean = self.estimates(family, value, &self.truth)?;
        let noisy = self.estimates(family, value, &self.noisy)?;
        let delay_s = delay(&clean);
        let noise = rms(clean.iter().zip(&noisy).map(|(c, n)| n.1 - c.1));
        Some(EstimatorErrors {
            delay_s,
            error: disagreement(&noisy, delay_s),
            undelayed: disagreement(&noisy, 0.0),
            distortion: disagreement(&clean, delay_s),
            noise,
        })
    }

    /// Measures the CPU time per sample.
    pub(super) fn cost(&self, family: Family, value: f64, repeats: usize) -> Option<CpuTime> {
        let mut estimator = family.build(value, 1.0 / self.rate_hz, self.noise_m)?;
        let positions = &self.noisy[..self.noisy.len().min(TIMED)];
        let run = cpu_time(repeats, || {
            for &x in positions {
                black_box(estimator.update(black_box(x)));
            }
        });
        let n = positions.len() as f64;
        Some(CpuTime { minimum_s: run.minimum_s / n, median_s: run.median_s / n })
    }
}

/// Returns the rms of the truth over the evaluated part, m/s²: the error of an estimate
/// that is always zero.
pub(super) fn error_of_zero(seconds: f64) -> f64 {
    let n = ((seconds - SETTLE_S) * 1e3) as usize;
    rms((0..n).map(|k| signal::acceleration(SETTLE_S + k as f64 * 1e-3)))
}

/// Returns the delay at which the truth agrees best: the best on a grid of 10 ms, refined
/// by golden-section search to 0.1 ms.
fn delay(clean: &[(f64, f64)]) -> f64 {
    let stride = clean.len().div_ceil(DELAY_READINGS).max(1);
    let few: Vec<(f64, f64)> = clean.iter().step_by(stride).copied().collect();
    let grid = (-5..=(LONGEST_S * 100.0) as i32).map(|k| f64::from(k) * 0.01);
    let scored = grid.map(|d| (d, disagreement(&few, d)));
    let best = scored.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |(d, _)| d);
    let (mut low, mut high) = (best - 0.01, best + 0.01);
    let golden = (5_f64.sqrt() - 1.0) / 2.0;
    while high - low > 1e-4 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if disagreement(&few, a) < disagreement(&few, b) { high = b } else { low = a }
    }
    low.midpoint(high)
}

fn disagreement(estimates: &[(f64, f64)], delay_s: f64) -> f64 {
    rms(estimates.iter().map(|(t, a)| a - signal::acceleration(t - delay_s)))
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0_u32), |(sum, n), v| (sum + v * v, n + 1));
    (sum / f64::from(n)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimators::EvaluationPoint;

    /// At 200 Hz without noise: a symmetric window delays by half its length, the raw second
    /// difference by one sample. The noise agrees with the theoretical gain.
    #[test]
    fn validate_delay_and_noise_of_known_filters() {
        let recording = TestSignal::new(200.0, 5e-4, 40.0, 3);
        let golay = Family::SavitzkyGolay { order: 4, at: EvaluationPoint::Centre };
        for (family, value, wanted_s) in [
            (Family::SlidingFit, 0.3, 0.15),
            (golay, 0.3, 0.15),
            (Family::Difference, 0.01, 0.005),
            (Family::Averages, 0.295, 0.1475),
        ] {
            let found = recording.measure(family, value).unwrap();
            assert!((found.delay_s - wanted_s).abs() < 2e-3, "{family:?}: {found:?}");
        }
        // 7000 readings, correlated within a window of 61: a tolerance of 20 %.
        let n = 61.0_f64;
        let gain = (720.0 / (n * (n * n - 1.0) * (n * n - 4.0))).sqrt() * 200.0 * 200.0;
        let found = recording.measure(Family::SlidingFit, 0.3).unwrap();
        assert!((found.noise / (gain * 5e-4) - 1.0).abs() < 0.2, "{found:?}");
        let parts = found.noise.hypot(found.distortion);
        assert!((found.error / parts - 1.0).abs() < 0.1, "{found:?}");
    }
}
