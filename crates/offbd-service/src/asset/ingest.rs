//! Evaluating and recording a batch of samples.

use super::actor::Asset;
use super::outcomes::{count_outcomes, count_unjudged};
use super::recorded::RecordedSamples;
use super::restart::first_run;
use super::retransmission::retransmitted;
use super::session::OpenSession;
use super::sessions::SessionSwitch;
use super::turn::Turn;
use crate::ServiceError;
use offbd_core::engine::{Admission, Recognition, Rejection};
use offbd_core::vocabulary::Sample;
use offbd_store::{Micros, Write};
use offbd_wire::telemetry::{AckView, Batch, RowView};
use offbd_wire::words::UnjudgedWord;

/// Time since the batch before from which on a device sends at its own pace, µs: one that waits for
/// the acknowledgement sends sooner. Chosen: several times what a commit may wait for others.
const OWN_PACE: Micros = 16_000;

impl Asset {
    /// Evaluates and records a batch; `importing` is set for a recording that is being
    /// imported.
    pub(super) fn ingest(
        &mut self,
        batch: Batch,
        importing: bool,
        turn: &mut Turn<'_>,
    ) -> Result<AckView, ServiceError> {
        let before = self.batch_at.replace(turn.at);
        turn.can_wait = before.is_some_and(|before| turn.at - before >= OWN_PACE);
        let mut ack = AckView::default();
        let (samples, malformed) = samples(batch.rows, &mut ack);
        let n_malformed = malformed.len();
        self.malformed = malformed;
        if self.open.as_ref().is_some_and(|open| open.importing != importing) {
            let what = "a recording is being imported into this asset";
            return Err(ServiceError::Busy { what });
        }
        self.link.unknown(batch.unknown, turn.at);
        let last_t_s = samples.last().map(|(_, last)| last.t_s);
        if !samples.is_empty() {
            match batch.session {
                Some(name) => match self.switch(&name, turn)? {
                    SessionSwitch::Open => self.record_in_parts(samples, turn, &mut ack)?,
                    SessionSwitch::Ended(row) => {
                        for reason in retransmitted(&row, &samples, turn, &mut ack)? {
                            count_unjudged(&mut self.link, reason, 1, turn.at);
                        }
                    }
                },
                None => {
                    let mut samples = samples;
                    while !samples.is_empty() {
                        let rest = samples.split_off(first_run(&samples));
                        self.record_nameless(samples, turn, &mut ack)?;
                        samples = rest;
                    }
                }
            }
        }
        if let Some(open) = &mut self.open {
            note_malformed(&mut self.malformed, usize::MAX, open);
        }
        // Not before the session is open that its batch names.
        count_unjudged(&mut self.link, Rejection::Malformed, n_malformed as u64, turn.at);
        self.note_presence(last_t_s, n_malformed, turn);
        if ack.session_id.is_none()
            || ack.session_id == self.open.as_ref().map(|open| open.id.clone())
        {
            self.count_rejected(ack.rejected.len(), turn);
        }
        self.learn_if_due(turn)?;
        ack.rejected.sort_by_key(|row| row.index);
        count_outcomes(&ack);
        if ack.duplicate > 0 {
            self.link.duplicates(ack.duplicate, turn.at);
        }
        Ok(ack)
    }

    /// Notes the arrival of a batch whose last sample has the time `last_t_s`, with `n_malformed`
    /// rows that are not samples.
    fn note_presence(&mut self, last_t_s: Option<f64>, n_malformed: usize, turn: &Turn<'_>) {
        let (presences, name) = (&turn.env.presences, &self.row.name);
        let open = self.open.as_ref().map(|open| (&*open.id, open.judging.engine().unjudged()));
        match (open, last_t_s) {
            (Some((session, unjudged)), Some(t_s)) => {
                let (lag_s, offset_s) = presences.record(name, session, turn.at, t_s, unjudged);
                self.link.batch(lag_s, offset_s, turn.at);
            }
            (open, None) if n_malformed > 0 => {
                let unjudged = open.map(|(_, unjudged)| unjudged);
                presences.record_malformed(name, turn.at, n_malformed, unjudged);
            }
            _ => {}
        }
    }

