//! A simulated device, and the model of what it was told.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::future::Future;
use std::pin::Pin;

use super::scenario::DeviceKind;
use crate::{PendingBatch, ServiceError};
use offbd_core::vocabulary::Sample;
use offbd_wire::telemetry::{AckView, Batch};

/// Interval between two samples, s.
const INTERVAL_S: f64 = 0.02;

/// Identifies a sample by its content: the run of the device, and its number in it.
pub(super) type Content = (usize, usize);

/// Every sample has its content in the digits of a reading.
const CONTENT_UNIT_M: f64 = 1e-8;
const SAMPLES_PER_RUN: usize = 100_000;

/// Samples from which on a session continues in another one.
pub(super) const SAMPLES_PER_PART: usize = 150;
/// Ended parts of a session that are searched for what is sent again.
const N_SEARCHED_PARTS: usize = 4;

/// Returns the content of a recorded sample.
pub(super) fn content(sample: &Sample) -> Content {
    let number = (sample.y_m.unwrap_or(f64::NAN) / CONTENT_UNIT_M).round() as usize;
    (number / SAMPLES_PER_RUN, number % SAMPLES_PER_RUN)
}

/// Waits until there is room for a batch.
pub(super) type Submission = Pin<Box<dyn Future<Output = Result<PendingBatch, ServiceError>>>>;

/// A batch that a device has sent.
#[derive(Clone, Debug)]
pub(super) struct SentBatch {
    pub(super) id: usize,
    pub(super) run: usize,
    /// The samples, each with its content; the content of an invalid one is `None`.
    pub(super) rows: Vec<(Sample, Option<Content>)>,
}

/// A device, with what it knows.
pub(super) struct Device {
    pub(super) kind: DeviceKind,
    pub(super) asset: String,
    pub(super) run: usize,
    n_measured: usize,
    clock_s: f64,
    n_batches: usize,
    /// What is not acknowledged, in the order of measurement.
    pub(super) unacknowledged: VecDeque<SentBatch>,
    /// The batch that waits for room, if it sends over one connection.
    pub(super) submission: Option<(SentBatch, Submission)>,
    /// The answers on its connection, which it has not read.
    pub(super) answers: VecDeque<(SentBatch, PendingBatch)>,
    /// All samples that it has measured.
    pub(super) measured: BTreeMap<Content, Sample>,
    /// What it was told to be there.
    pub(super) acknowledged: BTreeSet<Content>,
    /// What was in the sessions that persons have deleted.
    pub(super) deleted: BTreeSet<Content>,
}

impl Device {
    pub(super) fn new(number: usize, kind: DeviceKind) -> Self {
        Self {
            kind,
            asset: format!("rig-{number}"),
            run: 0,
            n_measured: 0,
            clock_s: 0.0,
            n_batches: 0,
            unacknowledged: VecDeque::new(),
            submission: None,
            answers: VecDeque::new(),
            measured: BTreeMap::new(),
            acknowledged: BTreeSet::new(),
            deleted: BTreeSet::new(),
        }
    }

    /// The name of the session of `run`; `None` if the device does not name its sessions.
    pub(super) fn session(&self, run: usize) -> Option<String> {
        self.kind.named.then(|| format!("run {run}"))
    }

    /// Measures `n` samples; returns the batch to be sent, `None` if the window is full.
    pub(super) fn measure(&mut self, n: usize, spoilt: bool) -> Option<SentBatch> {
        // Without a session name, its first samples tell that the device has begun again: they
        // must arrive first.
        let is_begun = self.kind.named || self.acknowledged.iter().any(|(run, _)| *run == self.run);
        let window = if is_begun { self.kind.window } else { 1 };
        if self.unacknowledged.len() >= window {
            return None;
        }
        let mut rows = Vec::new();
        for _ in 0..n {
            let content = (self.run, self.n_measured);
            let sample = self.sample();
            self.measured.insert(content, sample);
            rows.push((sample, Some(content)));
        }
        if spoilt {
            let (sample, content) = &mut rows[n / 2];
            self.measured.remove(&content.take().unwrap_or_default());
            sample.x_m = Some(1e9);
        }
        let batch = SentBatch { id: self.n_batches, run: self.run, rows };
        self.n_batches += 1;
        self.unacknowledged.push_back(batch.clone());
        Some(batch)
    }

