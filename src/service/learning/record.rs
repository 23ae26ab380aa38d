//! What is kept of a rig's learning by itself: what was gathered, what is offered,
//! what taught.
//!
//! One idea: all that happens is a method, called on the rig's shard; the store
//! keeps the record as a document, so that a restart changes nothing. Knows no
//! store, no job and no clock.

use serde::{Deserialize, Serialize};

use crate::service::calibrations::{MAX_SAMPLES, MAX_SESSIONS};
use crate::wire::learning::LearningState;
use offbd_core::engine::WANTED_MOTION_S;
use offbd_core::vocabulary::PerAxis;

/// Sessions with which a calibration is refined no further: later drift is measured
/// against what a rig was like at first, not against what it has become. Level and
/// gain differ from session to session; of five the spread is known to a third.
pub(super) const REFINED_SESSIONS: usize = 5;

/// Motion along each axis with which a session refines, s: as much as each half of a
/// first recording has, which must teach by itself too.
const REFINING_S: f64 = WANTED_MOTION_S / 2.0;

/// Times as much motion as was refused with which learning is tried again: half as
/// much again may say something new, and tries become rare.
const TRY_AGAIN: f64 = 1.5;

/// Seconds of usable motion; none along an axis without commands or positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::service) struct Seconds {
    pub(super) x: Option<f64>,
    pub(super) y: Option<f64>,
}

impl From<PerAxis<Option<f64>>> for Seconds {
    fn from(PerAxis { x, y }: PerAxis<Option<f64>>) -> Self {
        Self { x, y }
    }
}

impl Seconds {
    fn plus(self, other: Self) -> Self {
        let sum = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (None, None) => None,
            _ => Some(a.unwrap_or(0.0) + b.unwrap_or(0.0)),
        };
        Self { x: sum(self.x, other.x), y: sum(self.y, other.y) }
    }

    /// Of the axis that has least; none without any.
    pub(super) fn least(self) -> Option<f64> {
        self.x.into_iter().chain(self.y).reduce(f64::min)
    }

    /// Whether anything has moved.
    pub(super) fn moved(self) -> bool {
        self.x.into_iter().chain(self.y).any(|s| s > 0.0)
    }
}

/// A session, or the beginning of one, that teaches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::service) struct Teaching {
    pub(in crate::service) id: String,
    pub(super) name: String,
    /// Its first samples, which teach: what came later has not been vouched for.
    pub(in crate::service) n_samples: i64,
    pub(super) motion: Seconds,
}

/// Why nothing could be learnt, and how much more it takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Refusal {
    pub(super) reason: String,
    /// Motion along each axis with which it is tried again, s.
    pub(super) wanted_s: f64,
}

/// What is under way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Phase {
    #[default]
    Gathering,
    /// The calibration `job` learns from `teaching`, of so much motion.
    Learning { job: String, teaching: Vec<Teaching>, least_s: f64 },
    /// It is done, and waits for somebody to say that the rig was healthy.
    Offered { job: String, teaching: Vec<Teaching> },
}

/// What a calibration that has ended comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CalibrationEnd {
    /// It is none of this record's, or not any more.
    NotAsked,
    Offered,
    /// It takes the place of the one in force.
    Refines,
    Refused,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::service) struct Record {
    phase: Phase,
    /// Sessions that teach next, oldest first.
    sessions: Vec<Teaching>,
    /// Motion of those that are too old to be among them.
    earlier: Seconds,
    refusal: Option<Refusal>,
    /// The open session, if somebody has said that the rig was not healthy in it.
    left_out: Option<String>,
    /// What taught the calibration in force, if the rig learnt it by itself.
    taught: Vec<Teaching>,
}

impl Record {
    /// All motion that counts, with that of the `open` session.
    pub(super) fn motion(&self, open: Option<&Teaching>) -> Seconds {
        let open = open.filter(|open| self.may_teach(open));
        let each = self.sessions.iter().chain(open).map(|session| session.motion);
        each.fold(self.earlier, Seconds::plus)
    }

    /// Motion along each axis with which the rig is learnt, s.
    pub(super) fn wanted_s(&self) -> f64 {
        self.refusal.as_ref().map_or(WANTED_MOTION_S, |refusal| refusal.wanted_s)
    }

    /// Whether the calibration in force is one that the rig learnt by itself.
    pub(super) const fn by_itself(&self) -> bool {
        !self.taught.is_empty()
    }

    /// Whether later healthy sessions refine the calibration in force.
    pub(in crate::service) const fn refines(&self) -> bool {
        self.by_itself() && self.taught.len() < REFINED_SESSIONS
    }

    pub(super) const fn refusal(&self) -> Option<&Refusal> {
        self.refusal.as_ref()
    }

    /// The state of a rig that is `learnt` or is not.
    pub(in crate::service) const fn state(&self, learnt: bool) -> LearningState {
        match (learnt, &self.phase) {
            (true, _) => LearningState::Learnt,
            (false, Phase::Gathering) => LearningState::Gathering,
            (false, Phase::Learning { .. }) => LearningState::Learning,
            (false, Phase::Offered { .. }) => LearningState::Offered,
        }
    }

