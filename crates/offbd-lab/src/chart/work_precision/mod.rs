//! Speed against accuracy: every model by every method at every pace, on six
//! scenes, with the automatic choice and, if given, other people's engines.
//!
//! The error is the worst distance in the plate's plane from the compliant
//! model, solved far more finely. The cost is the CPU time of a run that takes
//! no samples, the minimum over repeats. `benches/peers` writes the same
//! records for other engines; run both on one machine, one after the other.

mod measure;
mod record;
mod show;

use measure::{ASKED_M, Bench};
pub use record::{Peers, Record, read};

use crate::scene::{Laws, Scene};

use super::{Chart, ChartError, Effort, front};

/// A scene with its drive, under the name that records have.
#[derive(Clone, Debug)]
pub struct Charted {
    pub name: String,
    pub scene: Scene,
    pub laws: Laws,
}

/// Measures `scenes` (the first alone where the effort is quick) and draws
/// them, with the records and versions of `peers` beside ours.
///
/// # Errors
/// [`ChartError`] if a record cannot be made.
pub fn make(effort: Effort, scenes: Vec<Charted>, peers: &Peers) -> Result<Chart, ChartError> {
    let quick = effort == Effort::Quick;
    let repeats = if quick { 1 } else { 5 };
    let mut ours = Vec::new();
    let most = if quick { 1 } else { usize::MAX };
    for charted in scenes.into_iter().take(most) {
        let bench = Bench::new(charted, repeats);
        let all = measure::configurations(quick);
        let mut records: Vec<Record> = all.iter().map(|c| bench.record(c)).collect();
        mark_front(&mut records);
        records.extend(ASKED_M.iter().filter_map(|&asked| bench.chosen(asked)));
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

fn mark_front(records: &mut [Record]) {
    let points: Vec<(f64, f64)> =
        records.iter().map(|r| r.point().unwrap_or((f64::NAN, f64::NAN))).collect();
    for on in front(&points) {
        records[on.index].front = true;
    }
}
