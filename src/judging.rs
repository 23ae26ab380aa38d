//! One session as it is judged, whichever way it comes: live, rebuilt after a
//! crash, replayed, drawn, or from a file.
//!
//! An engine, whether its data fit the rig that was described, the verdict, and
//! the counts of what was taken. Knows no store and no formats but the summary's.

use offbd_core::diagnosis::{Evidence, FaultMemory, Transition};
use offbd_core::engine::{Admission, Engine, Input, Misfit, Output, Plausibility, Setup};
use offbd_core::vocabulary::Sample;

use crate::wire::basis::Basis;
use crate::wire::verdict::{SummaryView, Verdict};

/// What was taken so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// Samples that were taken, in time or not: no duplicates, none rejected.
    pub n_samples: u64,
    /// Those of them that came too late, or too far ahead, to be judged.
    pub n_set_aside: u64,
    /// Earliest and latest time of those that were judged, s on the device's
    /// clock.
    pub span_s: Option<(f64, f64)>,
}

impl Counts {
    fn note(&mut self, t_s: f64, admission: Admission) {
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

    /// From the earliest to the latest sample that was judged, s.
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
    /// What followed from the last input.
    outputs: Vec<Output>,
}

impl Judging {
    /// A session of `setup` that begins on what earlier ones left in `memory`.
    #[must_use]
    pub fn new(setup: Setup, memory: FaultMemory) -> Self {
        Self {
            basis: Basis::of(&setup),
            plausibility: Plausibility::new(&setup.rig),
            engine: Engine::new(setup, memory),
            verdict: Verdict::default(),
            counts: Counts::default(),
            outputs: Vec::new(),
        }
    }

    /// Takes one sample.
    pub fn sample(&mut self, sample: Sample) -> Admission {
        self.observe(Input::Sample(sample), |_| {}).unwrap_or(Admission::Duplicate)
    }

    /// Takes one input; returns what became of it if it is a sample.
    pub fn input(&mut self, input: Input) -> Option<Admission> {
        self.observe(input, |_| {})
    }

    /// The same, and shows the evidence of every sample that is judged on the
    /// way to `seen`, in order of time.
    pub fn observe(&mut self, input: Input, seen: impl FnMut(&Evidence)) -> Option<Admission> {
        let sample = if let Input::Sample(sample) = &input { Some(*sample) } else { None };
        if let Some(sample) = &sample {
            self.plausibility.take(sample);
        }
        self.outputs.clear();
        self.engine.observe(input, &mut self.outputs, seen);
        self.outputs.iter().for_each(|output| self.verdict.take(output));
        let admission = self.outputs.iter().find_map(|output| match output {
            Output::Admitted(admission) => Some(*admission),
            Output::Transition(_) => None,
        });
        if let (Some(sample), Some(admission)) = (sample, admission) {
            self.counts.note(sample.t_s, admission);
        }
        admission
    }

    /// The changes of faults that followed from the last input.
    pub fn transitions(&self) -> impl Iterator<Item = &Transition> {
        self.outputs.iter().filter_map(|output| match output {
            Output::Transition(transition) => Some(&**transition),
            Output::Admitted(_) => None,
        })
    }

    /// The engine, to look at.
    #[must_use]
    pub const fn engine(&self) -> &Engine {
        &self.engine
    }

    /// By what it is judged.
    #[must_use]
    pub const fn basis(&self) -> &Basis {
        &self.basis
    }

    /// What was taken so far.
    #[must_use]
    pub const fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Whether a fault has been confirmed in it.
    #[must_use]
    pub fn has_confirmed(&self) -> bool {
        !self.verdict.confirmed().is_empty()
    }

    /// In what the data and the rig's description do not fit.
    #[must_use]
    pub fn misfits(&self) -> Vec<Misfit> {
        self.plausibility.misfits()
    }

    /// What the session of this name comes to, with so many rows rejected.
    #[must_use]
    pub fn summary(&self, session: &str, n_rejected: u64) -> SummaryView {
        let Counts { n_samples, .. } = self.counts;
        self.verdict
            .summary(session, n_samples, n_rejected, self.counts.duration_s())
            .with_monitors(self.verdict.monitors(&self.engine.state()))
            .with_misfits(&self.misfits())
    }
}