    /// Records samples of the open session, which their batch has named, unless an earlier
    /// part of it has them.
    fn record_in_parts(
        &mut self,
        samples: Vec<(usize, Sample)>,
        turn: &mut Turn<'_>,
        ack: &mut AckView,
    ) -> Result<(), ServiceError> {
        self.continue_if_long(turn)?;
        let mut recorded = self.unremembered(&samples, turn)?;
        let samples = self.without_earlier_parts(samples, &recorded, turn, ack)?;
        self.record(&samples, &mut recorded, turn, ack)
    }

    /// Looks up those of `samples` that the engine of the open session does not remember.
    fn unremembered(
        &self,
        samples: &[(usize, Sample)],
        turn: &Turn<'_>,
    ) -> Result<RecordedSamples, ServiceError> {
        let Some(open) = &self.open else { return Ok(RecordedSamples::default()) };
        RecordedSamples::unremembered(open, samples, turn)
    }

    /// Records samples of the open session.
    pub(super) fn record_in_open(
        &mut self,
        samples: &[(usize, Sample)],
        turn: &mut Turn<'_>,
        ack: &mut AckView,
    ) -> Result<(), ServiceError> {
        let mut recorded = self.unremembered(samples, turn)?;
        self.record(samples, &mut recorded, turn, ack)
    }

    /// Records samples without a session name: in the open session, or in a new one if
    /// none is open or the device has restarted.
    fn record_nameless(
        &mut self,
        samples: Vec<(usize, Sample)>,
        turn: &mut Turn<'_>,
        ack: &mut AckView,
    ) -> Result<(), ServiceError> {
        self.continue_if_long(turn)?;
        let mut recorded = self.unremembered(&samples, turn)?;
        let samples = &self.without_sent_before(samples, &recorded, turn, ack)?[..];
        if samples.is_empty() {
            return Ok(());
        }
        let Some(open) = &mut self.open else {
            self.open_nameless(turn)?;
            return self.record_in_open(samples, turn, ack);
        };
        // At most as often as sessions may begin; otherwise conflicts are rejected.
        let n_continued = match self.session_rate.allows(turn.at) {
            true => open.continued_by(samples, &recorded),
            false => samples.len(),
        };
        let (samples, rest) = samples.split_at(n_continued);
        self.record(samples, &mut recorded, turn, ack)?;
        if rest.is_empty() || self.is_earlier_run(rest, turn, ack)? {
            return Ok(());
        }
        // Once per run: a clock that jumps back and forth must not open many sessions.
        self.end(turn)?;
        self.open_nameless(turn)?;
        self.record_in_open(rest, turn, ack)
    }

    /// Evaluates and records `samples`, each with its index in the batch, in the open
    /// session; `recorded` are the earlier ones that its engine does not remember.
    fn record(
        &mut self,
        samples: &[(usize, Sample)],
        recorded: &mut RecordedSamples,
        turn: &mut Turn<'_>,
        ack: &mut AckView,
    ) -> Result<(), ServiceError> {
        let Some(open) = &mut self.open else { return Ok(()) };
        turn.engine_changed = true;
        let (link, at) = (&mut self.link, turn.at);
        link.follow(&open.id, open.judging.engine().gap_s(), at);
        let (first_index, n_dropped) = (open.progress.n_samples, open.n_unconfirmed());
        let mut new = Vec::with_capacity(samples.len());
        let mut transitions = Vec::new();
        // New samples that are in `recorded` too.
        let mut n_added = 0;
        for (index, sample) in samples {
            note_malformed(&mut self.malformed, *index, open);
            let row = |reason: String| RowView { index: *index, reason };
            let mut admission = open.take(sample);
            if admission == Admission::Unknown {
                recorded.add(&new[n_added..]);
                n_added = new.len();
                admission = take_old(open, sample, recorded);
            }
            match admission {
                Admission::Accepted => {
                    link.sample(sample.t_s, at);
                    new.push(*sample);
                }
                Admission::SetAside(why) => {
                    new.push(*sample);
                    // A jump may still be confirmed.
                    let is_late = matches!(why, Rejection::Late { .. });
                    match is_late {
                        true => link.late_sample(at),
                        false => link.doubted_sample(sample.t_s, at),
                    }
                    count_unjudged(link, why, u64::from(is_late), at);
                    ack.late.push(row(why.to_string()));
                }
                Admission::Duplicate => ack.duplicate += 1,
                Admission::Rejected(why) => {
                    count_unjudged(link, why, 1, at);
                    ack.rejected.push(row(why.to_string()));
                }
                Admission::Unknown => {
                    open.judging.note_rejected(Rejection::TooOld);
                    count_unjudged(link, Rejection::TooOld, 1, at);
                    ack.rejected.push(row(Rejection::TooOld.to_string()));
                }
            }
            open.report(&self.row.name, turn.at, &mut transitions)?;
        }
        count_unjudged(link, UnjudgedWord::Jump, open.n_unconfirmed() - n_dropped, at);
        ack.accepted += new.len();
        ack.session = Some(open.name.clone());
        ack.session_id = Some(open.id.clone());
        ack.last_seq = open.progress.last_seq.and_then(|seq| u64::try_from(seq).ok());
        self.append(first_index, new, turn)?;
        turn.writes.append(&mut transitions);
        self.write_memory(None, turn)
    }

