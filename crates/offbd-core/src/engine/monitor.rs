//! One monitor over time: debounce, onset, and updates of the fault memory.

use crate::diagnosis::{
    Candidate, Debounce, DebounceTimes, Evidence, FaultMemory, Finding, Qualified, Rival,
    RivalPart, ServoAnswer, Settings, Suspicion, Test, Transition,
};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{FaultCode, FaultKind, SimTime};
use serde::{Deserialize, Serialize};

/// Evidence from which on the monitor is suspicious, as a fraction of what makes the test
/// fail. Chosen.
const SUSPICIOUS_WEIGHT: f64 = 0.5;

/// Longer than any monitor needs to find a fault, s: the longest debounce has 60 s.
const LONG_S: f32 = 1000.0;

/// The state of the monitor of one code.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Monitor {
    debounce: Debounce,
    /// Evidence as a fraction of what makes the test fail.
    weight: f64,
    test: Test,
    /// Time of this session for which it could judge, s.
    judged_s: f64,
    /// That time since a fault of another monitor was last confirmed, less the time for which that fault
    /// went on and this monitor could not judge, s, in [0, [`LONG_S`]].
    judged_since_s: f32,
    /// Onset of the present failure.
    since: Option<SimTime>,
    kind: Option<FaultKind>,
    rival: Option<Rival>,
    /// Largest evidence so far, nats.
    most_nats: f64,
    /// Closest approach to a trip by duration of failure, 0 to 1.
    nearest: f64,
}

impl Monitor {
    pub(super) fn counter(&self) -> i8 {
        // In range by construction.
        let weighed = (127.0 * self.weight.clamp(0.0, 1.0)) as i8;
        if self.weight > 0.0 {
            self.debounce.counter().max(weighed)
        } else {
            self.debounce.counter()
        }
    }

