//! A rig that learns by itself: motion is gathered while sessions run, and once it is
//! enough the shard asks for a calibration; somebody says that the rig was healthy,
//! and later healthy sessions refine what was learnt.
//!
//! What is gathered and decided is in [`record`]; this brings it together with the
//! running asset, the jobs and the interface.

mod record;

use uuid::Uuid;

use self::record::{CalibrationEnd, REFINED_SESSIONS};
pub(super) use self::record::{Record, Teaching};
use super::access::Deed;
use super::jobs::Job;
use super::running::{OpenSession, Running, Work};
use super::shard::Context;
use super::{Service, ServiceError, views};
use crate::store::{AccessWrite, CalibrationRow, JobState, Write};
use crate::wire::asset::{self, CalibrationView};
use crate::wire::learning::{LearningState, LearningView, TeachingSessionView};
use crate::wire::verdict::{Outcome, SummaryView};
use offbd_core::vocabulary::Axis;

/// Who refines, in the audit log.
const ITSELF: &str = "offbd";

/// Motion below which an axis counts as not having moved, s.
const MOVED_S: f64 = 1.0;

impl Service {
    /// How far `asset` is on its way to being learnt, samples under way included.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn learning(&self, asset: &str) -> Result<LearningView, ServiceError> {
        self.look(asset, Running::learning_view).await
    }

    /// Somebody says that the rig was healthy: the calibration on offer comes into
    /// force. An open session goes on without it; the next one uses it.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::NothingOffered`].
    pub async fn accept_learning(&self, asset: &str) -> Result<LearningView, ServiceError> {
        let nothing = || ServiceError::NothingOffered { asset: asset.to_owned() };
        // Once this is answered, what was offered is durable.
        let offered =
            self.call(asset, |_, running, _| Ok(running.learning.offered().map(str::to_owned)));
        let id = offered.await?.ok_or_else(nothing)?;
        let document = self.calibration_row(asset, &id).await?.document.ok_or_else(nothing)?;
        let learnt: CalibrationView = views::from_json(&document)?;
        let nothing = nothing();
        self.call(asset, move |_, running, work| match running.learning.offered() {
            Some(offered) if offered == id => running.activate(learnt, &id, work),
            _ => Err(nothing),
        })
        .await?;
        self.learning(asset).await
    }

    /// Somebody says that the rig was not healthy: what was gathered, the open session
    /// so far included, is forgotten, and gathering begins anew.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::AlreadyLearnt`].
    pub async fn discard_learning(&self, asset: &str) -> Result<LearningView, ServiceError> {
        self.call(asset, |_, running, work| {
            if running.rig.calibration.is_some() {
                let asset = running.row.name.clone();
                return Err(ServiceError::AlreadyLearnt { asset });
            }
            let open = running.open.as_ref().map(|open| open.id.clone());
            running.learning.discard(open);
            running.keep_learning(work)
        })
        .await?;
        self.learning(asset).await
    }
}

impl Running {
    /// Begins to learn if there is enough to learn from and room for a job; else it is
    /// for a later batch or session.
    pub(super) fn learn_if_due(
        &mut self,
        context: &Context,
        work: &mut Work,
    ) -> Result<(), ServiceError> {
        if self.open.as_ref().is_some_and(|open| open.importing) {
            return Ok(());
        }
        let open = self.open_teaching();
        let learnt = self.rig.calibration.is_some();
        let Some(teaching) = self.learning.due(learnt, open.as_ref()) else { return Ok(()) };
        let Ok(place) = context.jobs.clone().try_reserve_owned() else { return Ok(()) };
        let sessions: Vec<&str> = teaching.iter().map(|t| t.id.as_str()).collect();
        let row = CalibrationRow {
            id: Uuid::now_v7().to_string(),
            asset: self.row.name.clone(),
            state: JobState::Queued.to_string(),
            sessions: views::to_json(&sessions)?,
            made_at: work.at,
            active: 0,
            document: None,
            error: None,
        };
        let id = row.id.clone();
        work.writes.push(Write::PutCalibration(row));
        work.jobs.push((place, Job::Calibration(id.clone())));
        self.learning.begin(id, teaching, open.as_ref());
        self.keep_learning(work)
    }

