//! The families of estimators compared, and the range of their tunings.

use crate::estimators::{
    Averages, Butterworth, Difference, Estimator, EvaluationPoint, Kalman, SavitzkyGolay,
    SlidingFit,
};

/// A family of estimators with one tuning parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Family {
    Difference,
    Averages,
    SlidingFit,
    SavitzkyGolay { order: usize, at: EvaluationPoint },
    Butterworth,
    Kalman,
}

/// All families measured, in the order of the legend.
pub(super) const FAMILIES: [Family; 10] = [
    Family::SlidingFit,
    Family::Kalman,
    Family::Averages,
    Family::SavitzkyGolay { order: 4, at: EvaluationPoint::Centre },
    Family::SavitzkyGolay { order: 3, at: EvaluationPoint::End },
    Family::Butterworth,
    Family::Difference,
    Family::SavitzkyGolay { order: 2, at: EvaluationPoint::Centre },
    Family::SavitzkyGolay { order: 3, at: EvaluationPoint::Centre },
    Family::SavitzkyGolay { order: 4, at: EvaluationPoint::End },
];

/// Number of families drawn. Of the others, two have the errors of the quadratic fit, and
/// order 4 at the end is worse than order 3.
pub(super) const DRAWN: usize = 7;

impl Family {
    pub(super) fn name(self) -> String {
        match self {
            Self::Difference => "second difference".to_owned(),
            Self::Averages => "moving average, differenced".to_owned(),
            Self::SlidingFit => "quadratic fit".to_owned(),
            Self::SavitzkyGolay { order, at } => {
                let at = if at == EvaluationPoint::Centre { "centre" } else { "end" };
                format!("Savitzky–Golay {order}, {at}")
            }
            Self::Butterworth => "Butterworth, differenced".to_owned(),
            Self::Kalman => "Kalman".to_owned(),
        }
    }

    /// Returns the name of the tuning parameter, with its unit.
    pub(super) const fn setting(self) -> &'static str {
        match self {
            Self::Butterworth => "cutoff_hz",
            Self::Kalman => "jerk_density_m2_s5",
            _ => "window_s",
        }
    }

    /// Returns a value of the tuning parameter with its unit.
    pub(super) fn tuning(self, value: f64) -> String {
        match self {
            Self::Butterworth => format!("{value:.2} Hz"),
            Self::Kalman => format!("{value:.2} m²/s⁵"),
            _ => format!("{:.0} ms", value * 1e3),
        }
    }

    /// Returns up to `n` values of the tuning parameter, from fast to smooth, without those
    /// that are equal at this sampling period.
    pub(super) fn sweep(self, n: usize, period_s: f64) -> Vec<f64> {
        let mut values = match self {
            Self::Butterworth => {
                let most_hz = (0.2 / period_s).min(12.0);
                spread(n, most_hz, 0.5)
            }
            Self::Kalman => spread(n, 3e3, 1e-3),
            _ => {
                let windows = spread(n, self.least(period_s), 1.0);
                windows.into_iter().map(|w| self.whole(w, period_s)).collect()
            }
        };
        values.dedup();
        values
    }

    /// Returns the shortest window, s.
    fn least(self, period_s: f64) -> f64 {
        let n = match self {
            Self::SavitzkyGolay { order, .. } => order,
            Self::SlidingFit => 4,
            // The raw positions.
            Self::Difference => return 2.0 * period_s,
            _ => 2,
        };
        (n as f64 * period_s).max(0.02)
    }

    /// Returns the nearest window on the grid: an even number of periods from the oldest to
    /// the newest position; for means over n, 3n positions.
    fn whole(self, window_s: f64, period_s: f64) -> f64 {
        let n = window_s / period_s;
        let n = match self {
            Self::Averages => ((n + 1.0) / 3.0).round().max(1.0) * 3.0 - 1.0,
            _ => (n / 2.0).round().max(1.0) * 2.0,
        };
        n * period_s
    }

    /// Creates the estimator for positions every `period_s` with noise of `sigma` (m), which
    /// only the Kalman filter uses.
    pub(super) fn build(self, value: f64, period_s: f64, sigma: f64) -> Option<Box<dyn Estimator>> {
        let n = (value / period_s).round() as usize;
        Some(match self {
            Self::Difference => Box::new(Difference::new(n / 2, period_s)),
            Self::Averages => Box::new(Averages::new((n + 1) / 3, period_s)),
            Self::SlidingFit => Box::new(SlidingFit::new(value, period_s)),
            Self::SavitzkyGolay { order, at } => {
                // Odd, so that the centre is a sample.
                Box::new(SavitzkyGolay::new(order, n | 1, at, period_s)?)
            }
            Self::Butterworth => Box::new(Butterworth::new(value, period_s)),
            Self::Kalman => Box::new(Kalman::new(value, sigma, period_s)),
        })
    }
}

/// Returns `n` logarithmically spaced values from `first` to `last`.
fn spread(n: usize, first: f64, last: f64) -> Vec<f64> {
    let share = |i: usize| i as f64 / (n.max(2) - 1) as f64;
    (0..n).map(|i| first * (last / first).powf(share(i))).collect()
}
