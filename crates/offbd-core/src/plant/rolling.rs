//! The rolling ball: the limit of the contact model without slip and penetration (2 + 2
//! states and a spin).
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
//! Valid while the plate pushes and friction can hold the ball without slip: for constant
//! tilt about one axis, up to tan(angle) = (1 + 1/κ)·μ.

use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::contact::Motion;
use super::tilt::PlateMotion;
use super::{Ball, Plate};
use crate::maths::{RK4, System};

/// The state of a rolling ball relative to the plate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RollingState {
    /// (x, y) in the plate frame, m.
    pub position: Vector2<f64>,
    /// Rate of the position, m/s.
    pub velocity: Vector2<f64>,
    /// Spin about the plate's normal, rad/s.
    pub spin: f64,
}

impl RollingState {
    /// (x, y, vx, vy, wz) as one array.
    #[must_use]
    pub fn to_row(&self) -> [f64; 5] {
        [self.position.x, self.position.y, self.velocity.x, self.velocity.y, self.spin]
    }

    #[must_use]
    pub fn from_row(y: &[f64; 5]) -> Self {
        Self { position: Vector2::new(y[0], y[1]), velocity: Vector2::new(y[2], y[3]), spin: y[4] }
    }
}

/// The contact forces that rolling requires, per kilogram of ball.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grip {
    /// Friction force along x and y per mass, m/s².
    pub friction: [f64; 2],
    /// Normal force per mass, m/s²; negative where the ball would leave the plate.
    pub normal: f64,
}

impl Grip {
    /// Fraction of the friction limit μ·F_z in use, the larger of both axes; the ball
    /// rolls up to 1. Infinite where the plate would have to pull.
    #[must_use]
    pub fn demand(&self, friction: f64) -> f64 {
        let worst = self.friction[0].abs().max(self.friction[1].abs());
        if self.normal > 0.0 { worst / (friction * self.normal) } else { f64::INFINITY }
    }
}

/// The rolling model of one ball on one plate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rolling {
    radius: f64,
    kappa: f64,
    centre_gap: f64,
}

impl Rolling {
    #[must_use]
    pub fn new(ball: &Ball, plate: &Plate) -> Self {
        Self {
            radius: ball.radius_m(),
            kappa: ball.inertia_factor(),
            centre_gap: plate.centre_gap_m(ball),
        }
    }

    /// Returns the rates of (x, y, vx, vy, wz).
    #[must_use]
    #[inline]
    pub fn rate(&self, y: &[f64; 5], plate: &PlateMotion) -> [f64; 5] {
        let (a, _, spin) = self.forced(y, plate);
        [y[2], y[3], a[0], a[1], spin]
    }

    /// Returns the rolling state of a ball that moves as `from`; slip is dropped.
    #[must_use]
    pub fn enter(&self, from: &Motion) -> [f64; 5] {
        let (p, v) = (&from.position, &from.velocity);
        [p.x, p.y, v.x, v.y, from.spin.z]
    }

    /// Returns the ball's motion in the state `y`.
    #[must_use]
    pub fn leave(&self, y: &[f64; 5]) -> Motion {
        Motion {
            position: Vector3::new(y[0], y[1], self.centre_gap),
            velocity: Vector3::new(y[2], y[3], 0.0),
            spin: Vector3::new(-y[3] / self.radius, y[2] / self.radius, y[4]),
        }
    }

    /// Returns the acceleration along x and y, the acceleration of a free ball, and the
    /// rate of the spin about the normal.
    #[inline]
    fn forced(&self, y: &[f64; 5], plate: &PlateMotion) -> ([f64; 2], Vector3<f64>, f64) {
        let p = Vector3::new(y[0], y[1], self.centre_gap);
        let v = Vector3::new(y[2], y[3], 0.0);
        let w = Vector3::new(-v.y / self.radius, v.x / self.radius, y[4]);
        let (free, turn) = (plate.free(&p, &v), plate.free_turn(&w));
        let lever = self.kappa * self.radius;
        let share = 1.0 / (1.0 + self.kappa);
        let a = [(free.x + lever * turn.y) * share, (free.y - lever * turn.x) * share];
        (a, free, turn.z)
    }

    /// Returns the acceleration in the plate frame, m/s², and the rate of the spin,
    /// rad/s².
    #[must_use]
    pub fn acceleration(&self, state: &RollingState, plate: &PlateMotion) -> (Vector2<f64>, f64) {
        let (a, _, spin) = self.forced(&state.to_row(), plate);
        (Vector2::from(a), spin)
    }

    /// Returns the friction and normal force that rolling requires.
    #[must_use]
    pub fn grip(&self, y: &[f64; 5], plate: &PlateMotion) -> Grip {
        self.grip_and_rate(y, plate).0
    }

