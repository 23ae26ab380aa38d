//! `offbd drive-cycle`: computes the motion in which every monitor comes to a result.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use crate::judge;
use offbd_core::engine::drive_cycle;
use offbd_terminal::errors::InputError;
use offbd_terminal::{output, table};
use offbd_wire::drive_cycle::{DriveCycleView, PYTHON, view, write_csv};

/// Computes the drive cycle of a calibrated rig: the shortest motion, within the
/// plate and the servos' limits, in which every monitor comes to a result.
///
/// The drive cycle is a table of commands, of the set points of the ball, and of
/// the corrections that keep the ball on them. A device with its own controller
/// uses only the set points. After a run no monitor is "not tested"; run it, for
/// example, at the start of a day, or if a verdict cannot tell causes apart.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd drive-cycle --asset calibrated.json\n  \
    offbd drive-cycle --asset calibrated.json --format json -o drive-cycle.json\n  \
    offbd drive-cycle --asset calibrated.json --format python -o drive-cycle.py\n  \
    offbd replay --asset calibrated.json drive-cycle-run.csv\n\n\
    Exit status: 0 done, 3 this rig has no drive cycle.")]
pub struct DriveCycleArgs {
    /// The rig's asset file, calibrated
    #[arg(long, value_name = "ASSET.json")]
    asset: PathBuf,
    /// Output: a table of which fault is found after what time (table), the rows
    /// (csv), the rows with corrections (json), or a program that runs the JSON file
    /// (python)
    #[arg(long, value_enum, default_value = "table")]
    format: DriveCycleFormat,
    /// Output file; `-` is stdout
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum DriveCycleFormat {
    Table,
    Csv,
    Json,
    Python,
}

pub fn run(args: &DriveCycleArgs) -> anyhow::Result<()> {
    let rig = judge::load_rig(Some(&args.asset))?;
    let cycle = drive_cycle(&rig).map_err(|why| InputError::file(&args.asset, why))?;
    let cycle_view = view(&rig.name, &cycle);
    if args.format != DriveCycleFormat::Table {
        output::remark(format_args!("{}", headline(&cycle_view)));
    }
    let mut out = output::create(&args.output)?;
    match args.format {
        DriveCycleFormat::Table => write_table(&mut out, &cycle_view)?,
        DriveCycleFormat::Csv => write_csv(&mut out, &cycle)?,
        DriveCycleFormat::Json => {
            serde_json::to_writer(&mut out, &cycle_view)?;
            writeln!(out)?;
        }
        DriveCycleFormat::Python => out.write_all(PYTHON.as_bytes())?,
    }
    Ok(out.flush()?)
}

fn headline(cycle: &DriveCycleView) -> String {
    let degrees = cycle.tilt_rad.x.max(cycle.tilt_rad.y).to_degrees();
    let order = match cycle.order.as_str() {
        "in_turn" => "x, then y",
        "staggered" => "y after x",
        _ => "both axes at once",
    };
    format!(
        "{}: {:.2} s, {order}, {:.0} and {:.0} mm to each side, {degrees:.1}° of tilt",
        cycle.asset,
        cycle.duration_s,
        1e3 * cycle.amplitude_m.x,
        1e3 * cycle.amplitude_m.y,
    )
}

fn write_table(out: &mut impl Write, cycle: &DriveCycleView) -> anyhow::Result<()> {
    writeln!(out, "{}\n", table::wrapped("", &headline(cycle)))?;
    let mut monitors = table::table(&["healthy", "passes after"], &[1]);
    for monitor in &cycle.monitors {
        let after = seconds(monitor.passed_after_s, monitor.why_not.as_deref());
        monitors.add_row([monitor.code.to_string(), after]);
    }
    write_lines(out, &monitors)?;
    writeln!(out)?;
    let mut faults = table::table(&["if", "then", "after", "beside"], &[2]);
    for fault in &cycle.faults {
        let after = seconds(fault.after_s, Some("not for sure"));
        let beside = fault.beside.map(|code| code.to_string()).unwrap_or_default();
        faults.add_row([fault.fault.clone(), fault.code.to_string(), after, beside]);
    }
    write_lines(out, &faults)
}

fn seconds(after_s: Option<f64>, without: Option<&str>) -> String {
    after_s.map_or_else(|| without.unwrap_or("–").to_owned(), |s| format!("{s:.1} s"))
}

fn write_lines(out: &mut impl Write, of: &comfy_table::Table) -> anyhow::Result<()> {
    for line in table::lines(of) {
        writeln!(out, "{line}")?;
    }
    Ok(())
}
