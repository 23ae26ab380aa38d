//! The variables of the model. The index of a variable is its value reference.

use std::f64::consts::FRAC_PI_2;
use std::ops::RangeInclusive;

use offbd_core::plant::{LONGEST_DEAD_TIME_S, SimulatedTwin};

/// What a variable is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    Time,
    Input,
    /// An output whose start value can be set.
    State,
    Output,
    /// A parameter that holds for the whole simulation.
    FixedParameter,
    /// A parameter that can also be set between two steps; it holds from the next step on.
    TunableParameter,
    Constant,
}

/// A variable of the model, a number.
#[derive(Clone, Debug)]
pub struct Variable {
    pub name: &'static str,
    pub role: Role,
    /// Its unit; empty for a ratio.
    pub unit: &'static str,
    pub description: &'static str,
    /// The values that it can be set to.
    pub range: RangeInclusive<f64>,
}

pub(crate) const TIME: usize = 0;
pub(crate) const COMMAND_QX: usize = 1;
pub(crate) const COMMAND_QY: usize = 2;
pub(crate) const X: usize = 3;
pub(crate) const Y: usize = 4;
pub(crate) const VX: usize = 5;
pub(crate) const VY: usize = 6;
pub(crate) const QX: usize = 7;
pub(crate) const QY: usize = 8;
pub(crate) const GRAVITY: usize = 9;
pub(crate) const BALL_RADIUS: usize = 10;
pub(crate) const INERTIA_FACTOR: usize = 11;
pub(crate) const PLATE_THICKNESS: usize = 12;
pub(crate) const FRICTION: usize = 13;
pub(crate) const LONGEST_STEP: usize = 14;
/// The first parameter of the x servo.
pub(crate) const X_SERVO: usize = 15;
/// The first parameter of the y servo.
pub(crate) const Y_SERVO: usize = X_SERVO + SERVO_PARAMETERS;
/// The number of parameters of a servo.
const SERVO_PARAMETERS: usize = 8;
/// The number of variables.
pub(crate) const COUNT: usize = Y_SERVO + SERVO_PARAMETERS;

/// Limit of positions and velocities that a run starts from, m and m/s. Chosen.
const FAR: f64 = 1e3;
/// Limit of commands, rad. Chosen: far beyond what a servo obeys.
const ANY_COMMAND: f64 = 1e3;
/// The least value of a parameter that must be positive. Chosen.
const LEAST: f64 = 1e-6;

/// All variables.
pub const VARIABLES: [Variable; COUNT] = [
    readable("time", Role::Time, "s", "Time of the simulation"),
    input("cmd_qx", "Command of the y servo, which turns the plate about x"),
    input("cmd_qy", "Command of the x servo, which turns the plate about y"),
    state("x", "m", "Position of the ball along x, from the middle of the plate"),
    state("y", "m", "Position of the ball along y, from the middle of the plate"),
    state("vx", "m/s", "Velocity of the ball along x, relative to the plate"),
    state("vy", "m/s", "Velocity of the ball along y, relative to the plate"),
    readable("qx", Role::Output, "rad", "Angle of the plate about x"),
    readable("qy", Role::Output, "rad", "Angle of the plate about y"),
    readable("gravity", Role::Constant, "m/s2", "Acceleration of a free fall"),
    fixed("ball_radius", "m", "Radius of the ball", LEAST..=1.0),
    fixed(
        "inertia_factor",
        "",
        "Moment of inertia of the ball over its mass and squared radius: solid 0.4, hollow 0.667",
        0.0..=1.0,
    ),
    fixed(
        "plate_thickness",
        "m",
        "Thickness of the plate, with its joint in the middle",
        0.0..=1.0,
    ),
    tunable("friction", "", "Coefficient of friction of ball and plate", LEAST..=100.0),
    fixed(
        "longest_step",
        "s",
        "Longest step of the integration; a longer communication step is divided",
        SimulatedTwin::STEPS_S,
    ),
    tunable("x_servo.angle_limit", "rad", "Largest angle of the x servo", LEAST..=FRAC_PI_2),
    tunable("x_servo.rate_limit", "rad/s", "Largest rate of the x servo", LEAST..=1000.0),
    tunable(
        "x_servo.dead_time",
        "s",
        "Time from a command to the x servo's first movement",
        DEAD_TIME,
    ),
    tunable(
        "x_servo.command_gain",
        "",
        "Angle asked of the x servo, as a multiple of its command: 0 without power, -1 if reversed",
        -100.0..=100.0,
    ),
    tunable("x_servo.lag", "s", "First-order lag of the x servo", 0.0..=10.0),
    tunable(
        "x_servo.gain",
        "",
        "Acceleration of the ball along x over that of the model",
        -100.0..=100.0,
    ),
    tunable("x_servo.level", "rad", "Angle of the plate about y at a command of zero", -1.0..=1.0),
    tunable("x_servo.resistance", "m/s2", "Deceleration of a ball that rolls along x", 0.0..=10.0),
    tunable("y_servo.angle_limit", "rad", "Largest angle of the y servo", LEAST..=FRAC_PI_2),
    tunable("y_servo.rate_limit", "rad/s", "Largest rate of the y servo", LEAST..=1000.0),
    tunable(
        "y_servo.dead_time",
        "s",
        "Time from a command to the y servo's first movement",
        DEAD_TIME,
    ),
    tunable(
        "y_servo.command_gain",
        "",
        "Angle asked of the y servo, as a multiple of its command: 0 without power, -1 if reversed",
        -100.0..=100.0,
    ),
    tunable("y_servo.lag", "s", "First-order lag of the y servo", 0.0..=10.0),
    tunable(
        "y_servo.gain",
        "",
        "Acceleration of the ball along y over that of the model",
        -100.0..=100.0,
    ),
    tunable("y_servo.level", "rad", "Angle of the plate about x at a command of zero", -1.0..=1.0),
    tunable("y_servo.resistance", "m/s2", "Deceleration of a ball that rolls along y", 0.0..=10.0),
];

const DEAD_TIME: RangeInclusive<f64> = 0.0..=LONGEST_DEAD_TIME_S;

const fn input(name: &'static str, description: &'static str) -> Variable {
    let range = -ANY_COMMAND..=ANY_COMMAND;
    Variable { name, role: Role::Input, unit: "rad", description, range }
}

const fn state(name: &'static str, unit: &'static str, description: &'static str) -> Variable {
    Variable { name, role: Role::State, unit, description, range: -FAR..=FAR }
}

const fn readable(
    name: &'static str,
    role: Role,
    unit: &'static str,
    description: &'static str,
) -> Variable {
    Variable { name, role, unit, description, range: f64::MIN..=f64::MAX }
}

const fn fixed(
    name: &'static str,
    unit: &'static str,
    description: &'static str,
    range: RangeInclusive<f64>,
) -> Variable {
    Variable { name, role: Role::FixedParameter, unit, description, range }
}

const fn tunable(
    name: &'static str,
    unit: &'static str,
    description: &'static str,
    range: RangeInclusive<f64>,
) -> Variable {
    Variable { name, role: Role::TunableParameter, unit, description, range }
}