    /// Returns [`grip`](Self::grip) and the rates of `y`, which share their computation.
    #[inline]
    #[must_use]
    pub fn grip_and_rate(&self, y: &[f64; 5], plate: &PlateMotion) -> (Grip, [f64; 5]) {
        let (a, free, spin) = self.forced(y, plate);
        let grip = Grip { friction: [a[0] - free.x, a[1] - free.y], normal: -free.z };
        (grip, [y[2], y[3], a[0], a[1], spin])
    }

    /// Returns the state (x, y, vx, vy, wz) after one step of `h` seconds by the explicit
    /// midpoint rule (order 2); `plate` is the plate at the middle of the step.
    ///
    /// For one motion of the plate the rates are linear in the state, so that both stages
    /// share their coefficients.
    #[must_use]
    #[inline]
    pub fn midpoint(&self, y: &[f64; 5], plate: &PlateMotion, h: f64) -> [f64; 5] {
        let field = LinearRates::new(self, plate);
        field.moved(y, &field.moved(y, y, 0.5 * h), h)
    }

    /// One step of `h` seconds by the classical Runge–Kutta method (order 4);
    /// `plate` is the plate at the start, the middle and the end of the step.
    #[must_use]
    pub fn rk4(&self, state: &RollingState, plate: [&PlateMotion; 3], h: f64) -> RollingState {
        let held = HeldPlate { rolling: self, plate, h };
        RollingState::from_row(&RK4.step(&held, 0.0, &state.to_row(), h))
    }
}

/// The rates of a rolling ball for one motion of the plate. With Ω = (a, b, c), z the height
/// of the ball's centre and g gravity with any push, the equations at the top are
///
/// ```text
/// (1 + κ)·v̇x = g_x − ac·z − α_y·(z + κr) + (b² + c²)·x + (α_z − ab)·y + (2 + κ)c·vy + κr·a·w
/// (1 + κ)·v̇y = g_y − bc·z + α_x·(z + κr) − (α_z + ab)·x + (a² + c²)·y − (2 + κ)c·vx + κr·b·w
/// ẇ = −α_z − (a·vx + b·vy)/r
/// ```
struct LinearRates {
    /// 1/(1 + κ), by which the linear accelerations are still to be multiplied.
    share: f64,
    /// Constant terms of v̇x and v̇y.
    constant: [f64; 2],
    /// Coefficients of x and y in v̇x.
    x_by: [f64; 2],
    /// Coefficients of x and y in v̇y.
    y_by: [f64; 2],
    /// Coefficient of vy in v̇x, and of −vx in v̇y.
    sideways: f64,
    /// Coefficients of the spin in v̇x and v̇y.
    spin: [f64; 2],
    /// −ẇ: constant term, coefficients of vx and vy.
    despin: [f64; 3],
}

impl LinearRates {
    #[inline]
    fn new(of: &Rolling, plate: &PlateMotion) -> Self {
        let PlateMotion { omega, alpha, gravity } = plate;
        let (a, b, c) = (omega.x, omega.y, omega.z);
        let (ab, cc, z) = (a * b, c * c, of.centre_gap);
        let spin_arm = of.kappa * of.radius;
        let (arm, curvature) = (z + spin_arm, 1.0 / of.radius);
        Self {
            share: 1.0 / (1.0 + of.kappa),
            constant: [
                (gravity.x - alpha.y * arm) - (a * c) * z,
                (gravity.y + alpha.x * arm) - (b * c) * z,
            ],
            x_by: [b * b + cc, alpha.z - ab],
            y_by: [-alpha.z - ab, a * a + cc],
            sideways: (2.0 + of.kappa) * c,
            spin: [spin_arm * a, spin_arm * b],
            despin: [alpha.z, a * curvature, b * curvature],
        }
    }

    /// Returns `from` moved for `h` seconds at the rates at `at`. Operands that become
    /// available last are added last, which shortens the dependency chain.
    #[inline]
    fn moved(&self, from: &[f64; 5], at: &[f64; 5], h: f64) -> [f64; 5] {
        let [x, y, vx, vy, spin] = *at;
        let by_position = [
            self.constant[0] + (self.x_by[0] * x + self.x_by[1] * y),
            self.constant[1] + (self.y_by[0] * x + self.y_by[1] * y),
        ];
        let by_rate =
            [self.sideways * vy + self.spin[0] * spin, self.spin[1] * spin - self.sideways * vx];
        let despin = self.despin[0] + (self.despin[1] * vx + self.despin[2] * vy);
        let gain = self.share * h;
        [
            from[0] + vx * h,
            from[1] + vy * h,
            from[2] + (by_position[0] + by_rate[0]) * gain,
            from[3] + (by_position[1] + by_rate[1]) * gain,
            from[4] - despin * h,
        ]
    }
}

