//! `offbd inspect`: what a recording holds, and how its columns would be read.

use std::fs::File;
use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use crate::judge::{self, TableArgs};
use offbd_terminal::errors::InputError;
use offbd_terminal::output::{self, OutputFormat};
use offbd_terminal::table;
use offbd_wire::inspection::{
    InspectedQuantityView, InspectionRemarkView, InspectionView, MappingChangeView, inspect,
};

/// Shows what a recording holds, and proposes how to read its columns.
///
/// Finds separator, decimal sign, encoding, header and units of a text, guesses
/// which columns are time, commands and positions, and compares the motion with
/// the commands: a wrong unit, sign or axis shows there. Prints the mapping to
/// give to `replay`, `calibrate`, `trends`, `export` and to an import.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd inspect log.txt\n  \
    offbd inspect counts.txt --rate 100 --columns \"x_m=#1/mm, cmd_qy_rad=#3/deg\"\n\n\
    Exit status: 0 inspected, 3 the file cannot be read.")]
pub struct InspectArgs {
    /// The recording
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The rig's asset file, whose `columns` are used for a file that has them all
    #[arg(long, value_name = "ASSET.json")]
    asset: Option<PathBuf>,
    #[command(flatten)]
    table: TableArgs,
    /// Text for people, or one JSON object
    #[arg(long, value_enum, default_value = "table")]
    format: OutputFormat,
}

pub fn run(args: &InspectArgs) -> anyhow::Result<()> {
    let failed = |e: String| InputError::file(&args.file, e);
    let file = File::open(&args.file).map_err(|e| failed(e.to_string()))?;
    let rig = judge::load_rig(args.asset.as_deref())?;
    let options = args.table.options().of_rig(rig.columns.as_deref());
    let view = inspect(file, &options).map_err(|e| failed(e.to_string()))?;
    let mut out = output::stdout();
    match args.format {
        OutputFormat::Json => {
            serde_json::to_writer(&mut out, &view)?;
            writeln!(out)?;
        }
        OutputFormat::Table => write_text(&mut out, &view, args)?,
    }
    Ok(out.flush()?)
}

fn write_text(
    out: &mut impl Write,
    view: &InspectionView,
    args: &InspectArgs,
) -> anyhow::Result<()> {
    let format = if view.layout.is_empty() { view.format.clone() } else { view.layout.join("; ") };
    writeln!(out, "{}", table::wrapped("", &format))?;
    write_columns(out, view)?;
    write_rows(out, view)?;
    write_quantities(out, view)?;
    for InspectionRemarkView { text, changes } in &view.remarks {
        writeln!(out, "{}", table::wrapped("note: ", text))?;
        for MappingChangeView { quantity, expression } in changes {
            writeln!(out, "      {quantity}={expression}")?;
        }
    }
    let has_time = view.quantities.iter().any(|q| q.quantity == "t_s" && q.expression.is_some());
    let lacks_time = !has_time && args.table.options().rate_hz.is_none();
    if view.rows == 0 {
        let example = "--columns \"t_s=#1/ms, cmd_qy_rad=#2/deg, x_m=#3*0.0001-0.2\"";
        writeln!(out, "\nSay which column is what, for example with {example},")?;
        writeln!(out, "and the rate with --rate if no column has the time.")?;
    } else if view.mapping.is_empty() && lacks_time {
        writeln!(
            out,
            "\nIts columns have the names of the quantities, but for the time: give the rate with"
        )?;
        writeln!(out, "the file, such as --rate 50.")?;
    } else if view.mapping.is_empty() {
        writeln!(out, "\nIts columns have the names of the quantities; no mapping is needed.")?;
    } else {
        let rate = args.table.options().rate_hz.map_or(String::new(), |hz| format!(" --rate {hz}"));
        writeln!(out, "\nCheck the mapping, and give it with the file:")?;
        writeln!(
            out,
            "  offbd replay{rate} --columns {} {}",
            quoted(&view.mapping),
            args.file.display()
        )?;
    }
    Ok(())
}

/// Returns an argument in quotes for a shell.
fn quoted(argument: &str) -> String {
    if argument.contains('\'') { format!("\"{argument}\"") } else { format!("'{argument}'") }
}

fn write_columns(out: &mut impl Write, view: &InspectionView) -> anyhow::Result<()> {
    if view.columns.is_empty() {
        return Ok(());
    }
    let mut columns = table::table_of_files(&["column", "name", "unit", "first values"], &[]);
    for column in &view.columns {
        columns.add_row([
            format!("#{}", column.number),
            column.name.clone().unwrap_or_default(),
            column.unit.clone().unwrap_or_default(),
            column.values.join("  "),
        ]);
    }
    writeln!(out)?;
    for line in table::lines(&columns) {
        writeln!(out, "{line}")?;
    }
    Ok(())
}

fn write_quantities(out: &mut impl Write, view: &InspectionView) -> anyhow::Result<()> {
    let heading = ["quantity", "column", "from", "to", "guessed by"];
    let mut quantities = table::table_of_files(&heading, &[2, 3]);
    let value = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.4}"));
    for InspectedQuantityView { quantity, expression, reason, from, to } in &view.quantities {
        let expression = expression.clone().unwrap_or_else(|| "-".to_owned());
        let reason = reason.clone().unwrap_or_default();
        quantities.add_row([quantity.clone(), expression, value(*from), value(*to), reason]);
    }
    writeln!(out)?;
    for line in table::lines(&quantities) {
        writeln!(out, "{line}")?;
    }
    Ok(())
}

fn write_rows(out: &mut impl Write, view: &InspectionView) -> anyhow::Result<()> {
    // Of a table without a mapping no row is read.
    if view.rows == 0 && view.rejected == 0 {
        return Ok(());
    }
    write!(out, "\n{} rows", view.rows)?;
    if let (Some(from), Some(to), 1) = (view.from_s, view.to_s, view.runs) {
        write!(out, " from {from:.2} to {to:.2} s")?;
    }
    if let Some(rate) = view.rate_hz {
        write!(out, ", {rate:.1} a second")?;
    }
    writeln!(out, ", without a ball {:.1} %", 100.0 * view.without_ball)?;
    if view.gaps > 0 {
        let gaps = if view.gaps == 1 { "gap" } else { "gaps" };
        writeln!(out, "{} {gaps}, the longest of {:.2} s", view.gaps, view.longest_gap_s)?;
    }
    if view.runs > 1 {
        writeln!(out, "{} runs, whose clock starts again: each is a session", view.runs)?;
    }
    if view.rejected > 0 {
        writeln!(out, "{} rows are rejected:", view.rejected)?;
        for rejection in &view.rejections {
            writeln!(out, "{}", table::wrapped("  ", rejection))?;
        }
    }
    Ok(())
}
