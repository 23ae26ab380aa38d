//! Evaluating and recording a batch of samples.

use super::actor::Asset;
use super::sessions::SessionSwitch;
use super::turn::Turn;
use crate::service::{ServiceError, views};
use crate::store::{SessionRow, Write};
use crate::wire::telemetry::{AckView, Batch, RowView, sample_key, sample_keys};
use offbd_core::engine::{Admission, rejection};
use offbd_core::vocabulary::Sample;

/// Limit of the chunks of a session that are searched for retransmitted samples; older
/// samples are not found.
const MAX_CHUNKS_SEARCHED: u32 = 32;

impl Asset {
    /// Evaluates and records a batch; `importing` is set for a recording that is being
    /// imported.
    pub(super) fn ingest(
        &mut self,
        batch: Batch,
        importing: bool,
        turn: &mut Turn<'_>,
    ) -> Result<AckView, ServiceError> {
        let mut ack = AckView::default();
        let samples = samples(batch.rows, &mut ack);
        if self.open.as_ref().is_some_and(|open| open.importing != importing) {
            let what = "a recording is being imported into this asset";
            return Err(ServiceError::Busy { what });
        }
        if !samples.is_empty() {
            match batch.session {
                Some(name) => match self.switch(&name, turn)? {
                    SessionSwitch::Open => drop(self.record(&samples, false, turn, &mut ack)?),
                    SessionSwitch::Ended(row) => retransmitted(&row, &samples, turn, &mut ack)?,
                },
                None => self.record_nameless(&samples, turn, &mut ack)?,
            }
        }
        if let (Some(open), Some((_, last))) = (&self.open, samples.last()) {
            turn.env.presences.record(&self.row.name, &open.id, turn.at, last.t_s);
        }
        if ack.session_id.is_none()
            || ack.session_id == self.open.as_ref().map(|open| open.id.clone())
        {
            self.count_rejected(ack.rejected.len(), turn);
        }
        self.learn_if_due(turn)?;
        ack.rejected.sort_by_key(|row| row.index);
        count(&ack);
        Ok(ack)
    }

    /// Records samples without a session name: in the open session, or in a new one if
    /// none is open or the device has restarted.
    fn record_nameless(
        &mut self,
        samples: &[(usize, Sample)],
        turn: &mut Turn<'_>,
        ack: &mut AckView,
    ) -> Result<(), ServiceError> {
        let mut rest = samples;
        let mut detect_restart = true;
        loop {
            if self.open.is_none() {
                self.open_nameless(turn)?;
            }
            let n_recorded = self.record(rest, detect_restart, turn, ack)?;
            rest = &rest[n_recorded..];
            let (Some((_, first)), Some(open)) = (rest.first(), &self.open) else {
                return Ok(());
            };
            // Once per batch: a clock that jumps back and forth must not open many sessions.
            detect_restart = false;
            if !is_recorded(&open.id, first, turn)? {
                self.end(turn)?;
            }
        }
    }

    /// Evaluates and records `samples`, each with its index in the batch, in the open
    /// session; with `detect_restart` only those before a restart of the device. Returns
    /// how many were processed.
    pub(super) fn record(
        &mut self,
        samples: &[(usize, Sample)],
        detect_restart: bool,
        turn: &mut Turn<'_>,
        ack: &mut AckView,
    ) -> Result<usize, ServiceError> {
        let Some(open) = &mut self.open else { return Ok(samples.len()) };
        turn.engine_changed = true;
        let first_index = open.progress.n_samples;
        let mut recorded = Vec::with_capacity(samples.len());
        let mut transitions = Vec::new();
        let mut n_processed = 0;
        for (index, sample) in samples {
            if detect_restart && open.seems_restarted(sample) {
                break;
            }
            n_processed += 1;
            let row = |reason: String| RowView { index: *index, reason };
            match open.take(sample) {
                Admission::Accepted => recorded.push(*sample),
                Admission::SetAside(why) => {
                    recorded.push(*sample);
                    count_unjudged(why.as_str());
                    ack.late.push(row(why.to_string()));
                }
                Admission::Duplicate => ack.duplicate += 1,
                Admission::Rejected(why) => {
                    count_unjudged(why.as_str());
                    ack.rejected.push(row(why.to_string()));
                }
            }
            open.report(&self.row.name, turn.at, &mut transitions)?;
        }
        ack.accepted += recorded.len();
        ack.session = Some(open.name.clone());
        ack.session_id = Some(open.id.clone());
        ack.last_seq = open.progress.last_seq.and_then(|seq| u64::try_from(seq).ok());
        self.append(first_index, recorded, turn);
        turn.writes.append(&mut transitions);
        self.write_memory(None, turn)?;
        Ok(n_processed)
    }

