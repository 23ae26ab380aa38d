//! Determines the fate of a ball on a plate at rest, stepped by one method.
//!
//! The criteria are slip and the energy normal to the plate, not the position: a slip that
//! chatters hardly affects the position.

use serde::Serialize;

use crate::methods::Stiff;
use crate::methods::{RODAS3, RODAS4};
use crate::models::{Compliant, ContactStep};
use crate::scene::Method;
use offbd_core::maths::{EULER, MIDPOINT, RK4, System, semi_implicit_euler};
use offbd_core::plant::{Ball, Body, Contact, Ground, Motion, Plate, PlateMotion, Tilt};

/// The fate of a ball.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Fate {
    /// A small disturbance decays, and a ball that starts just touching the plate settles.
    Stable,
    /// A small disturbance decays, but a ball that starts just touching the plate slips
    /// away or is thrown off.
    Touchdown,
    /// The slip does not return to the creep that friction needs.
    Chatter,
    /// The ball is thrown off the plate, or the state is not finite any more.
    BlownUp,
}

/// Number of steps in which a disturbance must decay or grow; chosen.
const STEPS: usize = 600;

/// Minimum time for a landing to settle, s. Chosen: over six time constants of the slower
/// of the chapter's normal modes.
const LANDING_S: f64 = 8e-3;

/// Initial disturbance of the slip along each axis, in units of v_thr; chosen small enough
/// to stay in the linear range of friction.
const KICK: f64 = 0.01;

/// Initial disturbance of the depth as a share of the depth at rest; chosen.
const PRESS: f64 = 1e-3;

/// Relative increase from which on a disturbance counts as grown. Chosen small: with
/// little damping the normal mode grows slowly.
const GROWN: f64 = 1e-6;

/// Energy normal to the plate, in units of weight times depth at rest, above which the
/// ball counts as thrown off. Chosen: the initial energy is at most 1.
const THROWN: f64 = 10.0;

/// Slip error in units of v_thr above which a landing counts as failed. Chosen: no landing
/// that succeeds leaves as much.
const SLIPS: f64 = 3.0;

/// A ball on a plate at rest, tilted by π/20 about both axes.
pub(super) struct BallOnHeldPlate {
    pub model: Compliant,
    plate: PlateMotion,
}

impl System<9> for BallOnHeldPlate {
    const POSITIONS: usize = 3;

    #[inline]
    fn rate(&self, _: f64, y: &[f64; 9]) -> [f64; 9] {
        self.model.rate(y, &self.plate)
    }
}

impl Stiff<9> for BallOnHeldPlate {
    fn jacobian(&self, _: f64, y: &[f64; 9]) -> [[f64; 9]; 9] {
        self.model.jacobian(y, &self.plate)
    }
}

impl BallOnHeldPlate {
    pub(super) fn new(contact: Contact) -> Self {
        let body = Body::ball(&Ball::default(), &Plate::default());
        let angle = std::f64::consts::PI / 20.0;
        Self {
            model: Compliant::new(body, contact, Ground::Endless),
            plate: Tilt::constant(angle, angle).motion(),
        }
    }

    /// Returns the normal force at rest per mass, m/s².
    pub(super) fn normal_m_s2(&self) -> f64 {
        -self.plate.gravity.z
    }

    fn sag(&self) -> f64 {
        self.model.body.mass_kg() * self.normal_m_s2() / self.model.contact.stiffness_n_per_m()
    }

    /// Returns the creep, the slip that carries the friction of the rolling ball, m/s.
    fn creep(&self) -> [f64; 2] {
        let (body, contact) = (&self.model.body, &self.model.contact);
        let share = 1.0 / (body.slip_ease() * body.mass_kg());
        let per = contact.slip_threshold_m_s() / (contact.friction() * self.normal_m_s2());
        [-self.plate.gravity.x * share * per, -self.plate.gravity.y * share * per]
    }

