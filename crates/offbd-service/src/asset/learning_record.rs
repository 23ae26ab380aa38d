//! The state of a rig's automatic calibration: the gathered sessions, the offered
//! calibration, the sessions of the active one.
//!
//! Every event is a method call on the rig's shard. The record is stored as a JSON
//! document, so that a restart changes nothing. Independent of store, jobs and clock.

use serde::{Deserialize, Serialize};

use crate::limits::{MAX_CALIBRATION_SAMPLES, MAX_CALIBRATION_SESSIONS};
use offbd_core::engine::WANTED_MOTION_S;
use offbd_core::vocabulary::PerAxis;
use offbd_wire::learning::LearningState;

/// Sessions after which a calibration is no longer refined, so that later drift is
/// measured against the initial condition of the rig. Level and gain differ from session to
/// session; five sessions determine their spread to a third.
pub(crate) const REFINED_SESSIONS: usize = 5;

/// Motion along each axis that a session needs to refine a calibration, s: half of a first
/// recording, each half of which must be sufficient for a calibration by itself.
const REFINING_S: f64 = WANTED_MOTION_S / 2.0;

/// Factor of the motion of a refused calibration with which it is tried again: half as much
/// again may change the result, and retries become rare.
const RETRY_FACTOR: f64 = 1.5;

/// Durations of usable motion, s; `None` for an axis without commands or positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct MotionSeconds {
    pub(crate) x: Option<f64>,
    pub(crate) y: Option<f64>,
}

impl From<PerAxis<Option<f64>>> for MotionSeconds {
    fn from(PerAxis { x, y }: PerAxis<Option<f64>>) -> Self {
        Self { x, y }
    }
}

impl MotionSeconds {
    fn add(self, other: Self) -> Self {
        let sum = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (None, None) => None,
            _ => Some(a.unwrap_or(0.0) + b.unwrap_or(0.0)),
        };
        Self { x: sum(self.x, other.x), y: sum(self.y, other.y) }
    }

    /// Returns what is left after the part `before`.
    pub(crate) fn after(self, before: Self) -> Self {
        let left = |whole: Option<f64>, before: Option<f64>| Some(whole? - before.unwrap_or(0.0));
        Self { x: left(self.x, before.x), y: left(self.y, before.y) }
    }

    /// Returns the shorter of the two durations; `None` without any axis.
    pub(crate) fn shortest(self) -> Option<f64> {
        self.x.into_iter().chain(self.y).reduce(f64::min)
    }

    /// Whether there is motion along any axis.
    pub(crate) fn any(self) -> bool {
        self.x.into_iter().chain(self.y).any(|s| s > 0.0)
    }
}

/// A session, or the start of one, that a calibration learns from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct TrainingSession {
    pub(crate) id: String,
    pub(crate) name: String,
    /// Number of samples to use, from the start. Nobody has confirmed that the rig was
    /// healthy in later ones.
    pub(crate) n_samples: i64,
    pub(crate) motion: MotionSeconds,
}

/// Why a calibration was refused, and the motion needed for the next attempt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct LearningRefusal {
    pub(crate) reason: String,
    /// Motion along each axis for the next attempt, s.
    pub(crate) wanted_s: f64,
}

/// The phase of the automatic calibration. Part of the stored document.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Phase {
    #[default]
    Gathering,
    /// The calibration `job` learns from the sessions `teaching`, with at least `least_s`
    /// of motion along each axis.
    Learning { job: String, teaching: Vec<TrainingSession>, least_s: f64 },
    /// The calibration is done and waits until a person confirms that the rig was healthy.
    Offered { job: String, teaching: Vec<TrainingSession> },
}

/// The effect of a calibration job that has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CalibrationEnd {
    /// The job is not the one that this record started last.
    NotRequested,
    /// The calibration is offered for acceptance.
    Offered,
    /// It replaces the active calibration.
    Refines,
    Refused,
}

/// The state of a rig's automatic calibration. Stored as a JSON document.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct LearningRecord {
    phase: Phase,
    /// Gathered sessions for the next calibration, oldest first.
    sessions: Vec<TrainingSession>,
    /// Motion of older sessions that are no longer in `sessions`.
    earlier: MotionSeconds,
    refusal: Option<LearningRefusal>,
    /// Id of the open session if a person has stated that the rig was not healthy in it.
    left_out: Option<String>,
    /// The sessions of the active calibration if it is an automatic one.
    taught: Vec<TrainingSession>,
}

