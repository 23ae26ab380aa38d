//! The rigid plate with Coulomb friction: a body that sticks or slips along each axis,
//! leaves the plate, and lands.
//!
//! In contact pz = cgap and vz = 0. With f the acceleration and t the angular
//! acceleration of a free body, and e = m·r²/I (1/κ for a ball, 0 for a block), per
//! kilogram:
//!
//! ```text
//! N = −f_z                                          pushes while N > 0
//! F_x = (r·t_y − f_x)/(1 + e)    while it sticks, that is |F_x| ≤ μ·N
//! F_x = μ·N·sign(s_x)            while it slips, until s_x = 0
//! v̇ = f + F,   ẇ = t + m·r/I·(F_y, −F_x, 0),   F_y alike with −r·t_x
//! ```
//!
//! Landing is inelastic (the chapter's contact is overdamped by a factor of 2.5): vz
//! becomes zero, and the friction impulse reduces the slip by at most μ times the normal
//! impulse. Friction acts on each axis separately (a friction box), as in the chapter.
//!
//! Valid for a contact that is stiff compared with the motion: no sag, no creep,
//! instantaneous landing.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::contact::{Body, Ground, Motion};
use super::tilt::PlateMotion;

/// How the contact holds along one axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Hold {
    /// No slip along this axis.
    Stick,
    /// Slip with this sign of s, ±1.
    Slip(f64),
}

/// The phase of a body's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// On the plate, with the hold along x and y.
    Contact([Hold; 2]),
    /// Above the plate.
    Flight,
    /// Beyond the edge; final.
    Fallen,
}

impl Phase {
    /// A description for people.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Contact([Hold::Stick, Hold::Stick]) => "rolls",
            Self::Contact(_) => "slips",
            Self::Flight => "flies",
            Self::Fallen => "falls",
        }
    }
}

/// The sliding model of one body on one rigid plate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sliding {
    pub body: Body,
    friction: f64,
    pub ground: Ground,
}

/// Slip below this counts as none, m/s: a thousandth of the chapter's threshold.
const NO_SLIP_M_S: f64 = 1e-7;

/// Distance from the plate within which a body touches it, m. The chapter's ball rests at
/// a depth of 6e-7 m, so a start on a compliant plate counts as touching.
const TOUCHING_M: f64 = 1e-5;

impl Sliding {
    /// Builds the model with `friction` μ in (0, 100].
    #[must_use]
    pub const fn new(body: Body, friction: f64, ground: Ground) -> Self {
        Self { body, friction, ground }
    }

    /// e = m·r²/I.
    fn inertia_ratio(&self) -> f64 {
        self.body.slip_ease() * self.body.mass_kg() - 1.0
    }

    /// Normal force per mass, m/s².
    #[inline]
    fn normal(free: &Vector3<f64>) -> f64 {
        -free.z
    }

    #[inline]
    fn free(&self, at: &Motion, plate: &PlateMotion) -> (Vector3<f64>, Vector3<f64>) {
        let turn = if self.body.turns() { plate.free_turn(&at.spin) } else { Vector3::zeros() };
        (plate.free(&at.position, &at.velocity), turn)
    }

    /// Friction force per mass that would keep each axis from slipping, m/s².
    #[inline]
    fn sticking(&self, free: &Vector3<f64>, turn: &Vector3<f64>) -> [f64; 2] {
        let (r, share) = (self.body.arm_m(), 1.0 / (1.0 + self.inertia_ratio()));
        [(r * turn.y - free.x) * share, (-r * turn.x - free.y) * share]
    }

    #[inline]
    fn friction(&self, holds: &[Hold; 2], normal: f64, sticking: [f64; 2]) -> [f64; 2] {
        core::array::from_fn(|axis| match holds[axis] {
            Hold::Stick => sticking[axis],
            Hold::Slip(sign) => sign * self.friction * normal,
        })
    }

