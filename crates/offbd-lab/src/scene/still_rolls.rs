//! Whether a ball that is taken to roll does.

use super::Scene;
use super::Subject;
use super::drive::Drive;
use super::rungs::{OnRolling, Rolls};
use super::stepping::{Failure, Watch};
use offbd_core::plant::{Ground, PlateMotion, Rolling};

/// Beyond this friction demand a survey is not believed: the ball may slip.
pub(super) const SURE_TO_ROLL: f64 = 0.9;

/// Moments of a step that are checked.
const CHECKS: u32 = 5;

/// Ends a run where the ball would slip, leave the plate or pass its edge.
pub(super) struct StillRolls {
    rolling: Option<Rolling>,
    friction: f64,
    ground: Ground,
}

impl StillRolls {
    pub(super) fn new(scene: &Scene) -> Self {
        let rolling = match &scene.subject {
            Subject::Ball(ball) => Some(Rolling::new(ball, &scene.plate)),
            Subject::Block(_) => None,
        };
        Self { rolling, friction: scene.contact.friction(), ground: scene.ground() }
    }

    /// Checks a few moments of a step: a peak of the demand may lie between
    /// its ends.
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

impl<'p, M: Rolls, D: Drive> Watch<OnRolling<'p, M, D>, 5> for StillRolls {
    fn step(
        &mut self,
        rung: &OnRolling<'p, M, D>,
        t: [f64; 2],
        y: [&[f64; 5]; 2],
    ) -> Result<(), Failure> {
        self.within(t, y, |t| rung.plate.at(t))
    }
}
