//! Judges one healthy session and notes what was found.

use std::collections::{BTreeMap, BTreeSet};

use super::found::Found;
use crate::wire::verdict;
use offbd_core::diagnosis::{Evidence, FaultMemory, Transition};
use offbd_core::engine::{Engine, Input, Output, Setup};
use offbd_core::vocabulary::{Axis, FaultCode, FaultStatus, Sample};

/// A gap in the log comes every so often and lasts for so long, s.
const GAP_EVERY_S: f64 = 300.0;
const GAP_S: f64 = 3.0;
/// Evidence that falls below this ends a peak, nats.
const PEAK_ENDS: f64 = 1.0;

/// One session while it is watched.
struct Watch<'a> {
    name: &'a str,
    found: Found,
    /// The worst of each code.
    seen: BTreeMap<FaultCode, FaultStatus>,
    /// Codes whose confirmed fault still fails.
    on_record: BTreeSet<FaultCode>,
    peaks: [f64; 2],
}

/// Judges the session of this name with its gaps.
pub(super) fn session(setup: &Setup, name: &str, samples: &[Sample]) -> Found {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let found = Found { n_sessions: 1, ..Found::default() };
    let (seen, on_record) = (BTreeMap::new(), BTreeSet::new());
    let mut watch = Watch { name, found, seen, on_record, peaks: [0.0; 2] };
    let mut outputs = Vec::new();
    for sample in samples.iter().filter(|s| s.t_s % GAP_EVERY_S > GAP_S) {
        engine.handle(Input::Sample(*sample), &mut outputs);
        watch.found.samples += 1;
        outputs.drain(..).for_each(|output| watch.output(&output));
        watch.evidence(engine.evidence());
    }
    watch.end()
}

impl Watch<'_> {
    fn output(&mut self, output: &Output) {
        let Output::Transition(change) = output else { return };
        if change.byte.test_failed() {
            self.failing(change);
        } else {
            self.on_record.remove(&change.code);
        }
    }

    fn failing(&mut self, change: &Transition) {
        let worst = self.seen.entry(change.code).or_insert(change.status);
        if *worst != FaultStatus::Confirmed {
            *worst = change.status;
        }
        // Told again, with its kind, it is the same.
        let confirmed = change.status == FaultStatus::Confirmed;
        if confirmed && self.on_record.insert(change.code) {
            self.alarm(change);
        }
    }

    fn alarm(&mut self, change: &Transition) {
        let kind = change.suspicion.kind.map(|kind| format!(":{kind}")).unwrap_or_default();
        let monitor = format!("{}{kind}", change.code);
        *self.found.confirmations.entry(monitor).or_default() += 1;
        let sentence = verdict::sentence(change);
        self.found.alarms.push(format!("{}: {sentence}", self.name));
    }

    /// Counts each rise of the evidence against one servo by its peak.
    fn evidence(&mut self, evidence: &Evidence) {
        let axes = &evidence.axes;
        for axis in Axis::ALL {
            let own = (axes[axis].nats - axes[axis.other()].nats).max(0.0);
            let peak = &mut self.peaks[axis as usize];
            if own < PEAK_ENDS && *peak > 0.0 {
                self.found.peak(*peak);
                *peak = 0.0;
            }
            *peak = peak.max(own);
        }
    }

    fn end(mut self) -> Found {
        for (code, status) in self.seen {
            let list = match status {
                FaultStatus::Confirmed => &mut self.found.confirmed,
                _ => &mut self.found.pending,
            };
            list.insert(code.to_string(), 1);
        }
        self.found
    }
}
