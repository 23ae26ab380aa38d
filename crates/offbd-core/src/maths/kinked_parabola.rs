//! Least-squares fit of a parabola with at most one kink.
//!
//! A path under a steady unknown acceleration is a parabola; a push at an unknown moment
//! changes its slope there. The residual of such a fit is due to neither.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use nalgebra::{Matrix3, Vector3};

/// Parameters of the curve: three of the parabola, position and size of the kink.
const CURVE_PARAMETERS: usize = 5;

/// Returns the root mean square residual of `points` (time, value), ascending in time,
/// about the best-fitting parabola with at most one kink.
///
/// The kink lies at one of the points and is followed by at least two others: a single
/// one does not determine a new slope. Returns `None` for fewer than six points, or if
/// they lie too close together to determine a parabola.
///
/// A kink at t_j adds β·(t − t_j)₊ to the parabola. All kinks are solved for in one pass
/// over sums of the points after t_j (Frisch & Waugh 1933).
#[must_use]
pub fn kinked_parabola_rms(points: &[(f64, f64)]) -> Option<f64> {
    let n = points.len();
    if n <= CURVE_PARAMETERS {
        return None;
    }
    // Times relative to the middle keep their powers small.
    let ((t0, _), (_, y0)) = (points[n / 2], points[0]);
    let about = |&(t, y): &(f64, f64)| (t - t0, y - y0);
    let (mut powers, mut right, mut squares) = ([0.0; 5], Vector3::zeros(), 0.0);
    for (t, y) in points.iter().map(about) {
        let mut power = 1.0;
        for sum in &mut powers {
            *sum += power;
            power *= t;
        }
        right += y * Vector3::new(1.0, t, t * t);
        squares += y * y;
    }
    let [p0, p1, p2, p3, p4] = powers;
    let inverse = Matrix3::new(p0, p1, p2, p1, p2, p3, p2, p3, p4).try_inverse()?;
    let parabola = inverse * right;
    let left = squares - parabola.dot(&right);
    let (mut after, mut after_y, mut explained) = ([0.0; 4], [0.0; 2], 0.0_f64);
    for j in (1..n - 1).rev() {
        let (t, y) = about(&points[j + 1]);
        let mut power = 1.0;
        for sum in &mut after {
            *sum += power;
            power *= t;
        }
        after_y = [after_y[0] + y, after_y[1] + y * t];
        if j + 2 == n {
            continue;
        }
        let (k, [s0, s1, s2, s3]) = (points[j].0 - t0, after);
        let shared = Vector3::new(s1 - k * s0, s2 - k * s1, s3 - k * s2);
        let own = s2 - 2.0 * k * s1 + k * k * s0 - shared.dot(&(inverse * shared));
        let pulled = after_y[1] - k * after_y[0] - shared.dot(&parabola);
        if own > f64::EPSILON * p2 {
            explained = explained.max(pulled * pulled / own);
        }
    }
    Some(((left - explained).max(0.0) / (n - CURVE_PARAMETERS) as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    fn points(n: usize, of: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        // Far from zero, like times of day.
        (0..n).map(|i| 5000.0 + 0.1 * i as f64).map(|t| (t, of(t - 5000.0))).collect()
    }

    #[test]
    fn a_parabola_with_a_kink_leaves_nothing() {
        let path = |t: f64| 0.3 - 0.2 * t + 0.5 * t * t + 0.4 * (t - 0.7).max(0.0);
        assert!(kinked_parabola_rms(&points(20, path)).unwrap() < 1e-9);
        let two = |t: f64| path(t) - 0.8 * (t - 1.3).max(0.0);
        assert!(kinked_parabola_rms(&points(20, two)).unwrap() > 0.01);
    }

    #[test]
    fn too_little_is_nothing() {
        assert_eq!(kinked_parabola_rms(&points(5, |t| t)), None);
        assert_eq!(kinked_parabola_rms(&[(1.0, 2.0); 9]), None);
    }

    /// Reference: an ordinary least-squares fit for every admissible kink.
    fn by_trying(points: &[(f64, f64)]) -> f64 {
        let n = points.len();
        let values = DVector::from_iterator(n, points.iter().map(|p| p.1));
        let left = |j: usize| {
            let row = |i: usize, k: usize| match k {
                3 => (points[i].0 - points[j].0).max(0.0),
                power => (points[i].0 - 5000.5).powi(power as i32),
            };
            let curve = DMatrix::from_fn(n, 4, row);
            let found = curve.clone().svd(true, true).solve(&values, 1e-12).unwrap();
            (curve * found - &values).norm_squared()
        };
        let least = (1..n - 2).map(left).fold(f64::INFINITY, f64::min);
        (least / (n - CURVE_PARAMETERS) as f64).sqrt()
    }

    proptest! {
        #[test]
        fn agrees_with_least_squares_at_every_kink(
            values in prop::collection::vec(-0.1..0.1f64, 8..24)
        ) {
            let points = points(values.len(), |t| values[(t / 0.1).round() as usize]);
            let (fast, slow) = (kinked_parabola_rms(&points).unwrap(), by_trying(&points));
            prop_assert!((fast - slow).abs() < 1e-6, "{fast}, not {slow}");
        }
    }
}
