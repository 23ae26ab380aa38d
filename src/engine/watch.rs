//! One monitor over time: debounce, onset, and what it tells the memory.

use super::Output;
use crate::diagnosis::{
    Candidate, Debounce, Evidence, FaultMemory, Finding, Qualified, Settings, Suspicion, Test,
    Transition,
};
use crate::vocabulary::{FaultCode, FaultKind, SimTime};

/// The watch over one code.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    debounce: Debounce,
    /// The debounce of what is seen through the second, shorter window.
    quick: Debounce,
    test: Test,
    enabled_s: f64,
    /// When the run of failures began.
    since: Option<SimTime>,
    kind: Option<FaultKind>,
    candidates: Option<[Candidate; 2]>,
}

impl Watch {
    pub fn counter(&self) -> i8 {
        self.debounce.counter().max(self.quick.counter())
    }

    pub const fn test(&self) -> Test {
        self.test
    }

    pub const fn enabled_s(&self) -> f64 {
        self.enabled_s
    }

    /// Takes what the monitor says of the last `dt` seconds. The first of the
    /// two windows to come to a failure speaks; a pass needs both.
    pub fn update(
        &mut self,
        code: FaultCode,
        finding: &Finding,
        at: SimTime,
        dt: f64,
        settings: &Settings,
        quick: &Settings,
    ) -> Qualified {
        self.test = finding.test;
        if finding.test != Test::NotTested {
            self.enabled_s += dt;
        }
        // A loose contact comes and goes; readings and a ball are given up on
        // sooner, for a disturbance shows in them too.
        let leak_s = if code.axis().is_some() { settings.leak_s } else { settings.pass_s };
        let seen = |debounce: &Debounce, test: Test| match finding.gone && debounce.failed() {
            true => Test::Prefailed,
            false => test,
        };
        let (test, quick_test) =
            (seen(&self.debounce, finding.test), seen(&self.quick, finding.quick));
        let slow = self.debounce.update(test, dt, leak_s, settings);
        let fast = self.quick.update(quick_test, dt, leak_s, quick);
        if finding.test == Test::Prefailed || finding.quick == Test::Prefailed {
            self.since.get_or_insert(at);
            self.kind = finding.kind.or(self.kind);
            self.candidates = finding.rival.map(|rival| {
                let own = Candidate { code, kind: finding.kind, weight: 1.0 - rival.weight };
                [own, rival]
            });
        } else if !self.suspicious() {
            (self.since, self.kind, self.candidates) = (None, None, None);
        }
        match slow.max(fast) {
            Qualified::Passed if self.suspicious() || slow != Qualified::Passed => Qualified::No,
            qualified => qualified,
        }
    }

    fn suspicious(&self) -> bool {
        self.debounce.suspicious() || self.quick.suspicious()
    }

    /// Another cause accounts for what was seen: the suspicion is taken back.
    pub fn exonerate(&mut self) {
        self.debounce.exonerate();
        self.quick.exonerate();
        (self.since, self.kind, self.candidates) = (None, None, None);
    }

    /// Tells the memory, and the world where the status byte says so.
    pub fn apply(
        &self,
        code: FaultCode,
        qualified: Qualified,
        settings: &Settings,
        evidence: &Evidence,
        memory: &mut FaultMemory,
        outputs: &mut Vec<Output>,
    ) {
        let record = memory.record(code);
        let failed = record.status.test_failed();
        match qualified {
            Qualified::No => {}
            Qualified::Passed => {
                if memory.passed(code) && failed {
                    self.announce(code, evidence, memory, outputs);
                }
            }
            Qualified::Failed if failed => {}
            Qualified::Failed => self.fail(code, settings, evidence, memory, outputs),
            Qualified::Tripped if failed && record.tripped_this_cycle => {}
            Qualified::Tripped => {
                if !failed {
                    self.fail(code, settings, evidence, memory, outputs);
                }
                if memory.trip(code, &self.suspicion(settings), &settings.memory) {
                    self.announce(code, evidence, memory, outputs);
                }
            }
        }
    }

    fn fail(
        &self,
        code: FaultCode,
        settings: &Settings,
        evidence: &Evidence,
        memory: &mut FaultMemory,
        outputs: &mut Vec<Output>,
    ) {
        if memory.failed(code, &self.suspicion(settings), evidence) {
            self.announce(code, evidence, memory, outputs);
        }
    }

    /// What is suspected now. The deviation shows in the filter half a window
    /// after it began.
    fn suspicion(&self, settings: &Settings) -> Suspicion {
        Suspicion {
            onset: self.since.map(|t| t + -settings.window_s / 2.0),
            kind: self.kind,
            candidates: self.candidates.map(|c| c.to_vec()).unwrap_or_default(),
        }
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

/// The transition that `memory` now shows for `code`.
pub fn transition(
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
