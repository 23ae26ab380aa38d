//! Readiness of the service, and the length of its queues.

use std::sync::atomic::Ordering;

use crate::start::Inner;
use crate::upkeep::STALLED_AFTER;
use crate::{Limits, Service, ServiceError};
use offbd_store::StoreError;

/// The length of the queues.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct QueueLoad {
    /// Samples between arrival and commit.
    pub samples: usize,
    /// Commands in the queue of each shard.
    pub shards: Vec<usize>,
    /// Write sets in the queue of the writer.
    pub writer: usize,
}

impl Service {
    /// Returns the configured limits.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.inner.limits
    }

    /// Checks that the store responds, the shards and the writer run, and ingest is not
    /// stalled.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`], [`ServiceError::Outage`] or [`ServiceError::Stalled`]
    /// with the reason.
    pub async fn ready(&self) -> Result<(), ServiceError> {
        if self.inner.handles.writer().is_closed() {
            return Err(ServiceError::Unavailable { what: "the writer has stopped" });
        }
        if self.inner.shards.is_any_closed() {
            return Err(ServiceError::Unavailable { what: "a shard has stopped" });
        }
        if let Some(reason) = self.inner.handles.outage.borrow().clone() {
            return Err(ServiceError::Outage { reason });
        }
        if self.inner.stalled.load(Ordering::Relaxed) {
            return Err(ServiceError::Stalled { seconds: STALLED_AFTER.as_secs() });
        }
        let outage = |error: StoreError| ServiceError::Outage { reason: error.to_string() };
        self.inner.handles.store.ping().await.map_err(outage)
    }

    /// Returns the current length of the queues.
    #[must_use]
    pub fn load(&self) -> QueueLoad {
        let Inner { shards, handles, in_flight, limits, .. } = &*self.inner;
        let samples = limits.requests.in_flight_samples - in_flight.available_permits();
        let writer = handles.writer().max_capacity() - handles.writer().capacity();
        QueueLoad { samples, shards: shards.n_queued(), writer }
    }

    /// Returns the number of assets whose engine is still to be rebuilt after the start.
    #[must_use]
    pub fn n_rebuilding(&self) -> usize {
        self.inner.n_rebuilding.load(Ordering::Relaxed)
    }

    /// Returns the number of assets whose latest samples are not judged.
    #[must_use]
    pub fn n_untested(&self) -> usize {
        self.inner.presences.n_untested()
    }

    /// Returns the partitions that this process owns, each with its epoch.
    #[must_use]
    pub fn partition_epochs(&self) -> Vec<(u32, i64)> {
        let epochs = self.inner.handles.ownership.epochs();
        epochs.into_iter().map(|(partition, epoch)| (partition.0, epoch)).collect()
    }
}
