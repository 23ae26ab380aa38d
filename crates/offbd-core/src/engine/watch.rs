//! One monitor over time: debounce, onset, and what it tells the memory.

use super::Output;
use crate::diagnosis::{
    Answer, Candidate, Debounce, Evidence, FaultMemory, Finding, Pace, Qualified, Settings,
    Suspicion, Test, Transition,
};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{FaultCode, FaultKind, SimTime};

/// The watch over one code.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    debounce: Debounce,
    /// Evidence by weight, as a share of what makes the test fail.
    weight: f64,
    test: Test,
    /// Seconds of this session in which it could judge.
    judged_s: f64,
    /// When the run of failures began.
    since: Option<SimTime>,
    kind: Option<FaultKind>,
    rival: Option<Candidate>,
    /// Most evidence by weight so far, nats.
    most_nats: f64,
    /// The nearest that failures came to a trip by their time, 0 to 1.
    nearest: f64,
}

impl Watch {
    pub(super) fn counter(&self) -> i8 {
        // In range by construction.
        let weighed = (127.0 * self.weight.clamp(0.0, 1.0)) as i8;
        if self.weight > 0.0 {
            self.debounce.counter().max(weighed)
        } else {
            self.debounce.counter()
        }
    }

    pub(super) const fn most_nats(&self) -> f64 {
        self.most_nats
    }

    pub(super) const fn nearest(&self) -> f64 {
        self.nearest
    }

    pub(super) const fn test(&self) -> Test {
        self.test
    }

    pub(super) const fn judged_s(&self) -> f64 {
        self.judged_s
    }

    /// Takes what the monitor says of the last `dt` seconds. A servo fails by
    /// time, as every monitor does, or by the weight of evidence, which has
    /// been `rising` since a moment; a pass needs both.
    pub(super) fn update(
        &mut self,
        code: FaultCode,
        finding: &Finding,
        at: SimTime,
        dt: f64,
        settings: &Settings,
        rising: Option<SimTime>,
    ) -> Qualified {
        self.test = finding.test;
        if finding.test != Test::NotTested {
            self.judged_s += dt;
        }
        let test = match finding.gone && self.debounce.failed() {
            true => Test::Prefailed,
            false => finding.test,
        };
        let pace = Pace::of(code, finding.kind, finding.rival.is_some(), settings);
        let timed = self.debounce.update(test, dt, &pace);
        self.nearest = self.nearest.max(self.debounce.progress(&pace));
        let gathered_s = rising.map_or(0.0, |since| at - since);
        let weighed = match gathered_s >= settings.gather_s {
            true => self.weigh(finding, settings),
            false => Qualified::No,
        };
        if timed.max(weighed) >= Qualified::Failed || finding.test == Test::Prefailed {
            // The deviation shows in the filter half a window after it began.
            let filtered = at + -settings.window_s / 2.0;
            self.since = self.since.or(rising).or(Some(filtered));
            self.kind = finding.kind.or(self.kind);
            self.rival = finding.rival;
        } else if !self.suspicious() {
            (self.since, self.kind, self.rival) = (None, None, None);
        }
        match timed.max(weighed) {
            Qualified::Passed if self.weight > 0.5 => Qualified::No,
            qualified => qualified,
        }
    }

    /// Evidence that does not grow any more because the ball has left the plate
    /// counts for as much as it will ever do.
    fn weigh(&mut self, finding: &Finding, settings: &Settings) -> Qualified {
        let Some(nats) = finding.nats else {
            let failed = finding.gone && self.weight >= 1.0;
            return if failed { Qualified::Tripped } else { Qualified::No };
        };
        self.most_nats = self.most_nats.max(nats);
        self.weight = nats / settings.suspect_nats;
        match nats {
            n if n >= settings.confirm_nats => Qualified::Tripped,
            n if n >= settings.suspect_nats && finding.gone => Qualified::Tripped,
            n if n >= settings.suspect_nats => Qualified::Failed,
            _ => Qualified::No,
        }
    }

    fn suspicious(&self) -> bool {
        self.debounce.suspicious() || self.weight > 0.5
    }

    /// Another cause accounts for what was seen: the suspicion is taken back.
    pub(super) fn exonerate(&mut self) {
        self.debounce.exonerate();
        self.weight = 0.0;
        (self.since, self.kind, self.rival) = (None, None, None);
    }

