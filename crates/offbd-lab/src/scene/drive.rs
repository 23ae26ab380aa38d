//! Drives: they move the plate and push the ball, in smooth pieces.

use std::cell::Cell;

use nalgebra::Vector2;

use super::law::Law;
use offbd_core::plant::{Motion, PlateMotion, Tilt};

/// The motion of the plate, in smooth pieces. Where a piece begins, the drive may read
/// the body's motion, as a controller does.
pub trait Drive {
    /// Returns the plate's tilt at time `t`, s, within the current piece.
    fn tilt(&self, t: f64) -> Tilt;

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
