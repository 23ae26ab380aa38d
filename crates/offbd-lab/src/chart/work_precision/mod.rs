//! Work–precision diagrams: speed against accuracy of every model by every method at
//! several paces, on six scenes, with runs in one pass and, if given, other engines.
//!
//! The error is the largest distance in the plate's plane from the reference solution, the
//! compliant model at a fine tolerance. The cost is the CPU time of a run without samples,
//! the minimum over repeated measurements. `benches/peers` writes the same records for
//! other engines; run both on the same machine, one after the other.

mod measure;
mod record;
mod show;

use measure::{ASKED_M, SceneBenchmark};
pub use record::{Peers, WorkPrecisionRecord, read};

use crate::scene::{Laws, Scene};

use super::{Chart, ChartError, Effort, front};

/// A scene with its drive, and its name in the records.
#[derive(Clone, Debug)]
pub struct ChartedScene {
    pub name: String,
    pub scene: Scene,
    pub laws: Laws,
}

/// Measures `scenes` (only the first with [`Effort::Quick`]), and returns the chart,
/// together with the records and versions of `peers`.
///
/// # Errors
/// [`ChartError::Records`] if a record cannot be written as JSON.
pub fn make(effort: Effort, scenes: Vec<ChartedScene>, peers: &Peers) -> Result<Chart, ChartError> {
    let quick = effort == Effort::Quick;
    let repeats = if quick { 1 } else { 5 };
    let mut ours = Vec::new();
    let most = if quick { 1 } else { usize::MAX };
    for charted in scenes.into_iter().take(most) {
        let benchmark = SceneBenchmark::new(charted, repeats);
        let all = measure::configurations(quick);
        let mut records: Vec<WorkPrecisionRecord> =
            all.iter().map(|c| benchmark.record(c)).collect();
        mark_front(&mut records);
        records.extend(ASKED_M.iter().filter_map(|&asked| benchmark.in_one_pass(asked)));
        ours.append(&mut records);
    }
    let figures = show::figures(&ours, &peers.records);
    let table = show::table(&ours);
    let records = ours.iter().chain(&peers.records).map(serde_json::to_value);
    Ok(Chart {
        name: "work-precision",
        records: records.collect::<Result<_, _>>()?,
        figures,
        table,
        versions: peers.versions.clone(),
    })
}

fn mark_front(records: &mut [WorkPrecisionRecord]) {
    let points: Vec<(f64, f64)> =
        records.iter().map(|r| r.point().unwrap_or((f64::NAN, f64::NAN))).collect();
    for on in front(&points) {
        records[on.index].front = true;
    }
}
