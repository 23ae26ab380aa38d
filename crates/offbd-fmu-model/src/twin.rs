//! The twin in a simulation of its own: the ball that it observes is its own, and has a spin.
//!
//! The twin of a rig follows a ball whose spin about the plate's normal no sensor sees; here the
//! spin is integrated too, by explicit Euler, from the plate's angles at both ends of a step.

use offbd_core::plant::{
    Ball, Ladder, Plate, Rolling, RollingState, ServoModel, Tilt, Twin, TwinAxis, TwinModel,
};
use offbd_core::vocabulary::{Axis, Invalid, PerAxis, SimTime};
use serde::{Deserialize, Serialize};

use crate::variables::{
    BALL_RADIUS, COUNT, FRICTION, INERTIA_FACTOR, PLATE_THICKNESS, VX, VY, X, X_SERVO, Y, Y_SERVO,
};

/// Acceleration that the twin may neglect, m/s²: none, because a simulation does not count
/// its cost.
const ACCURACY_M_S2: f64 = 0.0;

/// A twin with the ball that it moves.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SimulatedTwin {
    twin: Twin,
    rolling: Rolling,
    spin: f64,
    /// Mean rates of the plate in the last step, rad/s.
    rates: PerAxis<f64>,
}

impl SimulatedTwin {
    /// Builds the twin at `at`, with its servos at rest on `commands` and its ball in the motion
    /// that `values` say. The mass of the ball and the outline of the plate have no effect.
    pub(crate) fn start(
        values: &[f64; COUNT],
        at: SimTime,
        commands: PerAxis<f64>,
    ) -> Result<Self, Invalid> {
        let mass_kg = Ball::default().mass_kg();
        let ball = Ball::new(values[BALL_RADIUS], mass_kg, values[INERTIA_FACTOR])?;
        let plate = Plate::new(Plate::default().shape(), values[PLATE_THICKNESS], false)?;
        let ladder = Ladder::new(&ball, &plate, values[FRICTION], ACCURACY_M_S2);
        let axes = PerAxis { x: axis(&values[X_SERVO..Y_SERVO])?, y: axis(&values[Y_SERVO..])? };
        let mut twin = Twin::new(TwinModel { ladder, axes });
        twin.rebase([values[X], values[Y]].into(), [values[VX], values[VY]].into());
        twin.advance(at, commands.map(Some), &RollingState::default());
        let rolling = Rolling::new(&ball, &plate);
        Ok(Self { twin, rolling, spin: 0.0, rates: PerAxis::default() })
    }

    /// Gives commands, which hold from now on.
    pub(crate) fn command(&mut self, commands: PerAxis<f64>) {
        self.twin.command(commands.map(Some));
    }

    /// Advances by `h` seconds, to the time `to`.
    pub(crate) fn advance(&mut self, to: SimTime, h: f64) {
        let (ball, before) = (self.ball(), self.plate());
        self.twin.advance(to, PerAxis::default(), &ball);
        let after = self.plate();
        let rates = PerAxis::from_fn(|axis| (after[axis] - before[axis]) / h);
        let turn = |axis: Axis| {
            let mean = f64::midpoint(before[axis], after[axis]);
            [mean, rates[axis], (rates[axis] - self.rates[axis]) / h]
        };
        // The x servo turns qy, the y servo qx.
        let tilt = Tilt::of(turn(Axis::Y), turn(Axis::X));
        self.spin += self.rolling.acceleration(&ball, &tilt.motion()).1 * h;
        self.rates = rates;
    }

    /// The motion of the ball.
    pub(crate) fn ball(&self) -> RollingState {
        let motion = self.twin.motion();
        RollingState { position: motion.position, velocity: motion.velocity, spin: self.spin }
    }

    /// The angle of the plate that each servo turns, rad.
    pub(crate) fn plate(&self) -> PerAxis<f64> {
        self.twin.plate_angle()
    }
}

fn axis(servo: &[f64]) -> Result<TwinAxis, Invalid> {
    let &[angle_limit, rate_limit, dead_time_s, lag_s, gain, level_rad, resistance_m_s2] = servo
    else {
        return Err(Invalid::new("servo", "has another number of parameters"));
    };
    let servo = ServoModel::new(angle_limit, lag_s, rate_limit)?;
    Ok(TwinAxis { servo, dead_time_s, gain, level_rad, resistance_m_s2 })
}
