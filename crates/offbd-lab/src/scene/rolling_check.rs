//! Checks that a ball whose model assumes rolling does roll.

use super::Scene;
use super::Subject;
use super::drive::Drive;
use super::driven_models::{DrivenRolling, RollingModel};
use super::stepping::{Failure, StepObserver};
use offbd_core::plant::{Ground, PlateMotion, Rolling};

/// Maximum friction demand at which the ball counts as rolling, as a fraction of the
/// limit. Chosen below 1 as a margin for the estimates.
pub(super) const SURE_TO_ROLL: f64 = 0.9;

/// Number of times within a step at which the ball is checked; chosen.
const CHECKS: u32 = 5;

/// Ends a run when the ball would slip, leave the plate or pass its edge.
pub(super) struct RollingCheck {
    rolling: Option<Rolling>,
    friction: f64,
    ground: Ground,
}

impl RollingCheck {
    pub(super) fn new(scene: &Scene) -> Self {
        let rolling = match &scene.subject {
            Subject::Ball(ball) => Some(Rolling::new(ball, &scene.plate)),
            Subject::Block(_) => None,
        };
        Self { rolling, friction: scene.contact.friction(), ground: scene.ground() }
    }

    /// Checks several times within a step: the friction demand may peak between its
    /// ends.
    fn within(
        &self,
        t: [f64; 2],
        y: [&[f64; 5]; 2],
        plate: impl Fn(f64) -> PlateMotion,
    ) -> Result<(), Failure> {
        (1..=CHECKS).try_for_each(|i| {
            let s = f64::from(i) / f64::from(CHECKS);
            let at = t[0] + s * (t[1] - t[0]);
            let y = std::array::from_fn(|i| y[0][i] + s * (y[1][i] - y[0][i]));
            self.check(at, &y, &plate(at))
        })
    }

    fn check(&self, t: f64, y: &[f64; 5], plate: &PlateMotion) -> Result<(), Failure> {
        let demand = self
            .rolling
            .map_or(f64::INFINITY, |rolling| rolling.grip(y, plate).demand(self.friction));
        if demand.is_nan() || demand >= SURE_TO_ROLL {
            let why =
                if demand == f64::INFINITY { "the ball would fly" } else { "the ball would slip" };
            return Err(Failure::OutOfRange { at_s: t, why });
        }
        if self.ground.margin_m(y[0], y[1]) <= 0.0 {
            return Err(Failure::OutOfRange { at_s: t, why: "the ball passes the edge" });
        }
        Ok(())
    }
}

impl<'p, M: RollingModel, D: Drive> StepObserver<DrivenRolling<'p, M, D>, 5> for RollingCheck {
    fn step(
        &mut self,
        system: &DrivenRolling<'p, M, D>,
        t: [f64; 2],
        y: [&[f64; 5]; 2],
    ) -> Result<(), Failure> {
        self.within(t, y, |t| system.plate.at(t))
    }
}