    /// Evidence as a fraction of what makes the test fail.
    pub(super) const fn weight(&self) -> f64 {
        self.weight
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

    pub(super) fn judged_since_s(&self) -> f64 {
        self.judged_since_s.into()
    }

    /// Notes that a fault of another monitor is confirmed: from now on this one may not be able to
    /// judge.
    pub(super) const fn another_confirmed(&mut self) {
        self.judged_since_s = 0.0;
    }

    /// Notes that it could not judge for `dt` seconds in which a fault of another monitor went on.
    pub(super) fn could_not_judge(&mut self, dt: f64) {
        self.judged_since_s = (self.judged_since_s - dt as f32).max(0.0);
    }

    /// Takes the finding for the last `dt` seconds. A servo fails by duration of failure,
    /// like every monitor, or by evidence, which has been `rising` since a time; it
    /// passes only if neither is suspicious.
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
            self.judged_since_s = (self.judged_since_s + dt as f32).min(LONG_S);
        }
        let test = match finding.gone && self.debounce.failed() {
            true => Test::Prefailed,
            false => finding.test,
        };
        // No motion of the plate tells a ball that stands from both servos: no use waiting for it.
        let may_decide = finding.rival.is_some_and(|rival| rival.part != RivalPart::BothServos);
        let times = DebounceTimes::of(code, finding.kind, may_decide, settings);
        let timed = self.debounce.update(test, dt, &times);
        self.nearest = self.nearest.max(self.debounce.progress(&times));
        let gathered_s = rising.map_or(0.0, |since| at - since);
        let weighed = match gathered_s >= settings.gather_s {
            true => self.weigh(finding, settings),
            false => Qualified::No,
        };
        if timed.max(weighed) >= Qualified::Failed || finding.test == Test::Prefailed {
            // A deviation shows in the filter half a window after its onset.
            let filtered = at + -settings.window_s / 2.0;
            self.since = self.since.or(rising).or(Some(filtered));
            self.kind = finding.kind.or(self.kind);
            self.rival = finding.rival;
        } else if !self.suspicious() {
            (self.since, self.kind, self.rival) = (None, None, None);
        }
        match timed.max(weighed) {
            Qualified::Passed if self.weight > SUSPICIOUS_WEIGHT => Qualified::No,
            qualified => qualified,
        }
    }

    /// Evaluates the evidence. If the ball has left the plate no more can follow, and
    /// what suspects the servo confirms its fault.
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

    /// Whether much speaks for a fault at present.
    pub(super) fn suspicious(&self) -> bool {
        self.debounce.suspicious() || self.weight > SUSPICIOUS_WEIGHT
    }

    /// Withdraws the suspicion: another cause explains the readings.
    pub(super) fn exonerate(&mut self) {
        self.debounce.exonerate();
        self.weight = 0.0;
        (self.since, self.kind, self.rival) = (None, None, None);
    }

    /// Updates the fault memory, and emits a transition if the status byte changed.
    pub(super) fn apply(
        &self,
        code: FaultCode,
        qualified: Qualified,
        settings: &Settings,
        evidence: &Evidence,
        memory: &mut FaultMemory,
        transitions: &mut Vec<Transition>,
    ) {
        let record = memory.record(code);
        let failing = record.status.test_failed();
        // A failure that continues from the last session is reported in this one, too.
        let failed = failing && record.status.failed_this_cycle();
        match qualified {
            Qualified::No => {}
            Qualified::Passed => {
                if memory.passed(code) && failing {
                    self.announce(code, evidence, memory, transitions);
                }
            }
            Qualified::Failed if failed => self.name(code, evidence, memory, transitions),
            Qualified::Failed => self.fail(code, evidence, memory, transitions),
            Qualified::Tripped if failed && record.tripped_this_cycle => {
                self.name(code, evidence, memory, transitions);
            }
            Qualified::Tripped => {
                if !failed {
                    self.fail(code, evidence, memory, transitions);
                }
                if memory.trip(code, &self.suspicion(code, evidence), &settings.memory) {
                    self.announce(code, evidence, memory, transitions);
                }
            }
        }
    }

    fn fail(
        &self,
        code: FaultCode,
        evidence: &Evidence,
        memory: &mut FaultMemory,
        transitions: &mut Vec<Transition>,
    ) {
        if memory.failed(code, &self.suspicion(code, evidence), evidence) {
            self.announce(code, evidence, memory, transitions);
        }
    }

    /// Reports the kind of a confirmed fault that goes on, if it is another one, or sure now.
    fn name(
        &self,
        code: FaultCode,
        evidence: &Evidence,
        memory: &mut FaultMemory,
        transitions: &mut Vec<Transition>,
    ) {
        // What told the kind of a servo's fault before may tell none now.
        let shows = |axis| evidence.axes[axis].answer.and_then(|answer| answer.kind()) == self.kind;
        if !memory.goes_on(code) || !code.axis().is_none_or(shows) {
            return;
        }
        if memory.revise(code, &self.suspicion(code, evidence)) {
            self.announce(code, evidence, memory, transitions);
        }
    }

    /// The present suspicion.
    fn suspicion(&self, code: FaultCode, evidence: &Evidence) -> Suspicion {
        let candidates = match (self.rival, code.axis()) {
            (Some(rival), _) => {
                let own = Candidate { code, kind: self.kind, weight: 1.0 - rival.weight };
                let mut causes: Vec<Candidate> = rival.candidates().collect();
                let own_first = causes.iter().all(|cause| own.weight >= cause.weight);
                causes.insert(if own_first { 0 } else { causes.len() }, own);
                causes
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
        transitions: &mut Vec<Transition>,
    ) {
        let Some(at) = evidence.at else { return };
        transitions.push(transition(code, at, evidence, memory));
    }
}

/// Least likelihood of a kind to be listed as a candidate. Chosen.
const LEAST_LIKELIHOOD: f64 = 0.05;

/// Returns the possible kinds of a servo fault, the likeliest first; empty if there is
/// only one.
fn kinds(code: FaultCode, answer: Option<ServoAnswer>) -> Vec<Candidate> {
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

/// Returns the transition to the present record of `code` in `memory`.
pub(super) fn transition(
    code: FaultCode,
    at: SimTime,
    evidence: &Evidence,
    memory: &FaultMemory,
) -> Transition {
    let record = memory.record(code);
    Transition {
        at,
        code,
        status: record.word(),
        byte: record.status,
        suspicion: record.suspicion.as_deref().cloned().unwrap_or_default(),
        evidence: evidence.clone(),
    }
}
