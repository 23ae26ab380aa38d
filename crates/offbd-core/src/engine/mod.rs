//! The engine: the pipeline of one rig as a synchronous state machine.
//!
//! admit → clock → align → twin step → estimate acceleration → residual → enable conditions →
//! monitors → isolation → fault memory. Time comes from the samples. Equal inputs in
//! equal order give bit-identical outputs, however they are batched. Never fails on data:
//! a bad sample gives an output that says so. Independent of files, sockets, clocks and
//! formats.

mod acceleration_filter;
mod admit;
mod align;
mod calibrate;
mod clock;
mod coverage;
mod drive_cycle;
mod edge;
mod frame;
mod free_run;
mod ledger;
mod monitor;
mod motion;
mod pipeline;
mod plausibility;
mod rig;
mod span;
mod trial;
mod types;
mod untested;

#[cfg(not(feature = "std"))]
use crate::no_std::*;
pub use admit::rejection;
pub use calibrate::{
    CannotCalibrate, calibrate, calibrate_with_prospects, calibrate_with_prospects_while,
};
pub use drive_cycle::{
    DriveCycle, DriveLaw, FaultVerdict, Feedback, MonitorVerdict, NoDriveCycle, NotReached, Order,
    TriedFault, drive_cycle,
};
pub use free_run::{FreeRunPoint, LONGEST_FREE_RUN_S, free_run};
pub use ledger::Recognition;
pub use motion::{UsableMotion, WANTED_MOTION_S};
pub use plausibility::{Misfit, Plausibility};
pub use rig::{AxisMapping, DiagnosticsSpec, MAX_NAME, Rig, ServoSpec, Setup};
use serde::{Deserialize, Serialize};
pub use trial::Trial;
pub use types::{
    Admission, Input, MonitorState, Reach, Readiness, Rejection, State, Thresholds, Unjudged,
};
pub use untested::UNTESTED_FROM;

use align::Align;
use clock::{ClockContext, ClockDecision, DeviceClock};
use coverage::Coverage;
use ledger::Ledger;
use pipeline::Pipeline;
use span::Span;
use untested::LastSamples;

use crate::diagnosis::{Evidence, FaultMemory, ServoEstimate, Transition};
use crate::vocabulary::{FaultCode, PerAxis, Sample};

/// Version of the judgement: raised with every change that gives another verdict on some
/// recording by the same settings, so that verdicts of different versions can be told
/// apart.
pub const JUDGEMENT: u32 = 10;

/// Version of the serialised form of an [`Engine`], a [`Plausibility`] and a
/// [`UsableMotion`], and of what a caller stores with them: raised with every change of the
/// fields or of what these mean.
pub const SNAPSHOT_FORMAT: u32 = 13;

/// The pipeline of one rig for one session (one operation cycle).
///
/// Its serialised form holds the whole state to the bit, except [`Engine::unjudged`]: what
/// was serialised goes on as the original does. It is valid for one [`JUDGEMENT`] and one
/// [`SNAPSHOT_FORMAT`]. Data from elsewhere must not be deserialised, since only their types
/// are checked.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Engine {
    setup: Setup,
    memory: FaultMemory,
    ledger: Ledger,
    clock: DeviceClock,
    align: Align,
    span: Span,
    coverage: Coverage,
    pipeline: Pipeline,
    n_accepted: u64,
    /// Samples that were too late to be judged.
    n_late: u64,
    /// Begins again after a restart.
    #[serde(skip)]
    last_samples: LastSamples,
}

impl Engine {
    /// Builds an engine at the start of a session, with the fault memory of the earlier
    /// sessions ([`FaultMemory::default`] to judge a recording by itself).
    #[must_use]
    pub fn new(setup: Setup, mut memory: FaultMemory) -> Self {
        memory.start_cycle();
        Self {
            ledger: Ledger::default(),
            clock: DeviceClock::new(1.0 / setup.rig.sample_rate_hz),
            align: Align::default(),
            span: Span::default(),
            coverage: Coverage::default(),
            pipeline: Pipeline::new(&setup),
            n_accepted: 0,
            n_late: 0,
            last_samples: LastSamples::default(),
            memory,
            setup,
        }
    }