/// The rolling ball over one step from 0 to `h`, with the plate's motion given at the
/// start, the middle and the end.
struct HeldPlate<'a> {
    rolling: &'a Rolling,
    plate: [&'a PlateMotion; 3],
    h: f64,
}

impl System<5> for HeldPlate<'_> {
    const POSITIONS: usize = 2;

    fn rate(&self, t: f64, y: &[f64; 5]) -> [f64; 5] {
        let plate = if t <= 0.0 {
            0
        } else if t < self.h {
            1
        } else {
            2
        };
        self.rolling.rate(y, self.plate[plate])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maths::MIDPOINT;
    use crate::plant::{GRAVITY_M_S2, PlateShape, Tilt};
    use core::f64::consts::TAU;
    use proptest::prelude::*;

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
            let plate = [t, t + h / 2.0, t + h].map(|t| sines(t).motion());
            model.rk4(&s, plate.each_ref(), h)
        })
    }

    fn run_midpoint(h: f64, seconds: f64) -> RollingState {
        let (model, n) = (chapter(), (seconds / h).round() as usize);
        let step = |y, i| model.midpoint(&y, &sines((i as f64 + 0.5) * h).motion(), h);
        RollingState::from_row(&(0..n).fold([0.0; 5], step))
    }

    #[test]
    fn validate_constant_tilt_against_the_closed_form() {
        let (qx, qy) = (core::f64::consts::PI / 20.0, core::f64::consts::PI / 20.0);
        let (a, _) =
            chapter().acceleration(&RollingState::default(), &Tilt::constant(qx, qy).motion());
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
        let (a, _) = chapter().acceleration(&state, &tilt.motion());
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

    fn pair(limit: f64) -> impl Strategy<Value = Vector2<f64>> {
        [-limit..limit, -limit..limit].prop_map(Vector2::from)
    }

    fn rig() -> impl Strategy<Value = (Ball, Plate)> {
        (0.002..0.1, 0.0..=1.0, 0.0..0.1).prop_map(|(radius, kappa, thickness)| {
            let shape = PlateShape::Round { diameter_m: 1.0 };
            (Ball::new(radius, 0.05, kappa).unwrap(), Plate::new(shape, thickness, true).unwrap())
        })
    }

    fn state() -> impl Strategy<Value = RollingState> {
        let numbers = (pair(0.5), pair(3.0), -50.0..50.0);
        numbers.prop_map(|(position, velocity, spin)| RollingState { position, velocity, spin })
    }

    fn tilt() -> impl Strategy<Value = Tilt> {
        let numbers = (pair(7.0), pair(10.0), pair(100.0));
        numbers.prop_map(|(angle, rate, acceleration)| Tilt { angle, rate, acceleration })
    }

    proptest! {
        /// The step by linear rates is the midpoint rule on the model: the same terms in a
        /// different order, some forty roundings of 1.1e-16 each, of terms no larger than
        /// those summed here.
        #[test]
        fn linear_rates_are_the_models(
            (ball, plate) in rig(),
            state in state(),
            tilt in tilt(),
            push in pair(20.0),
            h in 0.0..0.02,
        ) {
            let (model, motion) = (Rolling::new(&ball, &plate), tilt.motion().pushed(push));
            let found = model.midpoint(&state.to_row(), &motion, h);
            let held = HeldPlate { rolling: &model, plate: [&motion; 3], h };
            let expected = MIDPOINT.step(&held, 0.0, &state.to_row(), h);
            let largest = |v: Vector2<f64>| v.amax();
            let (rate, curvature) = (largest(tilt.rate), 1.0 / ball.radius_m());
            let (angular, speed) =
                (largest(tilt.acceleration) + 2.0 * rate * rate, largest(state.velocity));
            let (arm, spin) = (plate.centre_gap_m(&ball) + ball.radius_m(), state.spin.abs());
            let reach = largest(state.position) + arm;
            let a = 9.81 + largest(push) + angular * reach + 3.0 * rate * (speed + arm * spin);
            let rotation = angular + rate * (speed + h * a) * curvature;
            let growth =
                [speed + h * a, a + 3.0 * rate * h * a + rate * arm * h * rotation, rotation];
            for (i, (ours, theirs)) in found.into_iter().zip(expected).enumerate() {
                let allowed = 4e-15 * h * growth[i / 2] + 2.3e-16 * theirs.abs();
                prop_assert!((ours - theirs).abs() <= allowed, "{i}: {ours} {theirs}");
            }
        }
    }
}
