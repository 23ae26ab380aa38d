//! The judgement of a recording: rows that exist already, some of which may be invalid.

use super::Judging;
use crate::session_file::{RejectedRow, RowPlace};
use crate::trace::ThresholdsView;
use crate::verdict::{FaultView, SummaryView, fault_view};
use offbd_core::diagnosis::{Evidence, FaultMemory, ServoEstimate};
use offbd_core::engine::{Admission, Input, Misfit, Setup, State};
use offbd_core::vocabulary::{PerAxis, Sample};
use serde::{Deserialize, Serialize};

/// Number of invalid rows of a recording that are reported one by one; further ones are only
/// counted.
pub const MAX_NAMED_ROWS: usize = 5;

/// Returns the name of a run of the recording `name`, counted from 1.
#[must_use]
pub fn run_name(name: &str, n_run: usize) -> String {
    if n_run == 1 { name.to_owned() } else { format!("{name}#{n_run}") }
}

/// The result of judging a recording.
#[derive(Debug)]
pub struct JudgedSession {
    pub faults: Vec<FaultView>,
    pub summary: SummaryView,
    /// The first [`MAX_NAMED_ROWS`] rejected rows.
    pub bad_rows: Vec<RejectedRow>,
    /// Rows that are not judged: their time was too late, or a step of the clock that no
    /// other row confirmed.
    pub n_set_aside: u64,
    /// The estimate of each servo; `None` if there was too little motion.
    pub estimates: PerAxis<Option<ServoEstimate>>,
    /// Contradictions between the data and the asset file.
    pub misfits: Vec<Misfit>,
}

/// A recording that is being judged, row by row. Its serialised form holds the whole state, as
/// that of [`Judging`] does.
#[derive(Debug, Serialize, Deserialize)]
pub struct RecordedSession {
    name: String,
    judging: Judging,
    faults: Vec<FaultView>,
    bad_rows: Vec<RejectedRow>,
    n_rejected: u64,
}

impl RecordedSession {
    /// Begins the session `name` of `setup`, without faults of earlier sessions.
    #[must_use]
    pub fn new(setup: Setup, name: String) -> Self {
        let judging = Judging::new(setup, FaultMemory::default());
        Self { name, judging, faults: Vec::new(), bad_rows: Vec::new(), n_rejected: 0 }
    }

    /// Counts a row that is not a sample.
    pub fn reject(&mut self, error: RejectedRow) {
        self.n_rejected += 1;
        if self.bad_rows.len() < MAX_NAMED_ROWS {
            self.bad_rows.push(error);
        }
    }

    /// Takes the sample of the row at `place`, and calls `observer` with the evidence of each
    /// sample that is judged thereby, in order of time.
    pub fn sample(
        &mut self,
        sample: Sample,
        place: impl FnOnce() -> RowPlace,
        mut observer: impl FnMut(&Evidence),
    ) {
        let mut take = |input| self.judging.observe(input, &mut observer);
        let admission = match take(Input::Sample(sample)) {
            // Rows as old as this are not retransmissions in a recording.
            Some(Admission::Unknown) => take(Input::NewSample(sample)),
            admission => admission,
        };
        if let Some(Admission::Rejected(reason)) = admission {
            self.reject(RejectedRow { place: place(), reason: reason.to_string() });
        }
        self.note_faults();
    }

    fn note_faults(&mut self) {
        let view = |t| fault_view(&self.name, self.judging.basis(), t);
        self.faults.extend(self.judging.transitions().iter().map(view));
    }

    /// The changes of faults so far.
    #[must_use]
    pub fn faults(&self) -> &[FaultView] {
        &self.faults
    }

    /// The state of the engine.
    #[must_use]
    pub fn state(&self) -> State {
        self.judging.engine().state()
    }

    /// The values at which the monitors decide.
    #[must_use]
    pub fn thresholds(&self) -> Vec<ThresholdsView> {
        ThresholdsView::of(self.judging.engine())
    }

    /// The summary of the session so far.
    #[must_use]
    pub fn summary(&self) -> SummaryView {
        self.judging.summary(&self.name, self.n_rejected)
    }

    /// Ends the session, and calls `observer` as [`sample`](Self::sample) does. Returns the
    /// result.
    ///
    /// # Errors
    /// The reason why nothing could be judged.
    pub fn end(mut self, observer: impl FnMut(&Evidence)) -> Result<JudgedSession, NoUsableRow> {
        self.judging.observe(Input::End, observer);
        self.note_faults();
        let misfits = self.judging.misfits();
        let counts = self.judging.counts();
        if counts.span_s.is_none() {
            return Err(NoUsableRow::of(&misfits, self.bad_rows.first()));
        }
        let summary = self.summary();
        let estimates = self.judging.engine().servo_estimates();
        let Self { faults, bad_rows, .. } = self;
        let n_set_aside = counts.n_set_aside;
        Ok(JudgedSession { faults, summary, bad_rows, n_set_aside, estimates, misfits })
    }
}

/// No row of a recording could be judged.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no usable row{why}")]
pub struct NoUsableRow {
    /// The reason, after a colon, if it is known; otherwise empty.
    why: String,
}

impl NoUsableRow {
    fn of(misfits: &[Misfit], rejected: Option<&RejectedRow>) -> Self {
        let units = |m: &&Misfit| matches!(m, Misfit::Positions { .. } | Misfit::Commands { .. });
        let why = misfits.iter().find(units).map(ToString::to_string);
        let why = why.or_else(|| rejected.map(ToString::to_string));
        Self { why: why.map_or_else(String::new, |why| format!(": {why}")) }
    }
}
