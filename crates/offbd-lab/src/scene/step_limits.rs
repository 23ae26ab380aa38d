//! The largest stable steps of explicit methods on the compliant contact, as the
//! eigenvalues predict them.
//!
//! Along the plate slip decays at λ = (1 + 1/κ)·μ·F_z/(m·v_thr); normal to it
//! the ball obeys m·s² + D·s + K = 0. A method is stable where its stability
//! function, or its amplification matrix, shrinks both (Hairer, Wanner,
//! *Solving Ordinary Differential Equations II*, 2nd ed., IV.2).

use nalgebra::Matrix2;

use super::configuration::{Method, SHORTEST_STEP_S};
use crate::models::Compliant;

/// Predicted largest stable steps of an explicit method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepLimits {
    /// Largest step at which slip decays, s. Above it the slip chatters, with friction
    /// losses that are too large, while the position hardly shows it.
    pub slip_s: f64,
    /// Largest step at which the motion normal to the plate decays, s. Above it the plate
    /// throws the body off.
    pub normal_s: f64,
}

impl StepLimits {
    /// Returns the limits of an explicit `method` for a normal force per mass of
    /// `normal_m_s2`; `None` for methods that are stable at any step.
    #[must_use]
    pub fn of(method: Method, model: &Compliant, normal_m_s2: f64) -> Option<Self> {
        let reach = real_reach(method)?;
        let (body, contact) = (&model.body, &model.contact);
        let mass = body.mass_kg();
        let rate = body.slip_ease() * mass * contact.friction() * normal_m_s2
            / contact.slip_threshold_m_s();
        let (k, d) = (contact.stiffness_n_per_m() / mass, contact.damping_n_s_per_m() / mass);
        Some(Self { slip_s: reach / rate, normal_s: normal_limit(method, k, d) })
    }

    /// Returns the largest stable step, s.
    #[must_use]
    pub const fn least_s(&self) -> f64 {
        self.slip_s.min(self.normal_s)
    }
}

/// Returns the extent of the stability region along the negative real axis.
fn real_reach(method: Method) -> Option<f64> {
    match method {
        Method::Euler | Method::SemiImplicitEuler | Method::Midpoint => Some(2.0),
        Method::Rk4 => Some(2.785_293_563_405_282),
        Method::Dopri5 => Some(DOPRI5_REACH),
        _ => None,
    }
}

/// Returns the coefficients 1/k! of the stability polynomial.
fn polynomial(method: Method) -> &'static [f64] {
    match method {
        Method::Euler => &[1.0, 1.0],
        Method::Midpoint => &[1.0, 1.0, 0.5],
        Method::Dopri5 => &[1.0, 1.0, 0.5, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 600.0],
        _ => &[1.0, 1.0, 0.5, 1.0 / 6.0, 1.0 / 24.0],
    }
}

/// Returns the amplification matrix of one step of `h` for (p, v) of p'' = −k·p − d·v.
fn amplification(method: Method, k: f64, d: f64, h: f64) -> Matrix2<f64> {
    if method == Method::SemiImplicitEuler {
        return Matrix2::new(1.0 - h * h * k, h * (1.0 - h * d), -h * k, 1.0 - h * d);
    }
    let z = Matrix2::new(0.0, 1.0, -k, -d) * h;
    let horner = |sum: Matrix2<f64>, c: &f64| sum * z + Matrix2::identity() * *c;
    polynomial(method).iter().rev().fold(Matrix2::zeros(), horner)
}

fn spectral_radius(m: &Matrix2<f64>) -> f64 {
    let (half, determinant) = (m.trace() / 2.0, m.determinant());
    let square = half * half - determinant;
    // Roots that differ by rounding only count as a complex pair.
    if square < 1e-14 { determinant.abs().sqrt() } else { half.abs() + square.sqrt() }
}

/// Where 1 + z + … + z⁵/120 + z⁶/600 first exceeds 1 in size on the negative axis.
const DOPRI5_REACH: f64 = 3.306_567_892_634_946;

/// Factor between the steps of the search for the first one with a spectral radius above
/// 1; chosen.
const GROWTH: f64 = 1.002;

fn normal_limit(method: Method, k: f64, d: f64) -> f64 {
    let outside = |h: f64| spectral_radius(&amplification(method, k, d, h)) > 1.0 + 1e-12;
    // Start well below the limit: the roots are at most of order d and √k, and with little
    // damping the limit is of order d/k.
    let mut h = (1e-3 * (1.0 / (d + k.sqrt())).min(d / k)).max(SHORTEST_STEP_S);
    while !outside(h * GROWTH) {
        h *= GROWTH;
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Explicit Euler: 2/λ of the faster root, and D/K of a complex pair;
    /// semi-implicit Euler without damping: 2/√k.
    #[test]
    fn validate_limits_that_have_a_closed_form() {
        let (k, d): (f64, f64) = (800_000.0 / 0.051, 1000.0 / 0.051);
        let fast = d / 2.0 + (d * d / 4.0 - k).sqrt();
        let close = |is: f64, should: f64| (is / should - 1.0).abs() < 2.0 * (GROWTH - 1.0);
        assert!(close(normal_limit(Method::Euler, k, d), 2.0 / fast));
        assert!(close(normal_limit(Method::Euler, k, d / 20.0), d / 20.0 / k));
        assert!(close(normal_limit(Method::SemiImplicitEuler, k, 1e-3), 2.0 / k.sqrt()));
    }
}
