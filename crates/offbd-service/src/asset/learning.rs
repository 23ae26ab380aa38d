//! Automatic calibration: motion is gathered while sessions run; once there is enough, the
//! shard starts a calibration job; a person confirms that the rig was healthy; later
//! healthy sessions refine the calibration.
//!
//! The state and the decisions are in
//! [`LearningRecord`](super::learning_record::LearningRecord); this module connects it to
//! the asset and the jobs.

use uuid::Uuid;

use super::actor::Asset;
use super::learning_record::{CalibrationEnd, REFINED_SESSIONS, TrainingSession};
use super::session::OpenSession;
use super::turn::Turn;
use crate::access::AuditEntry;
use crate::job::{self, Job, NewJob};
use crate::{ServiceError, views};
use offbd_core::vocabulary::Axis;
use offbd_store::{AccessWrite, CalibrationRow, Write};
use offbd_wire::asset::{self, CalibrationView};
use offbd_wire::learning::{LearningState, LearningView, TeachingSessionView};
use offbd_wire::verdict::{Outcome, SummaryView};
use offbd_wire::words::JobState;

/// The actor of what a rig learns by itself.
pub(crate) const ACTOR: &str = "offbd";

/// Motion below which an axis counts as not having moved, s.
const MOVED_S: f64 = 1.0;

impl Asset {
    /// Starts a calibration job if there is enough motion and the job queue has room;
    /// otherwise a later batch or session tries again.
    pub(super) fn learn_if_due(&mut self, turn: &mut Turn<'_>) -> Result<(), ServiceError> {
        if self.open.as_ref().is_some_and(|open| open.importing) {
            return Ok(());
        }
        let open = self.open_training_session();
        let calibrated = self.rig.calibration.is_some();
        let Some(training) = self.learning.due(calibrated, open.as_ref()) else { return Ok(()) };
        let Some(room) = turn.env.jobs.reserve() else { return Ok(()) };
        let sessions: Vec<&str> = training.iter().map(|t| t.id.as_str()).collect();
        let row = CalibrationRow {
            id: Uuid::now_v7().to_string(),
            asset: self.row.name.clone(),
            state: JobState::Queued.to_string(),
            sessions: views::to_json(&sessions)?,
            made_at: turn.at,
            active: 0,
            document: None,
            error: None,
            made_by: Some(ACTOR.to_owned()),
            activated_by: None,
            activated_at: None,
        };
        let id = row.id.clone();
        turn.writes.push(Write::PutCalibration(row));
        let cost = job::calibration_cost(training.iter().map(|t| t.n_samples).sum());
        let job = Job::Calibration(id.clone());
        turn.jobs.push((room, NewJob { job, asset: self.row.name.clone(), cost }));
        self.learning.begin(id, training, open.as_ref());
        self.write_learning(turn)
    }

    /// Returns the open session up to now, if it may be used for calibration.
    fn open_training_session(&self) -> Option<TrainingSession> {
        let open = self.open.as_ref().filter(|open| !open.judging.has_confirmed())?;
        training_session(open)
    }

    /// Adds a session that has ended with `summary` to the sessions to learn from;
    /// `has_warning` is set if it caused a drift warning. If the rig is not calibrated, a
    /// session without a confirmed fault is added. Otherwise only one in which every
    /// monitor completed without a finding, so that neither a fault nor drift is learnt as
    /// healthy.
    pub(super) fn gather(
        &mut self,
        open: &OpenSession,
        summary: &SummaryView,
        has_warning: bool,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        let calibrated = self.rig.calibration.is_some();
        let healthy = match calibrated {
            true => summary.outcome == Some(Outcome::NoFault) && !has_warning,
            false => summary.faults.is_empty(),
        };
        let Some(session) = training_session(open).filter(|_| healthy) else { return Ok(()) };
        self.learning.gather(calibrated, session);
        self.write_learning(turn)
    }

