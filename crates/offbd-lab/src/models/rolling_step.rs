//! A step of the rolling ball with one evaluation of the plate for both stages.
//!
//! The acceleration of a rolling ball is linear in its state, with coefficients that
//! depend on the plate alone. With Ω = (a, b, c), where a = q̇x cos qy, b = q̇y,
//! c = q̇x sin qy, and α = Ω̇, the equations at the top of `rolling.rs` become
//!
//! ```text
//! (1 + κ)·v̇x = g_x − ac·z − q̈y·(z + κr) + (b² + c²)·x + (α_z − ab)·y + (2 + κ)c·vy + κr·a·w
//! (1 + κ)·v̇y = g_y − bc·z + α_x·(z + κr) − (α_z + ab)·x + q̇x²·y − (2 + κ)c·vx + κr·b·w
//! ẇ = −α_z − (a·vx + b·vy)/r
//! ```
//!
//! where z is the height of the ball's centre and w its spin about the plate's
//! normal. Both stages of a step share one set of coefficients.

use nalgebra::Vector2;

use offbd_core::maths::sine::sin_cos;
use offbd_core::plant::{Ball, GRAVITY_M_S2, Plate, RollingState, Tilt};

/// The constants of one ball on one plate, for its step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RollingConstants {
    /// Height of the resting ball's centre above the joint, m.
    centre_gap: f64,
    /// κ r, m.
    spin_arm: f64,
    /// 1/r, 1/m.
    curvature: f64,
    /// 1/(1 + κ): acceleration of the rolling ball over that of a frictionless one.
    share: f64,
    /// 2 + κ.
    coriolis: f64,
}

impl RollingConstants {
    #[must_use]
    pub fn new(ball: &Ball, plate: &Plate) -> Self {
        Self {
            centre_gap: plate.centre_gap_m(ball),
            spin_arm: ball.inertia_factor() * ball.radius_m(),
            curvature: 1.0 / ball.radius_m(),
            share: 1.0 / (1.0 + ball.inertia_factor()),
            coriolis: 2.0 + ball.inertia_factor(),
        }
    }

    /// Returns the state after one step of `step_s` seconds by the explicit midpoint
    /// rule (order 2), without an external force; `tilt` is the plate at the middle of
    /// the step, its angles within ±1000 rad.
    #[must_use]
    pub fn midpoint(&self, state: &RollingState, tilt: &Tilt, step_s: f64) -> RollingState {
        let rotation = PlateRotation {
            x: sin_cos(tilt.angle.x),
            y: sin_cos(tilt.angle.y),
            rate: tilt.rate.into(),
            acceleration: tilt.acceleration.into(),
        };
        let motion = BallNumbers::from(state);
        let field = MotionCoefficients::new(self, &rotation);
        let middle = field.moved(&motion, &motion, 0.5 * step_s);
        field.moved(&motion, &middle, step_s).into()
    }
}

/// A [`RollingState`] as scalars.
#[derive(Clone, Copy)]
struct BallNumbers {
    pub x: f64,
    pub y: f64,
    pub vx: f64,
    pub vy: f64,
    pub spin: f64,
}

impl From<&RollingState> for BallNumbers {
    fn from(state: &RollingState) -> Self {
        let RollingState { position, velocity, spin } = *state;
        Self { x: position.x, y: position.y, vx: velocity.x, vy: velocity.y, spin }
    }
}

impl From<BallNumbers> for RollingState {
    fn from(motion: BallNumbers) -> Self {
        Self {
            position: Vector2::new(motion.x, motion.y),
            velocity: Vector2::new(motion.vx, motion.vy),
            spin: motion.spin,
        }
    }
}

/// A [`Tilt`] with the sines and cosines in place of the angles.
#[derive(Clone, Copy)]
struct PlateRotation {
    /// (sin, cos) of qx.
    pub x: (f64, f64),
    /// (sin, cos) of qy.
    pub y: (f64, f64),
    /// (q̇x, q̇y), rad/s.
    pub rate: [f64; 2],
    /// (q̈x, q̈y), rad/s².
    pub acceleration: [f64; 2],
}

