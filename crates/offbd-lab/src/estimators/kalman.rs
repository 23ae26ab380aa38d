//! A steady-state Kalman filter for position, velocity and acceleration.
//!
//! Discrete Wiener process acceleration (Bar-Shalom, Li & Kirubarajan, *Estimation with
//! Applications to Tracking and Navigation*, 2001, 6.3.3): over each period T the
//! acceleration changes by a white increment of standard deviation σ_w, x ← F x + Γ w
//! with F = [1 T T²/2; 0 1 T; 0 0 1] and Γ = [T²/2, T, 1]ᵀ; positions are measured with
//! standard deviation σ. White-noise jerk of spectral density q gives σ_w = √(qT), which
//! makes the tuning independent of the sampling rate. The gains are those to which the
//! Riccati recursion converges.

use nalgebra::{Matrix3, Vector3};

use super::Estimator;

/// Maximum number of steps of the Riccati recursion, which converges within some ten
/// times the filter's memory. Chosen to bound the time; after it, the gains reached are
/// used.
const MOST_STEPS: usize = 200_000;

/// Steady-state gains: K = [α, β/T, γ/T²].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KalmanGains {
    pub alpha: f64,
    pub beta: f64,
    pub gamma: f64,
}

impl KalmanGains {
    /// Returns the gains for the tracking index Λ = σ_w T²/σ, which is positive; they
    /// depend on nothing else.
    #[must_use]
    pub fn settled(tracking_index: f64) -> Self {
        // In units of T and σ.
        let f = Matrix3::new(1.0, 1.0, 0.5, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0);
        let gamma = Vector3::new(0.5, 1.0, 1.0) * tracking_index;
        let noise = gamma * gamma.transpose();
        let mut predicted = Matrix3::identity();
        let mut gain = Vector3::zeros();
        for _ in 0..MOST_STEPS {
            let next: Vector3<f64> = predicted.column(0) / (predicted[(0, 0)] + 1.0);
            // Symmetric by construction: P − K (P e₁)ᵀ.
            let corrected = predicted - next * predicted.row(0);
            predicted = f * corrected * f.transpose() + noise;
            let change = (next - gain).component_div(&next).amax();
            gain = next;
            if change < 1e-13 {
                break;
            }
        }
        Self { alpha: gain[0], beta: gain[1], gamma: gain[2] }
    }
}

/// The steady-state Kalman filter; the module documentation describes it.
#[derive(Clone, Copy, Debug)]
pub struct Kalman {
    period_s: f64,
    gain: [f64; 3],
    /// Position, velocity, acceleration; `None` before the first position.
    state: Option<[f64; 3]>,
}

impl Kalman {
    /// Creates the filter for positions every `period_s` with standard deviation `sigma`
    /// (m), and jerk of spectral density `jerk_density` (m²/s⁵); all positive.
    #[must_use]
    pub fn new(jerk_density: f64, sigma: f64, period_s: f64) -> Self {
        let t = period_s;
        let gains = KalmanGains::settled((jerk_density * t).sqrt() * t * t / sigma);
        let gain = [gains.alpha, gains.beta / t, gains.gamma / (t * t)];
        Self { period_s, gain, state: None }
    }

    fn predicted(&self, [x, v, a]: [f64; 3]) -> [f64; 3] {
        let t = self.period_s;
        [x + t * (v + 0.5 * t * a), v + t * a, a]
    }
}

impl Estimator for Kalman {
    fn update(&mut self, position: f64) -> Option<f64> {
        let predicted = self.state.map_or([position, 0.0, 0.0], |state| self.predicted(state));
        let innovation = position - predicted[0];
        let mut corrected = predicted;
        for (value, gain) in corrected.iter_mut().zip(self.gain) {
            *value += gain * innovation;
        }
        self.state = Some(corrected);
        Some(corrected[2])
    }
}

#[cfg(test)]
mod tests {
    use super::super::check::last;
    use super::*;

    /// The closed form of α and β by tracking index (Gray & Murray, *A Derivation of an
    /// Analytic Expression for the Tracking Index for the Alpha-Beta-Gamma Filter*, IEEE
    /// T-AES 29 (1993) 1064–1065), with s = √(1 − α) the root of s³ + bs² + cs − 1,
    /// b = Λ/2 − 3, c = Λ/2 + 3.
    fn gray_murray(index: f64) -> (f64, f64) {
        let (b, c) = (index / 2.0 - 3.0, index / 2.0 + 3.0);
        let (p, q) = (c - b * b / 3.0, 2.0 * b.powi(3) / 27.0 - b * c / 3.0 - 1.0);
        let v = (q * q + 4.0 * p.powi(3) / 27.0).sqrt();
        let z = -((q + v) / 2.0).cbrt();
        let s = z - p / (3.0 * z) - b / 3.0;
        (1.0 - s * s, 2.0 * (1.0 - s) * (1.0 - s))
    }

    /// Kalata, *The Tracking Index*, IEEE T-AES 20 (1984) 174–182:
    /// β = 2(2 − α) − 4√(1 − α), γ = β²/(2α), Λ² = γ²/(1 − α).
    #[test]
    fn validate_gains_by_tracking_index() {
        for index in [1e-4, 1e-2, 0.3, 5.0] {
            let KalmanGains { alpha, beta, gamma } = KalmanGains::settled(index);
            let close = |found: f64, wanted: f64| {
                assert!((found / wanted - 1.0).abs() < 1e-7, "{index}: {found} {wanted}");
            };
            close(beta, 2.0 * (2.0 - alpha) - 4.0 * (1.0 - alpha).sqrt());
            close(gamma, beta * beta / (2.0 * alpha));
            close(gamma * gamma / (1.0 - alpha), index * index);
            let (a, b) = gray_murray(index);
            close(alpha, a);
            close(beta, b);
        }
    }

    #[test]
    fn validate_a_parabola_is_exact_once_settled() {
        let mut filter = Kalman::new(1.0, 5e-4, 0.01);
        let found = last(&mut filter, 3000, |k| 1.5 * (0.01 * k).powi(2));
        assert!((found - 3.0).abs() < 1e-6, "{found}");
    }
}
