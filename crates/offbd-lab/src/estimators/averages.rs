use super::Estimator;
use super::history::History;

/// The second difference of three adjacent means of `n` positions each,
/// a = (x̄₀ − 2 x̄₁ + x̄₂)/(nT)²: a moving average, differenced over its own length.
/// Delay (3n − 1)T/2; σ_a = √(6/n) σ/(nT)².
///
/// The sums are updated with each position, and recomputed once per window, which keeps
/// rounding errors from accumulating.
#[derive(Clone, Debug)]
pub struct Averages {
    history: History,
    n: usize,
    sums: [f64; 3],
    since_afresh: usize,
    per_cube: f64,
}

impl Averages {
    /// Creates the estimator for positions every `period_s`, with means over `n`, at
    /// least 1.
    #[must_use]
    pub fn new(n: usize, period_s: f64) -> Self {
        let n = n.max(1);
        let per_cube = 1.0 / (n as f64 * (n as f64 * period_s).powi(2));
        // One more than the means contain: the position that leaves the window.
        Self { history: History::new(3 * n + 1), n, sums: [0.0; 3], since_afresh: 0, per_cube }
    }

    fn slide(&mut self) {
        for (i, sum) in self.sums.iter_mut().enumerate() {
            *sum += self.history.ago(i * self.n) - self.history.ago((i + 1) * self.n);
        }
        self.since_afresh += 1;
        if self.since_afresh >= 3 * self.n {
            self.sum_afresh();
        }
    }

    fn sum_afresh(&mut self) {
        let n = self.n;
        for (i, sum) in self.sums.iter_mut().enumerate() {
            *sum = (i * n..(i + 1) * n).map(|k| self.history.ago(k)).sum();
        }
        self.since_afresh = 0;
    }
}

impl Estimator for Averages {
    fn update(&mut self, position: f64) -> Option<f64> {
        self.history.push(position);
        self.slide();
        let [newest, middle, oldest] = self.sums;
        self.history.is_full().then_some((newest - 2.0 * middle + oldest) * self.per_cube)
    }
}

#[cfg(test)]
mod tests {
    use super::super::check::{last, noise_gain};
    use super::*;

    #[test]
    fn validate_a_parabola_is_exact_and_noise_falls_with_the_mean() {
        for n in [1, 2, 7] {
            let found = last(&mut Averages::new(n, 0.01), 1000, |k| 1.5 * (0.01 * k).powi(2));
            assert!((found - 3.0).abs() < 1e-7, "{found}");
            let gain = noise_gain(&mut Averages::new(n, 0.01), 100);
            let wanted = (6.0 / n as f64).sqrt() / (0.01 * n as f64).powi(2);
            assert!((gain / wanted - 1.0).abs() < 1e-9, "{gain} {wanted}");
        }
    }

    /// The updated sums agree with their definition at every sample.
    #[test]
    fn sliding_sums_equal_their_definition() {
        let mut averages = Averages::new(5, 1.0);
        let path: Vec<f64> = (0..200).map(|k| f64::from(k * k * 7 % 31)).collect();
        for (k, &x) in path.iter().enumerate() {
            let Some(found) = averages.update(x) else { continue };
            let mean = |i: usize| path[k + 1 - 5 * (i + 1)..=k - 5 * i].iter().sum::<f64>() / 5.0;
            let wanted = (mean(0) - 2.0 * mean(1) + mean(2)) / 25.0;
            assert!((found - wanted).abs() < 1e-12, "{k}: {found} {wanted}");
        }
    }
}
