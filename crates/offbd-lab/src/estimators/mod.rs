//! Estimators of acceleration from positions, side by side.
//!
//! What the literature offers beside the sliding quadratic that the engine
//! uses, to compare with: error, delay and cost. All take positions spaced
//! evenly and allocate when they are built only. Those with a window say
//! nothing until it is full.

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
pub use kalman::{Gains, Kalman};
pub use savitzky_golay::{At, SavitzkyGolay, savitzky_golay_weights};
pub use sliding_fit::SlidingFit;

/// An estimator of acceleration from evenly spaced positions.
pub trait Estimator {
    /// Takes the next position, m. Returns the acceleration, m/s², once enough
    /// positions are known.
    fn update(&mut self, position: f64) -> Option<f64>;
}

#[cfg(test)]
mod check {
    use super::Estimator;

    /// The last output for positions `path(k)`, k from 0 to `n` − 1.
    pub(super) fn last(estimator: &mut impl Estimator, n: usize, path: impl Fn(f64) -> f64) -> f64 {
        (0..n).filter_map(|k| estimator.update(path(k as f64))).last().unwrap()
    }

    /// The root of the sum of squares of the impulse response: σ_a/σ for white
    /// noise (the response has died out after `n` of silence).
    pub(super) fn noise_gain(estimator: &mut impl Estimator, n: usize) -> f64 {
        for _ in 0..n {
            estimator.update(0.0);
        }
        let response = (0..n).filter_map(|k| estimator.update(f64::from(u8::from(k == 0))));
        response.map(|a| a * a).sum::<f64>().sqrt()
    }
}
