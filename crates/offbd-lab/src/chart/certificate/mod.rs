//! What calibrations promise against what comes: false alarms and delays.
//!
//! Rigs as they are seen in the world, no two alike, are learnt from three
//! healthy sessions of two minutes each. What each calibration promises is kept;
//! then the rig is watched for hours while it is healthy, with hands and gusts,
//! and every fault of which a delay was promised is put into sessions of it.

mod measure;
mod show;

use rayon::prelude::*;

use super::{Chart, ChartError, Effort};

/// Rigs that are drawn, hours for which each is watched, and sessions that each
/// fault is put into.
struct Plan {
    n_rigs: u64,
    healthy_h: u64,
    n_faulty: u64,
}

impl Plan {
    const fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { n_rigs: 80, healthy_h: 4, n_faulty: 8 },
            Effort::Quick => Self { n_rigs: 3, healthy_h: 1, n_faulty: 1 },
        }
    }
}

/// Seeds of the rigs: others than those that the promises were made by.
const FIRST_SEED: u64 = 91_000_000;

/// Measures and draws.
///
/// # Errors
/// [`ChartError`] if a rig cannot be simulated, or a record is no JSON.
pub fn make(effort: Effort) -> Result<Chart, ChartError> {
    let plan = Plan::of(effort);
    let rigs = (0..plan.n_rigs).into_par_iter();
    let measured = rigs
        .map(|n| measure::rig(&plan, FIRST_SEED + n))
        .collect::<Result<Vec<_>, ChartError>>()?;
    Ok(Chart {
        name: "certificate",
        records: measured.iter().map(serde_json::to_value).collect::<Result<_, _>>()?,
        figures: vec![("promises", show::figure(&measured))],
        table: show::table(&measured),
        versions: Vec::new(),
    })
}
