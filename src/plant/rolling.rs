//! The rolling ball: what is left of the contact when slip and penetration
//! vanish (2 + 2 states and a spin).
//!
//! With `Ω`, `α` the plate's angular velocity and acceleration in the plate
//! frame, κ the inertia factor and `f = g_P − 2Ω×v − Ω×(Ω×p) − α×p + F/m`:
//!
//! ```text
//! (1 + κ)·v̇x = f_x − κ r·(α + Ω×w)_y
//! (1 + κ)·v̇y = f_y + κ r·(α + Ω×w)_x
//! ẇz = −α_z − (Ω×w)_z          vx = r wy,  vy = −r wx,  pz = cgap
//! ```
//!
//! Valid while friction can hold the ball without slip, for constant tilt
//! about one axis up to tan(angle) = (1 + 1/κ)·μ, and while the plate pushes.

use nalgebra::{Vector2, Vector3};

use super::{Ball, GRAVITY_M_S2, Plate};

/// Plate angles about x and y with their first and second rates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tilt {
    /// (qx, qy), rad.
    pub angle: Vector2<f64>,
    /// (q̇x, q̇y), rad/s.
    pub rate: Vector2<f64>,
    /// (q̈x, q̈y), rad/s².
    pub acceleration: Vector2<f64>,
}

impl Tilt {
    /// A plate at rest at (qx, qy).
    #[must_use]
    pub fn constant(qx_rad: f64, qy_rad: f64) -> Self {
        Self { angle: Vector2::new(qx_rad, qy_rad), ..Self::default() }
    }

    /// Ω = (q̇x cos qy, q̇y, q̇x sin qy), plate frame, rad/s.
    fn omega(&self) -> Vector3<f64> {
        let (sin_y, cos_y) = self.angle.y.sin_cos();
        Vector3::new(self.rate.x * cos_y, self.rate.y, self.rate.x * sin_y)
    }

    /// α = Ω̇, plate frame, rad/s².
    fn alpha(&self) -> Vector3<f64> {
        let (sin_y, cos_y) = self.angle.y.sin_cos();
        let coupling = self.rate.x * self.rate.y;
        Vector3::new(
            self.acceleration.x * cos_y - coupling * sin_y,
            self.acceleration.y,
            self.acceleration.x * sin_y + coupling * cos_y,
        )
    }

    /// Gravity seen from the plate, m/s².
    fn gravity(&self) -> Vector3<f64> {
        let (sin_x, cos_x) = self.angle.x.sin_cos();
        let (sin_y, cos_y) = self.angle.y.sin_cos();
        Vector3::new(cos_x * sin_y, -sin_x, -cos_x * cos_y) * GRAVITY_M_S2
    }
}

/// Where a rolling ball is and how it moves, relative to the plate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RollingState {
    /// (x, y) in the plate frame, m.
    pub position: Vector2<f64>,
    /// Rate of the position, m/s.
    pub velocity: Vector2<f64>,
    /// Spin about the plate's normal, rad/s.
    pub spin: f64,
}

impl RollingState {
    fn moved(&self, rate: &Rate, h: f64) -> Self {
        Self {
            position: self.position + rate.velocity * h,
            velocity: self.velocity + rate.acceleration * h,
            spin: self.spin + rate.spin * h,
        }
    }
}

/// Time derivative of a [`RollingState`].
#[derive(Clone, Copy)]
struct Rate {
    velocity: Vector2<f64>,
    acceleration: Vector2<f64>,
    spin: f64,
}

/// The rolling model of one ball on one plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rolling {
    radius: f64,
    kappa: f64,
    centre_gap: f64,
    mass: f64,
}

impl Rolling {
    #[must_use]
    pub fn new(ball: &Ball, plate: &Plate) -> Self {
        Self {
            radius: ball.radius_m(),
            kappa: ball.inertia_factor(),
            centre_gap: plate.centre_gap_m(ball),
            mass: ball.mass_kg(),
        }
    }

    /// Acceleration in the plate frame, m/s², and the rate of the spin, rad/s²,
    /// under `tilt` and an external force on the ball's centre, N.
    #[must_use]
    pub fn acceleration(
        &self,
        state: &RollingState,
        tilt: &Tilt,
        force: Vector2<f64>,
    ) -> (Vector2<f64>, f64) {
        let (omega, alpha) = (tilt.omega(), tilt.alpha());
        let p = Vector3::new(state.position.x, state.position.y, self.centre_gap);
        let v = Vector3::new(state.velocity.x, state.velocity.y, 0.0);
        let w = Vector3::new(-v.y / self.radius, v.x / self.radius, state.spin);
        let drive = tilt.gravity()
            - 2.0 * omega.cross(&v)
            - omega.cross(&omega.cross(&p))
            - alpha.cross(&p);
        let turn = alpha + omega.cross(&w);
        let spin_term = self.kappa * self.radius;
        let linear = Vector2::new(
            drive.x + force.x / self.mass - spin_term * turn.y,
            drive.y + force.y / self.mass + spin_term * turn.x,
        ) / (1.0 + self.kappa);
        (linear, -turn.z)
    }