    /// The sessions that the state is about.
    pub(super) fn teaching<'a>(
        &'a self,
        learnt: bool,
        open: Option<&'a Teaching>,
    ) -> Vec<&'a Teaching> {
        match &self.phase {
            _ if learnt => self.taught.iter().collect(),
            Phase::Learning { teaching, .. } | Phase::Offered { teaching, .. } => {
                teaching.iter().collect()
            }
            Phase::Gathering => {
                let open = open.filter(|open| self.may_teach(open));
                self.sessions.iter().chain(open).collect()
            }
        }
    }

    /// The calibration that is under way or on offer.
    pub(super) const fn job(&self) -> Option<&str> {
        match &self.phase {
            Phase::Gathering => None,
            Phase::Learning { job, .. } | Phase::Offered { job, .. } => Some(job.as_str()),
        }
    }

    pub(super) const fn offered(&self) -> Option<&str> {
        match &self.phase {
            Phase::Offered { job, .. } => Some(job.as_str()),
            Phase::Gathering | Phase::Learning { .. } => None,
        }
    }

    /// What the calibration `id` learns from, if it is this record's.
    pub(in crate::service) fn lesson(&self, id: &str) -> Option<&[Teaching]> {
        match &self.phase {
            Phase::Learning { job, teaching, .. } if job == id => Some(teaching),
            _ => None,
        }
    }

    fn may_teach(&self, session: &Teaching) -> bool {
        session.motion.moved() && self.left_out.as_deref() != Some(&session.id)
    }

    /// What is to be learnt from now, if there is enough: by a rig that is not
    /// `learnt` from all that is gathered, with the `open` session; by one that refines
    /// from what taught it and what came since.
    pub(super) fn due(&self, learnt: bool, open: Option<&Teaching>) -> Option<Vec<Teaching>> {
        if self.phase != Phase::Gathering {
            return None;
        }
        if learnt {
            let more = self.refines() && !self.sessions.is_empty();
            let all = self.taught.iter().chain(&self.sessions).take(REFINED_SESSIONS);
            return more.then(|| all.cloned().collect());
        }
        let enough = self.motion(open).least().is_some_and(|least_s| least_s >= self.wanted_s());
        let open = open.filter(|open| self.may_teach(open));
        enough.then(|| latest(self.sessions.iter().chain(open)))
    }

    /// The calibration `job` learns from `teaching`.
    pub(super) fn begin(&mut self, job: String, teaching: Vec<Teaching>, open: Option<&Teaching>) {
        let least_s = self.motion(open).least().unwrap_or(0.0);
        self.phase = Phase::Learning { job, teaching, least_s };
    }

    /// A session has ended in which nothing speaks against learning from it.
    pub(super) fn gather(&mut self, learnt: bool, session: Teaching) {
        let left_out = !self.may_teach(&session);
        if left_out {
            self.left_out = self.left_out.take().filter(|id| *id != session.id);
            return;
        }
        if learnt {
            let enough = session.motion.least().is_some_and(|least_s| least_s >= REFINING_S);
            if self.refines() && enough && self.sessions.len() < REFINED_SESSIONS {
                self.sessions.push(session);
            }
            return;
        }
        self.sessions.push(session);
        if self.sessions.len() > MAX_SESSIONS {
            self.earlier = self.earlier.plus(self.sessions.remove(0).motion);
        }
    }

    /// The calibration `job` has ended: done, or refused for a reason.
    pub(super) fn ended(
        &mut self,
        learnt: bool,
        job: &str,
        refused: Option<&str>,
    ) -> CalibrationEnd {
        if self.lesson(job).is_none() {
            return CalibrationEnd::NotAsked;
        }
        let Phase::Learning { job, teaching, least_s } = std::mem::take(&mut self.phase) else {
            return CalibrationEnd::NotAsked;
        };
        match refused {
            Some(reason) => {
                let wanted_s = WANTED_MOTION_S.max(TRY_AGAIN * least_s);
                self.refusal = Some(Refusal { reason: reason.to_owned(), wanted_s });
                if learnt {
                    // They do not go together with what taught.
                    self.sessions.retain(|s| !teaching.iter().any(|t| t.id == s.id));
                }
                CalibrationEnd::Refused
            }
            None if learnt => {
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

    /// The calibration `id` is in force: the one on offer, or one that somebody made.
    pub(in crate::service) fn activated(&mut self, id: &str) {
        let taught = match std::mem::take(&mut self.phase) {
            Phase::Offered { job, teaching } if job == id => teaching,
            _ => Vec::new(),
        };
        *self = Self { taught, ..Self::default() };
    }

    /// A calibration was put into the asset file by hand, or taken out of it.
    pub(in crate::service) fn replaced(&mut self) {
        *self = Self::default();
    }

    /// The rig is described anew: what was offered or refused was of another.
    pub(in crate::service) fn described(&mut self) {
        (self.phase, self.refusal) = (Phase::Gathering, None);
    }

    /// The rig was not healthy in what was gathered, nor in the `open` session so far.
    pub(super) fn discard(&mut self, open: Option<String>) {
        *self = Self { left_out: open, ..Self::default() };
    }

    /// The session `id` is deleted; whether that changes anything.
    pub(in crate::service) fn forget(&mut self, id: &str, open: bool) -> bool {
        let before = self.sessions.len();
        self.sessions.retain(|session| session.id != id);
        if open {
            self.left_out = Some(id.to_owned());
        }
        open || self.sessions.len() < before
    }
}

/// The latest of `sessions` that one calibration may learn from, and at least one.
fn latest<'a>(sessions: impl DoubleEndedIterator<Item = &'a Teaching>) -> Vec<Teaching> {
    let (mut n_samples, limit) = (0, i64::try_from(MAX_SAMPLES).unwrap_or(i64::MAX));
    let fits = |session: &&Teaching| {
        let first = n_samples == 0;
        n_samples += session.n_samples;
        first || n_samples <= limit
    };
    let newest = sessions.rev().take(MAX_SESSIONS).take_while(fits);
    let mut chosen: Vec<Teaching> = newest.cloned().collect();
    chosen.reverse();
    chosen
}

#[cfg(test)]
mod tests;
