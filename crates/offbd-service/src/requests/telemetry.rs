//! Submitting batches of samples. A batch is refused if the samples in flight are at their
//! limit.

use std::future::Future;
use std::time::Instant;

use tokio::sync::OwnedSemaphorePermit;
use tracing::Span;

use crate::asset::{Answer, AssetCommand, Reply};
use crate::{Service, ServiceError};
use offbd_wire::telemetry::{AckView, Batch, UnknownKeyView};

/// A submitted batch whose acknowledgement is pending. Its samples count as in flight until
/// they are durable or refused, even if this is dropped.
pub struct PendingBatch {
    answer: Answer<AckView>,
    submitted_at: Instant,
    unknown: Vec<UnknownKeyView>,
}

impl PendingBatch {
    /// Waits until the batch is durable.
    ///
    /// # Errors
    /// [`ServiceError`] if the batch, or a part of it, is not stored.
    pub async fn acknowledged(self) -> Result<AckView, ServiceError> {
        let mut ack = self.answer.wait().await?;
        ack.unknown = self.unknown;
        metrics::histogram!("offbd_ack_seconds").record(self.submitted_at.elapsed().as_secs_f64());
        Ok(ack)
    }
}

#[cfg(test)]
impl PendingBatch {
    /// Returns the answer if it is there, otherwise the batch.
    pub(crate) fn now(self) -> Result<Result<AckView, ServiceError>, Self> {
        let Self { answer, submitted_at, unknown } = self;
        answer.now().map_err(|answer| Self { answer, submitted_at, unknown })
    }
}

impl Service {
    /// Submits a batch for `asset` without waiting. Batches are evaluated in the order in
    /// which they are submitted.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] if a limit is reached; [`ServiceError::TooMany`] if the batch
    /// is too long.
    pub fn submit(&self, asset: &str, batch: Batch) -> Result<PendingBatch, ServiceError> {
        let permits = self.permits(&batch)?;
        let permit =
            self.inner.in_flight.clone().try_acquire_many_owned(permits).map_err(|_| {
                metrics::counter!("offbd_turned_away_total", "queue" => "samples").increment(1);
                ServiceError::Busy { what: "the limit of samples in flight is reached" }
            })?;
        let (command, pending) = ingest(batch, false, permit);
        self.inner.shards.try_send(asset, command)?;
        Ok(pending)
    }

    /// Submits a batch for `asset`, after waiting for room. Cancel safe: if the future is
    /// dropped before it completes, the batch is not submitted.
    ///
    /// # Errors
    /// [`ServiceError::TooMany`] if the batch is too long; [`ServiceError::Unavailable`] if
    /// the service is shutting down.
    pub fn submit_when_ready(
        &self,
        asset: &str,
        batch: Batch,
        importing: bool,
    ) -> impl Future<Output = Result<PendingBatch, ServiceError>> + Send + use<> {
        let (this, asset) = (self.clone(), asset.to_owned());
        async move {
            let permits = this.permits(&batch)?;
            let in_flight = this.inner.in_flight.clone();
            let permit = in_flight
                .acquire_many_owned(permits)
                .await
                .map_err(|_| ServiceError::Unavailable { what: "the service is shutting down" })?;
            let (command, pending) = ingest(batch, importing, permit);
            this.inner.shards.send(&asset, command).await?;
            Ok(pending)
        }
    }

    fn permits(&self, batch: &Batch) -> Result<u32, ServiceError> {
        let limit = self.inner.limits.requests.longest_batch();
        if batch.rows.len() > limit {
            return Err(ServiceError::TooMany { what: "samples in one batch", limit });
        }
        Ok(u32::try_from(batch.rows.len()).unwrap_or(u32::MAX))
    }
}

/// Returns the command that ingests `batch`, and its pending acknowledgement.
#[expect(clippy::disallowed_methods, reason = "the time to the acknowledgement is a metric")]
fn ingest(
    batch: Batch,
    importing: bool,
    permit: OwnedSemaphorePermit,
) -> (AssetCommand, PendingBatch) {
    let unknown = batch.unknown.clone();
    let (reply, answer) = Reply::new();
    let (request, reply) = (Span::current(), reply.with_permit(permit));
    let command = AssetCommand::Ingest { batch, importing, request, reply };
    (command, PendingBatch { answer, submitted_at: Instant::now(), unknown })
}