    /// Records the outcome of a calibration job. The result of an automatic one is offered,
    /// or activated if it refines the active calibration.
    pub(super) fn finish_calibration(
        &mut self,
        row: CalibrationRow,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        let calibrated = self.rig.calibration.is_some();
        let document: Option<CalibrationView> =
            row.document.as_deref().map(views::from_json).transpose()?;
        let id = row.id.clone();
        let outcome = self.learning.ended(calibrated, &id, row.error.as_deref());
        turn.writes.push(Write::PutCalibration(row));
        match (outcome, document) {
            (CalibrationEnd::NotRequested, _) => return Ok(()),
            (CalibrationEnd::Refines, Some(calibration)) => {
                self.activate_calibration(calibration, &id, Some(ACTOR.to_owned()), turn)?;
                let target = format!("/api/v1/assets/{}/calibrations/{id}", self.row.name);
                let action = "refine_calibration".to_owned();
                let entry = AuditEntry { action, target, address: None, by: None };
                let row = entry.row((ACTOR, None), turn.at);
                turn.writes.push(Write::Access(AccessWrite::Audit(row)));
            }
            _ => {}
        }
        self.write_learning(turn)?;
        self.learn_if_due(turn)
    }

    /// Activates the calibration `id` on request of the person `by`.
    pub(super) fn activate(
        &mut self,
        calibration: CalibrationView,
        id: &str,
        by: Option<String>,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        self.activate_calibration(calibration, id, by, turn)?;
        self.learning.activated(id);
        self.write_learning(turn)
    }

    /// Returns the id of the calibration that waits to be accepted.
    pub(super) fn offered_calibration(&self) -> Option<String> {
        self.learning.offered().map(str::to_owned)
    }

    /// The person `by` confirms that the rig was healthy: activates the calibration `id` if it is
    /// still offered.
    pub(super) fn accept_learning(
        &mut self,
        calibration: CalibrationView,
        id: &str,
        by: Option<String>,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        if self.learning.offered() != Some(id) {
            return Err(ServiceError::NothingOffered { asset: self.row.name.clone() });
        }
        self.activate(calibration, id, by, turn)
    }

    /// A person states that the rig was not healthy: discards the gathered motion,
    /// including that of the open session.
    pub(super) fn discard_learning(&mut self, turn: &mut Turn<'_>) -> Result<(), ServiceError> {
        if self.rig.calibration.is_some() {
            return Err(ServiceError::AlreadyLearnt { asset: self.row.name.clone() });
        }
        let open = self.open.as_ref().map(|open| open.id.clone());
        self.learning.discard(open);
        self.write_learning(turn)
    }

    /// Writes the calibration `id` to the asset file.
    fn activate_calibration(
        &mut self,
        calibration: CalibrationView,
        id: &str,
        by: Option<String>,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        let mut file = asset::view(&self.rig);
        file.calibration = Some(calibration);
        self.rig = asset::rig(&file)?;
        self.write_file(views::to_json(&file)?, turn);
        let (asset, id) = (self.row.name.clone(), id.to_owned());
        turn.writes.push(Write::ActivateCalibration { asset, id, by, at: turn.at });
        Ok(())
    }

    /// Writes the learning record.
    pub(super) fn write_learning(&self, turn: &mut Turn<'_>) -> Result<(), ServiceError> {
        let (asset, document) = (self.row.name.clone(), views::to_json(&self.learning)?);
        turn.writes.push(Write::PutLearning { asset, document });
        Ok(())
    }

    /// Returns the progress of the automatic calibration.
    pub(crate) fn learning(&self) -> LearningView {
        let (record, open) = (&self.learning, self.open_training_session());
        let calibration = self.rig.calibration.as_ref();
        let calibrated = calibration.is_some();
        let training = record.training_sessions(calibrated, open.as_ref());
        let n_sessions = match calibration {
            Some(calibration) if !record.is_automatic() => calibration.sessions.len(),
            _ => training.len(),
        };
        let motion = record.motion(open.as_ref());
        LearningView {
            asset: self.row.name.clone(),
            state: record.state(calibrated),
            summary: self.learning_summary(n_sessions, open.as_ref()),
            wanted_s: record.wanted_s(),
            x_s: motion.x,
            y_s: motion.y,
            t_s: self.open.as_ref().and_then(|open| open.judging.newest_t_s()),
            sessions: training.into_iter().map(session_view).collect(),
            n_sessions,
            calibration: record.job().map(str::to_owned),
            refused: record.refusal().map(|refusal| refusal.reason.clone()),
            by_itself: calibrated && record.is_automatic(),
            refines: calibrated && record.refines(),
        }
    }

