//! Traces: the judged quantities of a session over time, for charts.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::words::CodeWord;
use offbd_core::diagnosis::AxisEvidence;
use offbd_core::engine::{Engine, State};
use offbd_core::vocabulary::{Axis, FaultCode};

/// The judged quantities over an interval of a session, for charts: columns of equal length.
/// All values but the times are rounded to seven digits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TraceView {
    /// Times, s on the device's clock.
    pub t_s: Vec<f64>,
    pub x: AxisTraceView,
    pub y: AxisTraceView,
    /// Fault detection counter of the monitor of the ball, −128 (passed) to 127 (failed).
    pub stuck_ball_counter: Vec<i8>,
    /// Fault detection counter of the monitor of the sensor, −128 (passed) to 127 (failed).
    pub sensor_counter: Vec<i8>,
    /// The values at which the monitors decide, which are constant during a session. Live
    /// data have none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub thresholds: Vec<ThresholdsView>,
    /// Every how many judged moments the columns have one; 1 if they have all of them.
    pub stride: u64,
}

impl Default for TraceView {
    fn default() -> Self {
        let (x, y) = Default::default();
        let (t_s, stuck_ball_counter, sensor_counter, thresholds) = Default::default();
        Self { t_s, x, y, stuck_ball_counter, sensor_counter, thresholds, stride: 1 }
    }
}

/// The values at which a monitor decides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ThresholdsView {
    pub code: CodeWord,
    /// Time of failure after which the counter is at 127 and the test fails, s: for a failure
    /// of no particular kind without a rival cause.
    pub fail_s: f64,
    /// Further time of failure until the fault is confirmed, s.
    pub confirm_s: f64,
    /// Evidence at which the test of a servo fails, nats; null if evidence does not decide.
    pub suspect_nats: Option<f64>,
    /// Evidence that confirms a fault of a servo, nats; null if evidence does not decide.
    pub confirm_nats: Option<f64>,
}

impl ThresholdsView {
    /// Returns the values of all monitors of `engine`, in the order of the codes.
    #[must_use]
    pub fn of(engine: &Engine) -> Vec<Self> {
        let of_code = |&code: &FaultCode| {
            let found = engine.thresholds(code);
            Self {
                code: code.into(),
                fail_s: found.times.fail_s,
                confirm_s: found.times.confirm_s,
                suspect_nats: found.suspect_nats,
                confirm_nats: found.confirm_nats,
            }
        };
        FaultCode::ALL.iter().map(of_code).collect()
    }
}

/// The quantities along one axis over time. A value that is unknown is null.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct AxisTraceView {
    /// Command of the plate angle that moves the ball along this axis, rad.
    pub command_rad: Vec<Option<f32>>,
    /// The twin's plate angle that moves the ball along this axis, rad.
    pub plate_angle_rad: Vec<f32>,
    /// Measured position, from the fit over the window, m.
    pub position_m: Vec<Option<f32>>,
    /// Position of the twin if it had started from the measured motion at the start of the
    /// window, m.
    pub twin_position_m: Vec<f32>,
    /// Measured acceleration over the window, m/s².
    pub measured_m_s2: Vec<Option<f32>>,
    /// The twin's acceleration through the same filter, m/s².
    pub twin_m_s2: Vec<Option<f32>>,
    /// Limit of the residual, m/s².
    pub limit_m_s2: Vec<f32>,
    /// Whether the enable condition holds.
    pub enabled: Vec<bool>,
    /// Evidence against the servo as its monitor weighs it, nats.
    pub nats: Vec<f32>,
    /// Fault detection counter of the servo's monitor, −128 (passed) to 127 (failed).
    pub counter: Vec<i8>,
}

/// One moment of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracePoint {
    t_s: f64,
    x: AxisTracePoint,
    y: AxisTracePoint,
    stuck_ball_counter: i8,
    sensor_counter: i8,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct AxisTracePoint {
    evidence: AxisEvidence,
    plate_angle_rad: f64,
    twin_position_m: f64,
    nats: f64,
    counter: i8,
}

impl TracePoint {
    /// Returns the point at which the evidence of `state` was last renewed, every 50 ms in
    /// the default profile; `None` unless that was at the last judged sample, since
    /// the evidence belongs to no later one.
    #[must_use]
    pub fn of(state: &State) -> Option<Self> {
        let at = state.at.filter(|_| state.at == state.evidence.at)?;
        let monitor = |code: FaultCode| &state.monitors[code as usize];
        let of_axis = |axis: Axis| AxisTracePoint {
            evidence: state.evidence.axes[axis],
            plate_angle_rad: state.plate_angle_rad[axis],
            twin_position_m: state.twin_position_m[axis],
            nats: monitor(FaultCode::servo(axis)).nats,
            counter: monitor(FaultCode::servo(axis)).counter,
        };
        Some(Self {
            t_s: at.seconds(),
            x: of_axis(Axis::X),
            y: of_axis(Axis::Y),
            stuck_ball_counter: monitor(FaultCode::StuckBall).counter,
            sensor_counter: monitor(FaultCode::Sensor).counter,
        })
    }

    /// Returns the time, s on the device's clock.
    #[must_use]
    pub const fn t_s(&self) -> f64 {
        self.t_s
    }
}

impl TraceView {
    /// Appends `point`.
    pub fn push(&mut self, point: &TracePoint) {
        self.t_s.push(point.t_s);
        self.x.push(&point.x);
        self.y.push(&point.y);
        self.stuck_ball_counter.push(point.stuck_ball_counter);
        self.sensor_counter.push(point.sensor_counter);
    }
}

impl AxisTraceView {
    fn push(&mut self, point: &AxisTracePoint) {
        let evidence = &point.evidence;
        let single = |number: Option<f64>| number.map(|n| n as f32);
        self.command_rad.push(single(evidence.command_rad));
        self.plate_angle_rad.push(point.plate_angle_rad as f32);
        self.position_m.push(single(evidence.position_m));
        self.twin_position_m.push(point.twin_position_m as f32);
        self.measured_m_s2.push(single(evidence.measured_m_s2));
        self.twin_m_s2.push(single(evidence.twin_m_s2));
        self.limit_m_s2.push(evidence.limit_m_s2 as f32);
        self.enabled.push(evidence.enabled);
        self.nats.push(point.nats as f32);
        self.counter.push(point.counter);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::Evidence;
    use offbd_core::vocabulary::SimTime;

    #[test]
    fn evidence_is_paired_with_its_own_moment_only() {
        let state = |at_s: f64, evidence_s: Option<f64>| State {
            at: SimTime::new(at_s),
            evidence: Evidence { at: evidence_s.and_then(SimTime::new), ..Evidence::default() },
            ..State::default()
        };
        assert_eq!(TracePoint::of(&state(1.0, Some(1.0))).map(|p| p.t_s()), Some(1.0));
        assert_eq!(TracePoint::of(&state(1.04, Some(1.0))), None, "40 ms later");
        assert_eq!(TracePoint::of(&state(1.0, None)), None);
        assert_eq!(TracePoint::of(&State::default()), None);
    }
}
