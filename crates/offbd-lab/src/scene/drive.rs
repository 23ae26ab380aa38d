//! Drives: they move the plate and push the ball, in smooth pieces.

use std::cell::Cell;

use nalgebra::{Vector2, Vector3};

use super::law::{AngleNodes, Law};
use offbd_core::maths::sine::sin_cos;
use offbd_core::plant::{GRAVITY_M_S2, Motion, PlateMotion, Tilt};

/// The motion of the plate, in smooth pieces. Where a piece begins, the drive may read
/// the body's motion, as a controller does.
pub trait Drive {
    /// Returns the plate's tilt at time `t`, s, within the current piece.
    fn tilt(&self, t: f64) -> Tilt;

    /// Returns the plate's motion at the times `at`, s, within the current piece.
    #[inline]
    fn nodes<const M: usize>(&self, at: &[f64; M]) -> PlateNodes<M> {
        let tilts = at.map(|t| self.tilt(t));
        PlateNodes::of(&[
            AngleNodes {
                angle: tilts.map(|tilt| tilt.angle.x),
                rate: tilts.map(|tilt| tilt.rate.x),
                acceleration: tilts.map(|tilt| tilt.acceleration.x),
            },
            AngleNodes {
                angle: tilts.map(|tilt| tilt.angle.y),
                rate: tilts.map(|tilt| tilt.rate.y),
                acceleration: tilts.map(|tilt| tilt.acceleration.y),
            },
        ])
    }

    /// Returns the plate's motion at `M` times from `from` on, `every` seconds apart, within
    /// the current piece.
    #[inline]
    fn grid<const M: usize>(&self, from: f64, every: f64) -> PlateNodes<M> {
        self.nodes(&std::array::from_fn(|i| from + i as f64 * every))
    }

    /// Returns the force on the body's centre along x and y in the current piece, N.
    fn push(&self) -> Vector2<f64>;

    /// Returns whether the plate stands still throughout the current piece.
    fn is_still(&self) -> bool;

    /// Begins the piece at time `t`, s, with the body in the motion `at`; returns the
    /// end of the piece, s, which is after `t` and may be infinite.
    fn begin(&mut self, t: f64, at: &Motion) -> f64;

    /// Returns the shortest time scale of the plate's motion, s: a period or the duration
    /// of a step.
    fn shortest_time_s(&self) -> f64;
}

/// The plate's motion in its own frame at several times, as [`PlateMotion`], each
/// component side by side, so that the compiler can vectorise over the times.
pub struct PlateNodes<const M: usize> {
    pub omega: [[f64; M]; 3],
    pub alpha: [[f64; M]; 3],
    pub gravity: [[f64; M]; 3],
}

impl<const M: usize> PlateNodes<M> {
    /// Builds the motion from those of qx and qy, as [`Tilt::motion`] does.
    #[inline(always)]
    fn of([x, y]: &[AngleNodes<M>; 2]) -> Self {
        let mut to = Self { omega: [[0.0; M]; 3], alpha: [[0.0; M]; 3], gravity: [[0.0; M]; 3] };
        for i in 0..M {
            let (sin_x, cos_x) = sin_cos(x.angle[i]);
            let (sin_y, cos_y) = sin_cos(y.angle[i]);
            let coupling = x.rate[i] * y.rate[i];
            to.omega[0][i] = x.rate[i] * cos_y;
            to.omega[1][i] = y.rate[i];
            to.omega[2][i] = x.rate[i] * sin_y;
            to.alpha[0][i] = x.acceleration[i] * cos_y - coupling * sin_y;
            to.alpha[1][i] = y.acceleration[i];
            to.alpha[2][i] = x.acceleration[i] * sin_y + coupling * cos_y;
            to.gravity[0][i] = cos_x * sin_y * GRAVITY_M_S2;
            to.gravity[1][i] = -sin_x * GRAVITY_M_S2;
            to.gravity[2][i] = -cos_x * cos_y * GRAVITY_M_S2;
        }
        to
    }

    /// Returns the motion `plate`, which does not change.
    #[inline]
    pub(super) fn still(plate: &PlateMotion) -> Self {
        let row = |value: f64| [value; M];
        let rows = |v: &Vector3<f64>| [row(v.x), row(v.y), row(v.z)];
        Self { omega: rows(&plate.omega), alpha: rows(&plate.alpha), gravity: rows(&plate.gravity) }
    }

    /// Returns the motion at the `i`-th time.
    #[inline]
    pub(super) fn motion(&self, i: usize) -> PlateMotion {
        let at = |rows: &[[f64; M]; 3]| Vector3::new(rows[0][i], rows[1][i], rows[2][i]);
        PlateMotion { omega: at(&self.omega), alpha: at(&self.alpha), gravity: at(&self.gravity) }
    }

