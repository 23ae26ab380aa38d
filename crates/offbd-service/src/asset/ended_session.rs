//! An ended session that a device may be sending again.

use std::collections::BTreeSet;

use super::recorded::RecordedSamples;
use super::session::OpenSession;
use super::turn::Turn;
use crate::ServiceError;
use offbd_core::engine::{Engine, Recognition};
use offbd_core::vocabulary::Sample;
use offbd_store::EndedSessionRow;
use offbd_wire::telemetry::AckView;

/// An ended session that a device may be sending again.
#[derive(Clone, Debug)]
pub(super) struct EndedSession {
    id: String,
    name: String,
    /// The id of the first part of the session.
    pub(super) first_part: String,
    /// The latest time of its samples, also of those that were not judged, s.
    newest_t_s: Option<f64>,
    last_seq: Option<i64>,
    /// Whether the open session is known to be another run of the device, because it has the
    /// same times or numbers with other values. Then only what is before the first sample of
    /// the open session can belong to this one, and the rest is not searched in it.
    pub(super) is_other_run: bool,
    /// Whether something of it was sent again.
    pub(super) is_same_run: bool,
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

    /// Returns the session of `row`.
    pub(super) fn stored(row: EndedSessionRow) -> Self {
        Self {
            first_part: row.first_part.unwrap_or_else(|| row.id.clone()),
            id: row.id,
            name: row.name,
            newest_t_s: row.newest_t_s,
            last_seq: row.last_seq,
            is_other_run: false,
            is_same_run: false,
        }
    }

    /// Whether `sample` may be recorded in this session, if `open` does not have it.
    fn may_contain(&self, sample: &Sample, open: Option<OpenSamples<'_>>) -> bool {
        if self.is_other_run && !open.is_none_or(|open| open.engine.precedes(sample)) {
            return false;
        }
        match sample.seq.and_then(|seq| i64::try_from(seq).ok()) {
            Some(seq) => self.last_seq.is_some_and(|last| seq <= last),
            None => self.newest_t_s.is_some_and(|newest| sample.t_s <= newest),
        }
    }

    /// Whether `sample` may be recorded in this session, or in one before it, and `open` does not
    /// have it.
    pub(super) fn is_doubtful(&self, sample: &Sample, open: Option<OpenSamples<'_>>) -> bool {
        self.may_contain(sample, open)
            && sample.t_s.is_finite()
            && open.is_none_or(|open| open.recognise(sample) == Recognition::New)
    }

    /// Returns which of `samples`, each with its index in the batch, this session has already,
    /// or has with other values, and `open` has not. Blocks on the store.
    pub(super) fn search(
        &self,
        samples: &[(usize, Sample)],
        open: Option<OpenSamples<'_>>,
        turn: &Turn<'_>,
    ) -> Result<Found, ServiceError> {
        let doubtful = samples.iter().filter(|(_, sample)| self.is_doubtful(sample, open));
        self.look_up(&doubtful.collect::<Vec<_>>(), turn)
    }

    /// Returns which of `samples` this session has, or has with other values. Blocks on the store.
    pub(super) fn look_up(
        &self,
        samples: &[&(usize, Sample)],
        turn: &Turn<'_>,
    ) -> Result<Found, ServiceError> {
        let mut found = Found::default();
        if samples.is_empty() {
            return Ok(found);
        }
        turn.barrier()?;
        let recorded =
            RecordedSamples::find(&self.id, samples.iter().map(|(_, sample)| sample), turn)?;
        for (index, sample) in samples {
            match recorded.recognise(Recognition::Unknown, sample) {
                Recognition::Same => drop(found.same.insert(*index)),
                Recognition::Conflict => drop(found.conflicts.insert(*index)),
                Recognition::New | Recognition::Taken | Recognition::Unknown => {}
            }
        }
        Ok(found)
    }

    pub(super) fn acknowledge(&self, found: &Found, ack: &mut AckView) {
        if !found.same.is_empty() {
            ack.session.get_or_insert_with(|| self.name.clone());
            ack.session_id.get_or_insert_with(|| self.id.clone());
        }
        ack.duplicate += found.same.len();
    }
}

/// The samples that were found in an ended session, by their index in the batch.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub(super) same: BTreeSet<usize>,
    pub(super) conflicts: BTreeSet<usize>,
}

/// The samples of the open session: those that its engine remembers, and older ones that were
/// looked up.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpenSamples<'a> {
    pub(super) engine: &'a Engine,
    pub(super) recorded: &'a RecordedSamples,
}

impl OpenSamples<'_> {
    fn recognise(self, sample: &Sample) -> Recognition {
        self.recorded.recognise(self.engine.recognise(sample), sample)
    }
}
