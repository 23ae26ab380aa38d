//! One step of one ball. Whatever steps a batch steps it through these
//! functions, so that a ball does not know whether it is alone.
//!
//! The acceleration of a rolling ball is linear in its state, with
//! coefficients that only the plate decides. With Ω = (a, b, c), where
//! a = q̇x cos qy, b = q̇y, c = q̇x sin qy, and α = Ω̇, the equations at the head
//! of `rolling.rs` come to
//!
//! ```text
//! (1 + κ)·v̇x = g_x − ac·z − q̈y·(z + κr) + (b² + c²)·x + (α_z − ab)·y + (2 + κ)c·vy + κr·a·w
//! (1 + κ)·v̇y = g_y − bc·z + α_x·(z + κr) − (α_z + ab)·x + q̇x²·y − (2 + κ)c·vx + κr·b·w
//! ẇ = −α_z − (a·vx + b·vy)/r
//! ```
//!
//! where z is the height of the ball's centre and w its spin. Both stages of
//! a step share one set of coefficients.

use nalgebra::Vector2;

use offbd_core::maths::sine::sin_cos;
use offbd_core::plant::{Ball, GRAVITY_M_S2, Plate, RollingState, Tilt};

/// What a step needs to know of one ball on one plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RollingConstants {
    /// Height of the resting ball's centre above the joint, m.
    pub(super) centre_gap: f64,
    /// κ r, m.
    pub(super) spin_arm: f64,
    /// 1/r, 1/m.
    pub(super) curvature: f64,
    /// 1/(1 + κ): what rolling leaves of a force.
    pub(super) share: f64,
    /// 2 + κ.
    pub(super) coriolis: f64,
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

    /// One step of `step_s` seconds by the explicit midpoint rule (order 2),
    /// without an external force; `tilt` is the plate at the middle of the
    /// step, its angles within ±1000 rad.
    ///
    /// Equal, to the bit, to the step of the same ball in a
    /// [`RollingBatch`](super::RollingBatch).
    #[must_use]
    pub fn midpoint(&self, state: &RollingState, tilt: &Tilt, step_s: f64) -> RollingState {
        let turn = Turn {
            x: sin_cos(tilt.angle.x),
            y: sin_cos(tilt.angle.y),
            rate: tilt.rate.into(),
            acceleration: tilt.acceleration.into(),
        };
        self.step(&Motion::from(state), &turn, step_s).into()
    }

    #[inline(always)]
    pub(super) fn step(&self, motion: &Motion, turn: &Turn, step_s: f64) -> Motion {
        let field = Field::new(self, turn);
        let middle = field.moved(motion, motion, 0.5 * step_s);
        field.moved(motion, &middle, step_s)
    }
}

/// A [`RollingState`] as plain numbers.
#[derive(Clone, Copy)]
pub(super) struct Motion {
    pub x: f64,
    pub y: f64,
    pub vx: f64,
    pub vy: f64,
    pub spin: f64,
}

impl From<&RollingState> for Motion {
    fn from(state: &RollingState) -> Self {
        let RollingState { position, velocity, spin } = *state;
        Self { x: position.x, y: position.y, vx: velocity.x, vy: velocity.y, spin }
    }
}

impl From<Motion> for RollingState {
    fn from(motion: Motion) -> Self {
        Self {
            position: Vector2::new(motion.x, motion.y),
            velocity: Vector2::new(motion.vx, motion.vy),
            spin: motion.spin,
        }
    }
}

/// A [`Tilt`] by the sines and cosines of its angles.
#[derive(Clone, Copy)]
pub(super) struct Turn {
    /// (sin, cos) of qx.
    pub x: (f64, f64),
    /// (sin, cos) of qy.
    pub y: (f64, f64),
    /// (q̇x, q̇y), rad/s.
    pub rate: [f64; 2],
    /// (q̈x, q̈y), rad/s².
    pub acceleration: [f64; 2],
}

/// The coefficients of the motion: what each part of the state adds to the
/// accelerations, the linear ones before [`RollingConstants::share`].
struct Field {
    share: f64,
    constant: [f64; 2],
    /// By x and y.
    x_by: [f64; 2],
    y_by: [f64; 2],
    /// Of vy on x, and of −vx on y.
    sideways: f64,
    /// Of the spin.
    spin: [f64; 2],
    /// −ẇ: constant, by vx and by vy.
    despin: [f64; 3],
}

impl Field {
    #[inline(always)]
    fn new(of: &RollingConstants, turn: &Turn) -> Self {
        let ((sin_x, cos_x), (sin_y, cos_y)) = (turn.x, turn.y);
        let ([rate_x, b], [acceleration_x, acceleration_y]) = (turn.rate, turn.acceleration);
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

    /// `from`, moved for `h` seconds at the rates that hold at `at`. What is
    /// known last is added last, so that little waits for it.
    #[inline(always)]
    fn moved(&self, from: &Motion, at: &Motion, h: f64) -> Motion {
        let by_place = [
            self.constant[0] + (self.x_by[0] * at.x + self.x_by[1] * at.y),
            self.constant[1] + (self.y_by[0] * at.x + self.y_by[1] * at.y),
        ];
        let by_rate = [
            self.sideways * at.vy + self.spin[0] * at.spin,
            self.spin[1] * at.spin - self.sideways * at.vx,
        ];
        let despin = self.despin[0] + (self.despin[1] * at.vx + self.despin[2] * at.vy);
        let gain = self.share * h;
        Motion {
            x: from.x + at.vx * h,
            y: from.y + at.vy * h,
            vx: from.vx + (by_place[0] + by_rate[0]) * gain,
            vy: from.vy + (by_place[1] + by_rate[1]) * gain,
            spin: from.spin - despin * h,
        }
    }
}
