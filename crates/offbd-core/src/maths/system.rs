//! The interface of a system of differential equations.

/// y' = f(t, y) with N states, of which the first `POSITIONS` are positions and the next
/// `POSITIONS` their rates: `y[i]' = y[i + POSITIONS]`.
pub trait System<const N: usize> {
    /// Number of leading states that are positions.
    const POSITIONS: usize;

    /// f(t, y).
    fn rate(&self, t: f64, y: &[f64; N]) -> [f64; N];
}

/// Returns `y + h·k`, element by element.
#[inline]
#[must_use]
pub fn moved<const N: usize>(y: &[f64; N], k: &[f64; N], h: f64) -> [f64; N] {
    core::array::from_fn(|i| y[i] + h * k[i])
}
