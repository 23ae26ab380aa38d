//! Judges one healthy session and counts its false alarms.

use std::collections::{BTreeMap, BTreeSet};

use super::counts::SoakCounts;
use offbd_core::diagnosis::{Evidence, FaultMemory, Transition};
use offbd_core::engine::{Engine, Input, Setup};
use offbd_core::vocabulary::{Axis, FaultCode, FaultStatus, Sample};
use offbd_wire::verdict;

/// Interval between gaps in the log, s; chosen.
const GAP_EVERY_S: f64 = 300.0;
/// Duration of a gap in the log, s; chosen.
const GAP_S: f64 = 3.0;
/// Evidence below which a peak ends, nats; chosen.
const PEAK_ENDS: f64 = 1.0;

/// The state of one session while it is judged.
struct SessionWatch<'a> {
    name: &'a str,
    found: SoakCounts,
    /// The worst status of each code.
    seen: BTreeMap<FaultCode, FaultStatus>,
    /// Codes with a confirmed fault whose test still fails.
    on_record: BTreeSet<FaultCode>,
    peaks: [f64; 2],
}

/// Judges the session `name`, with gaps in its log.
pub(super) fn session(setup: &Setup, name: &str, samples: &[Sample]) -> SoakCounts {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let found = SoakCounts { n_sessions: 1, ..SoakCounts::default() };
    let (seen, on_record) = (BTreeMap::new(), BTreeSet::new());
    let mut watch = SessionWatch { name, found, seen, on_record, peaks: [0.0; 2] };
    let mut transitions = Vec::new();
    for sample in samples.iter().filter(|s| s.t_s % GAP_EVERY_S > GAP_S) {
        engine.handle(Input::Sample(*sample), &mut transitions);
        watch.found.samples += 1;
        transitions.drain(..).for_each(|change| watch.transition(&change));
        watch.evidence(engine.evidence());
    }
    watch.end()
}

impl SessionWatch<'_> {
    fn transition(&mut self, change: &Transition) {
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
        // A fault that is reported again, with its kind, counts once.
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

    /// Counts each rise of the evidence against a servo by its peak.
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

    fn end(mut self) -> SoakCounts {
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