impl LearningRecord {
    /// Returns the gathered motion, including that of the `open` session.
    pub(crate) fn motion(&self, open: Option<&TrainingSession>) -> MotionSeconds {
        let open = open.filter(|open| self.is_usable(open));
        let each = self.sessions.iter().chain(open).map(|session| session.motion);
        each.fold(self.earlier, MotionSeconds::add)
    }

    /// Returns the motion along each axis that the next calibration needs, s.
    pub(crate) fn wanted_s(&self) -> f64 {
        self.refusal.as_ref().map_or(WANTED_MOTION_S, |refusal| refusal.wanted_s)
    }

    /// Whether the active calibration was learnt automatically.
    pub(crate) const fn is_automatic(&self) -> bool {
        !self.taught.is_empty()
    }

    /// Whether later healthy sessions refine the active calibration.
    pub(crate) const fn refines(&self) -> bool {
        self.is_automatic() && self.taught.len() < REFINED_SESSIONS
    }

    pub(crate) const fn refusal(&self) -> Option<&LearningRefusal> {
        self.refusal.as_ref()
    }

    /// Returns the state of a rig that is `calibrated` or not.
    pub(crate) const fn state(&self, calibrated: bool) -> LearningState {
        match (calibrated, &self.phase) {
            (true, _) => LearningState::Learnt,
            (false, Phase::Gathering) => LearningState::Gathering,
            (false, Phase::Learning { .. }) => LearningState::Learning,
            (false, Phase::Offered { .. }) => LearningState::Offered,
        }
    }

