//! The rig's controller: one PID per axis on the measured position, with a filtered
//! derivative and quantised commands.
//!
//! The device runs one loop: read, command, log a row. At the chapter's 100 rows per
//! second the loops close every 10 ms, as in the chapter.

use std::ops::RangeInclusive;

use super::steps::{rounded, step_in};
use offbd_core::plant::Ball;
use offbd_core::vocabulary::{Axis, Invalid, PerAxis, in_range, positive};

/// The parameters of a controller; immutable. Its gains follow from them by pole
/// placement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerModel {
    /// Natural frequency of the closed loop without lag, rad/s.
    pub bandwidth_rad_s: f64,
    /// Damping ratio of the closed loop without lag.
    pub damping: f64,
    /// Rate of the integral action as a share of the bandwidth.
    pub integral: f64,
    /// Time constant of the derivative's filter, s.
    pub derivative_filter_s: f64,
    /// Limit of the command's magnitude, rad.
    pub limit_rad: f64,
    /// Feedforward: share of the reference acceleration, 0 to 1.
    pub feedforward: f64,
    /// Upper limit of the bandwidth times the period of the log, rad.
    pub turn_per_period_rad: f64,
    /// Resolution of the command, rad; 0: continuous.
    pub resolution_rad: f64,
}

/// Time for which the last command is held while no ball is seen, s; then the plate is
/// levelled. Chosen so that a single missing reading does not make the plate twitch.
const BLIND_S: f64 = 0.3;

/// The gains of a PID controller, the same for both axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PidGains {
    /// Kp, rad/m.
    pub proportional: f64,
    /// Ki, rad/(m·s).
    pub integral: f64,
    /// Kd, rad·s/m.
    pub derivative: f64,
}

impl PidGains {
    /// Range of Kp, rad/m. Chosen: up to eight times that of the fastest preset.
    pub const PROPORTIONAL: RangeInclusive<f64> = 0.0..=10.0;
    /// Range of Ki, rad/(m·s); chosen likewise.
    pub const INTEGRAL: RangeInclusive<f64> = 0.0..=4.0;
    /// Range of Kd, rad·s/m; chosen likewise.
    pub const DERIVATIVE: RangeInclusive<f64> = 0.0..=7.0;

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Invalid`] naming `/kp`, `/ki` or `/kd`.
    pub fn check(&self) -> Result<(), Invalid> {
        in_range("/kp", self.proportional, Self::PROPORTIONAL)?;
        in_range("/ki", self.integral, Self::INTEGRAL)?;
        in_range("/kd", self.derivative, Self::DERIVATIVE)?;
        Ok(())
    }
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

    /// [`turn_per_period_rad`](Self::turn_per_period_rad) of a loop that is not tuned to
    /// its rate, rad; chosen.
    pub const UNTUNED_RAD: f64 = 0.1;

    /// Returns the gains by pole placement on ẍ = g/(1 + κ)·q, with the bandwidth limited
    /// by the period.
    pub(super) fn gains(&self, ball: &Ball, period_s: f64) -> PidGains {
        let (w, g) =
            (self.bandwidth_rad_s.min(self.turn_per_period_rad / period_s), ball.rolling_gravity());
        PidGains {
            proportional: w * w / g,
            integral: self.integral * w * w * w / g,
            derivative: 2.0 * self.damping * w / g,
        }
    }
}

/// The reference along one axis: position, m, and acceleration, m/s².
#[derive(Clone, Copy, Debug)]
pub(super) struct Setpoint {
    pub position: f64,
    pub acceleration: f64,
}

/// The controller's state on one axis.
#[derive(Clone, Copy, Debug, Default)]
struct AxisControlState {
    integral: f64,
    rate: f64,
    last: Option<f64>,
    unseen_s: f64,
    command: f64,
}

/// A controller with its state.
#[derive(Clone, Debug)]
pub(super) struct Controller {
    model: ControllerModel,
    period_s: f64,
    gains: PidGains,
    /// Command per acceleration of the reference, rad per m/s².
    feedforward: f64,
    axes: PerAxis<AxisControlState>,
}

impl Controller {
    pub(super) fn new(model: ControllerModel, ball: &Ball, period_s: f64) -> Self {
        let gains = model.gains(ball, period_s);
        let feedforward = model.feedforward / ball.rolling_gravity();
        Self { model, period_s, gains, feedforward, axes: PerAxis::default() }
    }

    /// Uses other gains from the next period on; the integral keeps its share of the command.
    pub(super) fn tune(&mut self, gains: PidGains) {
        self.gains = gains;
    }

    /// Returns the current commands, rad.
    pub(super) fn commands(&self) -> PerAxis<f64> {
        self.axes.map(|a| a.command)
    }

    /// Sets commands from outside; an axis without one keeps its command.
    pub(super) fn command(&mut self, commands: PerAxis<Option<f64>>) {
        for axis in Axis::ALL {
            if let Some(command) = commands[axis] {
                self.axes[axis].command = self.quantise(command);
            }
        }
    }

    /// Runs one period: computes new commands from the last reading.
    pub(super) fn update(&mut self, wanted: PerAxis<Setpoint>, seen: PerAxis<Option<f64>>) {
        for axis in Axis::ALL {
            let state = self.axes[axis];
            self.axes[axis] = match seen[axis] {
                Some(position) => self.closed(state, axis, wanted[axis], position),
                None => self.blind(state),
            };
        }
    }

    fn closed(
        &self,
        state: AxisControlState,
        axis: Axis,
        wanted: Setpoint,
        position: f64,
    ) -> AxisControlState {
        let (model, h) = (&self.model, self.period_s);
        let change = state.last.map_or(0.0, |last| (position - last) / h);
        let rate = state.rate + (change - state.rate) * h / (model.derivative_filter_s + h);
        let error = wanted.position - position;
        let integral = state.integral + self.gains.integral * error * h;
        // Anti-windup: the integral may use at most half of the command range.
        let integral = integral.clamp(-model.limit_rad / 2.0, model.limit_rad / 2.0);
        let wish = self.gains.proportional * error + integral - self.gains.derivative * rate;
        let wish = wish + self.feedforward * wanted.acceleration;
        let command = self.quantise(wish * axis.drive_sign());
        AxisControlState { integral, rate, last: Some(position), unseen_s: 0.0, command }
    }

    fn blind(&self, state: AxisControlState) -> AxisControlState {
        let unseen_s = state.unseen_s + self.period_s;
        let command = if unseen_s > BLIND_S { 0.0 } else { state.command };
        AxisControlState { rate: 0.0, last: None, unseen_s, command, ..state }
    }

    fn quantise(&self, command: f64) -> f64 {
        let limit = self.model.limit_rad;
        rounded(command.clamp(-limit, limit), self.model.resolution_rad)
    }
}
