//! The rig's controller: one PID per axis on the measured position, with a
//! filtered derivative and a whole number of command steps.
//!
//! The device runs one loop: look, command, log a row. At the chapter's 100 rows
//! a second the loops close every 10 ms, as the chapter's do.

use super::steps::{rounded, step_in};
use offbd_core::plant::Ball;
use offbd_core::vocabulary::{Axis, Invalid, PerAxis, in_range, positive};

/// A controller; immutable. Its gains follow from the loop it is to close.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerModel {
    /// Natural frequency of the closed loop without lag, rad/s.
    pub bandwidth_rad_s: f64,
    /// Damping ratio of the same.
    pub damping: f64,
    /// Integral action: share of the bandwidth, dimensionless.
    pub integral: f64,
    /// Time constant of the derivative's filter, s.
    pub derivative_filter_s: f64,
    /// Largest command, rad.
    pub limit_rad: f64,
    /// Share of the wanted acceleration that is commanded ahead, 0 to 1.
    pub feedforward: f64,
    /// Largest bandwidth that a period of the log leaves, rad per period.
    pub turn_per_period_rad: f64,
    /// Smallest step of the command, rad; 0: continuous.
    pub resolution_rad: f64,
}

/// How long the last command stands while no ball is seen, s; then the plate
/// is levelled. A lone missing reading must not make the plate twitch.
const BLIND_S: f64 = 0.3;

/// The gains of one axis: rad per m, per m·s, per m/s and per m/s².
#[derive(Clone, Copy, Debug)]
struct Gains {
    proportional: f64,
    integral: f64,
    derivative: f64,
    feedforward: f64,
}

impl ControllerModel {
    pub(super) fn check(&self) -> Result<(), Invalid> {
        positive("/controller/limit_rad", self.limit_rad, 1.5)?;
        positive("/controller/bandwidth_rad_s", self.bandwidth_rad_s, 100.0)?;
        in_range("/controller/damping", self.damping, 0.0..=10.0)?;
        in_range("/controller/integral", self.integral, 0.0..=10.0)?;
        in_range("/controller/derivative_filter_s", self.derivative_filter_s, 0.0..=10.0)?;
        in_range("/controller/feedforward", self.feedforward, 0.0..=1.0)?;
        positive("/controller/turn_per_period_rad", self.turn_per_period_rad, 1.0)?;
        step_in("/controller/resolution_rad", self.resolution_rad, 0.5)?;
        Ok(())
    }

    /// What a loop holds that nobody has tuned to its rate, rad per period.
    pub const UNTUNED_RAD: f64 = 0.1;

    /// Pole placement on ẍ = g/(1 + κ)·q. A slow loop gets a bandwidth that it
    /// can hold.
    fn gains(&self, ball: &Ball, period_s: f64) -> Gains {
        let (w, g) =
            (self.bandwidth_rad_s.min(self.turn_per_period_rad / period_s), ball.rolling_gravity());
        Gains {
            proportional: w * w / g,
            integral: self.integral * w * w * w / g,
            derivative: 2.0 * self.damping * w / g,
            feedforward: self.feedforward / g,
        }
    }
}

/// Where the ball is asked to be along one axis, m, and to accelerate, m/s².
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    pub position: f64,
    pub acceleration: f64,
}

/// What one axis remembers.
#[derive(Clone, Copy, Debug, Default)]
struct AxisState {
    integral: f64,
    rate: f64,
    last: Option<f64>,
    unseen_s: f64,
    command: f64,
}

/// The controller in motion.
#[derive(Clone, Debug)]
pub(super) struct Controller {
    model: ControllerModel,
    period_s: f64,
    gains: Gains,
    axes: PerAxis<AxisState>,
}

impl Controller {
    pub(super) fn new(model: ControllerModel, ball: &Ball, period_s: f64) -> Self {
        Self { model, period_s, gains: model.gains(ball, period_s), axes: PerAxis::default() }
    }

    /// The commands in force, rad.
    pub(super) fn commands(&self) -> PerAxis<f64> {
        self.axes.map(|a| a.command)
    }

    /// Takes commands from outside; an axis without one keeps its own.
    pub(super) fn command(&mut self, commands: PerAxis<Option<f64>>) {
        for axis in Axis::ALL {
            if let Some(command) = commands[axis] {
                self.axes[axis].command = self.quantise(command);
            }
        }
    }

    /// One period: new commands from the last reading.
    pub(super) fn update(&mut self, wanted: PerAxis<Wanted>, seen: PerAxis<Option<f64>>) {
        for axis in Axis::ALL {
            let state = self.axes[axis];
            self.axes[axis] = match seen[axis] {
                Some(position) => self.closed(state, axis, wanted[axis], position),
                None => self.blind(state),
            };
        }
    }

    fn closed(&self, state: AxisState, axis: Axis, wanted: Wanted, position: f64) -> AxisState {
        let (model, h) = (&self.model, self.period_s);
        let change = state.last.map_or(0.0, |last| (position - last) / h);
        let rate = state.rate + (change - state.rate) * h / (model.derivative_filter_s + h);
        let error = wanted.position - position;
        let integral = state.integral + self.gains.integral * error * h;
        // The integral may not ask for more than half of the authority.
        let integral = integral.clamp(-model.limit_rad / 2.0, model.limit_rad / 2.0);
        let wish = self.gains.proportional * error + integral - self.gains.derivative * rate;
        let wish = wish + self.gains.feedforward * wanted.acceleration;
        let command = self.quantise(wish * axis.drive_sign());
        AxisState { integral, rate, last: Some(position), unseen_s: 0.0, command }
    }

    fn blind(&self, state: AxisState) -> AxisState {
        let unseen_s = state.unseen_s + self.period_s;
        let command = if unseen_s > BLIND_S { 0.0 } else { state.command };
        AxisState { rate: 0.0, last: None, unseen_s, command, ..state }
    }

    fn quantise(&self, command: f64) -> f64 {
        let limit = self.model.limit_rad;
        rounded(command.clamp(-limit, limit), self.model.resolution_rad)
    }
}
