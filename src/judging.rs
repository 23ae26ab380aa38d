//! The judgement of one session, the same for all callers: live, rebuilt after a crash,
//! replayed, traced for the charts, or from a file.
//!
//! It combines an engine, the check of the data against the rig's description, the
//! verdict, and counts of the samples. It has no access to the store, and of the formats
//! only that of the summary.

use offbd_core::diagnosis::{Evidence, FaultMemory, Transition};
use offbd_core::engine::{Admission, Engine, Input, Misfit, Plausibility, Setup};
use offbd_core::vocabulary::Sample;

use crate::wire::basis::Basis;
use crate::wire::verdict::{SummaryView, Verdict};

/// Counts of the samples of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// Samples that were neither duplicates nor rejected.
    pub n_samples: u64,
    /// Samples of these whose time was too late, or too far ahead, to be judged.
    pub n_set_aside: u64,
    /// Earliest and latest time of the judged samples, s on the device's clock.
    pub span_s: Option<(f64, f64)>,
}

impl Counts {
    fn count(&mut self, t_s: f64, admission: Admission) {
        match admission {
            Admission::Accepted => {
                let (first, last) = self.span_s.unwrap_or((t_s, t_s));
                self.span_s = Some((first.min(t_s), last.max(t_s)));
                self.n_samples += 1;
            }
            Admission::SetAside(_) => {
                self.n_samples += 1;
                self.n_set_aside += 1;
            }
            Admission::Duplicate | Admission::Rejected(_) => {}
        }
    }

    /// Time from the earliest to the latest judged sample, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.span_s.map_or(0.0, |(first, last)| last - first)
    }
}

/// A session that is being judged.
#[derive(Debug)]
pub struct Judging {
    engine: Engine,
    basis: Basis,
    plausibility: Plausibility,
    verdict: Verdict,
    counts: Counts,
    /// The changes of faults that the last input caused.
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
            counts: Counts::default(),
            transitions: Vec::new(),
        }
    }

    /// Takes one sample.
    pub fn sample(&mut self, sample: Sample) -> Admission {
        self.observe(Input::Sample(sample), |_| {}).unwrap_or(Admission::Duplicate)
    }

    /// Takes one input. Returns the admission of a sample, `None` for other inputs.
    pub fn input(&mut self, input: Input) -> Option<Admission> {
        self.observe(input, |_| {})
    }

    /// Takes one input like [`Judging::input`], and calls `observer` with the evidence of
    /// each sample that is judged thereby, in order of time.
    pub fn observe(&mut self, input: Input, observer: impl FnMut(&Evidence)) -> Option<Admission> {
        let sample = if let Input::Sample(sample) = &input { Some(*sample) } else { None };
        if let Some(sample) = &sample {
            self.plausibility.take(sample);
        }
        self.transitions.clear();
        let admission = self.engine.observe(input, &mut self.transitions, observer);
        self.verdict.take(admission, &self.transitions);
        if let (Some(sample), Some(admission)) = (sample, admission) {
            self.counts.count(sample.t_s, admission);
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
    pub const fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Returns whether a fault has been confirmed in this session.
    #[must_use]
    pub fn has_confirmed(&self) -> bool {
        !self.verdict.confirmed().is_empty()
    }

    /// Contradictions between the data and the rig's description.
    #[must_use]
    pub fn misfits(&self) -> Vec<Misfit> {
        self.plausibility.misfits()
    }

    /// The summary of the session, with the name `session` and `n_rejected` rejected rows.
    #[must_use]
    pub fn summary(&self, session: &str, n_rejected: u64) -> SummaryView {
        let Counts { n_samples, .. } = self.counts;
        self.verdict
            .summary(session, n_samples, n_rejected, self.counts.duration_s())
            .with_monitors(self.verdict.monitors(&self.engine.state()))
            .with_misfits(&self.misfits())
    }
}
