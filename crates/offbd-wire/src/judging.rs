//! The judgement of one session, the same for all callers: live, rebuilt after a crash,
//! replayed, traced for the charts, or from a file.
//!
//! It combines an engine, the check of the data against the rig's description, the
//! verdict, and counts of the samples. It has no access to the store, and of the formats
//! only those of the summary and the lines of faults.

mod recorded;
mod residual;

pub use recorded::{JudgedSession, MAX_NAMED_ROWS, NoUsableRow, RecordedSession, run_name};

use offbd_core::diagnosis::{Evidence, FaultMemory, Transition};
use offbd_core::engine::{Admission, Engine, Input, Misfit, Plausibility, Rejection, Setup};
use offbd_core::vocabulary::Sample;
use serde::{Deserialize, Serialize};

use crate::basis::Basis;
use crate::verdict::{SummaryView, Verdict};
use residual::ResidualSize;

/// Counts of the samples of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// Samples that were neither duplicates nor rejected.
    pub n_samples: u64,
    /// Samples of these that are not judged: their time was too late, or a step of the
    /// clock that no other confirmed.
    pub n_set_aside: u64,
    /// Earliest and latest time of the judged samples, s on the device's clock.
    pub span_s: Option<(f64, f64)>,
    /// Time from the first of these to the last, s.
    pub duration_s: f64,
}

/// A session that is being judged. Its serialised form holds the whole state, to the bit; it
/// is valid for one [`SNAPSHOT_FORMAT`](offbd_core::engine::SNAPSHOT_FORMAT).
#[derive(Debug, Serialize, Deserialize)]
pub struct Judging {
    engine: Engine,
    basis: Basis,
    plausibility: Plausibility,
    verdict: Verdict,
    residual: ResidualSize,
    /// Samples that were neither duplicates nor rejected.
    n_samples: u64,
    /// The latest time of these, also of those that are not judged, s.
    newest_t_s: Option<f64>,
    /// The changes of faults that the last input caused.
    #[serde(skip)]
    transitions: Vec<Transition>,
}

impl Judging {
    /// Begins a session of `setup`, with the faults that earlier sessions left in `memory`.
    #[must_use]
    pub fn new(setup: Setup, memory: FaultMemory) -> Self {
        Self {
            basis: Basis::of(&setup),
            plausibility: Plausibility::new(&setup.rig),
            engine: Engine::new(setup, memory),
            verdict: Verdict::default(),
            residual: ResidualSize::default(),
            n_samples: 0,
            newest_t_s: None,
            transitions: Vec::new(),
        }
    }

    /// Takes one sample that may be a retransmission.
    pub fn sample(&mut self, sample: Sample) -> Admission {
        self.observe(Input::Sample(sample), |_| {}).unwrap_or(Admission::Duplicate)
    }

    /// Takes one sample that is not a retransmission.
    pub fn new_sample(&mut self, sample: Sample) -> Admission {
        self.observe(Input::NewSample(sample), |_| {}).unwrap_or(Admission::Duplicate)
    }

    /// Notes that a sample was rejected by the caller, who has looked it up.
    pub fn note_rejected(&mut self, why: Rejection) {
        self.engine.note_rejected(why);
    }

    /// Takes one input. Returns the admission of a sample, `None` for other inputs.
    pub fn input(&mut self, input: Input) -> Option<Admission> {
        self.observe(input, |_| {})
    }

    /// Takes one input like [`Judging::input`], and calls `observer` with the evidence of
    /// each sample that is judged thereby, in order of time.
    pub fn observe(
        &mut self,
        input: Input,
        mut observer: impl FnMut(&Evidence),
    ) -> Option<Admission> {
        // Keeps no memory: there are many sessions, and their faults change rarely.
        self.transitions = Vec::new();
        let residual = &mut self.residual;
        let admission = self.engine.observe(input, &mut self.transitions, |evidence| {
            residual.take(evidence);
            observer(evidence);
        });
        self.verdict.take(self.engine.n_accepted(), &self.transitions);
        let is_recorded = matches!(admission, Some(Admission::Accepted | Admission::SetAside(_)));
        if let (true, Input::Sample(sample) | Input::NewSample(sample)) = (is_recorded, &input) {
            self.plausibility.take(sample);
            self.n_samples += 1;
            self.newest_t_s = Some(self.newest_t_s.map_or(sample.t_s, |t_s| t_s.max(sample.t_s)));
        }
        admission
    }

    /// The changes of faults that the last input caused.
    #[must_use]
    pub fn transitions(&self) -> &[Transition] {
        &self.transitions
    }

    /// The engine.
    #[must_use]
    pub const fn engine(&self) -> &Engine {
        &self.engine
    }

    /// The ids of the calibration and of the settings that the session is judged with.
    #[must_use]
    pub const fn basis(&self) -> &Basis {
        &self.basis
    }

    /// The counts of the samples so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        Counts {
            n_samples: self.n_samples,
            n_set_aside: self.engine.n_set_aside(),
            span_s: self.engine.span_s(),
            duration_s: self.engine.duration_s(),
        }
    }

    /// The latest time of all samples, also of those that are not judged, s.
    #[must_use]
    pub const fn newest_t_s(&self) -> Option<f64> {
        self.newest_t_s
    }

    /// Returns whether a fault has been confirmed in this session.
    #[must_use]
    pub fn has_confirmed(&self) -> bool {
        !self.verdict.confirmed().is_empty()
    }

    /// Contradictions between the data and the rig's description.
    #[must_use]
    pub fn misfits(&self) -> Vec<Misfit> {
        let offsets = self.engine.steady_offsets();
        let levels = self.plausibility.levels(&offsets);
        // A confirmed or suspected servo needs no doubt.
        let is_open = |m: &Misfit| m.doubted_servo().is_none_or(|code| !self.verdict.accuses(code));
        self.plausibility.misfits().into_iter().chain(levels.filter(is_open)).collect()
    }

    /// The summary of the session, with the name `session` and `n_rejected` rejected rows.
    #[must_use]
    pub fn summary(&self, session: &str, n_rejected: u64) -> SummaryView {
        self.verdict
            .summary(session, self.n_samples, n_rejected, self.engine.duration_s())
            .with_monitors(self.verdict.monitors(&self.engine.state(), self.engine.memory()))
            .with_misfits(&self.misfits())
            .with_residual(self.residual.rms_m_s2())
    }
}
