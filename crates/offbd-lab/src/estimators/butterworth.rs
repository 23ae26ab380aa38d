use std::f64::consts::{PI, SQRT_2};

use super::Estimator;

/// A second-order Butterworth low-pass filter by the bilinear transform, prewarped for
/// −3 dB at the cutoff frequency (Oppenheim & Schafer, *Discrete-Time Signal
/// Processing*, 3rd ed., 7.2.2).
///
/// With K = tan(π f_c T): H(z) = K²(1 + z⁻¹)² / ((1 + √2K + K²) +
/// 2(K² − 1)z⁻¹ + (1 − √2K + K²)z⁻²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowPass {
    /// Coefficients of the numerator, z⁰ to z⁻².
    pub b: [f64; 3],
    /// Coefficients of the denominator, z⁻¹ and z⁻²; that of z⁰ is 1.
    pub a: [f64; 2],
}

impl LowPass {
    /// Creates the filter with −3 dB at `cutoff_hz`, which is positive and below half the
    /// sampling rate `1/period_s`.
    #[must_use]
    pub fn new(cutoff_hz: f64, period_s: f64) -> Self {
        let k = (PI * cutoff_hz * period_s).tan();
        let norm = 1.0 / (1.0 + SQRT_2 * k + k * k);
        let b = k * k * norm;
        let a = [2.0 * (k * k - 1.0) * norm, (1.0 - SQRT_2 * k + k * k) * norm];
        Self { b: [b, 2.0 * b, b], a }
    }
}

/// The second difference of positions filtered by a [`LowPass`]. The filter starts in
/// the steady state of the first position.
#[derive(Clone, Copy, Debug)]
pub struct Butterworth {
    filter: LowPass,
    /// Filter state in transposed direct form II, for positions relative to the first.
    state: [f64; 2],
    first: Option<f64>,
    /// The last two filtered positions, newest first.
    smooth: [f64; 2],
    per_square: f64,
}

impl Butterworth {
    /// Creates the estimator for positions every `period_s`; `cutoff_hz` as in
    /// [`LowPass::new`].
    #[must_use]
    pub fn new(cutoff_hz: f64, period_s: f64) -> Self {
        let filter = LowPass::new(cutoff_hz, period_s);
        let per_square = 1.0 / (period_s * period_s);
        Self { filter, state: [0.0; 2], first: None, smooth: [0.0; 2], per_square }
    }

    fn smoothed(&mut self, x: f64) -> f64 {
        let LowPass { b, a } = self.filter;
        let y = b[0] * x + self.state[0];
        self.state = [b[1] * x - a[0] * y + self.state[1], b[2] * x - a[1] * y];
        y
    }
}

impl Estimator for Butterworth {
    fn update(&mut self, position: f64) -> Option<f64> {
        let first = *self.first.get_or_insert(position);
        let y = self.smoothed(position - first);
        let [before, long_before] = self.smooth;
        self.smooth = [y, before];
        Some((y - 2.0 * before + long_before) * self.per_square)
    }
}

#[cfg(test)]
mod tests {
    use super::super::check::last;
    use super::*;

    fn close(found: f64, wanted: f64, tolerance: f64) {
        assert!((found - wanted).abs() < tolerance, "{found} {wanted}");
    }

    /// The closed form at a quarter of the sampling rate: b₀ = 1/(2 + √2),
    /// a₂ = (2 − √2)/(2 + √2); and the tabulated values at a tenth.
    #[test]
    fn validate_known_coefficients() {
        let quarter = LowPass::new(0.25, 1.0);
        close(quarter.b[0], 1.0 / (2.0 + SQRT_2), 1e-14);
        close(quarter.a[0], 0.0, 1e-14);
        close(quarter.a[1], (2.0 - SQRT_2) / (2.0 + SQRT_2), 1e-14);
        let tenth = LowPass::new(0.1, 1.0);
        for (found, wanted) in tenth.b.iter().zip([0.067_455_3, 0.134_910_5, 0.067_455_3]) {
            close(*found, wanted, 5e-8);
        }
        close(tenth.a[0], -1.142_980_5, 5e-8);
        close(tenth.a[1], 0.412_801_6, 5e-8);
    }

    /// |H|² is 1/2 at the cutoff frequency, in the steady state of a sine.
    #[test]
    fn validate_three_decibels_at_the_cutoff() {
        let mut filter = Butterworth::new(5.0, 0.01);
        let mut peak = [0.0_f64; 2];
        for k in 0..4000 {
            let x = (2.0 * PI * 5.0 * 0.01 * f64::from(k) + 0.3).sin();
            let y = filter.smoothed(x);
            if k >= 2000 {
                peak = [peak[0] + x * x, peak[1] + y * y];
            }
        }
        close(peak[1] / peak[0], 0.5, 1e-9);
    }

    #[test]
    fn validate_a_parabola_is_exact_once_settled() {
        let found =
            last(&mut Butterworth::new(5.0, 0.01), 1000, |k| 7.0 + 1.5 * (0.01 * k).powi(2));
        close(found, 3.0, 1e-6);
    }
}