    fn append(&mut self, first_index: i64, samples: Vec<Sample>, turn: &mut Turn<'_>) {
        let Some(open) = &self.open else { return };
        if !samples.is_empty() {
            let (session, progress) = (open.id.clone(), open.progress);
            turn.writes.push(Write::Append { session, first_index, samples, progress });
        }
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

/// Returns the valid samples, each with its row index; adds the other rows to the
/// rejections.
fn samples(rows: Vec<Result<Sample, String>>, ack: &mut AckView) -> Vec<(usize, Sample)> {
    let mut samples = Vec::with_capacity(rows.len());
    for (index, row) in rows.into_iter().enumerate() {
        match row {
            Ok(sample) => samples.push((index, sample)),
            Err(reason) => {
                count_unjudged("form");
                ack.rejected.push(RowView { index, reason });
            }
        }
    }
    samples
}

/// Counts a sample that is not evaluated. `reason` is a metric label with few values.
fn count_unjudged(reason: &'static str) {
    metrics::counter!("offbd_samples_unjudged_total", "reason" => reason).increment(1);
}

fn count(ack: &AckView) {
    let outcome = |outcome: &'static str, n: usize| {
        metrics::counter!("offbd_samples_total", "outcome" => outcome).increment(n as u64);
    };
    outcome("accepted", ack.accepted);
    outcome("duplicate", ack.duplicate);
    outcome("rejected", ack.rejected.len());
    outcome("late", ack.late.len());
}

/// Whether the recording contains exactly this sample, so that it is a retransmission.
fn is_recorded(session: &str, sample: &Sample, turn: &Turn<'_>) -> Result<bool, ServiceError> {
    let (handles, range) = (&turn.env.handles, (sample.t_s, sample.t_s));
    let chunks = handles.store.chunks_between(session, range, MAX_CHUNKS_SEARCHED);
    Ok(handles.wait(chunks)?.iter().flatten().any(|recorded| recorded == sample))
}

/// Acknowledges samples for a session that has ended, if they are recorded already. Rows
/// that the engine rejects were never recorded, and are rejected again.
///
/// # Errors
/// [`ServiceError::SessionEnded`] if another one is not recorded.
fn retransmitted(
    row: &SessionRow,
    samples: &[(usize, Sample)],
    turn: &Turn<'_>,
    ack: &mut AckView,
) -> Result<(), ServiceError> {
    let rig = views::rig(&row.setup)?;
    let mut recorded = Vec::with_capacity(samples.len());
    for (index, sample) in samples {
        match rejection(&rig, sample) {
            None => recorded.push(sample),
            Some(why) => {
                count_unjudged(why.as_str());
                ack.rejected.push(RowView { index: *index, reason: why.to_string() });
            }
        }
    }
    let times = recorded.iter().map(|sample| sample.t_s);
    let range =
        (times.clone().fold(f64::INFINITY, f64::min), times.fold(f64::NEG_INFINITY, f64::max));
    let handles = &turn.env.handles;
    let chunks = handles.store.chunks_between(&row.id, range, MAX_CHUNKS_SEARCHED);
    let known = sample_keys(handles.wait(chunks)?.iter().flatten());
    if !recorded.iter().all(|sample| known.contains(&sample_key(sample))) {
        let (asset, name) = (row.asset.clone(), row.name.clone());
        return Err(ServiceError::SessionEnded { asset, name });
    }
    ack.duplicate += recorded.len();
    ack.session = Some(row.name.clone());
    ack.session_id = Some(row.id.clone());
    ack.last_seq = row.progress.last_seq.and_then(|seq| u64::try_from(seq).ok());
    Ok(())
}