    fn rate(&self, state: &RollingState, tilt: &Tilt, force: Vector2<f64>) -> Rate {
        let (acceleration, spin) = self.acceleration(state, tilt, force);
        Rate { velocity: state.velocity, acceleration, spin }
    }

    /// One step of `h` seconds by the explicit midpoint rule (order 2); `tilt`
    /// is the plate at the middle of the step.
    #[must_use]
    pub fn midpoint(
        &self,
        state: &RollingState,
        tilt: [&Tilt; 2],
        force: Vector2<f64>,
        h: f64,
    ) -> RollingState {
        let half = state.moved(&self.rate(state, tilt[0], force), h / 2.0);
        state.moved(&self.rate(&half, tilt[1], force), h)
    }

    /// One step of `h` seconds by the classical Runge–Kutta method (order 4);
    /// `tilt` is the plate at the start, the middle and the end of the step.
    #[must_use]
    pub fn rk4(
        &self,
        state: &RollingState,
        tilt: [&Tilt; 3],
        force: Vector2<f64>,
        h: f64,
    ) -> RollingState {
        let k1 = self.rate(state, tilt[0], force);
        let k2 = self.rate(&state.moved(&k1, h / 2.0), tilt[1], force);
        let k3 = self.rate(&state.moved(&k2, h / 2.0), tilt[1], force);
        let k4 = self.rate(&state.moved(&k3, h), tilt[2], force);
        let mean = Rate {
            velocity: (k1.velocity + 2.0 * (k2.velocity + k3.velocity) + k4.velocity) / 6.0,
            acceleration: (k1.acceleration
                + 2.0 * (k2.acceleration + k3.acceleration)
                + k4.acceleration)
                / 6.0,
            spin: (k1.spin + 2.0 * (k2.spin + k3.spin) + k4.spin) / 6.0,
        };
        state.moved(&mean, h)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn chapter() -> Rolling {
        Rolling::new(&Ball::default(), &Plate::default())
    }

    /// S2 of the reference trajectories: both angles sinusoidal.
    fn sines(t: f64) -> Tilt {
        let wave = |f: f64, phase: f64| {
            let (w, arg) = (TAU * f, TAU * f * t + phase);
            (0.05 * arg.sin(), 0.05 * w * arg.cos(), -0.05 * w * w * arg.sin())
        };
        let (x, y) = (wave(0.7, 0.0), wave(0.9, 0.5));
        Tilt {
            angle: Vector2::new(x.0, y.0),
            rate: Vector2::new(x.1, y.1),
            acceleration: Vector2::new(x.2, y.2),
        }
    }

    fn run_rk4(h: f64, seconds: f64) -> RollingState {
        let (model, n) = (chapter(), (seconds / h).round() as usize);
        (0..n).fold(RollingState::default(), |s, i| {
            let t = i as f64 * h;
            model.rk4(&s, [&sines(t), &sines(t + h / 2.0), &sines(t + h)], Vector2::zeros(), h)
        })
    }

    fn run_midpoint(h: f64, seconds: f64) -> RollingState {
        let (model, n) = (chapter(), (seconds / h).round() as usize);
        (0..n).fold(RollingState::default(), |s, i| {
            let t = i as f64 * h;
            model.midpoint(&s, [&sines(t), &sines(t + h / 2.0)], Vector2::zeros(), h)
        })
    }

    #[test]
    fn validate_constant_tilt_against_the_closed_form() {
        let (qx, qy) = (std::f64::consts::PI / 20.0, std::f64::consts::PI / 20.0);
        let (a, _) = chapter().acceleration(
            &RollingState::default(),
            &Tilt::constant(qx, qy),
            Vector2::zeros(),
        );
        let g = 5.0 / 7.0 * GRAVITY_M_S2;
        assert!((a.x - g * qx.cos() * qy.sin()).abs() < 1e-14);
        assert!((a.y + g * qx.sin()).abs() < 1e-14);
    }

    /// Angular momentum about the joint's z axis: a plate that only turns fast
    /// about a fixed tilt axis exerts the centrifugal force ω² p on the ball.
    #[test]
    fn validate_centrifugal_and_coriolis_terms() {
        let tilt = Tilt { rate: Vector2::new(0.0, 2.0), ..Tilt::default() };
        let state = RollingState { position: Vector2::new(0.1, 0.0), ..Default::default() };
        let (a, _) = chapter().acceleration(&state, &tilt, Vector2::zeros());
        assert!((a.x - 4.0 * 0.1 / 1.4).abs() < 1e-14, "ω² p/(1 + κ), got {}", a.x);
    }

    #[test]
    fn validate_orders_of_convergence() {
        let truth = run_rk4(2.5e-4, 2.0).position;
        let order = |run: fn(f64, f64) -> RollingState| {
            let errors: Vec<f64> = [0.02, 0.01, 0.005]
                .iter()
                .map(|&h| (run(h, 2.0).position - truth).norm())
                .collect();
            (errors[0] / errors[2]).log2() / 2.0
        };
        assert!((order(run_rk4) - 4.0).abs() < 0.2, "RK4 has order {}", order(run_rk4));
        assert!((order(run_midpoint) - 2.0).abs() < 0.2, "midpoint {}", order(run_midpoint));
    }
}