    fn sample(&mut self) -> Sample {
        let i = self.n_measured;
        self.n_measured += 1;
        let t_s = self.clock_s + i as f64 * INTERVAL_S;
        let phase = t_s.rem_euclid(100.0);
        // A ball that does not follow the commands, so that faults are found.
        let x_m = 0.03 * (1.3 * phase).sin() + if self.run.is_multiple_of(2) { 0.02 } else { 0.0 };
        Sample {
            seq: self.kind.numbered.then_some(i as u64),
            t_s,
            cmd_qx_rad: Some(0.05 * (0.7 * phase).cos()),
            cmd_qy_rad: Some(0.05 * (1.1 * phase).sin()),
            x_m: Some(x_m),
            y_m: Some((self.run * SAMPLES_PER_RUN + i) as f64 * CONTENT_UNIT_M),
        }
    }

    /// Sets the clock of the device. Without numbers, times that come again would be
    /// ambiguous.
    pub(super) fn set_clock(&mut self, by_s: f64) {
        if self.kind.numbered {
            self.clock_s += by_s.round();
        }
    }

    /// Begins again, and gives up what is not acknowledged.
    pub(super) fn reboot(&mut self) {
        self.run += 1;
        (self.n_measured, self.clock_s) = (0, 0.0);
        self.unacknowledged.clear();
        self.disconnect();
    }

    /// Loses the connection, with what is on it.
    pub(super) fn disconnect(&mut self) {
        self.submission = None;
        self.answers.clear();
    }

    /// Returns `batch` as it arrives.
    pub(super) fn arriving(&self, batch: &SentBatch) -> Batch {
        Batch {
            session: self.session(batch.run),
            rows: batch.rows.iter().map(|(sample, _)| Ok(*sample)).collect(),
            ..Batch::default()
        }
    }

    /// Notes the answer to `batch`.
    ///
    /// # Errors
    /// What the service must not have answered.
    pub(super) fn note(
        &mut self,
        batch: &SentBatch,
        answer: Result<AckView, ServiceError>,
    ) -> Result<(), String> {
        let ack = match answer {
            Ok(ack) => ack,
            Err(ServiceError::SessionEnded { .. }) => {
                if batch.run == self.run {
                    self.reboot();
                }
                return Ok(());
            }
            Err(
                ServiceError::Busy { .. }
                | ServiceError::Unavailable { .. }
                | ServiceError::Outage { .. }
                | ServiceError::NotStored { .. }
                | ServiceError::Store(_),
            ) => return Ok(()),
            Err(error) => return Err(format!("{} got {error:?}", self.asset)),
        };
        self.unacknowledged.retain(|sent| sent.id != batch.id);
        for (index, (_, content)) in batch.rows.iter().enumerate() {
            let rejected = ack.rejected.iter().find(|row| row.index == index);
            match (content, rejected) {
                (Some(content), None) => drop(self.acknowledged.insert(*content)),
                (None, Some(_)) => {}
                // What a nameless device lost before it began again cannot be told from what
                // it sends then.
                (Some(_), Some(row)) if !self.kind.named && row.reason.contains("other values") => {
                }
                // It is so late that the part of the session that may have it is not searched.
                (Some(content), Some(row))
                    if row.reason.contains("too old")
                        && self.kind.named
                        && self.n_measured > content.1 + N_SEARCHED_PARTS * SAMPLES_PER_PART
                        && !self.acknowledged.contains(content) => {}
                // A person ended the session before this was recorded.
                (Some(content), Some(row))
                    if row.reason.contains("session has ended")
                        && !self.acknowledged.contains(content) => {}
                (content, rejected) => {
                    return Err(format!("{}: {content:?} got {rejected:?}", self.asset));
                }
            }
        }
        let n = ack.accepted + ack.duplicate + ack.rejected.len();
        let expected = batch.rows.len();
        if n != expected {
            return Err(format!("{}: {n} outcomes for {expected} rows: {ack:?}", self.asset));
        }
        Ok(())
    }
}