    /// Returns the sessions of the active, running or offered calibration, or else those
    /// gathered so far.
    pub(crate) fn training_sessions<'a>(
        &'a self,
        calibrated: bool,
        open: Option<&'a TrainingSession>,
    ) -> Vec<&'a TrainingSession> {
        match &self.phase {
            _ if calibrated => self.taught.iter().collect(),
            Phase::Learning { teaching, .. } | Phase::Offered { teaching, .. } => {
                teaching.iter().collect()
            }
            Phase::Gathering => {
                let open = open.filter(|open| self.is_usable(open));
                self.sessions.iter().chain(open).collect()
            }
        }
    }

    /// Returns the id of the running or offered calibration.
    pub(crate) const fn job(&self) -> Option<&str> {
        match &self.phase {
            Phase::Gathering => None,
            Phase::Learning { job, .. } | Phase::Offered { job, .. } => Some(job.as_str()),
        }
    }

    /// Returns the id of the offered calibration.
    pub(crate) const fn offered(&self) -> Option<&str> {
        match &self.phase {
            Phase::Offered { job, .. } => Some(job.as_str()),
            Phase::Gathering | Phase::Learning { .. } => None,
        }
    }

    /// Returns the sessions that the running calibration `id` learns from; `None` if this
    /// record did not start it.
    pub(crate) fn sessions_of(&self, id: &str) -> Option<&[TrainingSession]> {
        match &self.phase {
            Phase::Learning { job, teaching, .. } if job == id => Some(teaching),
            _ => None,
        }
    }

    fn is_usable(&self, session: &TrainingSession) -> bool {
        session.motion.any() && self.left_out.as_deref() != Some(&session.id)
    }

    /// Returns the sessions for a calibration that can be started now. If the rig is not
    /// `calibrated`, these are the gathered sessions and the `open` one, once they have
    /// enough motion; for a refinement, the sessions of the active calibration and those
    /// gathered since.
    pub(crate) fn due(
        &self,
        calibrated: bool,
        open: Option<&TrainingSession>,
    ) -> Option<Vec<TrainingSession>> {
        if self.phase != Phase::Gathering {
            return None;
        }
        if calibrated {
            let can_refine = self.refines() && !self.sessions.is_empty();
            let all = self.taught.iter().chain(&self.sessions).take(REFINED_SESSIONS);
            return can_refine.then(|| all.cloned().collect());
        }
        let shortest_s = self.motion(open).shortest();
        let enough = shortest_s.is_some_and(|shortest_s| shortest_s >= self.wanted_s());
        let open = open.filter(|open| self.is_usable(open));
        enough.then(|| latest(self.sessions.iter().chain(open)))
    }

    /// Records that the calibration `job` learns from the sessions `teaching`.
    pub(crate) fn begin(
        &mut self,
        job: String,
        teaching: Vec<TrainingSession>,
        open: Option<&TrainingSession>,
    ) {
        let least_s = self.motion(open).shortest().unwrap_or(0.0);
        self.phase = Phase::Learning { job, teaching, least_s };
    }

    /// Adds a healthy session that has ended, if it is usable.
    pub(crate) fn gather(&mut self, calibrated: bool, session: TrainingSession) {
        if !self.is_usable(&session) {
            self.left_out = self.left_out.take().filter(|id| *id != session.id);
            return;
        }
        if calibrated {
            let shortest_s = session.motion.shortest();
            let enough = shortest_s.is_some_and(|shortest_s| shortest_s >= REFINING_S);
            if self.refines() && enough && self.sessions.len() < REFINED_SESSIONS {
                self.sessions.push(session);
            }
            return;
        }
        self.sessions.push(session);
        if self.sessions.len() > MAX_CALIBRATION_SESSIONS {
            self.earlier = self.earlier.add(self.sessions.remove(0).motion);
        }
    }

    /// Records that the calibration `job` has ended, `refused` for this reason or done.
    pub(crate) fn ended(
        &mut self,
        calibrated: bool,
        job: &str,
        refused: Option<&str>,
    ) -> CalibrationEnd {
        if self.sessions_of(job).is_none() {
            return CalibrationEnd::NotRequested;
        }
        let Phase::Learning { job, teaching, least_s } = std::mem::take(&mut self.phase) else {
            return CalibrationEnd::NotRequested;
        };
        match refused {
            Some(reason) => {
                let wanted_s = WANTED_MOTION_S.max(RETRY_FACTOR * least_s);
                self.refusal = Some(LearningRefusal { reason: reason.to_owned(), wanted_s });
                if calibrated {
                    // These sessions are not consistent with the active calibration.
                    self.sessions.retain(|s| !teaching.iter().any(|t| t.id == s.id));
                }
                CalibrationEnd::Refused
            }
            None if calibrated => {
                self.sessions.retain(|s| !teaching.iter().any(|t| t.id == s.id));
                (self.taught, self.refusal) = (teaching, None);
                CalibrationEnd::Refines
            }
            None => {
                self.phase = Phase::Offered { job, teaching };
                CalibrationEnd::Offered
            }
        }
    }

    /// Records that the calibration `id` is active: the offered one, or one that a person
    /// started.
    pub(crate) fn activated(&mut self, id: &str) {
        let taught = match std::mem::take(&mut self.phase) {
            Phase::Offered { job, teaching } if job == id => teaching,
            _ => Vec::new(),
        };
        *self = Self { taught, ..Self::default() };
    }

    /// Records that the asset file has another calibration, or none any more.
    pub(crate) fn calibration_replaced(&mut self) {
        *self = Self::default();
    }

    /// Records that the description of the rig has changed, which invalidates an offered
    /// or refused calibration.
    pub(crate) fn description_changed(&mut self) {
        (self.phase, self.refusal) = (Phase::Gathering, None);
    }

    /// Discards the gathered sessions and the `open` one, because the rig was not healthy.
    pub(crate) fn discard(&mut self, open: Option<String>) {
        *self = Self { left_out: open, ..Self::default() };
    }

    /// Removes a deleted session; returns whether the record has changed.
    pub(crate) fn remove(&mut self, id: &str, open: bool) -> bool {
        let before = self.sessions.len();
        self.sessions.retain(|session| session.id != id);
        if open {
            self.left_out = Some(id.to_owned());
        }
        open || self.sessions.len() < before
    }
}

/// Returns the latest of `sessions` within the limits of a calibration, at least one.
fn latest<'a>(
    sessions: impl DoubleEndedIterator<Item = &'a TrainingSession>,
) -> Vec<TrainingSession> {
    let (mut n_samples, limit) = (0, i64::try_from(MAX_CALIBRATION_SAMPLES).unwrap_or(i64::MAX));
    let fits = |session: &&TrainingSession| {
        let first = n_samples == 0;
        n_samples += session.n_samples;
        first || n_samples <= limit
    };
    let newest = sessions.rev().take(MAX_CALIBRATION_SESSIONS).take_while(fits);
    let mut chosen: Vec<TrainingSession> = newest.cloned().collect();
    chosen.reverse();
    chosen
}

#[cfg(test)]
mod tests;
