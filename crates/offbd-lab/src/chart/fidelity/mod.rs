//! Fidelity of the models: errors of the simpler models against the compliant one over
//! amplitude and frequency of the plate's motion, and the choices of `choose`.

mod draw;
mod errors;
mod judge;

use serde::Serialize;

use super::{Chart, ChartError, ChartTable, Effort};
use judge::{ChoiceVerdict, MotionCell, TOLERANCES_M};
use offbd_core::plant::Contact;

/// The contacts compared, with their names.
const CONTACTS: [(&str, Contact); 2] =
    [("chapter's contact", Contact::CHAPTER), ("soft contact", Contact::SOFT)];

/// All cells of one contact, a map over amplitude and frequency.
struct ContactMap {
    name: &'static str,
    amplitudes: Vec<f64>,
    frequencies: Vec<f64>,
    /// Cell (i, j) at `j · columns + i`: amplitude i, frequency j.
    cells: Vec<MotionCell>,
}

/// The record of one cell.
#[derive(Clone, Debug, Serialize)]
struct FidelityRecord {
    contact: &'static str,
    amplitude_rad: f64,
    frequency_hz: f64,
    /// Distance between two runs of the reference solution, m.
    truth_spread_m: Option<f64>,
    /// Largest error of the position by model, m; `None` if the run failed.
    errors_m: Vec<(&'static str, Option<f64>)>,
    decisions: Vec<Decision>,
}

/// The choice for one accuracy.
#[derive(Clone, Debug, Serialize)]
struct Decision {
    tolerance_m: f64,
    /// The cheapest model that meets the tolerance, by its error.
    cheapest: Option<&'static str>,
    chosen: Option<String>,
    /// Error of the chosen run against the reference solution, m.
    chosen_error_m: Option<f64>,
    verdict: ChoiceVerdict,
    /// CPU time of the chosen run over that of the cheapest one that meets the tolerance.
    cost_factor: Option<f64>,
}

/// Measures, and returns the chart.
///
/// # Errors
/// [`ChartError::Records`] if a record cannot be written as JSON.
pub fn make(effort: Effort) -> Result<Chart, ChartError> {
    let maps: Vec<ContactMap> =
        CONTACTS.iter().map(|(name, contact)| ContactMap::measure(name, contact, effort)).collect();
    let mut records = Vec::new();
    for record in maps.iter().flat_map(ContactMap::records) {
        records.push(serde_json::to_value(record)?);
    }
    let figures = vec![("regions", draw::regions(&maps)), ("errors", draw::errors(&maps))];
    Ok(Chart { name: "fidelity", records, figures, table: table(&maps), versions: Vec::new() })
}

impl ContactMap {
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
        let cells = pairs.map(|(a, f)| MotionCell::measure(contact, a, f)).collect();
        Self { name, amplitudes, frequencies, cells }
    }

    fn records(&self) -> impl Iterator<Item = FidelityRecord> {
        self.cells.iter().map(|cell| FidelityRecord {
            contact: self.name,
            amplitude_rad: cell.amplitude,
            frequency_hz: cell.frequency,
            truth_spread_m: finite(cell.errors.truth_spread),
            errors_m: cell.errors.by_model().map(|(m, e)| (m.name(), finite(e))).collect(),
            decisions: (0..TOLERANCES_M.len()).map(|k| cell.decision(k)).collect(),
        })
    }
}

impl MotionCell {
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

/// Returns a table of the verdicts by contact and accuracy.
fn table(maps: &[ContactMap]) -> ChartTable {
    let mut rows = Vec::new();
    for map in maps {
        for (k, tolerance) in TOLERANCES_M.iter().enumerate() {
            let tally = judge::DecisionCounts::of(&map.cells, k);
            let mut row = vec![map.name.to_owned(), format!("{tolerance:.0e}")];
            row.extend([tally.judged, tally.too_cheap, tally.too_dear].map(|n| n.to_string()));
            row.extend([tally.median_factor, tally.worst_factor].map(|f| format!("{f:.1}")));
            rows.push(row);
        }
    }
    ChartTable {
        heading: vec!["contact", "m", "cells", "too cheap", "too dear", "median factor", "worst"],
        right: vec![1, 2, 3, 4, 5, 6],
        rows,
    }
}
