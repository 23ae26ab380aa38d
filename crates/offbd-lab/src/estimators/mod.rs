//! Estimators of acceleration from positions.
//!
//! Alternatives from the literature to the sliding quadratic fit that the engine uses,
//! to compare error, delay and cost. All take evenly spaced positions and allocate only
//! when they are created. Those with a window return `None` until it is full.

mod averages;
mod butterworth;
mod difference;
mod history;
mod kalman;
mod savitzky_golay;
mod sliding_fit;

pub use averages::Averages;
pub use butterworth::{Butterworth, LowPass};
pub use difference::Difference;
pub use kalman::{Kalman, KalmanGains};
pub use savitzky_golay::{EvaluationPoint, SavitzkyGolay, savitzky_golay_weights};
pub use sliding_fit::SlidingFit;

/// An estimator of acceleration from evenly spaced positions.
pub trait Estimator {
    /// Takes the next position, m. Returns the acceleration, m/s², or `None` until there
    /// are enough positions.
    fn update(&mut self, position: f64) -> Option<f64>;
}

#[cfg(test)]
mod check {
    use super::Estimator;

    /// Returns the last output for positions `path(k)`, k from 0 to `n` − 1.
    pub(super) fn last(estimator: &mut impl Estimator, n: usize, path: impl Fn(f64) -> f64) -> f64 {
        (0..n).filter_map(|k| estimator.update(path(k as f64))).last().unwrap()
    }

    /// Returns the root of the sum of squares of the impulse response, which is σ_a/σ
    /// for white noise. The response must end within `n` samples.
    pub(super) fn noise_gain(estimator: &mut impl Estimator, n: usize) -> f64 {
        for _ in 0..n {
            estimator.update(0.0);
        }
        let response = (0..n).filter_map(|k| estimator.update(f64::from(u8::from(k == 0))));
        response.map(|a| a * a).sum::<f64>().sqrt()
    }
}
