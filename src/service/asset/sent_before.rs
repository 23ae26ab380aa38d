//! Recognises what a device sends again after its session has ended, or has continued in
//! another: it must not be recorded a second time, in the next session.

use std::collections::BTreeSet;

use super::actor::Asset;
use super::ingest::count_unjudged;
use super::recorded::RecordedSamples;
use super::restart::CERTAIN_AFTER;
use super::session::OpenSession;
use super::turn::Turn;
use crate::service::ServiceError;
use crate::service::writing::Handles;
use crate::store::{SessionFilter, SessionRow};
use crate::wire::telemetry::{AckView, RowView};
use offbd_core::engine::{Engine, Recognition, Rejection};
use offbd_core::vocabulary::Sample;

/// Limit of the ended sessions that are searched, the newest first. Chosen: a retransmission
/// is rarely older.
pub(super) const MAX_SESSIONS: u32 = 4;

/// An ended session that a device may be sending again.
#[derive(Clone, Debug)]
pub(super) struct EndedSession {
    id: String,
    name: String,
    /// The id of the first part of the session.
    first_part: String,
    /// The latest time of its samples, also of those that were not judged, s.
    newest_t_s: Option<f64>,
    last_seq: Option<i64>,
    /// Whether the open session is known to be another run of the device, because it has the
    /// same times or numbers with other values. Then only what is before the first sample of
    /// the open session can belong to this one, and the rest is not searched in it.
    is_other_run: bool,
    /// Whether something of it was sent again.
    is_same_run: bool,
}

impl EndedSession {
    pub(super) fn of(open: &OpenSession) -> Self {
        Self {
            id: open.id.clone(),
            name: open.name.clone(),
            first_part: open.part.first.clone(),
            newest_t_s: open.judging.newest_t_s(),
            last_seq: open.progress.last_seq,
            is_other_run: false,
            is_same_run: false,
        }
    }

    /// Reads the last ended sessions of `asset`, the newest first. Blocks on the store.
    pub(super) fn read(handles: &Handles, asset: &str) -> Result<Vec<Self>, ServiceError> {
        let (asset, state) = (Some(asset.to_owned()), Some("ended".to_owned()));
        let filter = SessionFilter { asset, state, ..SessionFilter::default() };
        let rows = handles.wait(handles.store.sessions(&filter, MAX_SESSIONS))?;
        let session = |row: SessionRow| {
            Ok(Self {
                newest_t_s: handles.wait(handles.store.newest_t_s(&row.id))?,
                first_part: row.first_part().to_owned(),
                id: row.id,
                name: row.name,
                last_seq: row.progress.last_seq,
                is_other_run: false,
                is_same_run: false,
            })
        };
        rows.into_iter().map(session).collect()
    }

    /// Whether `sample` may be recorded in this session, if `open` does not have it.
    fn may_contain(&self, sample: &Sample, open: Option<&Engine>) -> bool {
        if self.is_other_run && !open.is_none_or(|engine| engine.precedes(sample)) {
            return false;
        }
        match sample.seq.and_then(|seq| i64::try_from(seq).ok()) {
            Some(seq) => self.last_seq.is_some_and(|last| seq <= last),
            None => self.newest_t_s.is_some_and(|newest| sample.t_s <= newest),
        }
    }

    /// Returns which of `samples`, each with its index in the batch, this session has already,
    /// or has with other values, and `open` has not. Blocks on the store.
    fn search(
        &self,
        samples: &[(usize, Sample)],
        open: Option<&Engine>,
        turn: &Turn<'_>,
    ) -> Result<Found, ServiceError> {
        let mut found = Found::default();
        let is_doubtful = |sample: &Sample| self.may_contain(sample, open) && is_new(sample, open);
        let doubtful: Vec<_> = samples.iter().filter(|(_, sample)| is_doubtful(sample)).collect();
        if doubtful.is_empty() {
            return Ok(found);
        }
        turn.env.handles.fence()?;
        let recorded =
            RecordedSamples::find(&self.id, doubtful.iter().map(|(_, sample)| sample), turn)?;
        for (index, sample) in doubtful {
            match recorded.recognise(Recognition::Unknown, sample) {
                Recognition::Same => drop(found.same.insert(*index)),
                Recognition::Conflict => drop(found.conflicts.insert(*index)),
                Recognition::New | Recognition::Taken | Recognition::Unknown => {}
            }
        }
        Ok(found)
    }

    fn acknowledge(&self, found: &Found, ack: &mut AckView) {
        if !found.same.is_empty() {
            ack.session.get_or_insert_with(|| self.name.clone());
            ack.session_id.get_or_insert_with(|| self.id.clone());
        }
        ack.duplicate += found.same.len();
    }
}

/// The samples that were found in an ended session, by their index in the batch.
#[derive(Debug, Default)]
struct Found {
    same: BTreeSet<usize>,
    conflicts: BTreeSet<usize>,
}

impl Asset {
    /// Notes that `session` has ended.
    pub(super) fn note_ended(&mut self, session: EndedSession) {
        self.ended.iter_mut().for_each(|earlier| earlier.is_other_run = false);
        self.ended.insert(0, session);
        self.ended.truncate(MAX_SESSIONS as usize);
    }

    /// Returns `samples`, each with its index in the batch, without those that an ended
    /// session has already, which are counted as duplicates.
    pub(super) fn without_sent_before(
        &mut self,
        samples: &[(usize, Sample)],
        turn: &Turn<'_>,
        ack: &mut AckView,
    ) -> Result<Vec<(usize, Sample)>, ServiceError> {
        let mut rest = samples.to_vec();
        let engine = self.open.as_ref().map(|open| open.judging.engine());
        for session in &mut self.ended {
            let found = session.search(&rest, engine, turn)?;
            session.acknowledge(&found, ack);
            session.is_same_run |= !found.same.is_empty();
            session.is_other_run |= found.conflicts.len() >= CERTAIN_AFTER as usize;
            session.is_other_run &= !session.is_same_run;
            rest.retain(|(index, _)| !found.same.contains(index));
        }
        Ok(rest)
    }

    /// Returns `samples`, each with its index in the batch, without those that an earlier part
    /// of the open session has: with the same values, they are counted as duplicates; with
    /// others, they are rejected.
    pub(super) fn without_earlier_parts(
        &mut self,
        samples: &[(usize, Sample)],
        turn: &Turn<'_>,
        ack: &mut AckView,
    ) -> Result<Vec<(usize, Sample)>, ServiceError> {
        let mut rest = samples.to_vec();
        let Some(open) = &mut self.open else { return Ok(rest) };
        for part in self.ended.iter().filter(|ended| ended.first_part == open.part.first) {
            let engine = open.judging.engine();
            let found = part.search(&rest, Some(engine), turn)?;
            part.acknowledge(&found, ack);
            rest.retain(|(index, sample)| {
                if found.conflicts.contains(index) {
                    let why = Rejection::conflict(sample);
                    open.judging.note_rejected(why);
                    count_unjudged(why.as_str(), 1);
                    ack.rejected.push(RowView { index: *index, reason: why.to_string() });
                }
                !found.same.contains(index) && !found.conflicts.contains(index)
            });
        }
        Ok(rest)
    }
}

/// Whether the engine of the open session does not have `sample`.
fn is_new(sample: &Sample, open: Option<&Engine>) -> bool {
    sample.t_s.is_finite() && open.is_none_or(|engine| engine.recognise(sample) == Recognition::New)
}