    /// Tells the memory, and the world where the status byte says so.
    pub(super) fn apply(
        &self,
        code: FaultCode,
        qualified: Qualified,
        settings: &Settings,
        evidence: &Evidence,
        memory: &mut FaultMemory,
        outputs: &mut Vec<Output>,
    ) {
        let record = memory.record(code);
        let failing = record.status.test_failed();
        // One that goes on from the session before is told in this one too.
        let failed = failing && record.status.failed_this_cycle();
        match qualified {
            Qualified::No => {}
            Qualified::Passed => {
                if memory.passed(code) && failing {
                    self.announce(code, evidence, memory, outputs);
                }
            }
            Qualified::Failed if failed => self.name(code, evidence, memory, outputs),
            Qualified::Failed => self.fail(code, evidence, memory, outputs),
            Qualified::Tripped if failed && record.tripped_this_cycle => {
                self.name(code, evidence, memory, outputs);
            }
            Qualified::Tripped => {
                if !failed {
                    self.fail(code, evidence, memory, outputs);
                }
                if memory.trip(code, &self.suspicion(code, evidence), &settings.memory) {
                    self.announce(code, evidence, memory, outputs);
                }
            }
        }
    }

    fn fail(
        &self,
        code: FaultCode,
        evidence: &Evidence,
        memory: &mut FaultMemory,
        outputs: &mut Vec<Output>,
    ) {
        if memory.failed(code, &self.suspicion(code, evidence), evidence) {
            self.announce(code, evidence, memory, outputs);
        }
    }

    /// Tells the kind of a fault that was confirmed before it showed.
    fn name(
        &self,
        code: FaultCode,
        evidence: &Evidence,
        memory: &mut FaultMemory,
        outputs: &mut Vec<Output>,
    ) {
        let unnamed = self.kind.is_some() && memory.record(code).kind().is_none();
        if unnamed && memory.name(code, &self.suspicion(code, evidence)) {
            self.announce(code, evidence, memory, outputs);
        }
    }

    /// What is suspected now.
    fn suspicion(&self, code: FaultCode, evidence: &Evidence) -> Suspicion {
        let candidates = match (self.rival, code.axis()) {
            (Some(rival), _) => {
                let own = Candidate { code, kind: self.kind, weight: 1.0 - rival.weight };
                let own_first = own.weight >= rival.weight;
                if own_first { vec![own, rival] } else { vec![rival, own] }
            }
            (None, Some(axis)) => kinds(code, evidence.axes[axis].answer),
            (None, None) => Vec::new(),
        };
        Suspicion { onset: self.since, kind: self.kind, candidates }
    }

    fn announce(
        &self,
        code: FaultCode,
        evidence: &Evidence,
        memory: &FaultMemory,
        outputs: &mut Vec<Output>,
    ) {
        let Some(at) = evidence.at else { return };
        outputs.push(transition(code, at, evidence, memory));
    }
}

/// Likelihood below which a kind is not worth a candidate.
const LEAST_LIKELIHOOD: f64 = 0.05;

/// The kinds of fault that a servo's answer leaves open, the likeliest first;
/// none where only one is left.
fn kinds(code: FaultCode, answer: Option<Answer>) -> Vec<Candidate> {
    let Some(answer) = answer else { return Vec::new() };
    let mut found: Vec<Candidate> = answer
        .kinds()
        .filter(|&(_, weight)| weight >= LEAST_LIKELIHOOD)
        .map(|(kind, weight)| Candidate { code, kind: Some(kind), weight })
        .collect();
    if found.len() < 2 {
        return Vec::new();
    }
    let sum: f64 = found.iter().map(|c| c.weight).sum();
    for candidate in &mut found {
        candidate.weight /= sum;
    }
    found.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    found
}

/// The transition that `memory` now shows for `code`.
pub(super) fn transition(
    code: FaultCode,
    at: SimTime,
    evidence: &Evidence,
    memory: &FaultMemory,
) -> Output {
    let record = memory.record(code);
    Output::Transition(Box::new(Transition {
        at,
        code,
        status: record.word(),
        byte: record.status,
        suspicion: record.suspicion.clone().unwrap_or_default(),
        evidence: evidence.clone(),
    }))
}
