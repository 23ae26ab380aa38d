//! A drive cycle as JSON, as CSV, and as a program that runs it.

use std::io::{self, Write};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::session_csv;
use super::words::{CodeWord, CycleOrderWord, KindWord};
use offbd_core::engine::{DriveCycle, FaultVerdict, Feedback, MonitorVerdict, NotReached};
use offbd_core::vocabulary::{Axis, PerAxis, Sample};

/// A Python program for the device that runs the cycle in `drive-cycle.json`.
pub const PYTHON: &str = include_str!("drive_cycle/run.py");

/// Numbers are rounded to 1/`PER_UNIT` of a second, radian or metre, which is finer than
/// any device resolves.
const PER_UNIT: f64 = 1e6;

/// A drive cycle: the shortest motion in which every monitor has a result. Rows and
/// corrections use the device's axes, signs and units.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct DriveCycleView {
    pub asset: String,
    pub duration_s: f64,
    /// Duration of one motion to both sides and back, s.
    pub period_s: f64,
    /// Number of such motions along each axis.
    pub repeats: u32,
    pub order: CycleOrderWord,
    /// Largest distance of the set points from the plate's middle, m, along the plate's
    /// axes; zero along an axis that the rig lacks.
    pub amplitude_m: AlongAxes,
    /// Largest feedforward tilt, without the level, rad.
    pub tilt_rad: AlongAxes,
    /// Largest difference of a session's level from the learnt one that was tried, rad.
    pub level_within_rad: AlongAxes,
    /// Result of each monitor on the healthy rig.
    pub monitors: Vec<CycleMonitorView>,
    /// Faults that are present from the start, the hardest to find first.
    pub faults: Vec<CycleFaultView>,
    /// Correction of the command qy, which moves the ball along the plate's x; null if the
    /// rig has no such servo.
    pub correct_qy: Option<CorrectionView>,
    /// Correction of the command qx, which moves the ball along the plate's y; null if the
    /// rig has no such servo.
    pub correct_qx: Option<CorrectionView>,
    /// Time constant of the filter of the derivative part, s.
    pub filter_s: f64,
    /// Largest command in either direction.
    pub limit: f64,
    /// Rows per second.
    pub rate_hz: f64,
    pub rows: CycleRowsView,
}

/// One value for each axis of the plate.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct AlongAxes {
    pub x: f64,
    pub y: f64,
}

/// The result of one monitor on the healthy rig.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CycleMonitorView {
    pub code: CodeWord,
    /// Time at which its test passes, s after the start; null if it has no result.
    pub passed_after_s: Option<f64>,
    /// Why it has no result; null if it has one.
    pub why_not: Option<String>,
}

/// Whether and when a fault is found.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CycleFaultView {
    pub code: CodeWord,
    /// Failure mode; null for the ball.
    pub kind: Option<KindWord>,
    /// The fault in words.
    pub fault: String,
    /// Time by which it is confirmed in every trial, s after the start; null if a trial did
    /// not confirm it.
    pub after_s: Option<f64>,
    /// Code of another cause that would explain the same readings and is named as well;
    /// null if there is none. Both servos at once, as without power, may be named beside a stuck
    /// ball as well. They are not given here: no motion of the plate tells the two apart.
    pub beside: Option<CodeWord>,
}

/// The gains of the correction added to a command, from the distance of the ball to its
/// set point: set point − reading.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct CorrectionView {
    /// Whether the distance is that of the device's reading `x_m`; if false, of `y_m`.
    pub reads_x: bool,
    /// Command per distance; signed.
    pub proportional: f64,
    /// Command per integral of the distance over time, 1/s; signed.
    pub integral: f64,
    /// Command per rate of change of the distance, s; signed.
    pub derivative: f64,
}

/// Commands and set points over time, as columns of equal length. Positions are set
/// points; values along an axis that the rig lacks are null.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct CycleRowsView {
    pub t_s: Vec<f64>,
    pub cmd_qx_rad: Vec<Option<f64>>,
    pub cmd_qy_rad: Vec<Option<f64>>,
    pub x_m: Vec<Option<f64>>,
    pub y_m: Vec<Option<f64>>,
}

/// Returns the view of the drive cycle of `asset`.
#[must_use]
pub fn view(asset: &str, cycle: &DriveCycle) -> DriveCycleView {
    let along = |of: PerAxis<f64>| AlongAxes { x: of.x, y: of.y };
    DriveCycleView {
        asset: asset.to_owned(),
        duration_s: cycle.duration_s,
        period_s: cycle.period_s,
        repeats: cycle.repeats,
        order: cycle.order.into(),
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

fn monitor(verdict: &MonitorVerdict) -> CycleMonitorView {
    CycleMonitorView {
        code: verdict.code.into(),
        passed_after_s: verdict.passed.ok(),
        why_not: verdict.passed.err().map(|why| reason(why).to_owned()),
    }
}

const fn reason(why: NotReached) -> &'static str {
    match why {
        NotReached::NoSuchAxis => "the rig has no such servo, or no readings along its axis",
        NotReached::TooLittleMotion => {
            "no motion within the plate and the servos' limits lets the monitor judge for long \
             enough"
        }
    }
}

fn fault(verdict: &FaultVerdict) -> CycleFaultView {
    CycleFaultView {
        code: verdict.fault.code().into(),
        kind: verdict.fault.kind().map(KindWord::from),
        fault: verdict.fault.words().to_owned(),
        after_s: verdict.after_s,
        beside: verdict.beside.map(CodeWord::from),
    }
}

fn correction(feedback: Feedback) -> CorrectionView {
    let Feedback { reading, proportional, integral, derivative } = feedback;
    CorrectionView { reads_x: reading == Axis::X, proportional, integral, derivative }
}

fn rows(cycle: &DriveCycle) -> CycleRowsView {
    let mut rows = CycleRowsView::default();
    for row in cycle.rows.iter().map(rounded_row) {
        rows.t_s.push(row.t_s);
        rows.cmd_qx_rad.push(row.cmd_qx_rad);
        rows.cmd_qy_rad.push(row.cmd_qy_rad);
        rows.x_m.push(row.x_m);
        rows.y_m.push(row.y_m);
    }
    rows
}

/// Returns the row with its numbers rounded for output.
fn rounded_row(row: &Sample) -> Sample {
    // Adding zero turns −0 into 0.
    let rounded = |value: f64| (value * PER_UNIT).round() / PER_UNIT + 0.0;
    Sample {
        seq: None,
        t_s: rounded(row.t_s),
        cmd_qx_rad: row.cmd_qx_rad.map(rounded),
        cmd_qy_rad: row.cmd_qy_rad.map(rounded),
        x_m: row.x_m.map(rounded),
        y_m: row.y_m.map(rounded),
    }
}

/// Writes the rows of `cycle` as a session file, with the feedforward commands and, as
/// positions, the set points.
///
/// # Errors
/// [`io::Error`] if `out` fails.
pub fn write_csv(out: &mut impl Write, cycle: &DriveCycle) -> io::Result<()> {
    let rows: Vec<Sample> = cycle.rows.iter().map(rounded_row).collect();
    session_csv::write(out, &rows)
}
