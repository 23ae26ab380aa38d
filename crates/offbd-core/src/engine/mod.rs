//! The engine: the pipeline of one rig as a synchronous state machine.
//!
//! admit → align → twin step → estimate acceleration → residual → enable conditions →
//! monitors → isolation → fault memory. Time comes from the samples. Equal inputs in
//! equal order give bit-identical outputs, however they are batched. Never fails on data:
//! a bad sample gives an output that says so. Independent of files, sockets, clocks and
//! formats.

mod acceleration_filter;
mod admit;
mod align;
mod calibrate;
mod coverage;
mod drive_cycle;
mod edge;
mod frame;
mod monitor;
mod motion;
mod pipeline;
mod plausibility;
mod rig;
mod types;

#[cfg(not(feature = "std"))]
use crate::no_std::*;
pub use admit::rejection;
pub use calibrate::{CannotCalibrate, calibrate, calibrate_with_prospects};
pub use drive_cycle::{
    DriveCycle, DriveLaw, FaultVerdict, Feedback, MonitorVerdict, NoDriveCycle, NotReached, Order,
    TriedFault, drive_cycle,
};
pub use motion::{UsableMotion, WANTED_MOTION_S};
pub use plausibility::{Misfit, Plausibility};
pub use rig::{AxisMapping, DiagnosticsSpec, MAX_NAME, Rig, ServoSpec, Setup};
pub use types::{Admission, Input, MonitorState, Reach, Readiness, Rejection, State};

use admit::Admit;
use align::Align;
use coverage::Coverage;
use pipeline::Pipeline;

use crate::diagnosis::{Evidence, FaultMemory, ServoEstimate, Transition};
use crate::vocabulary::{FaultCode, PerAxis, Sample};

/// Version of the judgement: raised with every change that gives another verdict on some
/// recording by the same settings, so that verdicts of different versions can be told
/// apart.
pub const JUDGEMENT: u32 = 1;

/// The pipeline of one rig for one session (one operation cycle).
#[derive(Clone, Debug)]
pub struct Engine {
    setup: Setup,
    memory: FaultMemory,
    admit: Admit,
    align: Align,
    coverage: Coverage,
    pipeline: Pipeline,
}

impl Engine {
    /// Builds an engine at the start of a session, with the fault memory of the earlier
    /// sessions ([`FaultMemory::default`] to judge a recording by itself).
    #[must_use]
    pub fn new(setup: Setup, mut memory: FaultMemory) -> Self {
        memory.start_cycle();
        Self {
            admit: Admit::new(&setup.rig.mapping),
            align: Align::default(),
            coverage: Coverage::default(),
            pipeline: Pipeline::new(&setup),
            memory,
            setup,
        }
    }

    /// The rig, settings and twin of this engine.
    #[must_use]
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The present fault memory.
    #[must_use]
    pub const fn memory(&self) -> &FaultMemory {
        &self.memory
    }

    /// Takes one input and appends the transitions that it causes to `transitions`.
    /// Returns the decision on a sample, `None` for other inputs.
    pub fn handle(&mut self, input: Input, transitions: &mut Vec<Transition>) -> Option<Admission> {
        self.observe(input, transitions, |_| {})
    }

    /// Like [`handle`](Self::handle), and passes the evidence of every judged sample to
    /// `seen`, in order of time.
    pub fn observe(
        &mut self,
        input: Input,
        transitions: &mut Vec<Transition>,
        mut seen: impl FnMut(&Evidence),
    ) -> Option<Admission> {
        match input {
            Input::Sample(sample) => return Some(self.sample(sample, transitions, &mut seen)),
            Input::Clear(code) => self.clear(code, transitions),
            Input::Acknowledge(code) => drop(self.memory.acknowledge(code)),
            Input::End => self.end(transitions, &mut seen),
        }
        None
    }

    fn sample(
        &mut self,
        sample: Sample,
        transitions: &mut Vec<Transition>,
        seen: &mut impl FnMut(&Evidence),
    ) -> Admission {
        let admission = self.admit.take(&sample, self.align.released_s());
        if admission == Admission::Accepted {
            self.align.push(sample);
            while let Some(next) = self.align.pop(self.setup.settings.reorder_s) {
                self.judge(&next, transitions, seen);
            }
        }
        admission
    }

    fn judge(
        &mut self,
        sample: &Sample,
        transitions: &mut Vec<Transition>,
        seen: &mut impl FnMut(&Evidence),
    ) {
        let gap_s = self.setup.settings.gap_after_s(1.0 / self.setup.rig.sample_rate_hz);
        self.coverage.take(sample, gap_s);
        self.pipeline.judge(&self.setup, sample, &mut self.memory, transitions);
        seen(self.pipeline.evidence());
    }

    fn clear(&mut self, code: FaultCode, transitions: &mut Vec<Transition>) {
        let was_cleared = self.memory.record(code).word();
        self.memory.clear(code);
        self.pipeline.reset_monitor(code);
        let (now, evidence) = (self.pipeline.now(), self.pipeline.evidence());
        if let (Some(at), true) = (now, was_cleared != self.memory.record(code).word()) {
            transitions.push(monitor::transition(code, at, evidence, &self.memory));
        }
    }

    fn end(&mut self, transitions: &mut Vec<Transition>, seen: &mut impl FnMut(&Evidence)) {
        while let Some(next) = self.align.flush() {
            self.judge(&next, transitions, seen);
        }
        self.pipeline.count_use(&self.coverage, &mut self.memory);
        let before = self.memory.clone();
        self.memory.end_cycle(&self.setup.settings.memory);
        let Some(at) = self.pipeline.now() else { return };
        for &code in FaultCode::ALL {
            if before.record(code).word() != self.memory.record(code).word() {
                let evidence = self.pipeline.evidence();
                transitions.push(monitor::transition(code, at, evidence, &self.memory));
            }
        }
    }

    /// The evidence of the last judged sample.
    #[must_use]
    pub const fn evidence(&self) -> &Evidence {
        self.pipeline.evidence()
    }

    /// Largest deviation of the path of each axis from the twin's so far, m.
    fn most_path_error_m(&self) -> PerAxis<f64> {
        self.pipeline.most_path_error_m()
    }

    /// Largest evidence against each servo so far, nats.
    fn most_nats(&self) -> PerAxis<f64> {
        self.pipeline.most_nats()
    }

    /// The closest approach of each monitor to an alarm by duration of failure, 0 to 1,
    /// and the time for which it could judge, s.
    fn nearest(&self) -> [(f64, f64); FaultCode::COUNT] {
        self.pipeline.nearest()
    }

    /// Log-likelihood of the readings of each axis under the healthy hypothesis, nats.
    fn log_likelihood_nats(&self) -> PerAxis<f64> {
        self.pipeline.log_likelihood_nats()
    }

    /// Returns the parameters of each servo over this session; `None` if too little was
    /// seen.
    #[must_use]
    pub fn servo_estimates(&self) -> PerAxis<Option<ServoEstimate>> {
        self.pipeline.servo_estimates()
    }

    /// The state after the last judged sample.
    #[must_use]
    pub fn state(&self) -> State {
        self.pipeline.state(&self.memory, &self.coverage, self.align.n_waiting())
    }
}
