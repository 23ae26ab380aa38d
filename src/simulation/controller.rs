//! The rig's controller: one PID per axis on the measured position, with a
//! filtered derivative and a whole number of command steps.
//!
//! The device runs one loop: look, command, log a row. At the chapter's 100 rows
//! a second the loops close every 10 ms, as the chapter's do.

use crate::plant::Ball;
use crate::vocabulary::{Axis, PerAxis};

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
    /// Smallest step of the command, rad; 0: continuous.
    pub resolution_rad: f64,
}

/// How long the last command stands while no ball is seen, s; then the plate
/// is levelled. A lone missing reading must not make the plate twitch.
const BLIND_S: f64 = 0.3;

/// The gains of one axis: rad per m, per m·s, and per m/s.
#[derive(Clone, Copy, Debug)]
struct Gains {
    proportional: f64,
    integral: f64,
    derivative: f64,
}

impl ControllerModel {
    /// Pole placement on ẍ = g/(1 + κ)·q. A slow loop gets a bandwidth that it
    /// can hold: a tenth of a radian per period.
    fn gains(&self, ball: &Ball, period_s: f64) -> Gains {
        let (w, g) = (self.bandwidth_rad_s.min(0.1 / period_s), ball.rolling_gravity());
        Gains {
            proportional: w * w / g,
            integral: self.integral * w * w * w / g,
            derivative: 2.0 * self.damping * w / g,
        }
    }
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

    /// One period: new commands from the last reading.
    pub(super) fn update(&mut self, wanted: PerAxis<f64>, seen: PerAxis<Option<f64>>) {
        for axis in Axis::ALL {
            let state = self.axes[axis];
            self.axes[axis] = match seen[axis] {
                Some(position) => self.closed(state, axis, wanted[axis], position),
                None => self.blind(state),
            };
        }
    }

    fn closed(&self, state: AxisState, axis: Axis, wanted: f64, position: f64) -> AxisState {
        let (model, h) = (&self.model, self.period_s);
        let change = state.last.map_or(0.0, |last| (position - last) / h);
        let rate = state.rate + (change - state.rate) * h / (model.derivative_filter_s + h);
        let error = wanted - position;
        let integral = state.integral + self.gains.integral * error * h;
        // The integral may not ask for more than half of the authority.
        let integral = integral.clamp(-model.limit_rad / 2.0, model.limit_rad / 2.0);
        let wish = self.gains.proportional * error + integral - self.gains.derivative * rate;
        let command = self.quantise(wish * axis.drive_sign());
        AxisState { integral, rate, last: Some(position), unseen_s: 0.0, command }
    }

    fn blind(&self, state: AxisState) -> AxisState {
        let unseen_s = state.unseen_s + self.period_s;
        let command = if unseen_s > BLIND_S { 0.0 } else { state.command };
        AxisState { rate: 0.0, last: None, unseen_s, command, ..state }
    }

    fn quantise(&self, command: f64) -> f64 {
        let (limit, step) = (self.model.limit_rad, self.model.resolution_rad);
        let clamped = command.clamp(-limit, limit);
        if step > 0.0 { (clamped / step).round() * step } else { clamped }
    }
}
