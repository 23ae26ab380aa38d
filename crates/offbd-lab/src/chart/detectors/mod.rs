//! Detectors of servo faults: delay against false alarms, and what each finds.
//!
//! Simulated rigs are learnt from a healthy session each; then healthy ones with
//! hands and gusts tell how often a method cries wolf, and one for each fault
//! and size how soon it cries rightly. Every session is simulated once and goes
//! once through an engine of each profile; all thresholds of all methods are
//! swept over the evidence that the engines left.

mod bench;
mod cost;
mod faults;
mod method;
mod record;
mod show;
mod tally;
mod trace;

use rayon::prelude::*;

use super::{Chart, ChartError, Effort};
use crate::simulation::{Preset, Reference};
use bench::{Bench, Session};
use tally::Tally;

pub use record::Record;

/// What is measured.
struct Plan {
    references: &'static [Reference],
    /// Healthy sessions of each rig and reference, and their length, s.
    n_healthy: u64,
    healthy_s: f64,
    /// Sessions of each rig, reference and fault.
    n_faulty: u64,
    faults: &'static [&'static str],
    /// Thresholds of each method.
    n: usize,
    repeats: usize,
}

impl Plan {
    const fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self {
                references: &Reference::ALL,
                n_healthy: 12,
                healthy_s: 600.0,
                n_faulty: 2,
                faults: &faults::ALL,
                n: 28,
                repeats: 9,
            },
            Effort::Quick => Self {
                references: &[Reference::Lissajous],
                n_healthy: 1,
                healthy_s: 120.0,
                n_faulty: 1,
                faults: &faults::FEW,
                n: 8,
                repeats: 1,
            },
        }
    }

    /// All sessions, each with its own seed.
    fn sessions(&self) -> Vec<Session> {
        let mut all = Vec::new();
        for preset in Preset::ALL {
            for &reference in self.references {
                for _ in 0..self.n_healthy {
                    let seed = all.len() as u64;
                    all.push(Session::healthy(preset, reference, self.healthy_s, seed));
                }
                for fault in self.faults {
                    for _ in 0..self.n_faulty {
                        let seed = all.len() as u64;
                        all.push(Session::faulty(preset, reference, fault, seed));
                    }
                }
            }
        }
        all
    }
}

/// Measures and draws.
///
/// # Errors
/// [`ChartError`] if a rig cannot be simulated or learnt, or a record is no
/// JSON.
pub fn make(effort: Effort) -> Result<Chart, ChartError> {
    let plan = Plan::of(effort);
    let benches = Preset::ALL.into_iter().map(Bench::new).collect::<Result<Vec<_>, _>>()?;
    let detectors = method::all(plan.n);
    let run = |session: &Session| {
        let bench = &benches[session.preset as usize];
        Ok(Tally::of(&detectors, &bench.run(session)?, &bench.healthy_m_s2))
    };
    let tallies: Vec<Tally> =
        plan.sessions().par_iter().map(run).collect::<Result<_, ChartError>>()?;
    let costs = cost::measure(&benches[0], plan.repeats)?;
    let found = record::gather(&detectors, &tallies, plan.faults, costs);
    Ok(Chart {
        name: "detectors",
        records: found.iter().map(serde_json::to_value).collect::<Result<_, _>>()?,
        figures: show::figures(&found),
        table: show::table(&found),
        versions: Vec::new(),
    })
}
