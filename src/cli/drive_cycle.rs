//! `offbd drive-cycle`: the motion in which every monitor comes to a result.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::unusable::Unusable;
use super::{judge, output, table};
use crate::wire::drive_cycle::{DriveCycleView, PYTHON, view, write_csv};
use offbd_core::engine::drive_cycle;

/// The drive cycle of a learnt rig: the shortest motion, within its plate and its
/// servos' limits, in which every monitor comes to a result.
///
/// It is a table of commands and of set points that the ball follows, and the
/// corrections by which the commands keep it there; a device with a controller of
/// its own plays the set points alone. Run at the start of a day, or when a verdict
/// says that it cannot tell, it ends every "not tested".
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd drive-cycle --asset learnt.json\n  \
    offbd drive-cycle --asset learnt.json --format json -o drive-cycle.json\n  \
    offbd drive-cycle --asset learnt.json --format python -o drive-cycle.py\n  \
    offbd replay --asset learnt.json drive-cycle-run.csv\n\n\
    Exit status: 0 done, 3 there is no drive cycle for this rig.")]
pub(super) struct DriveCycleArgs {
    /// The rig's asset file, calibrated
    #[arg(long, value_name = "ASSET.json")]
    asset: PathBuf,
    /// A table of what is found when, the rows, rows with corrections, or a program
    /// that runs the JSON beside it
    #[arg(long, value_enum, default_value = "table")]
    format: Format,
    /// Where it goes; `-` is stdout
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    Table,
    Csv,
    Json,
    Python,
}

pub(super) fn run(args: &DriveCycleArgs) -> anyhow::Result<()> {
    let rig = judge::load_rig(Some(&args.asset))?;
    let cycle = drive_cycle(&rig).map_err(|why| Unusable::file(&args.asset, why))?;
    let shown = view(&rig.name, &cycle);
    if args.format != Format::Table {
        anstream::eprintln!("{}", headline(&shown));
    }
    let mut out = output::create(&args.output)?;
    match args.format {
        Format::Table => write_table(&mut out, &shown)?,
        Format::Csv => write_csv(&mut out, &cycle)?,
        Format::Json => {
            serde_json::to_writer(&mut out, &shown)?;
            writeln!(out)?;
        }
        Format::Python => out.write_all(PYTHON.as_bytes())?,
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
        monitors.add_row([monitor.code.clone(), after]);
    }
    write_lines(out, &monitors)?;
    writeln!(out)?;
    let mut faults = table::table(&["if", "then", "after", "beside"], &[2]);
    for fault in &cycle.faults {
        let after = seconds(fault.after_s, Some("not for sure"));
        let beside = fault.beside.clone().unwrap_or_default();
        faults.add_row([fault.fault.clone(), fault.code.clone(), after, beside]);
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
