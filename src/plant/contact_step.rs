//! A step of the compliant model in closed form: what is stiff by backward
//! Euler, what is slow by the midpoint rule.
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
//! Gravity and the fictitious forces are taken at the middle of the step, with
//! velocity and spin from a first pass, so that the ball's slow motion is of
//! second order while the contact cannot blow up at any step.

use nalgebra::Vector3;

use super::compliant::Compliant;
use super::contact::Motion;
use super::tilt::PlateMotion;

impl Compliant {
    /// One step of `h` seconds; `plate` is the plate at its middle.
    #[must_use]
    pub fn contact_step(&self, from: &Motion, plate: &PlateMotion, h: f64) -> Motion {
        let first = self.pass(from, from, plate, h);
        let middle = Motion {
            position: from.position,
            velocity: (from.velocity + first.velocity) / 2.0,
            spin: (from.spin + first.spin) / 2.0,
        };
        self.pass(from, &middle, plate, h)
    }

    /// A step with the slow terms taken at the velocity and spin of `slow`.
    #[inline]
    fn pass(&self, from: &Motion, slow: &Motion, plate: &PlateMotion, h: f64) -> Motion {
        let middle = from.position + slow.velocity * (h / 2.0);
        let a = plate.free(&middle, &slow.velocity);
        let turn = if self.body.turns() { plate.free_turn(&slow.spin) } else { Vector3::zeros() };
        let normal = self.normal_force(from, a.z, h);
        let slip = self.body.slip(&(from.velocity + a * h), &(from.spin + turn * h));
        let [x, y] = self.friction(slip, normal, h);
        let lever = self.body.arm_m() * self.body.inverse_inertia();
        let velocity = from.velocity + (a + Vector3::new(x, y, normal) / self.body.mass_kg()) * h;
        let mean = (from.velocity + velocity) / 2.0;
        Motion {
            position: from.position + Vector3::new(mean.x, mean.y, velocity.z) * h,
            velocity,
            spin: from.spin + (turn + Vector3::new(lever * y, -lever * x, 0.0)) * h,
        }
    }

    /// F_z over the step, N; 0 where the body is off the plate at the step's end.
    #[inline]
    fn normal_force(&self, from: &Motion, a_z: f64, h: f64) -> f64 {
        let (p, v, m) = (&from.position, &from.velocity, self.body.mass_kg());
        let (k, d) = (self.contact.stiffness_n_per_m(), self.contact.damping_n_s_per_m());
        if self.ground.margin_m(p.x, p.y) <= 0.0 {
            return 0.0;
        }
        let depth = p.z - self.body.rest_height_m();
        let touching = (v.z + h * a_z - h * k / m * depth) / (1.0 + h * d / m + h * h * k / m);
        let apart = depth >= 0.0 && depth + h * (v.z + h * a_z) >= 0.0;
        if apart || depth + h * touching >= 0.0 {
            return 0.0;
        }
        let force = m * ((touching - v.z) / h - a_z);
        if self.pushes_only() { force.max(0.0) } else { force }
    }

    /// (F_x, F_y) over a step that ends with the slip `free` without friction, N.
    #[inline]
    fn friction(&self, free: [f64; 2], normal: f64, h: f64) -> [f64; 2] {
        let limit = self.contact.friction() * normal;
        // A plate that pulls turns friction round: then it drives the slip, and
        // the explicit step is the stable one.
        let implicit = h * limit.max(0.0) * self.body.slip_ease();
        let threshold = self.contact.slip_threshold_m_s();
        if self.limits_as_a_cone() {
            let speed = free[0].hypot(free[1]);
            let scale = limit / (threshold + implicit).max(speed);
            return free.map(|s| scale * s);
        }
        free.map(|s| limit * (s / (threshold + implicit)).clamp(-1.0, 1.0))
    }
}
