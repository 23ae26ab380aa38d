//! What becomes of a ball on a held plate, step after step by one method.
//!
//! Judged by slip and by the energy normal to the plate, never by position: a
//! slip that chatters leaves the position as good as right.

use serde::Serialize;

use crate::methods::Stiff;
use crate::methods::{RODAS3, RODAS4};
use crate::models::{Compliant, ContactStep};
use crate::scene::Method;
use offbd_core::maths::{EULER, MIDPOINT, RK4, System, semi_implicit_euler};
use offbd_core::plant::{Ball, Body, Contact, Ground, Motion, Plate, PlateMotion, Tilt};

/// What becomes of the ball.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Fate {
    /// A small disturbance dies out, and the ball may begin off the plate.
    Stable,
    /// A small disturbance dies out, but a ball that begins where it only
    /// touches comes to slip or is thrown off.
    Touchdown,
    /// The slip stays away from the creep that friction needs.
    Chatter,
    /// Thrown off the plate, or no number any more.
    BlownUp,
}

/// Steps in which a disturbance must die out or grow.
const STEPS: usize = 600;

/// A landing has this long at least to settle, s: six times the slower of the
/// chapter's normal modes.
const LANDING_S: f64 = 8e-3;

/// The first slip beside the creep along each axis, over v_thr.
const KICK: f64 = 0.01;

/// The first depth beside that at rest, as a part of it.
const PRESS: f64 = 1e-3;

/// A disturbance that is larger by this part at the end has grown: a spring
/// that is hardly damped takes long to show it.
const GROWN: f64 = 1e-6;

/// Energy normal to the plate over weight times depth at rest: above, the ball
/// was thrown off. At the start it is 1 at most.
const THROWN: f64 = 10.0;

/// Slip over v_thr that no landing leaves behind by itself.
const SLIPS: f64 = 3.0;

/// A ball on a plate held at π/20 about both axes.
pub(super) struct Held {
    pub model: Compliant,
    plate: PlateMotion,
}

impl System<9> for Held {
    const POSITIONS: usize = 3;

    #[inline]
    fn rate(&self, _: f64, y: &[f64; 9]) -> [f64; 9] {
        self.model.rate(y, &self.plate)
    }
}

impl Stiff<9> for Held {
    fn jacobian(&self, _: f64, y: &[f64; 9]) -> [[f64; 9]; 9] {
        self.model.jacobian(y, &self.plate)
    }
}

impl Held {
    pub(super) fn new(contact: Contact) -> Self {
        let body = Body::ball(&Ball::default(), &Plate::default());
        let angle = std::f64::consts::PI / 20.0;
        Self {
            model: Compliant::new(body, contact, Ground::Endless),
            plate: Tilt::constant(angle, angle).motion(),
        }
    }

    /// Normal force at rest over mass, m/s².
    pub(super) fn normal_m_s2(&self) -> f64 {
        -self.plate.gravity.z
    }

    fn sag(&self) -> f64 {
        self.model.body.mass_kg() * self.normal_m_s2() / self.model.contact.stiffness_n_per_m()
    }

    /// The slip that carries the friction of the rolling ball, m/s.
    fn creep(&self) -> [f64; 2] {
        let (body, contact) = (&self.model.body, &self.model.contact);
        let share = 1.0 / (body.slip_ease() * body.mass_kg());
        let per = contact.slip_threshold_m_s() / (contact.friction() * self.normal_m_s2());
        [-self.plate.gravity.x * share * per, -self.plate.gravity.y * share * per]
    }

    /// Pressed in and creeping as it must, but for a small slip and a
    /// thousandth of the depth.
    fn settled(&self) -> [f64; 9] {
        let mut at = Motion::at_rest(&self.model.body);
        let kick = KICK * self.model.contact.slip_threshold_m_s();
        let [x, y] = self.creep();
        at.position.z -= self.sag() * (1.0 + PRESS);
        (at.velocity.x, at.velocity.y) = (-x - kick, -y - kick);
        at.to_row()
    }

    /// Slip beside the creep, over v_thr.
    fn slip_off(&self, y: &[f64; 9]) -> f64 {
        let at = Motion::from_row(y);
        let (slip, creep) = (self.model.body.slip(&at.velocity, &at.spin), self.creep());
        (slip[0] - creep[0]).hypot(slip[1] - creep[1]) / self.model.contact.slip_threshold_m_s()
    }

    /// Energy normal to the plate beyond that of the settled ball, over weight
    /// times depth.
    fn thrown(&self, y: &[f64; 9]) -> f64 {
        let (sag, g) = (self.sag(), self.normal_m_s2());
        let above = y[2] - self.model.body.rest_height_m();
        let spring = above.min(0.0).powi(2) / sag;
        (y[5] * y[5] / 2.0 + g * (above + spring / 2.0)) / (g * sag) + 0.5
    }

    /// What becomes of it by `method` with steps of `h`, and the last slip
    /// beside the creep, over v_thr.
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
        let holds = self.thrown(&landed) <= THROWN && self.slip_off(&landed) <= SLIPS;
        (if holds { Fate::Stable } else { Fate::Touchdown }, off)
    }

    /// Whether a small disturbance of the settled ball dies out.
    pub(super) fn dies_out(&self, method: Method, h: f64) -> bool {
        self.grew(&self.run(method, self.settled(), h, STEPS)) == [false; 2]
    }

    /// Whether the disturbances of slip and of the normal mode have grown; what
    /// is no number has.
    fn grew(&self, end: &[f64; 9]) -> [bool; 2] {
        let start = self.settled();
        let within = |end: f64, start: f64| end <= start * (1.0 + GROWN);
        [
            !within(self.slip_off(end), self.slip_off(&start)),
            !within(self.thrown(end), self.thrown(&start)),
        ]
    }

    /// What full friction changes of the slip within `h`, over v_thr.
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
            if !self.thrown(&y).is_finite() {
                break;
            }
        }
        y
    }
}