    /// What the open session may teach so far.
    fn open_teaching(&self) -> Option<Teaching> {
        let open = self.open.as_ref().filter(|open| !open.judging.has_confirmed())?;
        teaching(open)
    }

    /// Takes note of a session that has ended with `summary`; `warned` if it led to a
    /// warning of drift. Before a rig is learnt a session teaches unless a fault was
    /// confirmed; afterwards only if every monitor found nothing, lest a fault or a
    /// drift be learnt for healthy.
    pub(super) fn gather(
        &mut self,
        open: &OpenSession,
        summary: &SummaryView,
        warned: bool,
        work: &mut Work,
    ) -> Result<(), ServiceError> {
        let learnt = self.rig.calibration.is_some();
        let healthy = match learnt {
            true => summary.outcome == Some(Outcome::NoFault) && !warned,
            false => summary.faults.is_empty(),
        };
        let Some(session) = teaching(open).filter(|_| healthy) else { return Ok(()) };
        self.learning.gather(learnt, session);
        self.keep_learning(work)
    }

    /// The calibration of `row` has ended; if it is one that the rig asked for, it is
    /// offered, or refines what is in force.
    pub(super) fn calibrated(
        &mut self,
        context: &Context,
        row: CalibrationRow,
        work: &mut Work,
    ) -> Result<(), ServiceError> {
        let learnt = self.rig.calibration.is_some();
        let document: Option<CalibrationView> =
            row.document.as_deref().map(views::from_json).transpose()?;
        let id = row.id.clone();
        let outcome = self.learning.ended(learnt, &id, row.error.as_deref());
        work.writes.push(Write::PutCalibration(row));
        match (outcome, document) {
            (CalibrationEnd::NotAsked, _) => return Ok(()),
            (CalibrationEnd::Refines, Some(calibration)) => {
                self.put_in_force(calibration, &id, work)?;
                let target = format!("/api/v1/assets/{}/calibrations/{id}", self.row.name);
                let deed = Deed { act: "refine_calibration".to_owned(), target, address: None };
                let row = deed.row((ITSELF, None), work.at);
                work.writes.push(Write::Access(AccessWrite::Audit(row)));
            }
            _ => {}
        }
        self.keep_learning(work)?;
        self.learn_if_due(context, work)
    }

    /// Somebody puts the calibration `id` into force.
    pub(super) fn activate(
        &mut self,
        calibration: CalibrationView,
        id: &str,
        work: &mut Work,
    ) -> Result<(), ServiceError> {
        self.put_in_force(calibration, id, work)?;
        self.learning.activated(id);
        self.keep_learning(work)
    }

    /// Puts the calibration `id` into the asset file.
    fn put_in_force(
        &mut self,
        calibration: CalibrationView,
        id: &str,
        work: &mut Work,
    ) -> Result<(), ServiceError> {
        let mut file = asset::view(&self.rig);
        file.calibration = Some(calibration);
        self.rig = asset::rig(&file)?;
        self.update(views::to_json(&file)?, work);
        let (asset, id) = (self.row.name.clone(), id.to_owned());
        work.writes.push(Write::ActivateCalibration { asset, id });
        Ok(())
    }

    /// Writes the record of what was learnt.
    pub(super) fn keep_learning(&self, work: &mut Work) -> Result<(), ServiceError> {
        let (asset, document) = (self.row.name.clone(), views::to_json(&self.learning)?);
        work.writes.push(Write::PutLearning { asset, document });
        Ok(())
    }

    /// How far the rig is on its way to being learnt.
    pub(super) fn learning_view(&self) -> LearningView {
        let (record, open) = (&self.learning, self.open_teaching());
        let calibration = self.rig.calibration.as_ref();
        let learnt = calibration.is_some();
        let teaching = record.teaching(learnt, open.as_ref());
        let n_sessions = match calibration {
            Some(calibration) if !record.by_itself() => calibration.sessions.len(),
            _ => teaching.len(),
        };
        let motion = record.motion(open.as_ref());
        LearningView {
            asset: self.row.name.clone(),
            state: record.state(learnt),
            summary: self.learning_summary(n_sessions, open.as_ref()),
            wanted_s: record.wanted_s(),
            x_s: motion.x,
            y_s: motion.y,
            sessions: teaching.into_iter().map(session_view).collect(),
            n_sessions,
            calibration: record.job().map(str::to_owned),
            refused: record.refusal().map(|refusal| refusal.reason.clone()),
            by_itself: learnt && record.by_itself(),
            refines: learnt && record.refines(),
        }
    }

