//! Recognises what a device without session names sends again after its session has ended:
//! it must not be recorded a second time, in the next session.

use std::collections::BTreeSet;

use super::actor::Asset;
use super::recorded::RecordedSamples;
use super::session::OpenSession;
use super::turn::Turn;
use crate::service::ServiceError;
use crate::service::writing::Handles;
use crate::store::{SessionFilter, SessionRow};
use crate::wire::telemetry::AckView;
use offbd_core::engine::{Engine, Recognition};
use offbd_core::vocabulary::Sample;

/// Limit of the ended sessions that are searched, the newest first. Chosen: a retransmission
/// is rarely older.
const MAX_SESSIONS: usize = 4;

/// Conflicting samples in a batch after which a session is certainly another run: one may
/// have a wrong time.
const CERTAIN_AFTER: u32 = 2;

/// An ended session that a device may be sending again.
#[derive(Clone, Debug)]
pub(super) struct EndedSession {
    id: String,
    name: String,
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
        let (id, name) = (open.id.clone(), open.name.clone());
        Self::new(id, name, open.judging.newest_t_s(), open.progress.last_seq)
    }

    const fn new(id: String, name: String, newest_t_s: Option<f64>, last_seq: Option<i64>) -> Self {
        Self { id, name, newest_t_s, last_seq, is_other_run: false, is_same_run: false }
    }

    /// Reads the last ended sessions of `asset`, the newest first. Blocks on the store.
    pub(super) fn read(handles: &Handles, asset: &str) -> Result<Vec<Self>, ServiceError> {
        let (asset, state) = (Some(asset.to_owned()), Some("ended".to_owned()));
        let filter = SessionFilter { asset, state, ..SessionFilter::default() };
        let rows = handles.wait(handles.store.sessions(&filter, MAX_SESSIONS as u32))?;
        let session = |row: SessionRow| {
            let newest_t_s = handles.wait(handles.store.newest_t_s(&row.id))?;
            Ok(Self::new(row.id, row.name, newest_t_s, row.progress.last_seq))
        };
        rows.into_iter().map(session).collect()
    }

    /// Whether `sample`, which `open` does not have, may be recorded in this session.
    fn may_contain(&self, sample: &Sample, open: Option<&Engine>) -> bool {
        if self.is_other_run && !open.is_none_or(|engine| engine.precedes(sample)) {
            return false;
        }
        match sample.seq.and_then(|seq| i64::try_from(seq).ok()) {
            Some(seq) => self.last_seq.is_some_and(|last| seq <= last),
            None => self.newest_t_s.is_some_and(|newest| sample.t_s <= newest),
        }
    }
}

impl Asset {
    /// Notes that `session` has ended.
    pub(super) fn note_ended(&mut self, session: EndedSession) {
        self.ended.iter_mut().for_each(|earlier| earlier.is_other_run = false);
        self.ended.insert(0, session);
        self.ended.truncate(MAX_SESSIONS);
    }

    /// Returns `samples`, each with its index in the batch, without those that an ended
    /// session has already, which are counted as duplicates.
    pub(super) fn without_sent_before(
        &mut self,
        samples: &[(usize, Sample)],
        turn: &Turn<'_>,
        ack: &mut AckView,
    ) -> Result<Vec<(usize, Sample)>, ServiceError> {
        let engine = self.open.as_ref().map(|open| open.judging.engine());
        let is_new = |sample: &Sample| {
            sample.t_s.is_finite()
                && engine.is_none_or(|engine| engine.recognise(sample) == Recognition::New)
        };
        let new: Vec<_> = samples.iter().filter(|(_, sample)| is_new(sample)).collect();
        let mut found = BTreeSet::new();
        for session in &mut self.ended {
            let doubtful: Vec<_> =
                new.iter().filter(|(_, sample)| session.may_contain(sample, engine)).collect();
            if doubtful.is_empty() {
                continue;
            }
            turn.env.handles.fence()?;
            let doubtful_samples = doubtful.iter().map(|(_, sample)| sample);
            let recorded = RecordedSamples::find(&session.id, doubtful_samples, turn)?;
            let mut n_conflicts = 0;
            for (index, sample) in doubtful {
                match recorded.recognise(Recognition::Unknown, sample) {
                    Recognition::Same => {
                        ack.session.get_or_insert_with(|| session.name.clone());
                        ack.session_id.get_or_insert_with(|| session.id.clone());
                        found.insert(*index);
                        session.is_same_run = true;
                    }
                    Recognition::Conflict => n_conflicts += 1,
                    Recognition::New | Recognition::Taken | Recognition::Unknown => {}
                }
            }
            session.is_other_run = n_conflicts >= CERTAIN_AFTER && !session.is_same_run;
        }
        ack.duplicate += found.len();
        Ok(samples.iter().filter(|(index, _)| !found.contains(index)).copied().collect())
    }
}
