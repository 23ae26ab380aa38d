//! Detectors of servo faults: detection delay against false alarms, and the detected
//! share of each fault.
//!
//! Simulated rigs are calibrated on a healthy session each. Further healthy sessions, with
//! pushes and gusts, give the rate of false alarms of each method; sessions with each fault
//! and size give its delay. Every session is simulated once and processed once by an
//! engine of each profile; all thresholds of all methods are then applied to the evidence
//! that the engines recorded.

mod calibrated_rig;
mod cost;
mod faults;
mod method;
mod record;
mod session_result;
mod show;
mod trace;

use rayon::prelude::*;

use super::{Chart, ChartError, Effort};
use crate::simulation::{Preset, Reference};
use calibrated_rig::{CalibratedRig, Session};
use session_result::SessionResult;

pub use record::DetectorRecord;

/// The extent of the measurement.
struct DetectorPlan {
    references: &'static [Reference],
    /// Number of healthy sessions of each rig and reference.
    n_healthy: u64,
    /// Duration of a healthy session, s.
    healthy_s: f64,
    /// Number of sessions of each rig, reference and fault.
    n_faulty: u64,
    faults: &'static [&'static str],
    /// Number of thresholds of each method.
    n: usize,
    /// Number of timed measurements.
    repeats: usize,
}

impl DetectorPlan {
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

    /// Returns all sessions, each with its own seed.
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

/// Measures, and returns the chart.
///
/// # Errors
/// [`ChartError`] if a rig cannot be simulated or calibrated, or a record cannot be
/// written as JSON.
pub fn make(effort: Effort) -> Result<Chart, ChartError> {
    let plan = DetectorPlan::of(effort);
    let rigs = Preset::ALL.into_iter().map(CalibratedRig::new).collect::<Result<Vec<_>, _>>()?;
    let detectors = method::all(plan.n);
    let run = |session: &Session| {
        let rig = &rigs[session.preset as usize];
        Ok(SessionResult::of(&detectors, &rig.run(session)?, &rig.healthy_m_s2))
    };
    let tallies: Vec<SessionResult> =
        plan.sessions().par_iter().map(run).collect::<Result<_, ChartError>>()?;
    let costs = cost::measure(&rigs[0], plan.repeats)?;
    let found = record::gather(&detectors, &tallies, plan.faults, costs);
    Ok(Chart {
        name: "detectors",
        records: found.iter().map(serde_json::to_value).collect::<Result<_, _>>()?,
        figures: show::figures(&found),
        table: show::table(&found),
        versions: Vec::new(),
    })
}
