//! The creeping ball: rolling with the creep and sag of the contact, to first order.
//!
//! Regularised friction needs a small slip to carry a force, and the spring a small
//! depth. With F the forces that rolling implies,
//!
//! ```text
//! s = v_thr·F_xy/(μ·F_z)          creep, the slip that carries F_xy
//! δ = F_z/K                       sag, the depth that carries F_z
//! ```
//!
//! both settle within τ_n = D/K and τ_s = v_thr/((1 + 1/κ)·μ·g), about 1 ms and 5 µs
//! with the chapter's numbers. While they settle,
//! U = v + κ/(1 + κ)·s + 2/(1 + κ)·(−Ω_y·δ, Ω_x·δ) is constant: friction exchanges v for
//! s, and sinking in a turning plate exchanges v for δ (Coriolis). So U obeys a smooth
//! equation, and no step has to resolve the contact: this is the slow manifold of the
//! compliant model to first order (singular perturbation).
//!
//! Valid where rolling is valid and the motion is slow against τ_n and τ_s.

use nalgebra::Vector3;

use offbd_core::plant::{Ball, Body, Contact, Grip, Motion, Plate, PlateMotion, Rolling};

/// The creeping model of one ball on one plate. Its state is (x, y, Ux, Uy, wz).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Creeping {
    rolling: Rolling,
    body: Body,
    kappa: f64,
    contact: Contact,
}

/// The creep and sag of the contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CreepAndSag {
    /// Creep: slip along x and y, m/s.
    pub slip: [f64; 2],
    /// Sag: depth of the ball in the plate, m.
    pub sag: f64,
    /// v − U along x and y, m/s.
    pub velocity: [f64; 2],
}

impl Creeping {
    #[must_use]
    pub fn new(ball: &Ball, plate: &Plate, contact: &Contact) -> Self {
        Self {
            rolling: Rolling::new(ball, plate),
            body: Body::ball(ball, plate),
            kappa: ball.inertia_factor(),
            contact: *contact,
        }
    }

    #[must_use]
    pub const fn rolling(&self) -> &Rolling {
        &self.rolling
    }

    /// Returns the settling times of sag and creep, s, under the normal force per mass
    /// `normal`, m/s².
    #[must_use]
    pub fn settling_s(&self, normal: f64) -> [f64; 2] {
        let contact = &self.contact;
        let sag = contact.damping_n_s_per_m() / contact.stiffness_n_per_m();
        let share = self.kappa / (1.0 + self.kappa);
        [sag, share * contact.slip_threshold_m_s() / (contact.friction() * normal)]
    }

    /// Returns creep and sag under the contact forces `grip`.
    #[must_use]
    #[inline]
    pub fn creep_and_sag(&self, grip: &Grip, plate: &PlateMotion) -> CreepAndSag {
        let sag = self.body.mass_kg() * grip.normal / self.contact.stiffness_n_per_m();
        let per = self.contact.slip_threshold_m_s() / (self.contact.friction() * grip.normal);
        let slip = grip.friction.map(|f| f * per);
        CreepAndSag { slip, sag, velocity: self.velocity_offset(slip, sag, plate) }
    }

    /// Returns v − U for a slip and a depth.
    #[inline]
    fn velocity_offset(&self, slip: [f64; 2], sag: f64, plate: &PlateMotion) -> [f64; 2] {
        let share = 1.0 / (1.0 + self.kappa);
        let turn = 2.0 * sag;
        [
            share * (turn * plate.omega.y - self.kappa * slip[0]),
            share * (-turn * plate.omega.x - self.kappa * slip[1]),
        ]
    }

    /// Returns the derivatives of (x, y, Ux, Uy, wz), and the contact forces.
    #[must_use]
    #[inline]
    pub fn rate(&self, y: &[f64; 5], plate: &PlateMotion) -> ([f64; 5], Grip) {
        let (grip, rolled) = self.rolling.grip_and_rate(y, plate);
        let creep_and_sag = self.creep_and_sag(&grip, plate);
        let v = [y[2] + creep_and_sag.velocity[0], y[3] + creep_and_sag.velocity[1]];
        let correction = self.rate_correction(&creep_and_sag, plate);
        let rates =
            [rolled[2] + correction[0], rolled[3] + correction[1], rolled[4] + correction[2]];
        ([v[0], v[1], rates[0], rates[1], rates[2]], grip)
    }

    /// Returns the difference of the derivatives of (Ux, Uy, wz) from those of the rolling
    /// ball: velocity and spin differ from those of U, and the ball lies deeper.
    #[inline]
    fn rate_correction(&self, creep_and_sag: &CreepAndSag, plate: &PlateMotion) -> [f64; 3] {
        let (omega, alpha) = (&plate.omega, &plate.alpha);
        let (share, sag, [x, y]) =
            (1.0 / (1.0 + self.kappa), creep_and_sag.sag, creep_and_sag.velocity);
        // The difference of r·w, rotated by 90°.
        let [turn_x, turn_y] = [x + creep_and_sag.slip[0], y + creep_and_sag.slip[1]];
        // α×p acts at the lowered height; d(Ω·δ)/dt contributes twice the opposite.
        let sunk_x = sag * (omega.x * omega.z - alpha.y);
        let sunk_y = sag * (omega.y * omega.z + alpha.x);
        [
            share * (sunk_x + omega.z * (2.0 * y + self.kappa * turn_y)),
            share * (sunk_y - omega.z * (2.0 * x + self.kappa * turn_x)),
            -(omega.x * turn_x + omega.y * turn_y) / self.body.arm_m(),
        ]
    }

    /// Returns the state for a ball in the motion `from`, once its slip and its depth
    /// have settled.
    #[must_use]
    pub fn enter(&self, from: &Motion, plate: &PlateMotion) -> [f64; 5] {
        let slip = self.body.slip(&from.velocity, &from.spin);
        let sag = self.body.rest_height_m() - from.position.z;
        let offset = self.velocity_offset(slip, sag, plate);
        let (p, v) = (&from.position, &from.velocity);
        [p.x, p.y, v.x - offset[0], v.y - offset[1], from.spin.z]
    }

    /// Returns the ball's motion in the state `y`.
    #[must_use]
    pub fn leave(&self, y: &[f64; 5], plate: &PlateMotion) -> Motion {
        let grip = self.rolling.grip(y, plate);
        let creep_and_sag = self.creep_and_sag(&grip, plate);
        let v = [y[2] + creep_and_sag.velocity[0], y[3] + creep_and_sag.velocity[1]];
        let r = self.body.arm_m();
        Motion {
            position: Vector3::new(y[0], y[1], self.body.rest_height_m() - creep_and_sag.sag),
            velocity: Vector3::new(v[0], v[1], 0.0),
            spin: Vector3::new(
                -(v[1] + creep_and_sag.slip[1]) / r,
                (v[0] + creep_and_sag.slip[0]) / r,
                y[4],
            ),
        }
    }
}
