//! An open session and its engine.

use super::part::Part;
use super::recent::RecentTrace;
use crate::clock::rfc3339;
use crate::{ServiceError, snapshots, views};
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Admission, Setup, UsableMotion};
use offbd_core::vocabulary::Sample;
use offbd_store::{Micros, SessionProgress, SessionRow, Snapshot, TransitionRow, Write};
use offbd_wire::judging::Judging;
use offbd_wire::stored::StoredOccurrence;
use offbd_wire::verdict::{SummaryView, fault_view};

/// An open session and its engine.
pub(super) struct OpenSession {
    pub(super) id: String,
    pub(super) name: String,
    pub(super) part: Part,
    pub(super) judging: Judging,
    pub(super) progress: SessionProgress,
    pub(super) n_transitions: i64,
    /// Whether a recording is being imported into it; live telemetry is refused then.
    pub(super) importing: bool,
    /// The trace for clients that watch the session.
    pub(super) recent: RecentTrace,
    /// Motion usable for calibration; `None` if it is not counted.
    pub(super) motion: Option<UsableMotion>,
    /// Number of samples at the last snapshot of the engine.
    pub(super) snapshot_at: i64,
    /// Number of samples at the last act of a person.
    pub(super) acted_at: Option<i64>,
    /// Consecutive different samples so far that show a restart of the device, and the last
    /// of them.
    pub(super) n_restart_signs: u32,
    pub(super) last_restart_sign: Option<Sample>,
}

impl OpenSession {
    /// Returns the session of `row`, with an engine at its start. Motion is counted if the rig
    /// is not calibrated, or if `refines` is set because the session may refine its
    /// calibration.
    pub(super) fn new(
        row: &SessionRow,
        setup: Setup,
        baseline: FaultMemory,
        refines: bool,
    ) -> Self {
        let counts = refines || setup.rig.calibration.is_none();
        Self {
            motion: counts.then(|| UsableMotion::new(&setup.rig)),
            id: row.id.clone(),
            name: row.name.clone(),
            part: Part::of(row),
            judging: Judging::new(setup, baseline),
            progress: SessionProgress::default(),
            n_transitions: 0,
            importing: row.importing != 0,
            recent: RecentTrace::default(),
            snapshot_at: 0,
            acted_at: None,
            n_restart_signs: 0,
            last_restart_sign: None,
        }
    }

    /// Whether the engine has evaluated any of the recorded samples, if there are some. It has
    /// not if it was read for a question, and no state of it is stored.
    pub(super) fn is_known(&self) -> bool {
        self.progress.n_samples == 0 || self.judging.counts().n_samples > 0
    }

    /// Evaluates one sample that may be a retransmission.
    pub(super) fn take(&mut self, sample: &Sample) -> Admission {
        let admission = self.judging.sample(*sample);
        self.note(sample, admission)
    }

    /// Evaluates one sample that is not a retransmission.
    pub(super) fn take_new(&mut self, sample: &Sample) -> Admission {
        let admission = self.judging.new_sample(*sample);
        self.note(sample, admission)
    }

    fn note(&mut self, sample: &Sample, admission: Admission) -> Admission {
        if let (Admission::Accepted, Some(motion)) = (admission, &mut self.motion) {
            motion.take(sample);
        }
        if matches!(admission, Admission::Accepted | Admission::SetAside(_)) {
            let progress = &mut self.progress;
            progress.n_samples += 1;
            (progress.first_t_s, progress.last_t_s) = self.judging.counts().span_s.unzip();
            let seq = sample.seq.and_then(|seq| i64::try_from(seq).ok());
            progress.last_seq = progress.last_seq.max(seq);
        }
        self.recent.push(|| self.judging.engine().state());
        admission
    }

    /// Returns a snapshot of the engine, which has evaluated `n_samples` recorded samples, if
    /// the last one was `interval` samples ago.
    pub(super) fn snapshot_if_due(
        &mut self,
        n_samples: i64,
        interval: i64,
    ) -> Result<Option<Snapshot>, ServiceError> {
        let is_due = n_samples - self.snapshot_at >= interval;
        is_due.then(|| self.snapshot(n_samples, interval)).transpose()
    }

    /// Returns a snapshot of an engine that is about to be dropped. `None` if the last one is as
    /// new, if an import is interrupted, or if a person has acted since the last sample: an engine
    /// from a snapshot takes the acts after its last sample again.
    pub(super) fn last_snapshot(
        &mut self,
        interval: i64,
    ) -> Result<Option<Snapshot>, ServiceError> {
        let n_samples = self.progress.n_samples;
        let is_wanted = n_samples > self.snapshot_at && self.acted_at != Some(n_samples);
        let is_wanted = is_wanted && !self.importing;
        is_wanted.then(|| self.snapshot(n_samples, interval)).transpose()
    }

    /// Returns a snapshot of the engine, which has evaluated `n_samples` recorded samples;
    /// `interval` is the usual number of them between two.
    fn snapshot(&mut self, n_samples: i64, interval: i64) -> Result<Snapshot, ServiceError> {
        let last = std::mem::replace(&mut self.snapshot_at, n_samples);
        Ok(Snapshot {
            session: self.id.clone(),
            n_samples,
            kept: snapshots::is_kept(n_samples, last, interval),
            version: snapshots::version(),
            state: snapshots::state(&self.judging, self.motion.as_ref())?,
        })
    }

    /// Samples that are not judged because no other confirmed their step of the clock.
    pub(super) fn n_unconfirmed(&self) -> u64 {
        self.judging.engine().n_unconfirmed()
    }

    /// Appends the transitions caused by the last input to `writes`, with the time `at`.
    pub(super) fn report(
        &mut self,
        asset: &str,
        at: Micros,
        writes: &mut Vec<Write>,
    ) -> Result<(), ServiceError> {
        for transition in self.judging.transitions() {
            let view = fault_view(&self.name, self.judging.basis(), transition);
            writes.push(Write::Transition(TransitionRow {
                id: 0,
                asset: asset.to_owned(),
                session: self.id.clone(),
                ordinal: self.n_transitions,
                t_s: view.t_s,
                code: view.code.to_string(),
                status: view.status.to_string(),
                at,
                document: views::to_json(&view)?,
            }));
            self.n_transitions += 1;
        }
        Ok(())
    }

    /// Returns the provenance of a failure that occurs at `at`.
    pub(super) fn occurrence(&self, at: Micros) -> StoredOccurrence {
        StoredOccurrence {
            session: self.name.clone(),
            session_id: self.id.clone(),
            noted_at: rfc3339(at),
            calibration_id: self.judging.basis().calibration_id.clone(),
            settings_id: self.judging.basis().settings_id.clone(),
        }
    }

    pub(super) fn summary(&self) -> SummaryView {
        let n_rejected = u64::try_from(self.progress.n_rejected).unwrap_or_default();
        self.judging.summary(&self.name, n_rejected)
    }
}