/// The coefficients of the equations of motion; those of the linear accelerations are
/// still to be multiplied by [`RollingConstants::share`].
struct MotionCoefficients {
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

impl MotionCoefficients {
    fn new(of: &RollingConstants, rotation: &PlateRotation) -> Self {
        let ((sin_x, cos_x), (sin_y, cos_y)) = (rotation.x, rotation.y);
        let ([rate_x, b], [acceleration_x, acceleration_y]) =
            (rotation.rate, rotation.acceleration);
        let (a, c) = (rate_x * cos_y, rate_x * sin_y);
        let (ab, bc) = (a * b, b * c);
        // α_z = q̈x sin qy + ab and α_x = q̈x cos qy − bc.
        let (twist, alpha_x) = (acceleration_x * sin_y, acceleration_x * cos_y - bc);
        let arm = of.centre_gap + of.spin_arm;
        let gravity = [GRAVITY_M_S2 * (cos_x * sin_y), -GRAVITY_M_S2 * sin_x];
        Self {
            share: of.share,
            constant: [
                (gravity[0] - acceleration_y * arm) - (a * c) * of.centre_gap,
                (gravity[1] + alpha_x * arm) - bc * of.centre_gap,
            ],
            x_by: [b * b + c * c, twist],
            y_by: [-twist - (ab + ab), rate_x * rate_x],
            sideways: of.coriolis * c,
            spin: [of.spin_arm * a, of.spin_arm * b],
            despin: [twist + ab, a * of.curvature, b * of.curvature],
        }
    }

    /// Returns `from` moved for `h` seconds at the rates at `at`. Operands that become
    /// available last are added last, which shortens the dependency chain.
    fn moved(&self, from: &BallNumbers, at: &BallNumbers, h: f64) -> BallNumbers {
        let by_position = [
            self.constant[0] + (self.x_by[0] * at.x + self.x_by[1] * at.y),
            self.constant[1] + (self.y_by[0] * at.x + self.y_by[1] * at.y),
        ];
        let by_rate = [
            self.sideways * at.vy + self.spin[0] * at.spin,
            self.spin[1] * at.spin - self.sideways * at.vx,
        ];
        let despin = self.despin[0] + (self.despin[1] * at.vx + self.despin[2] * at.vy);
        let gain = self.share * h;
        BallNumbers {
            x: from.x + at.vx * h,
            y: from.y + at.vy * h,
            vx: from.vx + (by_position[0] + by_rate[0]) * gain,
            vy: from.vy + (by_position[1] + by_rate[1]) * gain,
            spin: from.spin - despin * h,
        }
    }
}

#[cfg(test)]
mod tests {
    use offbd_core::plant::{PlateShape, Rolling};
    use proptest::prelude::*;

    use super::*;

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

    fn numbers(state: &RollingState) -> [f64; 5] {
        let RollingState { position, velocity, spin } = *state;
        [position.x, position.y, velocity.x, velocity.y, spin]
    }

    proptest! {
        /// Both compute the same terms in a different order: some forty roundings of
        /// 1.1e-16 each, of terms no larger than those summed here.
        #[test]
        fn a_step_agrees_with_the_rolling_model(
            (ball, plate) in rig(), state in state(), tilt in tilt(), h in 0.0..0.02,
        ) {
            let found = RollingConstants::new(&ball, &plate).midpoint(&state, &tilt, h);
            let expected = Rolling::new(&ball, &plate).midpoint(&state, [&tilt.motion(); 2], h);
            let largest = |v: Vector2<f64>| v.amax();
            let (rate, curvature) = (largest(tilt.rate), 1.0 / ball.radius_m());
            let (angular, speed) =
                (largest(tilt.acceleration) + 2.0 * rate * rate, largest(state.velocity));
            let (arm, spin) = (plate.centre_gap_m(&ball) + ball.radius_m(), state.spin.abs());
            let reach = largest(state.position) + arm;
            let a = 9.81 + angular * reach + 3.0 * rate * (speed + arm * spin);
            let rotation = angular + rate * (speed + h * a) * curvature;
            let growth =
                [speed + h * a, a + 3.0 * rate * h * a + rate * arm * h * rotation, rotation];
            let pairs = numbers(&found).into_iter().zip(numbers(&expected));
            for (i, (ours, theirs)) in pairs.enumerate() {
                let allowed = 4e-15 * h * growth[i / 2] + 2.3e-16 * theirs.abs();
                prop_assert!((ours - theirs).abs() <= allowed, "{i}: {ours} {theirs}");
            }
        }
    }
}