    /// Adds an external force along x and y, given per mass, m/s².
    #[inline]
    pub(super) fn pushed(mut self, acceleration: Vector2<f64>) -> Self {
        for axis in 0..2 {
            for value in &mut self.gravity[axis] {
                *value += acceleration[axis];
            }
        }
        self
    }
}

/// A constant force on the body's centre for a limited time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// Along x and y, N.
    pub force: Vector2<f64>,
    pub start_s: f64,
    pub duration_s: f64,
}

/// A drive that moves both angles by laws of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Laws {
    qx: Law,
    qy: Law,
    pushes: Vec<Push>,
    inside: f64,
    push: Vector2<f64>,
}

impl Laws {
    #[must_use]
    pub fn new(qx: Law, qy: Law, pushes: Vec<Push>) -> Self {
        Self { qx, qy, pushes, inside: 0.0, push: Vector2::zeros() }
    }
}

impl Drive for Laws {
    #[inline]
    fn tilt(&self, t: f64) -> Tilt {
        Tilt::of(self.qx.at(t, self.inside), self.qy.at(t, self.inside))
    }

    #[inline]
    fn nodes<const M: usize>(&self, at: &[f64; M]) -> PlateNodes<M> {
        PlateNodes::of(&[self.qx.nodes(at, self.inside), self.qy.nodes(at, self.inside)])
    }

    #[inline]
    fn grid<const M: usize>(&self, from: f64, every: f64) -> PlateNodes<M> {
        let [x, y] = [&self.qx, &self.qy].map(|law| law.grid(from, every, self.inside));
        PlateNodes::of(&[x, y])
    }

    fn push(&self) -> Vector2<f64> {
        self.push
    }

    fn is_still(&self) -> bool {
        self.qx.is_still(self.inside) && self.qy.is_still(self.inside)
    }

    fn begin(&mut self, t: f64, _: &Motion) -> f64 {
        let end = self.qx.next_break(t).min(self.qy.next_break(t)).min(next_push(&self.pushes, t));
        self.inside = if end.is_finite() { (t + end) / 2.0 } else { t + 1.0 };
        self.push = pushed(&self.pushes, self.inside);
        end
    }

    fn shortest_time_s(&self) -> f64 {
        self.qx.shortest_time_s().min(self.qy.shortest_time_s())
    }
}

/// Returns the next time after `t` at which a push begins or ends, s.
pub(super) fn next_push(pushes: &[Push], t: f64) -> f64 {
    let edges = pushes.iter().flat_map(|push| [push.start_s, push.start_s + push.duration_s]);
    edges.filter(|&edge| edge > t).fold(f64::INFINITY, f64::min)
}

/// Returns the sum of the pushes active at time `inside`, N.
pub(super) fn pushed(pushes: &[Push], inside: f64) -> Vector2<f64> {
    let in_force = |push: &&Push| (push.start_s..push.start_s + push.duration_s).contains(&inside);
    pushes.iter().filter(in_force).map(|push| push.force).sum()
}

/// The plate's motion as input of a model, with the last evaluated instant cached:
/// stages of a method often share their times, and a plate that stands still needs one
/// evaluation only.
pub(super) struct DrivenPlate<'a, D> {
    drive: &'a D,
    push: Vector2<f64>,
    still: Option<PlateMotion>,
    last: Cell<(f64, PlateMotion)>,
}

impl<'a, D: Drive> DrivenPlate<'a, D> {
    /// Creates the input from `drive` in its current piece, which contains `t`, for a
    /// body of `mass` kg.
    pub(super) fn new(drive: &'a D, mass: f64, t: f64) -> Self {
        let push = drive.push() / mass;
        let now = drive.tilt(t).motion().pushed(push);
        let still = drive.is_still().then_some(now);
        Self { drive, push, still, last: Cell::new((t, now)) }
    }

    /// Returns whether the plate stands still throughout the piece.
    pub(super) const fn is_still(&self) -> bool {
        self.still.is_some()
    }

    /// Returns the plate's motion at `M` times from `from` on, `every` seconds apart.
    #[inline]
    pub(super) fn grid<const M: usize>(&self, from: f64, every: f64) -> PlateNodes<M> {
        self.drive.grid(from, every).pushed(self.push)
    }

    #[inline]
    pub(super) fn at(&self, t: f64) -> PlateMotion {
        if let Some(still) = self.still {
            return still;
        }
        let (then, motion) = self.last.get();
        if then == t {
            return motion;
        }
        let now = self.drive.tilt(t).motion().pushed(self.push);
        self.last.set((t, now));
        now
    }
}
