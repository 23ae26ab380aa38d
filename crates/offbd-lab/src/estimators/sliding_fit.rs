use super::Estimator;
use offbd_core::maths::SlidingQuadratic;

/// The engine's own filter, [`SlidingQuadratic`], for evenly spaced positions: the
/// second derivative of the least-squares quadratic over a window. The delay is half of
/// the window; σ_a = σ/T²·√(720/(n(n²−1)(n²−4))) over n positions.
#[derive(Clone, Debug)]
pub struct SlidingFit {
    filter: SlidingQuadratic,
    window_s: f64,
    period_s: f64,
    n_seen: u64,
    n_window: u64,
}

impl SlidingFit {
    /// Creates the estimator for positions every `period_s` over a window of `window_s`.
    #[must_use]
    pub fn new(window_s: f64, period_s: f64) -> Self {
        // Half a period more, so that rounding of the time stamps drops no position.
        let n_window = (window_s / period_s + 1e-9).floor() as u64 + 1;
        let window_s = (n_window as f64 - 0.5) * period_s;
        Self { filter: SlidingQuadratic::default(), window_s, period_s, n_seen: 0, n_window }
    }
}

impl Estimator for SlidingFit {
    fn update(&mut self, position: f64) -> Option<f64> {
        self.filter.push(self.n_seen as f64 * self.period_s, position, 0.0, self.window_s);
        self.n_seen += 1;
        let full = self.n_seen >= self.n_window;
        full.then(|| self.filter.fit().map(|fit| fit.measured.acceleration)).flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::super::check::{last, noise_gain};
    use super::*;

    #[test]
    fn validate_a_parabola_is_exact_and_noise_as_derived() {
        let found = last(&mut SlidingFit::new(0.3, 0.01), 400, |k| 1.5 * (0.01 * k).powi(2));
        assert!((found - 3.0).abs() < 1e-7, "{found}");
        for (window_s, n) in [(0.04, 5.0_f64), (0.12, 13.0), (0.5, 51.0)] {
            let gain = noise_gain(&mut SlidingFit::new(window_s, 0.01), 200);
            let factor = 720.0 / (n * (n * n - 1.0) * (n * n - 4.0));
            let wanted = factor.sqrt() / 1e-4;
            // The impulse leaves rounding errors in the running sums: up to 1e-6.
            assert!((gain / wanted - 1.0).abs() < 1e-6, "{n}: {gain} {wanted}");
        }
    }
}
