//! The models as systems of differential equations on a driven plate.

use super::drive::{Drive, DrivenPlate};
use crate::methods::Stiff;
use crate::models::{Compliant, Creeping};
use offbd_core::maths::{System, moved};
use offbd_core::plant::{Motion, Phase, PlateMotion, Rolling, Sliding};

/// A model on a driven plate: a system whose state represents a motion.
pub(super) trait DrivenModel<const N: usize>: System<N> {
    /// Whether accelerations are continuous within a piece; a stiff contact makes them
    /// jump.
    const SMOOTH: bool;

    /// Returns the longest step near the state `y` at which an implicit method does not
    /// damp what grows, s.
    #[inline]
    fn longest_step_s(&self, _y: &[f64; N]) -> f64 {
        f64::INFINITY
    }

    /// Returns the motion that the state `y` represents at time `t`.
    fn motion(&self, t: f64, y: &[f64; N]) -> Motion;
}

/// Longest step of an implicit method, in times in which a slip grows by a factor of e.
/// Chosen: with twice that time all but a few of the random scenes of the tests keep their
/// tolerance.
const LONGEST_IN_GROWTH: f64 = 2.0;

/// A model of a ball that stays on the plate and does not slip, except by creep.
pub(super) trait RollingModel {
    /// Returns the derivatives of the state (x, y, two velocities as the model defines
    /// them, wz).
    fn rate(&self, y: &[f64; 5], plate: &PlateMotion) -> [f64; 5];

    /// Returns the state after a step of `h` seconds by the explicit midpoint rule, with
    /// the plate at the middle of the step for both stages.
    fn midpoint(&self, y: &[f64; 5], plate: &PlateMotion, h: f64) -> [f64; 5] {
        let middle = moved(y, &self.rate(y, plate), h / 2.0);
        moved(y, &self.rate(&middle, plate), h)
    }

    /// Returns the state for a ball in the motion `from`.
    fn enter(&self, from: &Motion, plate: &PlateMotion) -> [f64; 5];

    /// Returns the motion of the ball in the state `y`.
    fn leave(&self, y: &[f64; 5], plate: &PlateMotion) -> Motion;
}

impl RollingModel for Rolling {
    #[inline]
    fn rate(&self, y: &[f64; 5], plate: &PlateMotion) -> [f64; 5] {
        self.rate(y, plate)
    }

    #[inline]
    fn midpoint(&self, y: &[f64; 5], plate: &PlateMotion, h: f64) -> [f64; 5] {
        self.midpoint(y, plate, h)
    }

    fn enter(&self, from: &Motion, _: &PlateMotion) -> [f64; 5] {
        self.enter(from)
    }

    fn leave(&self, y: &[f64; 5], _: &PlateMotion) -> Motion {
        self.leave(y)
    }
}

impl RollingModel for Creeping {
    #[inline]
    fn rate(&self, y: &[f64; 5], plate: &PlateMotion) -> [f64; 5] {
        self.rate(y, plate).0
    }

    fn enter(&self, from: &Motion, plate: &PlateMotion) -> [f64; 5] {
        self.enter(from, plate)
    }

    fn leave(&self, y: &[f64; 5], plate: &PlateMotion) -> Motion {
        self.leave(y, plate)
    }
}

pub(super) struct DrivenRolling<'a, M, D> {
    pub model: &'a M,
    pub plate: DrivenPlate<'a, D>,
}

impl<M: RollingModel, D: Drive> System<5> for DrivenRolling<'_, M, D> {
    const POSITIONS: usize = 2;

    #[inline]
    fn rate(&self, t: f64, y: &[f64; 5]) -> [f64; 5] {
        self.model.rate(y, &self.plate.at(t))
    }
}

impl<M: RollingModel, D: Drive> DrivenModel<5> for DrivenRolling<'_, M, D> {
    const SMOOTH: bool = true;

    fn motion(&self, t: f64, y: &[f64; 5]) -> Motion {
        self.model.leave(y, &self.plate.at(t))
    }
}

pub(super) struct DrivenSliding<'a, D> {
    pub model: &'a Sliding,
    pub phase: Phase,
    pub plate: DrivenPlate<'a, D>,
}

impl<D: Drive> System<9> for DrivenSliding<'_, D> {
    const POSITIONS: usize = 3;

    #[inline]
    fn rate(&self, t: f64, y: &[f64; 9]) -> [f64; 9] {
        self.model.rate(&self.phase, y, &self.plate.at(t))
    }
}

impl<D: Drive> DrivenModel<9> for DrivenSliding<'_, D> {
    const SMOOTH: bool = true;

    fn motion(&self, _: f64, y: &[f64; 9]) -> Motion {
        Motion::from_row(y)
    }
}

pub(super) struct DrivenCompliant<'a, D> {
    pub model: &'a Compliant,
    pub plate: DrivenPlate<'a, D>,
}

impl<D: Drive> System<9> for DrivenCompliant<'_, D> {
    const POSITIONS: usize = 3;

    #[inline]
    fn rate(&self, t: f64, y: &[f64; 9]) -> [f64; 9] {
        self.model.rate(y, &self.plate.at(t))
    }
}

impl<D: Drive> DrivenCompliant<'_, D> {
    /// Returns whether the body stays in contact, or out of reach of the plate, in a step of
    /// `h` seconds from `t` between these states, and whether no slip grows too fast for it.
    pub(super) fn keeps_contact(&self, t: f64, [from, to]: [&[f64; 9]; 2], h: f64) -> bool {
        let (from, to) = (Motion::from_row(from), Motion::from_row(to));
        let touches = self.model.touches(&to.position);
        if self.model.has_contact_derivatives(&from.position) {
            let grows_s = self.model.slip_growth_s(&from).min(self.model.slip_growth_s(&to));
            return touches && h <= LONGEST_IN_GROWTH * grows_s;
        }
        let gap = from.position.z - self.model.body.rest_height_m();
        let a = self.plate.at(t).free(&from.position, &from.velocity);
        !touches && gap.abs() > from.velocity.z.abs() * h + a.z.abs() * h * h
    }
}

impl<D: Drive> Stiff<9> for DrivenCompliant<'_, D> {
    fn jacobian(&self, t: f64, y: &[f64; 9]) -> [[f64; 9]; 9] {
        self.model.jacobian(y, &self.plate.at(t))
    }
}

impl<D: Drive> DrivenModel<9> for DrivenCompliant<'_, D> {
    const SMOOTH: bool = false;

    #[inline]
    fn longest_step_s(&self, y: &[f64; 9]) -> f64 {
        LONGEST_IN_GROWTH * self.model.slip_growth_s(&Motion::from_row(y))
    }

    fn motion(&self, _: f64, y: &[f64; 9]) -> Motion {
        Motion::from_row(y)
    }
}
