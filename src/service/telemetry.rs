//! A batch arrives.

use std::future::Future;
use std::time::Instant;

use tokio::sync::{OwnedSemaphorePermit, oneshot};
use tracing::Span;

use super::running::{Running, Work};
use super::shard::{Context, Job, Reply};
use super::{Service, ServiceError, settled};
use crate::store::SessionRow;
use crate::wire::telemetry::{AckView, Batch, RowView, key, keys};
use offbd_core::vocabulary::Sample;

/// Chunks of an ended session, or of the past of an open one, that are looked
/// through for a retransmitted batch; older samples are not found.
const MAX_CHUNKS_SEARCHED: u32 = 32;

/// The acknowledgement of a batch that is under way. Its samples are in flight
/// until they are durable or refused, whether or not anybody reads this.
pub struct Pending {
    answer: oneshot::Receiver<Result<AckView, ServiceError>>,
    begun: Instant,
}

impl Pending {
    /// Waits until the batch is durable.
    ///
    /// # Errors
    /// [`ServiceError`] if it was not taken, or not as a whole.
    pub async fn acknowledged(self) -> Result<AckView, ServiceError> {
        let ack = settled(self.answer.await)?;
        metrics::histogram!("offbd_ack_seconds").record(self.begun.elapsed().as_secs_f64());
        Ok(ack)
    }
}

impl Service {
    /// Takes a batch for `asset`, or turns it away at once when too much waits.
    /// Batches given one after the other are judged in that order.
    ///
    /// # Errors
    /// [`ServiceError::Busy`]; [`ServiceError::TooMany`] for a batch too long.
    pub fn submit(&self, asset: &str, batch: Batch) -> Result<Pending, ServiceError> {
        let permits = self.permits(&batch)?;
        let permit =
            self.inner.in_flight.clone().try_acquire_many_owned(permits).map_err(|_| {
                metrics::counter!("offbd_turned_away_total", "queue" => "samples").increment(1);
                ServiceError::Busy { what: "too many samples are under way" }
            })?;
        let (job, pending) = take_job(asset, batch, false, permit);
        self.shard(asset).try_send(job).map_err(ServiceError::from_full)?;
        Ok(pending)
    }

    /// The same, but waits for room. Dropped before it is ready, it has taken nothing.
    ///
    /// # Errors
    /// [`ServiceError::TooMany`]; [`ServiceError::Unavailable`] when closing.
    pub fn submit_in_turn(
        &self,
        asset: &str,
        batch: Batch,
        importing: bool,
    ) -> impl Future<Output = Result<Pending, ServiceError>> + Send + use<> {
        let (this, asset) = (self.clone(), asset.to_owned());
        async move {
            let closing = |_| ServiceError::Unavailable { what: "the service is closing" };
            let permits = this.permits(&batch)?;
            let in_flight = this.inner.in_flight.clone();
            let permit = in_flight
                .acquire_many_owned(permits)
                .await
                .map_err(|_| ServiceError::Unavailable { what: "the service is closing" })?;
            let (job, pending) = take_job(&asset, batch, importing, permit);
            this.shard(&asset).send(job).await.map_err(closing)?;
            Ok(pending)
        }
    }

    fn permits(&self, batch: &Batch) -> Result<u32, ServiceError> {
        let limit = self.inner.limits.longest_batch();
        if batch.rows.len() > limit {
            return Err(ServiceError::TooMany { what: "samples in one batch", limit });
        }
        Ok(u32::try_from(batch.rows.len()).unwrap_or(u32::MAX))
    }
}

#[expect(clippy::disallowed_methods, reason = "how long an acknowledgement took is a metric")]
fn take_job(
    asset: &str,
    batch: Batch,
    importing: bool,
    permit: OwnedSemaphorePermit,
) -> (Job, Pending) {
    let (reply, answer) = oneshot::channel();
    let asset = asset.to_owned();
    let request = Span::current();
    let job: Job = Box::new(move |shard| {
        let _judging = tracing::debug_span!(parent: &request, "judge").entered();
        let act = |context: &Context, running: &mut Running, work: &mut Work| {
            take(context, running, batch, importing, work)
        };
        shard.act(&asset, act, Reply::with_permit(reply, permit));
    });
    (job, Pending { answer, begun: Instant::now() })
}