    /// Describes the state in a sentence.
    fn learning_summary(&self, n_sessions: usize, open: Option<&TrainingSession>) -> String {
        let sessions = format!("{n_sessions} session{}", if n_sessions == 1 { "" } else { "s" });
        match self.learning.state(self.rig.calibration.is_some()) {
            LearningState::Gathering => self.describe_gathering(open),
            LearningState::Learning => {
                format!("Enough motion gathered: the rig is being calibrated from {sessions}.")
            }
            LearningState::Offered => {
                format!("Calibrated from {sessions}: was the rig healthy during these recordings?")
            }
            LearningState::Learnt => self.describe_calibration(&sessions),
        }
    }

    /// Describes what is missing before the rig can be calibrated.
    fn describe_gathering(&self, open: Option<&TrainingSession>) -> String {
        let misfits = self.open.as_ref().map(|open| open.judging.misfits()).unwrap_or_default();
        if let Some(misfit) = misfits.into_iter().find(|misfit| misfit.prevents_learning()) {
            return format!("The rig cannot be calibrated from this telemetry: {misfit}.");
        }
        if self.open.as_ref().is_some_and(|open| !open.is_known()) {
            return "The motion of the open session counts again with its next sample.".to_owned();
        }
        let (motion, wanted_s) = (self.learning.motion(open), self.learning.wanted_s());
        let axes = [(Axis::X, motion.x), (Axis::Y, motion.y)];
        let axes: Vec<(Axis, f64)> =
            axes.into_iter().filter_map(|(axis, s)| Some((axis, s?))).collect();
        let last_refusal = match self.learning.refusal() {
            Some(refusal) => format!(" The last attempt was refused: {}.", refusal.reason),
            None => String::new(),
        };
        let still: Vec<&str> =
            axes.iter().filter(|(_, s)| *s < MOVED_S).map(|(axis, _)| axis.as_str()).collect();
        let progress: Vec<String> = axes
            .iter()
            .map(|(axis, s)| format!("{} {:.0} of {wanted_s:.0} s", axis.as_str(), s.floor()))
            .collect();
        match (axes.is_empty(), still.as_slice()) {
            (true, _) => {
                "Waiting for motion: send commands and positions while the ball rolls.".to_owned()
            }
            (false, []) => format!("Gathering motion: {}.{last_refusal}", progress.join(", ")),
            (false, [axis]) => format!(
                "No motion along {axis} yet: record steps or circles of a few degrees. So far \
                 {}.{last_refusal}",
                progress.join(", ")
            ),
            (false, _) => format!(
                "The ball has not moved yet: record steps or circles of a few degrees.\
                 {last_refusal}"
            ),
        }
    }

    /// Describes the active calibration, and whether it will be refined.
    fn describe_calibration(&self, sessions: &str) -> String {
        let mut text = match (self.learning.is_automatic(), self.learning.refines()) {
            (false, _) => {
                format!("Calibrated from {sessions} chosen by a person; not refined automatically.")
            }
            (true, true) => format!(
                "Calibrated from {sessions}; further healthy sessions refine it until it is based \
                 on {REFINED_SESSIONS}."
            ),
            (true, false) => format!(
                "Calibrated from {sessions}; no longer refined, so that later drift can be \
                 detected."
            ),
        };
        if let Some(refusal) = self.learning.refusal() {
            text += &format!(" The last refinement was refused: {}.", refusal.reason);
        }
        let calibration =
            |open: &OpenSession| open.judging.engine().setup().rig.calibration.clone();
        if self.open.as_ref().is_some_and(|open| calibration(open) != self.rig.calibration) {
            text += " The open session started earlier and does not use it; the next one does.";
        }
        text
    }
}

/// Returns `open` up to now as a training session; `None` if its motion is not counted.
fn training_session(open: &OpenSession) -> Option<TrainingSession> {
    let motion = open.motion.as_ref()?.seconds().into();
    let (id, name, n_samples) = (open.id.clone(), open.name.clone(), open.progress.n_samples);
    Some(TrainingSession { id, name, n_samples, motion })
}

fn session_view(training: &TrainingSession) -> TeachingSessionView {
    TeachingSessionView { id: training.id.clone(), name: training.name.clone() }
}
