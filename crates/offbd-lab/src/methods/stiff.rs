//! Stiff systems as the implicit methods see them.

use offbd_core::maths::System;

/// A system that knows its Jacobian, for the implicit methods.
pub trait Stiff<const N: usize>: System<N> {
    /// `∂f[i]/∂y[j]` at (t, y), as `[i][j]`.
    fn jacobian(&self, t: f64, y: &[f64; N]) -> [[f64; N]; N];
}
