//! The twin with the parameters and the start that the variables say.

use offbd_core::plant::{
    Ball, Ladder, Plate, RollingState, ServoModel, SimulatedTwin, TwinAxis, TwinModel,
};
use offbd_core::vocabulary::{Invalid, PerAxis, SimTime};

use crate::variables::{
    BALL_RADIUS, COUNT, FRICTION, INERTIA_FACTOR, PLATE_THICKNESS, VX, VY, X, X_SERVO, Y, Y_SERVO,
};

/// Starts the twin at `at`, with its servos at rest on `commands` and its ball in the motion
/// that `values` say.
pub(crate) fn start(
    values: &[f64; COUNT],
    at: SimTime,
    commands: PerAxis<f64>,
) -> Result<SimulatedTwin, Invalid> {
    let motion = RollingState {
        position: [values[X], values[Y]].into(),
        velocity: [values[VX], values[VY]].into(),
        spin: 0.0,
    };
    Ok(SimulatedTwin::start(model(values)?, at, commands, &motion))
}

/// Returns the parameters of the twin that `values` say. The mass of the ball and the outline of
/// the plate have no effect.
pub(crate) fn model(values: &[f64; COUNT]) -> Result<TwinModel, Invalid> {
    let mass_kg = Ball::default().mass_kg();
    let ball = Ball::new(values[BALL_RADIUS], mass_kg, values[INERTIA_FACTOR])?;
    let plate = Plate::new(Plate::default().shape(), values[PLATE_THICKNESS], false)?;
    let ladder = Ladder::new(&ball, &plate, values[FRICTION], SimulatedTwin::ACCURACY_M_S2);
    let axes = PerAxis { x: axis(&values[X_SERVO..Y_SERVO])?, y: axis(&values[Y_SERVO..])? };
    Ok(TwinModel { ladder, axes })
}

fn axis(servo: &[f64]) -> Result<TwinAxis, Invalid> {
    let &[
        angle_limit,
        rate_limit,
        dead_time_s,
        command_gain,
        lag_s,
        gain,
        level_rad,
        resistance_m_s2,
    ] = servo
    else {
        return Err(Invalid::new("servo", "has another number of parameters"));
    };
    let servo = ServoModel::new(angle_limit, lag_s, rate_limit)?;
    Ok(TwinAxis { servo, dead_time_s, command_gain, gain, level_rad, resistance_m_s2 })
}
