//! Which model is good enough where: errors of the smaller models against the
//! compliant one over amplitude and frequency of the plate's motion, and what
//! `choose` makes of it.

mod draw;
mod errors;
mod judge;

use serde::Serialize;

use super::{Chart, ChartError, Effort, Table};
use judge::{Cell, TOLERANCES_M, Verdict};
use offbd_core::plant::Contact;

/// The contacts compared, by their names.
const CONTACTS: [(&str, Contact); 2] =
    [("chapter's contact", Contact::CHAPTER), ("soft contact", Contact::SOFT)];

/// All cells of one contact.
struct Ground {
    name: &'static str,
    amplitudes: Vec<f64>,
    frequencies: Vec<f64>,
    /// Cell (i, j) at `j · columns + i`: amplitude i, frequency j.
    cells: Vec<Cell>,
}

/// One cell.
#[derive(Clone, Debug, Serialize)]
struct Record {
    contact: &'static str,
    amplitude_rad: f64,
    frequency_hz: f64,
    /// How far two runs of the truth differ, m.
    truth_spread_m: Option<f64>,
    /// Worst error of position by model, m; none where a model gives no number.
    errors_m: Vec<(&'static str, Option<f64>)>,
    decisions: Vec<Decision>,
}

/// What was chosen for one accuracy.
#[derive(Clone, Debug, Serialize)]
struct Decision {
    tolerance_m: f64,
    /// The cheapest model that meets it, by the errors above.
    cheapest: Option<&'static str>,
    chosen: Option<String>,
    /// Error of the chosen run against the truth, m.
    chosen_error_m: Option<f64>,
    verdict: Verdict,
    /// CPU time of the chosen run over that of the cheapest that meets it.
    cost_factor: Option<f64>,
}

/// Measures and draws.
///
/// # Errors
/// If a record is no JSON.
pub fn make(effort: Effort) -> Result<Chart, ChartError> {
    let grounds: Vec<Ground> =
        CONTACTS.iter().map(|(name, contact)| Ground::measure(name, contact, effort)).collect();
    let mut records = Vec::new();
    for record in grounds.iter().flat_map(Ground::records) {
        records.push(serde_json::to_value(record)?);
    }
    let figures = vec![("regions", draw::regions(&grounds)), ("errors", draw::errors(&grounds))];
    Ok(Chart { name: "fidelity", records, figures, table: table(&grounds), versions: Vec::new() })
}

impl Ground {
    fn measure(name: &'static str, contact: &Contact, effort: Effort) -> Self {
        let n = match effort {
            Effort::Full => (6, 5),
            Effort::Quick => (4, 3),
        };
        let spread = |low: f64, high: f64, n: usize| -> Vec<f64> {
            let share = |i: usize| i as f64 / (n - 1) as f64;
            (0..n).map(|i| low * (high / low).powf(share(i))).collect()
        };
        let (amplitudes, frequencies) = (spread(1e-3, 1.3, n.0), spread(0.1, 10.0, n.1));
        let pairs = frequencies.iter().flat_map(|&f| amplitudes.iter().map(move |&a| (a, f)));
        let cells = pairs.map(|(a, f)| Cell::measure(contact, a, f)).collect();
        Self { name, amplitudes, frequencies, cells }
    }

    fn records(&self) -> impl Iterator<Item = Record> {
        self.cells.iter().map(|cell| Record {
            contact: self.name,
            amplitude_rad: cell.amplitude,
            frequency_hz: cell.frequency,
            truth_spread_m: finite(cell.errors.truth_spread),
            errors_m: cell.errors.by_model().map(|(m, e)| (m.name(), finite(e))).collect(),
            decisions: (0..TOLERANCES_M.len()).map(|k| cell.decision(k)).collect(),
        })
    }
}

impl Cell {
    fn decision(&self, k: usize) -> Decision {
        let judged = &self.judged[k];
        Decision {
            tolerance_m: TOLERANCES_M[k],
            cheapest: judged.cheapest.map(|model| model.name()),
            chosen: judged.chosen.map(|c| format!("{} by {}", c.model(), c.method())),
            chosen_error_m: judged.error.and_then(finite),
            verdict: judged.verdict,
            cost_factor: judged.cost_factor,
        }
    }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// For each contact and accuracy: how many cells are decided how.
fn table(grounds: &[Ground]) -> Table {
    let mut rows = Vec::new();
    for ground in grounds {
        for (k, tolerance) in TOLERANCES_M.iter().enumerate() {
            let tally = judge::Tally::of(&ground.cells, k);
            let mut row = vec![ground.name.to_owned(), format!("{tolerance:.0e}")];
            row.extend([tally.judged, tally.too_cheap, tally.too_dear].map(|n| n.to_string()));
            row.extend([tally.median_factor, tally.worst_factor].map(|f| format!("{f:.1}")));
            rows.push(row);
        }
    }
    Table {
        heading: vec!["contact", "m", "cells", "too cheap", "too dear", "median factor", "worst"],
        right: vec![1, 2, 3, 4, 5, 6],
        rows,
    }
}