/// Takes a batch on the asset's shard.
fn take(
    context: &Context,
    running: &mut Running,
    batch: Batch,
    importing: bool,
    work: &mut Work,
) -> Result<AckView, ServiceError> {
    let mut ack = AckView::default();
    let mut samples = Vec::with_capacity(batch.rows.len());
    for (index, row) in batch.rows.into_iter().enumerate() {
        match row {
            Ok(sample) => samples.push((index, sample)),
            Err(reason) => {
                unjudged("form");
                ack.rejected.push(RowView { index, reason });
            }
        }
    }
    if running.open.as_ref().is_some_and(|open| open.importing != importing) {
        return Err(ServiceError::Busy { what: "a recording is being imported into this asset" });
    }
    if !samples.is_empty() {
        match batch.session {
            Some(name) => match switch(context, running, &name, work)? {
                Switched::Open => drop(running.ingest(&samples, false, work, &mut ack)?),
                Switched::Ended(row) => retransmitted(context, &row, &samples, &mut ack)?,
            },
            None => nameless(context, running, &samples, work, &mut ack)?,
        }
    }
    if let (Some(open), Some((_, last))) = (&running.open, samples.last()) {
        context.presences.note(&running.row.name, &open.id, work.at, last.t_s);
    }
    running.count_rejected(ack.rejected.len(), work);
    running.learn_if_due(context, work)?;
    ack.rejected.sort_by_key(|row| row.index);
    count(&ack);
    Ok(ack)
}

/// Counts a sample that is not judged; `reason` is one of few.
pub(super) fn unjudged(reason: &'static str) {
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

pub(super) enum Switched {
    /// The session is open now.
    Open,
    /// It has ended long ago.
    Ended(Box<SessionRow>),
}

/// Makes the session `name` the open one, ending another if need be.
pub(super) fn switch(
    context: &Context,
    running: &mut Running,
    name: &str,
    work: &mut Work,
) -> Result<Switched, ServiceError> {
    if running.open.as_ref().is_some_and(|open| open.name == name) {
        return Ok(Switched::Open);
    }
    super::sessions::check_name(name)?;
    context.handles.fence()?;
    if let Some(row) =
        context.handles.wait(context.handles.store.session_named(&running.row.name, name))?
    {
        return Ok(Switched::Ended(Box::new(row)));
    }
    running.end(context, work)?;
    running.open(name.to_owned(), work)?;
    Ok(Switched::Open)
}

/// Samples for a session that has ended: fine if they are there already.
fn retransmitted(
    context: &Context,
    row: &SessionRow,
    samples: &[(usize, Sample)],
    ack: &mut AckView,
) -> Result<(), ServiceError> {
    let times = samples.iter().map(|(_, sample)| sample.t_s).filter(|t_s| t_s.is_finite());
    let first = times.clone().fold(f64::INFINITY, f64::min);
    let last = times.fold(f64::NEG_INFINITY, f64::max);
    let question =
        context.handles.store.chunks_between(&row.id, (first, last), MAX_CHUNKS_SEARCHED);
    let known = keys(context.handles.wait(question)?.iter().flatten());
    if !samples.iter().all(|(_, sample)| known.contains(&key(sample))) {
        let (asset, name) = (row.asset.clone(), row.name.clone());
        return Err(ServiceError::SessionEnded { asset, name });
    }
    ack.duplicate += samples.len();
    ack.session = Some(row.name.clone());
    ack.session_id = Some(row.id.clone());
    ack.last_seq = row.progress.last_seq.and_then(|seq| u64::try_from(seq).ok());
    Ok(())
}

/// Samples that name no session: for the open one, or for a new one when none
/// is open or the device has started anew.
fn nameless(
    context: &Context,
    running: &mut Running,
    samples: &[(usize, Sample)],
    work: &mut Work,
    ack: &mut AckView,
) -> Result<(), ServiceError> {
    let mut rest = samples;
    let mut watch = true;
    loop {
        if running.open.is_none() {
            running.open_nameless(work)?;
        }
        let taken = running.ingest(rest, watch, work, ack)?;
        rest = &rest[taken..];
        let (Some((_, first)), Some(open)) = (rest.first(), &running.open) else { return Ok(()) };
        // Once a batch: a clock that jumps to and fro opens no session each time.
        watch = false;
        if !is_recorded(context, &open.id, first)? {
            running.end(context, work)?;
        }
    }
}

/// Whether exactly this sample is in the recording: then it is sent again.
fn is_recorded(context: &Context, session: &str, sample: &Sample) -> Result<bool, ServiceError> {
    let range = (sample.t_s, sample.t_s);
    let question = context.handles.store.chunks_between(session, range, MAX_CHUNKS_SEARCHED);
    Ok(context.handles.wait(question)?.iter().flatten().any(|recorded| recorded == sample))
}