    /// Records samples that the engine has evaluated, with a snapshot of it if one is due.
    fn append(
        &mut self,
        first_index: i64,
        samples: Vec<Sample>,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        let Some(open) = self.open.as_mut().filter(|_| !samples.is_empty()) else { return Ok(()) };
        let (session, progress) = (open.id.clone(), open.progress);
        turn.writes.push(Write::Append { session, first_index, samples, progress });
        let interval = turn.env.handles.sessions.snapshot_interval;
        let snapshot = open.snapshot_if_due(progress.n_samples, interval)?;
        turn.writes.extend(snapshot.map(Write::PutSnapshot));
        Ok(())
    }

    /// Adds rejected rows to the count of the session.
    fn count_rejected(&mut self, n: usize, turn: &mut Turn<'_>) {
        let Some(open) = self.open.as_mut().filter(|_| n > 0) else { return };
        open.progress.n_rejected += i64::try_from(n).unwrap_or(i64::MAX);
        let (session, progress) = (open.id.clone(), open.progress);
        let first_index = progress.n_samples;
        turn.writes.push(Write::Append { session, first_index, samples: Vec::new(), progress });
    }
}

/// Tells the engine of the rows before `index` that are not samples.
fn note_malformed(malformed: &mut Vec<usize>, index: usize, open: &mut OpenSession) {
    let n = malformed.partition_point(|&malformed| malformed < index);
    for _ in malformed.drain(..n) {
        open.judging.note_rejected(Rejection::Malformed);
    }
}

/// Evaluates a sample that is older than those the engine remembers. Returns
/// [`Admission::Unknown`] if it could not be looked up.
fn take_old(open: &mut OpenSession, sample: &Sample, recorded: &RecordedSamples) -> Admission {
    let rejection = match recorded.recognise(open.judging.engine().recognise(sample), sample) {
        Recognition::New => return open.take_new(sample),
        Recognition::Same => return Admission::Duplicate,
        Recognition::Conflict => Rejection::conflict(sample),
        Recognition::Taken | Recognition::Unknown => return Admission::Unknown,
    };
    open.judging.note_rejected(rejection);
    Admission::Rejected(rejection)
}

/// Returns the valid samples, each with its row index, and the indexes of the other rows, which
/// are added to the rejections.
fn samples(
    rows: Vec<Result<Sample, String>>,
    ack: &mut AckView,
) -> (Vec<(usize, Sample)>, Vec<usize>) {
    let (mut samples, mut malformed) = (Vec::with_capacity(rows.len()), Vec::new());
    for (index, row) in rows.into_iter().enumerate() {
        match row {
            Ok(sample) => samples.push((index, sample)),
            Err(reason) => {
                malformed.push(index);
                ack.rejected.push(RowView { index, reason });
            }
        }
    }
    (samples, malformed)
}
