//! The equations that every peer is judged by, in the plate's frame.
//!
//! State of the compliant ball: position, velocity and spin relative to the plate
//! (9 numbers). State of the rolling ball: px, py, vx, vy, wz.

use crate::scene::{Contact, Law};

pub const GRAVITY: f64 = 9.81;
pub const RADIUS: f64 = 0.0127;
pub const MASS: f64 = 0.051;
/// Moment of inertia over m r²: solid sphere.
pub const SHAPE: f64 = 0.4;
pub const INERTIA: f64 = SHAPE * MASS * RADIUS * RADIUS;
pub const FRICTION: f64 = 0.6;
/// Slip at which friction saturates, in m/s.
pub const SLIP_LIMIT: f64 = 1e-4;
pub const REST_HEIGHT: f64 = 0.0227;

/// At rest at the centre.
pub const START: [f64; 9] = [0.0, 0.0, REST_HEIGHT, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

type Triple = [f64; 3];

/// Gravity, angular velocity and angular acceleration of the plate, in its frame.
struct Plate {
    gravity: Triple,
    turn: Triple,
    turn_rate: Triple,
}

impl Plate {
    #[inline]
    fn at(law: Law, t: f64) -> Self {
        let motion = law.at(t);
        let [(sx, cx), (sy, cy)] = motion.angle.map(f64::sin_cos);
        let ([rx, ry], [ax, ay]) = (motion.rate, motion.acceleration);
        Self {
            gravity: [GRAVITY * cx * sy, -GRAVITY * sx, -GRAVITY * cx * cy],
            turn: [rx * cy, ry, rx * sy],
            turn_rate: [ax * cy - rx * ry * sy, ay, ax * sy + rx * ry * cy],
        }
    }

    /// What turning adds to the acceleration at `p`, `v`: linear in both.
    #[inline]
    fn fictitious(&self, p: Triple, v: Triple) -> Triple {
        let coriolis = cross(self.turn, v);
        let centrifugal = cross(self.turn, cross(self.turn, p));
        let euler = cross(self.turn_rate, p);
        std::array::from_fn(|i| -2.0 * coriolis[i] - centrifugal[i] - euler[i])
    }
}

/// Derivative of the compliant state.
#[inline]
pub fn compliant(law: Law, contact: Contact, t: f64, y: &[f64], out: &mut [f64]) {
    let plate = Plate::at(law, t);
    let ([p, v, w], force) = (parts(y), contact_force(contact, y));
    let (added, carried) = (plate.fictitious(p, v), cross(plate.turn, w));
    let torque = [RADIUS * force[1], -RADIUS * force[0], 0.0];
    for i in 0..3 {
        out[i] = v[i];
        out[3 + i] = plate.gravity[i] + added[i] + force[i] / MASS;
        out[6 + i] = torque[i] / INERTIA - plate.turn_rate[i] - carried[i];
    }
}

/// Its derivative by the state, times `d`.
#[inline]
pub fn compliant_times(law: Law, contact: Contact, t: f64, y: &[f64], d: &[f64], out: &mut [f64]) {
    let plate = Plate::at(law, t);
    let ([p, v, w], force) = (parts(d), contact_force_times(contact, y, d));
    let (added, carried) = (plate.fictitious(p, v), cross(plate.turn, w));
    let torque = [RADIUS * force[1], -RADIUS * force[0], 0.0];
    for i in 0..3 {
        out[i] = v[i];
        out[3 + i] = added[i] + force[i] / MASS;
        out[6 + i] = torque[i] / INERTIA - carried[i];
    }
}

/// Derivative of the rolling state.
#[inline]
pub fn rolling(law: Law, t: f64, y: &[f64], out: &mut [f64]) {
    let plate = Plate::at(law, t);
    let spin = [-y[3] / RADIUS, y[2] / RADIUS, y[4]];
    let added = plate.fictitious([y[0], y[1], REST_HEIGHT], [y[2], y[3], 0.0]);
    let carried = cross(plate.turn, spin);
    let turned = |i: usize| SHAPE * RADIUS * (plate.turn_rate[i] + carried[i]);
    out[0] = y[2];
    out[1] = y[3];
    out[2] = (plate.gravity[0] + added[0] - turned(1)) / (1.0 + SHAPE);
    out[3] = (plate.gravity[1] + added[1] + turned(0)) / (1.0 + SHAPE);
    out[4] = -plate.turn_rate[2] - carried[2];
}

#[inline]
fn cross(a: Triple, b: Triple) -> Triple {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
fn parts(y: &[f64]) -> [Triple; 3] {
    [[y[0], y[1], y[2]], [y[3], y[4], y[5]], [y[6], y[7], y[8]]]
}

/// Slip with the sign of the friction, and the spring's and damper's force.
#[inline]
fn slip(y: &[f64]) -> [f64; 2] {
    [-y[3] + RADIUS * y[7], -y[4] - RADIUS * y[6]]
}

#[inline]
fn push(contact: Contact, height: f64, speed: f64) -> f64 {
    -contact.stiffness * height - contact.damping * speed
}

#[inline]
fn contact_force(contact: Contact, y: &[f64]) -> Triple {
    if y[2] >= REST_HEIGHT {
        return [0.0; 3];
    }
    let normal = push(contact, y[2] - REST_HEIGHT, y[5]);
    let [fx, fy] = slip(y).map(|s| FRICTION * normal * (s / SLIP_LIMIT).clamp(-1.0, 1.0));
    [fx, fy, normal]
}

#[inline]
fn contact_force_times(contact: Contact, y: &[f64], d: &[f64]) -> Triple {
    if y[2] >= REST_HEIGHT {
        return [0.0; 3];
    }
    let normal = push(contact, y[2] - REST_HEIGHT, y[5]);
    let change = push(contact, d[2], d[5]);
    let (slips, changes) = (slip(y), slip(d));
    let [fx, fy] = std::array::from_fn(|i| {
        let saturation = (slips[i] / SLIP_LIMIT).clamp(-1.0, 1.0);
        let grip = if saturation.abs() < 1.0 { changes[i] / SLIP_LIMIT } else { 0.0 };
        FRICTION * (change * saturation + normal * grip)
    });
    [fx, fy, change]
}
