//! The engine: one rig's pipeline as a synchronous state machine.
//!
//! admit → align → twin step → estimate acceleration → residual → gate →
//! monitors → isolate → fault memory. Time comes from the samples; equal
//! inputs in equal order give equal outputs, to the bit, whatever the
//! batching. Never fails on data: a bad sample is an output that says so.
//! Knows no files, sockets, clocks or formats.

mod admit;
mod align;
mod calibrate;
mod coverage;
mod drive_cycle;
mod edge;
mod frame;
mod look;
mod motion;
mod pipeline;
mod plausibility;
mod rig;
mod types;
mod watch;

#[cfg(not(feature = "std"))]
use crate::no_std::*;
pub use calibrate::{CannotCalibrate, calibrate, calibrate_and_foresee};
pub use drive_cycle::{
    DriveCycle, DriveLaw, FaultVerdict, Feedback, MonitorVerdict, NoDriveCycle, NotReached, Order,
    TriedFault, drive_cycle,
};
pub use motion::{UsableMotion, WANTED_MOTION_S};
pub use plausibility::{Misfit, Plausibility};
pub use rig::{AxisMapping, DiagnosticsSpec, MAX_NAME, Rig, ServoSpec, Setup};
pub use types::{Admission, Input, MonitorState, Output, Reach, Readiness, Rejection, State};

use admit::Admit;
use align::Align;
use coverage::Coverage;
use pipeline::Pipeline;

use crate::diagnosis::{Evidence, FaultMemory, ServoEstimate};
use crate::vocabulary::{FaultCode, PerAxis, Sample};

/// One rig's pipeline for the length of one session (one operation cycle).
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
    /// An engine at the start of a session, with the fault memory that earlier
    /// sessions left ([`FaultMemory::default`] to judge a recording afresh).
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

    /// What the engine runs on.
    #[must_use]
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The fault memory as it stands.
    #[must_use]
    pub const fn memory(&self) -> &FaultMemory {
        &self.memory
    }

    /// Takes one input and appends what follows from it to `outputs`: exactly
    /// one [`Output::Admitted`] for a sample, then the transitions it caused.
    pub fn handle(&mut self, input: Input, outputs: &mut Vec<Output>) {
        self.observe(input, outputs, |_| {});
    }

    /// The same, and shows the evidence of every sample that is judged on the
    /// way to `seen`, in order of time.
    pub fn observe(
        &mut self,
        input: Input,
        outputs: &mut Vec<Output>,
        mut seen: impl FnMut(&Evidence),
    ) {
        match input {
            Input::Sample(sample) => self.sample(sample, outputs, &mut seen),
            Input::Clear(code) => self.clear(code, outputs),
            Input::Acknowledge(code) => {
                self.memory.acknowledge(code);
            }
            Input::End => self.end(outputs, &mut seen),
        }
    }

    fn sample(
        &mut self,
        sample: Sample,
        outputs: &mut Vec<Output>,
        seen: &mut impl FnMut(&Evidence),
    ) {
        let admission = self.admit.take(&sample, self.align.released_s());
        outputs.push(Output::Admitted(admission));
        if admission == Admission::Accepted {
            self.align.push(sample);
            while let Some(next) = self.align.pop(self.setup.settings.reorder_s) {
                self.judge(&next, outputs, seen);
            }
        }
    }

    fn judge(
        &mut self,
        sample: &Sample,
        outputs: &mut Vec<Output>,
        seen: &mut impl FnMut(&Evidence),
    ) {
        let gap_s = self.setup.settings.gap_after_s(1.0 / self.setup.rig.sample_rate_hz);
        self.coverage.take(sample, gap_s);
        self.pipeline.judge(&self.setup, sample, &mut self.memory, outputs);
        seen(self.pipeline.evidence());
    }

    fn clear(&mut self, code: FaultCode, outputs: &mut Vec<Output>) {
        let was_cleared = self.memory.record(code).word();
        self.memory.clear(code);
        self.pipeline.reset_monitor(code);
        let (now, evidence) = (self.pipeline.now(), self.pipeline.evidence());
        if let (Some(at), true) = (now, was_cleared != self.memory.record(code).word()) {
            outputs.push(watch::transition(code, at, evidence, &self.memory));
        }
    }

    fn end(&mut self, outputs: &mut Vec<Output>, seen: &mut impl FnMut(&Evidence)) {
        while let Some(next) = self.align.flush() {
            self.judge(&next, outputs, seen);
        }
        self.pipeline.count_use(&self.coverage, &mut self.memory);
        let before = self.memory.clone();
        self.memory.end_cycle(&self.setup.settings.memory);
        let Some(at) = self.pipeline.now() else { return };
        for &code in FaultCode::ALL {
            if before.record(code).word() != self.memory.record(code).word() {
                let evidence = self.pipeline.evidence();
                outputs.push(watch::transition(code, at, evidence, &self.memory));
            }
        }
    }

    /// What was seen at the last judged sample.
    #[must_use]
    pub const fn evidence(&self) -> &Evidence {
        self.pipeline.evidence()
    }

    /// Most evidence against each servo so far, nats.
    fn most_path_error_m(&self) -> PerAxis<f64> {
        self.pipeline.most_path_error_m()
    }

    fn most_nats(&self) -> PerAxis<f64> {
        self.pipeline.most_nats()
    }

    /// The nearest that each monitor has come to an alarm by the time of its
    /// failures, 0 to 1, and the seconds that it could judge.
    fn nearest(&self) -> [(f64, f64); FaultCode::COUNT] {
        self.pipeline.nearest()
    }

    /// How well the twin has foretold the readings of each axis, nats.
    fn foretold_nats(&self) -> PerAxis<f64> {
        self.pipeline.foretold_nats()
    }

    /// How each servo has answered over this session; none where too little of
    /// it was seen.
    #[must_use]
    pub fn servo_estimates(&self) -> PerAxis<Option<ServoEstimate>> {
        self.pipeline.servo_estimates()
    }

    /// Where the engine stands after the last judged sample.
    #[must_use]
    pub fn state(&self) -> State {
        self.pipeline.state(&self.memory, &self.coverage, self.align.n_waiting())
    }
}
