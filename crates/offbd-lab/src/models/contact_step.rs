//! A step of the compliant model in closed form: the stiff terms by backward Euler, the
//! slow terms by the midpoint rule.
//!
//! The normal mode is linear, so its backward Euler step is one division. Slip
//! along each axis feels a force that is linear up to v_thr and constant
//! beyond, so its backward Euler step is one division and one clamp:
//!
//! ```text
//! vz' = (vz + h·a_z − h·K/m·(pz − cgap)) / (1 + h·D/m + h²·K/m)
//! s'  = s* / (1 + h·μ·F_z·e/v_thr)  if |s'| ≤ v_thr, else F = μ·F_z·sign(s*)
//!       with s* the slip without friction and e = 1/m + r²/I
//! ```
//!
//! Gravity and the fictitious forces are evaluated at the middle of the step, with
//! velocity and spin predicted by rolling or free fall. So the slow motion is of second
//! order, while the contact is stable at any step.

use nalgebra::Vector3;

use super::compliant::Compliant;
use offbd_core::plant::{Motion, PlateMotion};

/// Contact steps of one length, with their precomputed constants. Forces are per
/// kilogram.
#[derive(Clone, Copy, Debug)]
pub struct ContactStep {
    model: Compliant,
    h: f64,
    per_h: f64,
    /// h·K/m, 1/s.
    spring: f64,
    /// 1/(1 + h·D/m + h²·K/m).
    held: f64,
    friction: f64,
    threshold: f64,
    /// h·(1 + m·r²/I), s.
    ease: f64,
    /// m·r/I, 1/m.
    lever: f64,
    /// Acceleration of the rolling ball over that of a frictionless one, 1/(1 + κ); 0 for
    /// a block.
    rolls: f64,
    /// Spin over velocity while rolling, 1/r; 0 for a block.
    turns: f64,
    /// κ·r, m; 0 for a block.
    roll_arm: f64,
}

impl ContactStep {
    /// Creates steps of `h` seconds, above 0, of `model`.
    #[must_use]
    pub fn new(model: &Compliant, h: f64) -> Self {
        let (body, contact) = (&model.body, &model.contact);
        let m = body.mass_kg();
        let (k, d) = (contact.stiffness_n_per_m() / m, contact.damping_n_s_per_m() / m);
        Self {
            model: *model,
            h,
            per_h: 1.0 / h,
            spring: h * k,
            held: 1.0 / (1.0 + h * d + h * h * k),
            friction: contact.friction(),
            threshold: contact.slip_threshold_m_s(),
            ease: h * body.slip_ease() * m,
            lever: body.arm_m() * body.inverse_inertia() * m,
            rolls: 1.0 - 1.0 / (body.slip_ease() * m),
            turns: if body.turns() { 1.0 / body.arm_m() } else { 0.0 },
            roll_arm: if body.turns() {
                1.0 / (m * body.arm_m() * body.inverse_inertia())
            } else {
                0.0
            },
        }
    }

    /// Returns the motion after one step; `plate` is the plate at the middle of the step.
    #[must_use]
    #[inline]
    pub fn step(&self, from: &Motion, plate: &PlateMotion) -> Motion {
        let (body, h) = (&self.model.body, self.h);
        let (v, w) = self.half_way(from, plate);
        let a = plate.free(&(from.position + v * (h / 2.0)), &v);
        let turn = if body.turns() { plate.free_turn(&w) } else { Vector3::zeros() };
        let normal = self.normal_force(from, a.z);
        let slip = body.slip(&(from.velocity + a * h), &(from.spin + turn * h));
        let [x, y] = self.friction(slip, normal);
        let velocity = from.velocity + (a + Vector3::new(x, y, normal)) * h;
        let mean = (from.velocity + velocity) / 2.0;
        Motion {
            position: from.position + Vector3::new(mean.x, mean.y, velocity.z) * h,
            velocity,
            spin: from.spin + (turn + Vector3::new(self.lever * y, -self.lever * x, 0.0)) * h,
        }
    }

    /// Predicts velocity and spin at the middle of the step, for the slow terms: on the
    /// plate as if the ball rolled (or the block stuck), above it as in free fall.
    #[inline]
    fn half_way(&self, from: &Motion, plate: &PlateMotion) -> (Vector3<f64>, Vector3<f64>) {
        let half = self.h / 2.0;
        let free = plate.free(&from.position, &from.velocity);
        if from.position.z > self.model.body.rest_height_m() {
            return (from.velocity + free * half, from.spin);
        }
        let turn = plate.free_turn(&from.spin);
        let x = half * self.rolls * (free.x + self.roll_arm * turn.y);
        let y = half * self.rolls * (free.y - self.roll_arm * turn.x);
        let spin = Vector3::new(-y * self.turns, x * self.turns, half * turn.z);
        (from.velocity + Vector3::new(x, y, 0.0), from.spin + spin)
    }

    /// Returns F_z/m during the step; 0 if the body is off the plate at its end.
    #[inline]
    fn normal_force(&self, from: &Motion, a_z: f64) -> f64 {
        let (p, h) = (&from.position, self.h);
        let depth = p.z - self.model.body.rest_height_m();
        let free = from.velocity.z + h * a_z;
        let touching = (free - self.spring * depth) * self.held;
        let apart = depth >= 0.0 && depth + h * free >= 0.0;
        if apart || depth + h * touching >= 0.0 || self.model.ground.margin_m(p.x, p.y) <= 0.0 {
            return 0.0;
        }
        let force = (touching - free) * self.per_h;
        if self.model.pushes_only() { force.max(0.0) } else { force }
    }

    /// Returns (F_x, F_y)/m during a step that without friction would end with the slip
    /// `free`.
    #[inline]
    fn friction(&self, free: [f64; 2], normal: f64) -> [f64; 2] {
        let limit = self.friction * normal;
        // If the plate pulls, friction reverses and drives the slip: then the explicit
        // step is the stable one.
        let sticks = self.threshold + self.ease * limit.max(0.0);
        if self.model.limits_as_a_cone() {
            let scale = limit / sticks.max(free[0].hypot(free[1]));
            return free.map(|s| scale * s);
        }
        let scale = limit / sticks;
        let most = limit.abs();
        free.map(|s| (s * scale).clamp(-most, most))
    }
}
