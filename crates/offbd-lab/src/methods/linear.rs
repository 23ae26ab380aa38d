//! Solves small dense linear systems with the structure of equations of motion: the
//! derivatives of positions are states themselves.
//!
//! A step with Gaussian elimination of fixed size that uses this structure takes about
//! two thirds of the time of one with `nalgebra`'s general LU decomposition, measured on
//! the nine states of the compliant model.
#![expect(clippy::needless_range_loop, reason = "indices of a matrix, as in the textbook")]

use offbd_core::maths::System;

/// The LU decomposition of W = I/g − J for a system in which the derivatives of the
/// first P states are the next P states. The rows of the positions,
/// `u_p/g − u_v = r_p`, are eliminated analytically, which leaves N − P unknowns to
/// Gaussian elimination with partial pivoting.
pub(super) struct LuFactors<const N: usize> {
    positions: usize,
    g: f64,
    /// Rows and columns from P on: L below the diagonal, U on and above it.
    lu: [[f64; N]; N],
    pivots: [usize; N],
    /// 1/U on the diagonal.
    inverse: [f64; N],
    /// ∂f/∂p of the rows from P on.
    by_position: [[f64; N]; N],
}

impl<const N: usize> LuFactors<N> {
    /// Decomposes I/g − `jacobian`, g > 0; returns `None` if it is singular.
    #[inline]
    pub(super) fn new<F: System<N>>(jacobian: &[[f64; N]; N], g: f64) -> Option<Self> {
        let p = F::POSITIONS;
        let mut lu = [[0.0; N]; N];
        for i in p..N {
            for j in p..N {
                let through = if j < 2 * p { g * jacobian[i][j - p] } else { 0.0 };
                lu[i][j] = -jacobian[i][j] - through;
            }
            lu[i][i] += 1.0 / g;
        }
        let (mut pivots, mut inverse) = (std::array::from_fn(|i| i), [0.0; N]);
        for k in p..N {
            let pivot = (k..N).max_by(|&a, &b| lu[a][k].abs().total_cmp(&lu[b][k].abs()))?;
            lu.swap(k, pivot);
            pivots[k] = pivot;
            inverse[k] = 1.0 / lu[k][k];
            if !inverse[k].is_finite() {
                return None;
            }
            let row = lu[k];
            for below in &mut lu[k + 1..] {
                let factor = below[k] * inverse[k];
                below[k] = factor;
                for j in k + 1..N {
                    below[j] -= factor * row[j];
                }
            }
        }
        Some(Self { positions: p, g, lu, pivots, inverse, by_position: *jacobian })
    }

    /// Returns the solution u of W·u = `right`.
    #[inline]
    pub(super) fn solve(&self, right: &[f64; N]) -> [f64; N] {
        let (p, mut u) = (self.positions, *right);
        for i in p..N {
            for j in 0..p {
                u[i] += self.g * self.by_position[i][j] * right[j];
            }
        }
        for k in p..N {
            u.swap(k, self.pivots[k]);
        }
        for k in p..N {
            let value = u[k];
            for i in k + 1..N {
                u[i] -= self.lu[i][k] * value;
            }
        }
        for k in (p..N).rev() {
            u[k] *= self.inverse[k];
            let value = u[k];
            for i in p..k {
                u[i] -= self.lu[i][k] * value;
            }
        }
        for i in 0..p {
            u[i] = self.g * (right[i] + u[i + p]);
        }
        u
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    struct Any;

    impl System<5> for Any {
        const POSITIONS: usize = 2;

        fn rate(&self, _: f64, y: &[f64; 5]) -> [f64; 5] {
            *y
        }
    }

    proptest! {
        #[test]
        fn the_solution_solves(
            rows in prop::array::uniform3(prop::array::uniform5(-1e3..1e3_f64)),
            right in prop::array::uniform5(-1.0..1.0_f64), g in 1e-6..1e-2_f64,
        ) {
            let mut j = [[0.0; 5]; 5];
            (j[0][2], j[1][3]) = (1.0, 1.0);
            j[2..].copy_from_slice(&rows);
            let u = LuFactors::new::<Any>(&j, g).unwrap().solve(&right);
            for i in 0..5 {
                let sum: f64 = (0..5).map(|k| (f64::from(i == k) / g - j[i][k]) * u[k]).sum();
                let size: f64 = (0..5).map(|k| ((f64::from(i == k) / g - j[i][k]) * u[k]).abs()).sum();
                prop_assert!((sum - right[i]).abs() <= 1e-12 * (1.0 + size));
            }
        }
    }
}
