//! The models as systems on a driven plate.

use super::drive::{Drive, Seen};
use crate::maths::{Stiff, System};
use crate::plant::{Body, Compliant, Creeping, Motion, Phase, Rolling, Sliding};

use nalgebra::Vector3;

/// A model on its plate: a system whose states stand for a motion.
pub(super) trait Rung<const N: usize>: System<N> {
    /// The motion is smooth within a piece: no contact that jumps.
    const SMOOTH: bool;

    fn motion(&self, t: f64, y: &[f64; N]) -> Motion;
}

pub(super) struct OnRolling<'a, D> {
    pub model: &'a Rolling,
    radius: f64,
    height: f64,
    pub plate: Seen<'a, D>,
}

impl<'a, D: Drive> OnRolling<'a, D> {
    pub(super) fn new(model: &'a Rolling, body: &Body, drive: &'a D, t: f64) -> Self {
        Self {
            model,
            radius: body.arm_m(),
            height: body.rest_height_m(),
            plate: Seen::new(drive, body.mass_kg(), t),
        }
    }
}

impl<D: Drive> System<5> for OnRolling<'_, D> {
    const POSITIONS: usize = 2;

    #[inline]
    fn rate(&self, t: f64, y: &[f64; 5]) -> [f64; 5] {
        self.model.rate(y, &self.plate.at(t))
    }
}

impl<D: Drive> Rung<5> for OnRolling<'_, D> {
    const SMOOTH: bool = true;

    fn motion(&self, _: f64, y: &[f64; 5]) -> Motion {
        Motion {
            position: Vector3::new(y[0], y[1], self.height),
            velocity: Vector3::new(y[2], y[3], 0.0),
            spin: Vector3::new(-y[3] / self.radius, y[2] / self.radius, y[4]),
        }
    }
}

pub(super) struct OnCreeping<'a, D> {
    pub model: &'a Creeping,
    pub plate: Seen<'a, D>,
}

impl<'a, D: Drive> OnCreeping<'a, D> {
    pub(super) fn new(model: &'a Creeping, body: &Body, drive: &'a D, t: f64) -> Self {
        Self { model, plate: Seen::new(drive, body.mass_kg(), t) }
    }
}

impl<D: Drive> System<5> for OnCreeping<'_, D> {
    const POSITIONS: usize = 2;

    #[inline]
    fn rate(&self, t: f64, y: &[f64; 5]) -> [f64; 5] {
        self.model.rate(y, &self.plate.at(t)).0
    }
}

impl<D: Drive> Rung<5> for OnCreeping<'_, D> {
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
