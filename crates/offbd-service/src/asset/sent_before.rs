//! Recognises what a device sends again after its session has ended, or has continued in
//! another: it must not be recorded a second time, in the next session.

use super::actor::Asset;
use super::ended_session::{EndedSession, OpenSamples};
use super::outcomes::count_unjudged;
use super::recorded::RecordedSamples;
use super::restart::CERTAIN_AFTER;
use super::session::OpenSession;
use super::turn::Turn;
use crate::ServiceError;
use offbd_core::engine::Rejection;
use offbd_core::vocabulary::Sample;
use offbd_store::MAX_ENDED_SESSIONS;
use offbd_wire::telemetry::{AckView, RowView};

impl Asset {
    /// Notes that `session` has ended.
    pub(super) fn note_ended(&mut self, session: EndedSession) {
        self.ended.iter_mut().for_each(|earlier| earlier.is_other_run = false);
        self.ended.insert(0, session);
        self.ended.truncate(MAX_ENDED_SESSIONS as usize);
    }

    /// Returns `samples`, each with its index in the batch, without those that an ended
    /// session has already, which are counted as duplicates. `recorded` are those of the open
    /// session that its engine does not remember.
    pub(super) fn without_sent_before(
        &mut self,
        mut samples: Vec<(usize, Sample)>,
        recorded: &RecordedSamples,
        turn: &Turn<'_>,
        ack: &mut AckView,
    ) -> Result<Vec<(usize, Sample)>, ServiceError> {
        let engine = self.open.as_ref().map(|open| open.judging.engine());
        let open = engine.map(|engine| OpenSamples { engine, recorded });
        for session in &mut self.ended {
            let found = session.search(&samples, open, turn)?;
            session.acknowledge(&found, ack);
            session.is_same_run |= !found.same.is_empty();
            session.is_other_run |= found.conflicts.len() >= CERTAIN_AFTER as usize;
            session.is_other_run &= !session.is_same_run;
            samples.retain(|(index, _)| !found.same.contains(index));
        }
        Ok(samples)
    }

    /// Whether an ended session has all of `samples`, which are then counted as duplicates: they are
    /// not of another run, although the open session has other values for them.
    pub(super) fn is_earlier_run(
        &self,
        samples: &[(usize, Sample)],
        turn: &Turn<'_>,
        ack: &mut AckView,
    ) -> Result<bool, ServiceError> {
        let samples: Vec<_> = samples.iter().collect();
        for session in &self.ended {
            let found = session.look_up(&samples, turn)?;
            if found.same.len() == samples.len() {
                session.acknowledge(&found, ack);
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Returns `samples`, each with its index in the batch, without those that an earlier part
    /// of the open session has: with the same values, they are counted as duplicates; with
    /// others, they are rejected, as are those that parts may have that are not searched.
    /// `recorded` is as above.
    pub(super) fn without_earlier_parts(
        &mut self,
        mut samples: Vec<(usize, Sample)>,
        recorded: &RecordedSamples,
        turn: &Turn<'_>,
        ack: &mut AckView,
    ) -> Result<Vec<(usize, Sample)>, ServiceError> {
        let Some(open) = &mut self.open else { return Ok(samples) };
        let (link, at) = (&mut self.link, turn.at);
        let mut reject =
            |open: &mut OpenSession, index: usize, why: Rejection, ack: &mut AckView| {
                open.judging.note_rejected(why);
                count_unjudged(link, why, 1, at);
                ack.rejected.push(RowView { index, reason: why.to_string() });
            };
        let parts: Vec<_> =
            self.ended.iter().filter(|ended| ended.first_part == open.part.first).collect();
        for part in &parts {
            let known = OpenSamples { engine: open.judging.engine(), recorded };
            let found = part.search(&samples, Some(known), turn)?;
            part.acknowledge(&found, ack);
            samples.retain(|(index, sample)| {
                if found.conflicts.contains(index) {
                    reject(open, *index, Rejection::conflict(sample), ack);
                }
                !found.same.contains(index) && !found.conflicts.contains(index)
            });
        }
        // A deleted part leaves none out.
        let are_left_out = parts.len() >= MAX_ENDED_SESSIONS as usize
            && open.part.number > i64::from(MAX_ENDED_SESSIONS) + 1;
        if let Some(oldest) = parts.last().filter(|_| are_left_out) {
            samples.retain(|(index, sample)| {
                let known = OpenSamples { engine: open.judging.engine(), recorded };
                let is_doubtful = oldest.is_doubtful(sample, Some(known));
                if is_doubtful {
                    reject(open, *index, Rejection::TooOld, ack);
                }
                !is_doubtful
            });
        }
        Ok(samples)
    }
}