    /// Returns the rates of (p, v, w) in `phase` under the plate's motion.
    #[must_use]
    #[inline]
    pub fn rate(&self, phase: &Phase, y: &[f64; 9], plate: &PlateMotion) -> [f64; 9] {
        let at = Motion::from_row(y);
        let (mut a, mut turn) = self.free(&at, plate);
        if let Phase::Contact(holds) = phase {
            let [x, y] = self.friction(holds, Self::normal(&a), self.sticking(&a, &turn));
            let lever = self.body.arm_m() * self.body.inverse_inertia() * self.body.mass_kg();
            a = Vector3::new(a.x + x, a.y + y, 0.0);
            turn += Vector3::new(lever * y, -lever * x, 0.0);
        }
        let v = at.velocity;
        [v.x, v.y, v.z, a.x, a.y, a.z, turn.x, turn.y, turn.z]
    }

    /// Returns the event function of `phase`: positive while the phase lasts, 0 at its
    /// end, negative beyond. Continuous along a motion within one phase; its parts are in
    /// m, m/s and m/s².
    #[must_use]
    pub fn margin(&self, phase: &Phase, y: &[f64; 9], plate: &PlateMotion) -> f64 {
        let at = Motion::from_row(y);
        let over = self.ground.margin_m(at.position.x, at.position.y);
        match phase {
            Phase::Fallen => f64::INFINITY,
            Phase::Flight => over.min(at.position.z - self.body.rest_height_m()),
            Phase::Contact(holds) => over.min(self.contact_margin(holds, &at, plate)),
        }
    }

    fn contact_margin(&self, holds: &[Hold; 2], at: &Motion, plate: &PlateMotion) -> f64 {
        let (free, turn) = self.free(at, plate);
        let (sticking, slip) =
            (self.sticking(&free, &turn), self.body.slip(&at.velocity, &at.spin));
        let normal = Self::normal(&free);
        let held = (0..2).map(|axis| match holds[axis] {
            Hold::Stick => self.friction * normal - sticking[axis].abs(),
            Hold::Slip(sign) => sign * slip[axis],
        });
        held.fold(normal, f64::min)
    }

    /// Returns the phase that follows for a body moving as `at`, and the motion at its
    /// start: a landing sets vz to zero.
    #[must_use]
    pub fn enter(&self, at: &Motion, plate: &PlateMotion) -> (Phase, Motion) {
        if self.ground.margin_m(at.position.x, at.position.y) <= 0.0 {
            return (Phase::Fallen, *at);
        }
        let above = at.position.z - self.body.rest_height_m();
        if above > TOUCHING_M {
            return (Phase::Flight, *at);
        }
        let landed = self.land(at);
        let (free, turn) = self.free(&landed, plate);
        if Self::normal(&free) <= 0.0 || (above >= 0.0 && at.velocity.z > 0.0) {
            // A body that moves towards the plate faster than the plate recedes is
            // stopped: it would pass through the plate.
            return (Phase::Flight, if at.velocity.z < 0.0 { landed } else { *at });
        }
        let sticking = self.sticking(&free, &turn);
        let slip = self.body.slip(&landed.velocity, &landed.spin);
        let holds = core::array::from_fn(|axis| {
            if slip[axis].abs() > NO_SLIP_M_S {
                Hold::Slip(slip[axis].signum())
            } else if sticking[axis].abs() > self.friction * Self::normal(&free) {
                Hold::Slip(sticking[axis].signum())
            } else {
                Hold::Stick
            }
        });
        (Phase::Contact(holds), landed)
    }

    /// Returns the motion after an inelastic landing; a soft one changes little.
    fn land(&self, at: &Motion) -> Motion {
        let mut to = *at;
        let impulse = (-at.velocity.z).max(0.0);
        let slip = self.body.slip(&at.velocity, &at.spin);
        let most = self.friction * impulse;
        let [x, y] = slip.map(|s| (s / (1.0 + self.inertia_ratio())).clamp(-most, most));
        let lever = self.body.arm_m() * self.body.inverse_inertia() * self.body.mass_kg();
        to.velocity += Vector3::new(x, y, 0.0);
        to.velocity.z = 0.0;
        to.position.z = self.body.rest_height_m();
        to.spin += Vector3::new(lever * y, -lever * x, 0.0);
        to
    }
}
