//! An open session and its engine.

use super::recent::RecentTrace;
use crate::judging::Judging;
use crate::service::clock::rfc3339;
use crate::service::{ServiceError, views};
use crate::store::{Micros, SessionProgress, TransitionRow, Write};
use crate::wire::stored::StoredOccurrence;
use crate::wire::verdict::{SummaryView, fault_view};
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Admission, Setup, UsableMotion};
use offbd_core::vocabulary::Sample;

/// How far the clock of a device without session names must go back to count as a restart,
/// s. A smaller step back makes the samples late.
const RESTART_S: f64 = 10.0;

/// An open session and its engine.
pub(super) struct OpenSession {
    pub(super) id: String,
    pub(super) name: String,
    pub(super) judging: Judging,
    pub(super) progress: SessionProgress,
    pub(super) n_transitions: i64,
    /// Whether a recording is being imported into it; live telemetry is refused then.
    pub(super) importing: bool,
    /// The trace for clients that watch the session.
    pub(super) recent: RecentTrace,
    /// Motion usable for calibration; `None` if it is not counted.
    pub(super) motion: Option<UsableMotion>,
    /// The latest time of an accepted sample.
    latest_t_s: f64,
    /// Whether the last sample was more than [`RESTART_S`] older than the latest.
    stepped_back: bool,
}

impl OpenSession {
    /// Returns a new session. Motion is counted if the rig is not calibrated, or if
    /// `refines` is set because the session may refine its calibration.
    pub(super) fn new(
        id: String,
        name: String,
        setup: Setup,
        baseline: FaultMemory,
        refines: bool,
    ) -> Self {
        let counts = refines || setup.rig.calibration.is_none();
        Self {
            motion: counts.then(|| UsableMotion::new(&setup.rig)),
            id,
            name,
            judging: Judging::new(setup, baseline),
            progress: SessionProgress::default(),
            n_transitions: 0,
            importing: false,
            recent: RecentTrace::default(),
            latest_t_s: f64::NEG_INFINITY,
            stepped_back: false,
        }
    }

    /// Evaluates one sample.
    pub(super) fn take(&mut self, sample: &Sample) -> Admission {
        let admission = self.judging.sample(*sample);
        if let (Admission::Accepted, Some(motion)) = (admission, &mut self.motion) {
            motion.take(sample);
        }
        if matches!(admission, Admission::Accepted | Admission::SetAside(_)) {
            self.count(sample, admission == Admission::Accepted);
        }
        self.recent.push(|| self.judging.engine().state());
        admission
    }

    fn count(&mut self, sample: &Sample, in_time: bool) {
        self.stepped_back = self.is_far_behind(sample);
        if in_time {
            self.latest_t_s = self.latest_t_s.max(sample.t_s);
        }
        let progress = &mut self.progress;
        progress.n_samples += 1;
        (progress.first_t_s, progress.last_t_s) = self.judging.counts().span_s.unzip();
        let seq = sample.seq.and_then(|seq| i64::try_from(seq).ok());
        progress.last_seq = progress.last_seq.max(seq);
    }

    fn is_far_behind(&self, sample: &Sample) -> bool {
        sample.t_s < self.latest_t_s - RESTART_S
    }

    /// Whether the device has restarted before `sample`: its clock has gone back by more
    /// than [`RESTART_S`] and `seq` has not increased. Without `seq` two such samples in a
    /// row are required, because a single one may be a clock error.
    pub(super) fn seems_restarted(&self, sample: &Sample) -> bool {
        let seq = sample.seq.and_then(|seq| i64::try_from(seq).ok());
        self.is_far_behind(sample)
            && match (seq, self.progress.last_seq) {
                (Some(seq), Some(last)) => seq <= last,
                _ => self.stepped_back,
            }
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
