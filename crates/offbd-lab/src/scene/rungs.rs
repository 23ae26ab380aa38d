//! The models as systems on a driven plate.

use super::drive::{Drive, Seen};
use crate::methods::Stiff;
use crate::models::{Compliant, Creeping};
use offbd_core::maths::System;
use offbd_core::plant::{Motion, Phase, PlateMotion, Rolling, Sliding};

/// A model on its plate: a system whose states stand for a motion.
pub(super) trait Rung<const N: usize>: System<N> {
    /// The motion is smooth within a piece: no contact that jumps.
    const SMOOTH: bool;

    fn motion(&self, t: f64, y: &[f64; N]) -> Motion;
}

/// A model of a ball that stays on the plate and does not slip, or hardly.
pub(super) trait Rolls {
    /// Rates of (x, y, two rates that are its own, wz).
    fn rate(&self, y: &[f64; 5], plate: &PlateMotion) -> [f64; 5];

    fn enter(&self, from: &Motion, plate: &PlateMotion) -> [f64; 5];

    fn leave(&self, y: &[f64; 5], plate: &PlateMotion) -> Motion;
}

impl Rolls for Rolling {
    #[inline]
    fn rate(&self, y: &[f64; 5], plate: &PlateMotion) -> [f64; 5] {
        self.rate(y, plate)
    }

    fn enter(&self, from: &Motion, _: &PlateMotion) -> [f64; 5] {
        self.enter(from)
    }

    fn leave(&self, y: &[f64; 5], _: &PlateMotion) -> Motion {
        self.leave(y)
    }
}

impl Rolls for Creeping {
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

pub(super) struct OnRolling<'a, M, D> {
    pub model: &'a M,
    pub plate: Seen<'a, D>,
}

impl<M: Rolls, D: Drive> System<5> for OnRolling<'_, M, D> {
    const POSITIONS: usize = 2;

    #[inline]
    fn rate(&self, t: f64, y: &[f64; 5]) -> [f64; 5] {
        self.model.rate(y, &self.plate.at(t))
    }
}

impl<M: Rolls, D: Drive> Rung<5> for OnRolling<'_, M, D> {
    const SMOOTH: bool = true;

    fn motion(&self, t: f64, y: &[f64; 5]) -> Motion {
        self.model.leave(y, &self.plate.at(t))
    }
}

pub(super) struct OnSliding<'a, D> {
    pub model: &'a Sliding,
    pub phase: Phase,
    pub plate: Seen<'a, D>,
}

impl<D: Drive> System<9> for OnSliding<'_, D> {
    const POSITIONS: usize = 3;

    #[inline]
    fn rate(&self, t: f64, y: &[f64; 9]) -> [f64; 9] {
        self.model.rate(&self.phase, y, &self.plate.at(t))
    }
}

impl<D: Drive> Rung<9> for OnSliding<'_, D> {
    const SMOOTH: bool = true;

    fn motion(&self, _: f64, y: &[f64; 9]) -> Motion {
        Motion::from_row(y)
    }
}

pub(super) struct OnCompliant<'a, D> {
    pub model: &'a Compliant,
    pub plate: Seen<'a, D>,
}

impl<D: Drive> System<9> for OnCompliant<'_, D> {
    const POSITIONS: usize = 3;

    #[inline]
    fn rate(&self, t: f64, y: &[f64; 9]) -> [f64; 9] {
        self.model.rate(y, &self.plate.at(t))
    }
}

impl<D: Drive> Stiff<9> for OnCompliant<'_, D> {
    fn jacobian(&self, t: f64, y: &[f64; 9]) -> [[f64; 9]; 9] {
        self.model.jacobian(y, &self.plate.at(t))
    }
}

impl<D: Drive> Rung<9> for OnCompliant<'_, D> {
    const SMOOTH: bool = false;

    fn motion(&self, _: f64, y: &[f64; 9]) -> Motion {
        Motion::from_row(y)
    }
}