    /// Returns the equilibrium of depth and creep with small disturbances of both.
    fn settled(&self) -> [f64; 9] {
        let mut at = Motion::at_rest(&self.model.body);
        let kick = KICK * self.model.contact.slip_threshold_m_s();
        let [x, y] = self.creep();
        at.position.z -= self.sag() * (1.0 + PRESS);
        (at.velocity.x, at.velocity.y) = (-x - kick, -y - kick);
        at.to_row()
    }

    /// Returns the slip error, the distance of the slip from the creep, in units of v_thr.
    fn slip_off(&self, y: &[f64; 9]) -> f64 {
        let at = Motion::from_row(y);
        let (slip, creep) = (self.model.body.slip(&at.velocity, &at.spin), self.creep());
        (slip[0] - creep[0]).hypot(slip[1] - creep[1]) / self.model.contact.slip_threshold_m_s()
    }

    /// Returns the energy normal to the plate above that of the ball at rest, in units of
    /// weight times depth at rest.
    fn normal_energy(&self, y: &[f64; 9]) -> f64 {
        let (sag, g) = (self.sag(), self.normal_m_s2());
        let above = y[2] - self.model.body.rest_height_m();
        let spring = above.min(0.0).powi(2) / sag;
        (y[5] * y[5] / 2.0 + g * (above + spring / 2.0)) / (g * sag) + 0.5
    }

    /// Returns the fate of the ball by `method` with steps of `h`, and the final slip error
    /// in units of v_thr.
    pub(super) fn fate(&self, method: Method, h: f64) -> (Fate, f64) {
        let end = self.run(method, self.settled(), h, STEPS);
        let off = self.slip_off(&end);
        if self.grew(&end)[1] || !off.is_finite() {
            return (Fate::BlownUp, off);
        }
        if self.grew(&end)[0] {
            return (Fate::Chatter, off);
        }
        let steps = STEPS.max((LANDING_S / h).ceil() as usize);
        let landed = self.run(method, Motion::at_rest(&self.model.body).to_row(), h, steps);
        let holds = self.normal_energy(&landed) <= THROWN && self.slip_off(&landed) <= SLIPS;
        (if holds { Fate::Stable } else { Fate::Touchdown }, off)
    }

    /// Returns whether a small disturbance of the equilibrium decays.
    pub(super) fn dies_out(&self, method: Method, h: f64) -> bool {
        self.grew(&self.run(method, self.settled(), h, STEPS)) == [false; 2]
    }

    /// Returns whether the disturbances of slip and of the normal mode have grown; NaN
    /// counts as grown.
    fn grew(&self, end: &[f64; 9]) -> [bool; 2] {
        let start = self.settled();
        let within = |end: f64, start: f64| end <= start * (1.0 + GROWN);
        [
            !within(self.slip_off(end), self.slip_off(&start)),
            !within(self.normal_energy(end), self.normal_energy(&start)),
        ]
    }

    /// Returns the change of slip by full friction within `h`, in units of v_thr.
    pub(super) fn full_friction(&self, h: f64) -> f64 {
        let (body, contact) = (&self.model.body, &self.model.contact);
        let rate = body.slip_ease() * body.mass_kg() * contact.friction() * self.normal_m_s2();
        rate * h / contact.slip_threshold_m_s()
    }

    fn run(&self, method: Method, mut y: [f64; 9], h: f64, steps: usize) -> [f64; 9] {
        let contact = ContactStep::new(&self.model, h);
        for _ in 0..steps {
            y = match method {
                Method::Euler => EULER.step(self, 0.0, &y, h),
                Method::SemiImplicitEuler => semi_implicit_euler(self, 0.0, &y, h),
                Method::Midpoint => MIDPOINT.step(self, 0.0, &y, h),
                Method::Rk4 => RK4.step(self, 0.0, &y, h),
                Method::Rodas3 => RODAS3.step(self, 0.0, &y, h).map_or([f64::NAN; 9], |to| to.y),
                Method::Rodas4 => RODAS4.step(self, 0.0, &y, h).map_or([f64::NAN; 9], |to| to.y),
                _ => contact.step(&Motion::from_row(&y), &self.plate).to_row(),
            };
            if !self.normal_energy(&y).is_finite() {
                break;
            }
        }
        y
    }
}
