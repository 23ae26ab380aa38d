//! `offbd trends`: the drift of the servos over the sessions of one rig.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use rayon::prelude::*;

use crate::judge::{self, JudgedSession, TableArgs};
use crate::recordings::JoinArgs;
use offbd_core::diagnosis::ServoEstimate;
use offbd_core::diagnosis::trend::{LEAST_SESSIONS, MAX_SESSIONS};
use offbd_core::vocabulary::{Axis, PerAxis};
use offbd_terminal::errors::InputError;
use offbd_terminal::output::{self, OutputFormat};
use offbd_terminal::table;
use offbd_wire::basis::Basis;
use offbd_wire::trend::{TrendPointView, TrendView, TrendsView, estimate_view, trend_views};

/// Shows how the servos of one rig drift from session to session, and warns of
/// faults to come.
///
/// The sessions are given oldest first. Each yields an estimate of gain, offset
/// and delay of both servos. A line is fitted through the estimates; if it rises
/// or falls significantly and will reach its limit within 20 sessions, there is a
/// warning.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd trends --asset calibrated.json monday.csv tuesday.csv wednesday.csv …\n  \
    offbd trends --asset calibrated.json --format json *.csv | jq .trends\n\n\
    Exit status: 0 judged (warnings or not), 3 a file could not be used.")]
pub struct TrendsArgs {
    /// The rig's asset file, calibrated
    #[arg(long, value_name = "ASSET.json")]
    asset: PathBuf,
    /// Recorded sessions of the rig, oldest first; of a folder all files, by their names
    #[arg(required = true, value_name = "SESSION.csv")]
    sessions: Vec<PathBuf>,
    /// A table for people, or one JSON object
    #[arg(long, value_enum, default_value = "table")]
    format: OutputFormat,
    #[command(flatten)]
    table: TableArgs,
}

pub fn run(args: &TrendsArgs) -> anyhow::Result<()> {
    let rig = judge::load_rig(Some(&args.asset))?;
    let asset = rig.name.clone();
    let setup = judge::set_up(rig, None)?;
    let Some(calibration_id) = Basis::of(&setup).calibration_id else {
        let reason = "it has no calibration, which trends need";
        return Err(InputError::file(&args.asset, reason).into());
    };
    let options = args.table.options();
    let recordings = JoinArgs::default().recordings(&args.sessions)?;
    let judged: Result<Vec<Vec<JudgedSession>>, InputError> =
        recordings.par_iter().map(|r| judge::judge_recording(&setup, r, &options)).collect();
    let judged: Vec<JudgedSession> = judged?.into_iter().flatten().collect();
    let first = judged.len().saturating_sub(MAX_SESSIONS);
    let estimates: Vec<PerAxis<Option<ServoEstimate>>> =
        judged[first..].iter().map(|j| j.estimates).collect();
    let view = TrendsView {
        asset,
        points: judged[first..].iter().map(|j| point(j, &calibration_id)).collect(),
        trends: trend_views(&estimates),
        calibration_id: Some(calibration_id),
    };
    let mut out = output::stdout();
    match args.format {
        OutputFormat::Json => {
            serde_json::to_writer(&mut out, &view)?;
            writeln!(out)?;
        }
        OutputFormat::Table => write_table(&mut out, &view, &judged[first..])?,
    }
    Ok(out.flush()?)
}

fn point(judged: &JudgedSession, calibration_id: &str) -> TrendPointView {
    TrendPointView {
        session: judged.summary.session.clone(),
        session_id: None,
        ended_at: None,
        calibration_id: Some(calibration_id.to_owned()),
        samples: judged.summary.samples,
        x: judged.estimates.x.as_ref().map(estimate_view),
        y: judged.estimates.y.as_ref().map(estimate_view),
    }
}

fn write_table(
    out: &mut impl Write,
    view: &TrendsView,
    judged: &[JudgedSession],
) -> anyhow::Result<()> {
    let heading = ["session", "axis", "gain", "offset, m/s²", "delay, ms", "motion, s"];
    let mut points = table::table_of_files(&heading, &[2, 3, 4, 5]);
    for session in judged {
        for axis in Axis::ALL {
            points.add_row(row(session, axis));
        }
    }
    for line in table::lines(&points) {
        writeln!(out, "{line}")?;
    }
    writeln!(out)?;
    if view.trends.is_empty() {
        let needed = format!("{LEAST_SESSIONS} sessions with enough motion make a trend");
        let n = view.points.iter().filter(|point| point.x.is_some() || point.y.is_some()).count();
        writeln!(out, "{needed}; only {n} so far")?;
        return Ok(());
    }
    let heading = ["trend", "a session", "between", "and", "now", "limits"];
    let mut trends = table::table(&heading, &[1, 2, 3, 4]);
    for trend in &view.trends {
        trends.add_row(trend_row(trend));
    }
    for line in table::lines(&trends) {
        writeln!(out, "{line}")?;
    }
    write_warnings(out, view)
}

fn row(session: &JudgedSession, axis: Axis) -> [String; 6] {
    let name = if axis == Axis::X { session.summary.session.clone() } else { String::new() };
    let dash = || "–".to_owned();
    let Some(e) = &session.estimates[axis] else {
        return [name, axis.as_str().to_owned(), dash(), dash(), dash(), dash()];
    };
    [
        name,
        axis.as_str().to_owned(),
        format!("{:.3} ± {:.3}", e.gain, e.gain_error),
        format!("{:.3} ± {:.3}", e.offset_m_s2, e.offset_error_m_s2),
        format!("{:.0} ± {:.0}", e.delay_s * 1e3, e.delay_error_s * 1e3),
        format!("{:.0}", e.seconds),
    ]
}

fn trend_row(trend: &TrendView) -> [String; 6] {
    let (factor, digits, unit) = match trend.parameter.as_str() {
        "gain" => (1.0, 3, ""),
        "offset" => (1.0, 4, " m/s²"),
        _ => (1e3, 1, " ms"),
    };
    let number = |value: f64| format!("{:.digits$}", value * factor);
    [
        format!("{} {}", trend.axis, trend.parameter),
        number(trend.slope),
        number(trend.slope_low),
        number(trend.slope_high),
        number(trend.level),
        format!("{} to {}{unit}", number(trend.limit_low), number(trend.limit_high)),
    ]
}

fn write_warnings(out: &mut impl Write, view: &TrendsView) -> anyhow::Result<()> {
    writeln!(out)?;
    let mut warnings = view.trends.iter().filter_map(|trend| trend.warning.as_ref()).peekable();
    if warnings.peek().is_none() {
        writeln!(out, "no warning")?;
    }
    for warning in warnings {
        writeln!(out, "{}", table::wrapped("warning: ", &warning.summary))?;
    }
    Ok(())
}