    /// The state in words.
    fn learning_summary(&self, n_sessions: usize, open: Option<&Teaching>) -> String {
        let sessions = format!("{n_sessions} session{}", if n_sessions == 1 { "" } else { "s" });
        match self.learning.state(self.rig.calibration.is_some()) {
            LearningState::Gathering => self.missing(open),
            LearningState::Learning => {
                format!("Enough motion has come: the rig is being learnt from {sessions}.")
            }
            LearningState::Offered => {
                format!("Learnt from {sessions}: was the rig healthy in what was recorded?")
            }
            LearningState::Learnt => self.learnt_words(&sessions),
        }
    }

    /// What is missing before the rig can be learnt.
    fn missing(&self, open: Option<&Teaching>) -> String {
        let misfits = self.open.as_ref().map(|open| open.judging.misfits()).unwrap_or_default();
        if let Some(misfit) = misfits.into_iter().find(|misfit| misfit.prevents_learning()) {
            return format!("Nothing can be learnt from what comes: {misfit}.");
        }
        let (motion, wanted_s) = (self.learning.motion(open), self.learning.wanted_s());
        let along = [(Axis::X, motion.x), (Axis::Y, motion.y)];
        let along: Vec<(Axis, f64)> =
            along.into_iter().filter_map(|(axis, s)| Some((axis, s?))).collect();
        let again = match self.learning.refusal() {
            Some(refusal) => format!(" The last try was refused: {}.", refusal.reason),
            None => String::new(),
        };
        let still: Vec<&str> =
            along.iter().filter(|(_, s)| *s < MOVED_S).map(|(axis, _)| axis.as_str()).collect();
        let progress: Vec<String> = along
            .iter()
            .map(|(axis, s)| format!("{} {:.0} of {wanted_s:.0} s", axis.as_str(), s.floor()))
            .collect();
        match (along.is_empty(), still.as_slice()) {
            (true, _) => {
                "Waiting for motion: send commands and positions while the ball rolls.".to_owned()
            }
            (false, []) => format!("Gathering motion: {}.{again}", progress.join(", ")),
            (false, [axis]) => format!(
                "{axis} has not moved yet: record steps or circles of a few degrees. So far {}.{again}",
                progress.join(", ")
            ),
            (false, _) => format!(
                "The ball has not moved yet: record steps or circles of a few degrees.{again}"
            ),
        }
    }

    /// What was learnt, and whether it stays as it is.
    fn learnt_words(&self, sessions: &str) -> String {
        let mut words = match (self.learning.by_itself(), self.learning.refines()) {
            (false, _) => format!("Learnt from {sessions}, by hand: it stays as it is."),
            (true, true) => format!(
                "Learnt from {sessions}; the next healthy ones refine it until {REFINED_SESSIONS} \
                 have taught."
            ),
            (true, false) => format!(
                "Learnt from {sessions}; it stays as it is, so that later drift is seen against it."
            ),
        };
        if let Some(refusal) = self.learning.refusal() {
            words += &format!(" The last refinement was refused: {}.", refusal.reason);
        }
        let calibration =
            |open: &OpenSession| open.judging.engine().setup().rig.calibration.clone();
        if self.open.as_ref().is_some_and(|open| calibration(open) != self.rig.calibration) {
            words +=
                " The open session began before and is judged without it; the next one uses it.";
        }
        words
    }
}

/// What `open` has taught so far; none where its motion is not counted.
fn teaching(open: &OpenSession) -> Option<Teaching> {
    let motion = open.motion.as_ref()?.seconds().into();
    let (id, name, n_samples) = (open.id.clone(), open.name.clone(), open.progress.n_samples);
    Some(Teaching { id, name, n_samples, motion })
}

fn session_view(teaching: &Teaching) -> TeachingSessionView {
    TeachingSessionView { id: teaching.id.clone(), name: teaching.name.clone() }
}
