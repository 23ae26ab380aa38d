//! A drive cycle as JSON, as CSV, and as a program that runs it.

use std::io::{self, Write};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::session_csv;
use offbd_core::engine::{DriveCycle, FaultVerdict, Feedback, MonitorVerdict, NotReached, Order};
use offbd_core::vocabulary::{Axis, PerAxis, Sample};

/// The program that runs a cycle beside which it lies, for a device with Python.
pub const PYTHON: &str = include_str!("drive_cycle/run.py");

/// Digits of a second, a radian and a metre after which a device sees nothing.
const PER_UNIT: f64 = 1e6;

/// A drive cycle: the shortest motion in which every monitor comes to a result. Rows and
/// corrections are in the device's own numbers: its axes, signs and units.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct DriveCycleView {
    pub asset: String,
    pub duration_s: f64,
    /// Duration of one motion to both sides and back, s.
    pub period_s: f64,
    /// Such motions along each axis.
    pub repeats: u32,
    /// `at_once`: both axes together; `staggered`: y a quarter of a period after x;
    /// `in_turn`: first x, then y.
    #[schema(pattern = "^(at_once|staggered|in_turn)$")]
    pub order: String,
    /// Largest distance of the set points from the plate's middle, m, along the plate's
    /// axes.
    pub amplitude_m: AlongAxes,
    /// Largest tilt that is commanded beforehand, the level aside, rad.
    pub tilt_rad: AlongAxes,
    /// How far a session's level may be from the learnt one, rad.
    pub level_within_rad: AlongAxes,
    /// What each monitor comes to on the healthy rig.
    pub monitors: Vec<CycleMonitorView>,
    /// What is found if it is there from the start, those hardest to find first.
    pub faults: Vec<CycleFaultView>,
    /// How to correct the command that moves the ball along each axis of the plate: qy
    /// for x, qx for y. Null where the rig has no such servo.
    pub correct_qy: Option<CorrectionView>,
    pub correct_qx: Option<CorrectionView>,
    /// Time constant of the filter of the rate of the distance, s.
    pub filter_s: f64,
    /// Largest command, either way.
    pub limit: f64,
    /// Rows a second.
    pub rate_hz: f64,
    pub rows: CycleRowsView,
}

/// One value along each axis of the plate.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct AlongAxes {
    pub x: f64,
    pub y: f64,
}

/// What one monitor comes to on the healthy rig.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CycleMonitorView {
    pub code: String,
    /// Seconds after the start; null where it comes to no result.
    pub passed_after_s: Option<f64>,
    /// Why it comes to none.
    pub why_not: Option<String>,
}

/// How a fault is found.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CycleFaultView {
    pub code: String,
    /// In which way it is wrong; null for the ball.
    pub kind: Option<String>,
    /// In words.
    pub fault: String,
    /// Seconds after the start by which it is confirmed; null where it is not found for
    /// sure.
    pub after_s: Option<f64>,
    /// A cause that reads alike and is named beside it.
    pub beside: Option<String>,
}

/// What is added to a command: a distance is set point − reading.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct CorrectionView {
    /// Whether it follows the device's reading `x_m` or `y_m`.
    pub reads_x: bool,
    /// Command per distance; signed.
    pub proportional: f64,
    /// Command per distance and second; signed.
    pub integral: f64,
    /// Command per rate of the distance, s; signed.
    pub derivative: f64,
}

/// Commands and set points over time, as columns.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct CycleRowsView {
    pub t_s: Vec<f64>,
    pub cmd_qx_rad: Vec<Option<f64>>,
    pub cmd_qy_rad: Vec<Option<f64>>,
    pub x_m: Vec<Option<f64>>,
    pub y_m: Vec<Option<f64>>,
}

/// The view of `cycle` of the rig called `asset`.
#[must_use]
pub fn view(asset: &str, cycle: &DriveCycle) -> DriveCycleView {
    let along = |of: PerAxis<f64>| AlongAxes { x: of.x, y: of.y };
    DriveCycleView {
        asset: asset.to_owned(),
        duration_s: cycle.duration_s,
        period_s: cycle.period_s,
        repeats: cycle.repeats,
        order: order(cycle.order).to_owned(),
        amplitude_m: along(cycle.amplitude_m),
        tilt_rad: along(cycle.tilt_rad),
        level_within_rad: along(cycle.level_within_rad),
        monitors: cycle.monitors.iter().map(monitor).collect(),
        faults: cycle.faults.iter().map(fault).collect(),
        correct_qy: cycle.feedback.x.map(correction),
        correct_qx: cycle.feedback.y.map(correction),
        filter_s: cycle.filter_s,
        limit: cycle.limit,
        rate_hz: cycle.rate_hz,
        rows: rows(cycle),
    }
}

const fn order(order: Order) -> &'static str {
    match order {
        Order::AtOnce => "at_once",
        Order::Staggered => "staggered",
        Order::InTurn => "in_turn",
    }
}

fn monitor(verdict: &MonitorVerdict) -> CycleMonitorView {
    CycleMonitorView {
        code: verdict.code.to_string(),
        passed_after_s: verdict.passed.ok(),
        why_not: verdict.passed.err().map(|why| reason(why).to_owned()),
    }
}

const fn reason(why: NotReached) -> &'static str {
    match why {
        NotReached::NoSuchAxis => "the rig has no such servo, or no readings along its axis",
        NotReached::TooLittleMotion => {
            "no motion within the plate and the servos' limits lets it judge for long enough"
        }
    }
}

fn fault(verdict: &FaultVerdict) -> CycleFaultView {
    CycleFaultView {
        code: verdict.fault.code().to_string(),
        kind: verdict.fault.kind().map(|kind| kind.to_string()),
        fault: verdict.fault.words().to_owned(),
        after_s: verdict.after_s,
        beside: verdict.beside.map(|code| code.to_string()),
    }
}

fn correction(feedback: Feedback) -> CorrectionView {
    let Feedback { reading, proportional, integral, derivative } = feedback;
    CorrectionView { reads_x: reading == Axis::X, proportional, integral, derivative }
}

fn rows(cycle: &DriveCycle) -> CycleRowsView {
    let mut rows = CycleRowsView::default();
    for row in cycle.rows.iter().map(written) {
        rows.t_s.push(row.t_s);
        rows.cmd_qx_rad.push(row.cmd_qx_rad);
        rows.cmd_qy_rad.push(row.cmd_qy_rad);
        rows.x_m.push(row.x_m);
        rows.y_m.push(row.y_m);
    }
    rows
}

/// The row as it is written.
fn written(row: &Sample) -> Sample {
    // Adding zero turns −0 into 0.
    let short = |value: f64| (value * PER_UNIT).round() / PER_UNIT + 0.0;
    Sample {
        seq: None,
        t_s: short(row.t_s),
        cmd_qx_rad: row.cmd_qx_rad.map(short),
        cmd_qy_rad: row.cmd_qy_rad.map(short),
        x_m: row.x_m.map(short),
        y_m: row.y_m.map(short),
    }
}

/// Writes the rows of `cycle` as a session file has them: the commands beforehand, and
/// as readings the set points.
///
/// # Errors
/// What `out` says.
pub fn write_csv(out: &mut impl Write, cycle: &DriveCycle) -> io::Result<()> {
    let rows: Vec<Sample> = cycle.rows.iter().map(written).collect();
    session_csv::write(out, &rows)
}