    /// Tries other limits and debounce times; only for an engine that has taken no input and
    /// is not serialised.
    #[must_use]
    pub fn with_trial(self, trial: &Trial) -> Self {
        Self { pipeline: self.pipeline.with_trial(trial), ..self }
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
            Input::Sample(sample) => {
                return Some(self.sample(&sample, false, transitions, &mut seen));
            }
            Input::NewSample(sample) => {
                return Some(self.sample(&sample, true, transitions, &mut seen));
            }
            Input::Clear(code) => self.clear(code, transitions),
            Input::Acknowledge(code) => drop(self.memory.acknowledge(code)),
            Input::End => self.end(transitions, &mut seen),
        }
        None
    }

    fn sample(
        &mut self,
        sample: &Sample,
        is_new: bool,
        transitions: &mut Vec<Transition>,
        seen: &mut impl FnMut(&Evidence),
    ) -> Admission {
        let decided = self.admit(sample, is_new);
        let admission = decided.unwrap_or_else(|| self.take_new(sample, transitions, seen));
        match admission {
            Admission::Accepted => self.last_samples.note_judged(),
            Admission::Rejected(why) | Admission::SetAside(why) => {
                self.last_samples.note_unjudged(why);
            }
            Admission::Duplicate | Admission::Unknown => {}
        }
        admission
    }

    /// Decides on a sample that is new if `is_new`, and may be a retransmission otherwise.
    /// Returns `None` if it is new and its clock is to be judged.
    fn admit(&self, sample: &Sample, is_new: bool) -> Option<Admission> {
        if let Err(rejection) = admit::check(&self.setup.rig.mapping, sample) {
            return Some(Admission::Rejected(rejection));
        }
        if is_new {
            return None;
        }
        match self.ledger.recognise(sample) {
            Recognition::New => None,
            Recognition::Same => Some(Admission::Duplicate),
            Recognition::Conflict => Some(Admission::Rejected(Rejection::conflict(sample))),
            Recognition::Taken | Recognition::Unknown => Some(Admission::Unknown),
        }
    }

    /// Takes a sample that is valid and new.
    fn take_new(
        &mut self,
        sample: &Sample,
        transitions: &mut Vec<Transition>,
        seen: &mut impl FnMut(&Evidence),
    ) -> Admission {
        let gap_s = self.gap_s();
        let context = ClockContext {
            released_s: self.align.released_s(),
            in_stretch: sample.seq.is_none() && self.ledger.has_stretch_at(sample.t_s),
            precedes: sample.seq.is_none() && self.ledger.precedes(sample),
            reorder_s: self.setup.settings.reorder_s,
            gap_s,
        };
        self.ledger.note(sample, gap_s);
        match self.clock.take(sample, &context) {
            ClockDecision::Follows => self.arrange(sample, transitions, seen),
            ClockDecision::Doubted { step_s } => {
                return Admission::SetAside(Rejection::Jump { step_s });
            }
            ClockDecision::Believed { held, set_back } => {
                if set_back {
                    self.set_clock_back(transitions, seen);
                }
                // All but this one have been noted as set aside.
                self.last_samples.judge_last(held.len() - 1);
                held.iter().for_each(|sample| self.arrange(sample, transitions, seen));
            }
            ClockDecision::Late { behind_s } => {
                self.n_late += 1;
                return Admission::SetAside(Rejection::Late { behind_s });
            }
        }
        Admission::Accepted
    }

    /// Puts a sample in order of time and judges those that are due.
    fn arrange(
        &mut self,
        sample: &Sample,
        transitions: &mut Vec<Transition>,
        seen: &mut impl FnMut(&Evidence),
    ) {
        self.n_accepted += 1;
        self.span.take(sample.t_s);
        let (reorder_s, interval_s) = (self.setup.settings.reorder_s, self.clock.interval_s());
        if self.align.pass(sample, interval_s) {
            return self.judge(sample, transitions, seen);
        }
        self.align.push(*sample);
        while let Some(next) = self.align.pop(reorder_s, interval_s) {
            self.judge(&next, transitions, seen);
        }
    }

    fn set_clock_back(
        &mut self,
        transitions: &mut Vec<Transition>,
        seen: &mut impl FnMut(&Evidence),
    ) {
        while let Some(next) = self.align.flush() {
            self.judge(&next, transitions, seen);
        }
        self.align.restart();
        self.span.set_back();
        self.coverage.set_back();
        self.pipeline.set_clock_back();
    }

    /// The interval without a sample that makes a gap, after which evidence begins again, s.
    #[must_use]
    pub fn gap_s(&self) -> f64 {
        self.setup.settings.gap_after_s(1.0 / self.setup.rig.sample_rate_hz)
    }

    fn judge(
        &mut self,
        sample: &Sample,
        transitions: &mut Vec<Transition>,
        seen: &mut impl FnMut(&Evidence),
    ) {
        let gap_s = self.gap_s();
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
        self.clock.drop_held();
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

    /// The values at which the monitor of `code` decides.
    #[must_use]
    pub fn thresholds(&self, code: FaultCode) -> Thresholds {
        self.pipeline.thresholds(code)
    }

    /// Largest evidence of the path of each axis so far, nats.
    fn most_path_nats(&self) -> PerAxis<f64> {
        self.pipeline.most_path_nats()
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

    /// Returns the offset of each servo in this session, averaged over the last 20 s, as an acceleration
    /// of the ball, and its standard error, m/s²; zero before the ball has moved. A fault that has just
    /// begun hardly affects it.
    #[must_use]
    pub fn steady_offsets(&self) -> PerAxis<(f64, f64)> {
        self.pipeline.steady_offsets()
    }

    /// Notes that a sample was rejected by the caller, who has looked it up, or could not read
    /// it.
    pub fn note_rejected(&mut self, why: Rejection) {
        self.last_samples.note_unjudged(why);
    }

    /// Returns what is known of a sample; its numbers must be finite.
    #[must_use]
    pub fn recognise(&self, sample: &Sample) -> Recognition {
        self.ledger.recognise(sample)
    }

    /// Whether a sample of the past that is new can be one that was lost and is sent late,
    /// and does not overlap with those taken: its `seq` or, without one, its time is after
    /// the first one, and for times in a gap.
    #[must_use]
    pub fn fits_gap(&self, sample: &Sample) -> bool {
        self.ledger.fits_gap(sample)
    }

    /// Whether a sample is before the first one taken: its `seq` or, without one, its time.
    #[must_use]
    pub fn precedes(&self, sample: &Sample) -> bool {
        self.ledger.precedes(sample)
    }

    /// Samples that are judged or wait for an earlier one.
    #[must_use]
    pub const fn n_accepted(&self) -> u64 {
        self.n_accepted
    }

    /// New samples that are not judged, because they came too late or because no other
    /// confirmed their step of the clock.
    #[must_use]
    pub const fn n_set_aside(&self) -> u64 {
        self.n_late + self.clock.n_dropped()
    }

    /// Those of them whose step of the clock no other sample confirmed.
    #[must_use]
    pub const fn n_unconfirmed(&self) -> u64 {
        self.clock.n_dropped()
    }

    /// Earliest and latest time of the samples that are judged or wait for it, s.
    #[must_use]
    pub const fn span_s(&self) -> Option<(f64, f64)> {
        self.span.whole_s()
    }

    /// Time from the first of these samples to the last, s. A clock that was set back does
    /// not count twice.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.span.duration_s()
    }

    /// The unjudged ones of the last samples, if they are so many that the rig counts as not
    /// tested.
    #[must_use]
    pub fn unjudged(&self) -> Option<Unjudged> {
        self.last_samples.unjudged()
    }

    /// The state after the last judged sample. No monitor is enabled while many samples go
    /// unjudged.
    #[must_use]
    pub fn state(&self) -> State {
        let n_waiting = self.align.n_waiting() + self.clock.n_held();
        let mut state = self.pipeline.state(&self.memory, &self.coverage, n_waiting);
        state.unjudged = self.unjudged();
        if state.unjudged.is_some() {
            state.monitors.iter_mut().for_each(|monitor| monitor.readiness.enabled = false);
        }
        state
    }
}
