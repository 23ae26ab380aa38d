//! The Savitzky–Golay filter (Savitzky & Golay, *Smoothing and Differentiation of Data
//! by Simplified Least Squares Procedures*, Analytical Chemistry 36 (1964) 1627–1639): a
//! polynomial is fitted to a window by least squares, and its second derivative is
//! evaluated at one point. On an even grid that is one weighted sum per sample.

use nalgebra::{DMatrix, DVector};

use super::Estimator;
use super::history::History;

/// The point of the window at which the fitted polynomial is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EvaluationPoint {
    /// The middle of the window: least noise, a delay of half the window.
    Centre,
    /// The newest position: least delay, most noise.
    End,
}

/// The second derivative of a fitted polynomial; the module documentation describes it.
#[derive(Clone, Debug)]
pub struct SavitzkyGolay {
    history: History,
    weights: Vec<f64>,
}

impl SavitzkyGolay {
    /// Creates the filter for polynomials of `order` over `n` positions, `period_s`
    /// apart. Returns `None` unless 2 ≤ `order` < `n`, or if the normal equations are too
    /// ill-conditioned to be solved.
    #[must_use]
    pub fn new(order: usize, n: usize, at: EvaluationPoint, period_s: f64) -> Option<Self> {
        let mut weights = savitzky_golay_weights(order, n, at)?;
        weights.iter_mut().for_each(|w| *w /= period_s * period_s);
        Some(Self { history: History::new(n), weights })
    }
}

/// Returns the weights, oldest position first, for a spacing of 1; `None` as in
/// [`SavitzkyGolay::new`].
///
/// The abscissae run from −1 to 1, for which powers up to the fifth are well
/// conditioned. With the design matrix A and the row vector d of the powers' second
/// derivatives at the point, the weights are d (AᵀA)⁻¹ Aᵀ.
#[must_use]
pub fn savitzky_golay_weights(order: usize, n: usize, at: EvaluationPoint) -> Option<Vec<f64>> {
    if order < 2 || n <= order {
        return None;
    }
    let half = (n - 1) as f64 / 2.0;
    let design = DMatrix::from_fn(n, order + 1, |i, j| (i as f64 / half - 1.0).powi(j as i32));
    let point: f64 = if at == EvaluationPoint::End { 1.0 } else { 0.0 };
    let second = |j: usize| (j * j.saturating_sub(1)) as f64 * point.powi((j as i32 - 2).max(0));
    let derivative = DVector::from_fn(order + 1, |j, _| second(j));
    let normal = design.transpose() * &design;
    let solved = normal.cholesky()?.solve(&derivative);
    Some((design * solved).iter().map(|w| w / (half * half)).collect())
}

impl Estimator for SavitzkyGolay {
    fn update(&mut self, position: f64) -> Option<f64> {
        self.history.push(position);
        self.history.is_full().then(|| {
            let (older, newer) = self.history.runs();
            let (a, b) = self.weights.split_at(older.len());
            dot(older, a) + dot(newer, b)
        })
    }
}

/// The dot product, in four partial sums to shorten the dependency chain.
fn dot(values: &[f64], weights: &[f64]) -> f64 {
    let (v, v_rest) = values.as_chunks::<4>();
    let (w, w_rest) = weights.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (v, w) in v.iter().zip(w) {
        for k in 0..4 {
            sums[k] += v[k] * w[k];
        }
    }
    let rest: f64 = v_rest.iter().zip(w_rest).map(|(v, w)| v * w).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::super::check::{last, noise_gain};
    use super::*;

    /// The paper's tables for the second derivative, quadratic and cubic: numerators and
    /// norm.
    #[test]
    fn validate_published_weights() {
        let tables: [(usize, &[f64], f64); 3] = [
            (5, &[2.0, -1.0, -2.0, -1.0, 2.0], 7.0),
            (7, &[5.0, 0.0, -3.0, -4.0, -3.0, 0.0, 5.0], 42.0),
            (9, &[28.0, 7.0, -8.0, -17.0, -20.0, -17.0, -8.0, 7.0, 28.0], 462.0),
        ];
        for (n, numerators, norm) in tables {
            for order in [2, 3] {
                let found = savitzky_golay_weights(order, n, EvaluationPoint::Centre).unwrap();
                for (w, numerator) in found.iter().zip(numerators) {
                    assert!((w - numerator / norm).abs() < 1e-12, "{n}, {order}: {found:?}");
                }
            }
        }
        // Quartic over five points: the five-point stencil.
        let found = savitzky_golay_weights(4, 5, EvaluationPoint::Centre).unwrap();
        for (w, numerator) in found.iter().zip([-1.0, 16.0, -30.0, 16.0, -1.0]) {
            assert!((w - numerator / 12.0).abs() < 1e-12, "{found:?}");
        }
    }

    /// A polynomial of the filter's order is reproduced exactly: at the centre with a
    /// delay of half a window, at the end without delay.
    #[test]
    fn validate_polynomials_of_its_order_are_exact() {
        let (n, period) = (21, 0.02);
        let path = |k: f64| {
            let t = k * period - 1.0;
            0.3 - t + 0.5 * t.powi(2) - 0.7 * t.powi(3) + 0.4 * t.powi(4)
        };
        let truth = |k: f64| {
            let t = k * period - 1.0;
            1.0 - 4.2 * t + 4.8 * t * t
        };
        for (at, delay) in [(EvaluationPoint::Centre, 10.0), (EvaluationPoint::End, 0.0)] {
            let mut filter = SavitzkyGolay::new(4, n, at, period).unwrap();
            let found = last(&mut filter, 70, path);
            assert!((found - truth(69.0 - delay)).abs() < 1e-9, "{at:?}: {found}");
        }
    }

    #[test]
    fn validate_the_quadratic_is_the_sliding_fit() {
        let mut filter = SavitzkyGolay::new(2, 51, EvaluationPoint::Centre, 0.01).unwrap();
        let n = 51.0_f64;
        let wanted = (720.0 / (n * (n * n - 1.0) * (n * n - 4.0))).sqrt() / 1e-4;
        let gain = noise_gain(&mut filter, 200);
        assert!((gain / wanted - 1.0).abs() < 1e-9, "{gain} {wanted}");
    }

    #[test]
    fn what_cannot_be_fitted_is_refused() {
        assert!(savitzky_golay_weights(1, 9, EvaluationPoint::End).is_none());
        assert!(savitzky_golay_weights(4, 4, EvaluationPoint::End).is_none());
    }
}
