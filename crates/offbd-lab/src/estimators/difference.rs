use super::Estimator;
use super::history::History;

/// The second difference of positions `m` samples apart,
/// a = (x(t) − 2 x(t − mT) + x(t − 2mT))/(mT)². Delay mT; σ_a = √6 σ/(mT)².
#[derive(Clone, Debug)]
pub struct Difference {
    history: History,
    m: usize,
    per_square: f64,
}

impl Difference {
    /// Creates the estimator for positions every `period_s`, with a spacing of `m` of
    /// them, at least 1.
    #[must_use]
    pub fn new(m: usize, period_s: f64) -> Self {
        let m = m.max(1);
        let per_square = (m as f64 * period_s).powi(-2);
        Self { history: History::new(2 * m + 1), m, per_square }
    }
}

impl Estimator for Difference {
    fn update(&mut self, position: f64) -> Option<f64> {
        self.history.push(position);
        let h = &self.history;
        let difference = || position - 2.0 * h.ago(self.m) + h.ago(2 * self.m);
        h.is_full().then(|| difference() * self.per_square)
    }
}

#[cfg(test)]
mod tests {
    use super::super::check::{last, noise_gain};
    use super::*;

    #[test]
    fn validate_a_parabola_is_exact_and_noise_grows_as_root_six() {
        for m in [1, 4] {
            let found = last(&mut Difference::new(m, 0.01), 50, |k| 0.5 * 3.0 * (0.01 * k).powi(2));
            assert!((found - 3.0).abs() < 1e-9, "{found}");
            let gain = noise_gain(&mut Difference::new(m, 0.01), 50);
            let wanted = 6_f64.sqrt() / (0.01 * m as f64).powi(2);
            assert!((gain / wanted - 1.0).abs() < 1e-12, "{gain} {wanted}");
        }
    }
}
