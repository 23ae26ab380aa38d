//! Stiff systems, for the implicit methods.

use offbd_core::maths::System;

/// A system with an analytic Jacobian, for the implicit methods.
pub trait Stiff<const N: usize>: System<N> {
    /// Returns `∂f[i]/∂y[j]` at (t, y), as `[i][j]`.
    fn jacobian(&self, t: f64, y: &[f64; N]) -> [[f64; N]; N];
}
