//! Where each method fails on the compliant model: the step against the slip
//! threshold, the stiffness and the damping, measured by slip and energy, with
//! the limits that the eigenvalues predict.

mod draw;
mod map;
mod measure;
mod theory;

use serde::Serialize;

use super::{Chart, ChartError, Effort, Table};
use crate::scene::Method;
use map::{Map, Sweep};
use measure::Fate;

/// Explicit methods first, then those that should take any step.
const METHODS: [Method; 7] = [
    Method::Euler,
    Method::SemiImplicitEuler,
    Method::Midpoint,
    Method::Rk4,
    Method::Rodas3,
    Method::Rodas4,
    Method::ContactStep,
];

/// One run of one method at one step.
#[derive(Clone, Debug, Serialize)]
struct Record {
    sweep: &'static str,
    method: &'static str,
    stiffness_n_per_m: f64,
    damping_n_s_per_m: f64,
    slip_threshold_m_s: f64,
    step_s: f64,
    fate: Fate,
    /// Slip beside the creep that friction needs, over v_thr; none where the
    /// state is no number any more.
    slip_off: Option<f64>,
}

/// One column of one map: its largest stable step.
#[derive(Clone, Debug, Serialize)]
struct LimitRecord {
    sweep: &'static str,
    method: &'static str,
    swept: f64,
    predicted_s: f64,
    measured_s: f64,
}

/// Measures and draws.
///
/// # Errors
/// If a record is no JSON.
pub fn make(effort: Effort) -> Result<Chart, ChartError> {
    let maps: Vec<Vec<Map>> = Sweep::ALL
        .iter()
        .map(|&sweep| METHODS.iter().map(|&method| Map::measure(sweep, method, effort)).collect())
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

/// For each map: how far measured and predicted limits differ.
fn table(maps: &[Vec<Map>]) -> Table {
    let rows = maps.iter().flatten().map(|map| {
        let count = |fate| map.count(fate).to_string();
        let mut row = vec![map.sweep.word().to_owned(), map.method.name().to_owned()];
        row.push(
            map.worst_off().map_or_else(|| "-".to_owned(), |off| format!("{:.1}", 100.0 * off)),
        );
        row.extend([Fate::Stable, Fate::Touchdown, Fate::Chatter, Fate::BlownUp].map(count));
        row
    });
    Table {
        heading: vec!["sweep", "method", "off by %", "stable", "touchdown", "chatter", "blown up"],
        right: vec![2, 3, 4, 5, 6],
        rows: rows.collect(),
    }
}
