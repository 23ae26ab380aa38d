//! Traces: what the pictures of a session are drawn from, column by column.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use offbd_core::diagnosis::AxisEvidence;
use offbd_core::engine::State;
use offbd_core::vocabulary::Axis;

/// A stretch of a session as it was judged, one entry for each moment, for
/// drawing: all but the times are rounded to seven digits.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TraceView {
    /// s on the device's clock.
    pub t_s: Vec<f64>,
    pub x: AxisTraceView,
    pub y: AxisTraceView,
}

/// One direction of ball motion over time. Null where there is no number.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct AxisTraceView {
    /// Command in force behind this axis, rad.
    pub command_rad: Vec<Option<f32>>,
    /// The twin's plate angle behind this axis, rad.
    pub plate_angle_rad: Vec<f32>,
    /// Measured position, by the fit over the window, m.
    pub position_m: Vec<Option<f32>>,
    /// Where the twin would be, had it left from the start of the window, m.
    pub twin_position_m: Vec<f32>,
    /// Measured acceleration over the window, m/s².
    pub measured_m_s2: Vec<Option<f32>>,
    /// The twin's through the same filter, m/s².
    pub twin_m_s2: Vec<Option<f32>>,
    /// Residual limit in force, m/s².
    pub limit_m_s2: Vec<f32>,
    /// Whether the residual may be judged (the gate).
    pub enabled: Vec<bool>,
}

/// One moment of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracePoint {
    t_s: f64,
    x: AxisPoint,
    y: AxisPoint,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct AxisPoint {
    evidence: AxisEvidence,
    plate_angle_rad: f64,
    twin_position_m: f64,
}

impl TracePoint {
    /// What a trace has of `state`; none before the first judged sample.
    #[must_use]
    pub fn of(state: &State) -> Option<Self> {
        let of_axis = |axis: Axis| AxisPoint {
            evidence: state.evidence.axes[axis],
            plate_angle_rad: state.plate_angle_rad[axis],
            twin_position_m: state.twin_position_m[axis],
        };
        let t_s = state.at?.seconds();
        Some(Self { t_s, x: of_axis(Axis::X), y: of_axis(Axis::Y) })
    }

    /// s on the device's clock.
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
    }
}

impl AxisTraceView {
    fn push(&mut self, point: &AxisPoint) {
        let evidence = &point.evidence;
        let short = |number: Option<f64>| number.map(|n| n as f32);
        self.command_rad.push(short(evidence.command_rad));
        self.plate_angle_rad.push(point.plate_angle_rad as f32);
        self.position_m.push(short(evidence.position_m));
        self.twin_position_m.push(point.twin_position_m as f32);
        self.measured_m_s2.push(short(evidence.measured_m_s2));
        self.twin_m_s2.push(short(evidence.twin_m_s2));
        self.limit_m_s2.push(evidence.limit_m_s2 as f32);
        self.enabled.push(evidence.enabled);
    }
}
