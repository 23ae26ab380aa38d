//! The output of a soak: tables, or a JSON object.

use std::collections::BTreeMap;
use std::io::Write;

use serde::Serialize;

use super::counts::{ByName, PEAKS, SoakCounts};
use offbd_terminal::output::{self, OutputFormat};
use offbd_terminal::table;

/// A soak as one JSON object.
#[derive(Debug, Serialize)]
struct SoakReport<'a> {
    rig_days: f64,
    samples: u64,
    rigs: u64,
    rigs_with_an_alarm: u64,
    refused: usize,
    refusals: &'a [String],
    confirmations: &'a ByName,
    alarms_per_rig_day: BTreeMap<&'a str, Option<f64>>,
    confirmed: &'a ByName,
    pending: &'a ByName,
    peaks: Vec<(f64, u64)>,
    alarms: &'a [String],
}

pub(super) fn write(format: OutputFormat, found: &SoakCounts) -> anyhow::Result<()> {
    let mut out = output::stdout();
    match format {
        OutputFormat::Json => {
            serde_json::to_writer(&mut out, &SoakReport::of(found))?;
            writeln!(out)?;
        }
        OutputFormat::Table => write_tables(&mut out, found)?,
    }
    Ok(out.flush()?)
}

impl<'a> SoakReport<'a> {
    fn of(found: &'a SoakCounts) -> Self {
        let rate = |(name, n): (&'a String, &u64)| (name.as_str(), found.per_rig_day(*n));
        Self {
            rig_days: found.rig_days(),
            samples: found.samples,
            rigs: found.n_rigs,
            rigs_with_an_alarm: found.n_rigs_alarmed,
            refused: found.refusals.len(),
            refusals: &found.refusals,
            confirmations: &found.confirmations,
            alarms_per_rig_day: found.confirmations.iter().map(rate).collect(),
            confirmed: &found.confirmed,
            pending: &found.pending,
            peaks: PEAKS.into_iter().zip(found.peaks).collect(),
            alarms: &found.alarms,
        }
    }
}

fn write_tables(out: &mut impl Write, found: &SoakCounts) -> anyhow::Result<()> {
    let parts = [figures(found), monitors(found), peaks(found)];
    for (i, part) in parts.iter().flatten().enumerate() {
        if i > 0 {
            writeln!(out)?;
        }
        for line in table::lines(part) {
            writeln!(out, "{line}")?;
        }
    }
    Ok(())
}

fn figures(found: &SoakCounts) -> Option<comfy_table::Table> {
    let mut figures = table::table(&["figure", "value"], &[1]);
    let mut row = |name: &str, value: String| {
        figures.add_row([name.to_owned(), value]);
    };
    row("healthy operation", format!("{:.2} rig-days", found.rig_days()));
    row("samples", found.samples.to_string());
    row("rigs watched", found.n_rigs.to_string());
    row("calibrations refused", found.refusals.len().to_string());
    row("false alarms", found.alarms.len().to_string());
    row("rigs with one", found.n_rigs_alarmed.to_string());
    row("sessions with one", listed(&found.confirmed));
    row("false alarms per rig-year", per_year(found));
    row("sessions with suspicions only", listed(&found.pending));
    Some(figures)
}

/// Returns a table of the false alarms by monitor; `None` if there are none.
fn monitors(found: &SoakCounts) -> Option<comfy_table::Table> {
    let mut monitors = table::table(&["false alarms of", "number", "per rig-day"], &[1, 2]);
    for (name, n) in &found.confirmations {
        monitors.add_row([name.clone(), n.to_string(), rate(found.per_rig_day(*n))]);
    }
    (!found.confirmations.is_empty()).then_some(monitors)
}

fn peaks(found: &SoakCounts) -> Option<comfy_table::Table> {
    let mut peaks = table::table(&["evidence against a servo beyond", "per rig-day"], &[1]);
    for (level, n) in PEAKS.into_iter().zip(found.peaks) {
        peaks.add_row([format!("{level:.0} nats"), rate(found.per_rig_day(n))]);
    }
    Some(peaks)
}

fn listed(sessions: &ByName) -> String {
    let words: Vec<String> = sessions.iter().map(|(name, n)| format!("{name} {n}")).collect();
    if words.is_empty() { "none".to_owned() } else { words.join(", ") }
}

fn rate(per_rig_day: Option<f64>) -> String {
    per_rig_day.map_or("-".to_owned(), |rate| format!("{rate:.2}"))
}

fn per_year(found: &SoakCounts) -> String {
    const DAYS_PER_YEAR: f64 = 365.25;
    let n = found.alarms.len() as u64;
    match found.per_rig_day(n) {
        None => "-".to_owned(),
        // The rule of three: with 95 % confidence the rate is below 3/T.
        Some(_) if n == 0 => format!("below {:.0}", 3.0 * DAYS_PER_YEAR / found.rig_days()),
        Some(rate) => format!("{:.0}", rate * DAYS_PER_YEAR),
    }
}
