//! Stability of each method on the compliant model: the step size against slip threshold,
//! stiffness and damping, judged by slip and energy, with the limits that the eigenvalues
//! predict.

mod draw;
mod map;
mod measure;

use serde::Serialize;

use super::{Chart, ChartError, ChartTable, Effort};
use crate::scene::Method;
use map::{StabilityMap, Sweep};
use measure::Fate;

/// The methods compared: explicit ones first, then those that are stable at any step in
/// theory.
const METHODS: [Method; 7] = [
    Method::Euler,
    Method::SemiImplicitEuler,
    Method::Midpoint,
    Method::Rk4,
    Method::Rodas3,
    Method::Rodas4,
    Method::ContactStep,
];

/// The record of one run of one method at one step size.
#[derive(Clone, Debug, Serialize)]
struct StabilityRecord {
    sweep: &'static str,
    method: &'static str,
    stiffness_n_per_m: f64,
    damping_n_s_per_m: f64,
    slip_threshold_m_s: f64,
    step_s: f64,
    fate: Fate,
    /// Final distance of the slip from the creep that friction needs, in units of v_thr;
    /// `None` if the state is not finite any more.
    slip_off: Option<f64>,
}

/// The record of the largest stable step for one value of the swept parameter.
#[derive(Clone, Debug, Serialize)]
struct StabilityLimitRecord {
    sweep: &'static str,
    method: &'static str,
    swept: f64,
    predicted_s: f64,
    measured_s: f64,
}

/// Measures, and returns the chart.
///
/// # Errors
/// [`ChartError::Records`] if a record cannot be written as JSON.
pub fn make(effort: Effort) -> Result<Chart, ChartError> {
    let maps: Vec<Vec<StabilityMap>> = Sweep::ALL
        .iter()
        .map(|&sweep| {
            METHODS.iter().map(|&method| StabilityMap::measure(sweep, method, effort)).collect()
        })
        .collect();
    let mut records = Vec::new();
    for map in maps.iter().flatten() {
        for record in map.records() {
            records.push(serde_json::to_value(record)?);
        }
        for record in map.limit_records() {
            records.push(serde_json::to_value(record)?);
        }
    }
    let figures = maps.iter().map(|maps| (maps[0].sweep.word(), draw::figure(maps))).collect();
    Ok(Chart { name: "stability", records, figures, table: table(&maps), versions: Vec::new() })
}

/// Returns a table of the differences of measured and predicted limits, and of the fates.
fn table(maps: &[Vec<StabilityMap>]) -> ChartTable {
    let rows = maps.iter().flatten().map(|map| {
        let count = |fate| map.count(fate).to_string();
        let mut row = vec![map.sweep.word().to_owned(), map.method.name().to_owned()];
        row.push(
            map.worst_off().map_or_else(|| "-".to_owned(), |off| format!("{:.1}", 100.0 * off)),
        );
        row.extend([Fate::Stable, Fate::Touchdown, Fate::Chatter, Fate::BlownUp].map(count));
        row
    });
    ChartTable {
        heading: vec!["sweep", "method", "off by %", "stable", "touchdown", "chatter", "blown up"],
        right: vec![2, 3, 4, 5, 6],
        rows: rows.collect(),
    }
}
