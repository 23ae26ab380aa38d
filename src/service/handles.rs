//! What every part of the service works with: the store, the writer's queue, the
//! clock, the runtime, and whether the service closes.

use std::future::Future;

use tokio::runtime::Handle;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

use super::commit::{Life, WriteSet};
use super::{Clock, ServiceError};
use crate::store::{Store, Write};

/// Cheap to clone.
#[derive(Clone)]
pub(super) struct Handles {
    pub(super) store: Store,
    pub(super) clock: Clock,
    pub(super) runtime: Handle,
    /// Cancelled when the service closes.
    pub(super) closing: CancellationToken,
    writer: mpsc::Sender<WriteSet>,
}

impl Handles {
    /// On the current runtime.
    pub(super) fn new(
        store: Store,
        writer: mpsc::Sender<WriteSet>,
        closing: CancellationToken,
    ) -> Self {
        Self { store, clock: Clock, runtime: Handle::current(), closing, writer }
    }

    /// The writer's queue, to look at.
    pub(super) const fn writer(&self) -> &mpsc::Sender<WriteSet> {
        &self.writer
    }

    /// Makes one change durable that belongs to no engine.
    pub(super) async fn write(&self, write: Write) -> Result<(), ServiceError> {
        self.write_all(vec![write]).await
    }

    /// Makes changes durable, together, that belong to no engine.
    pub(super) async fn write_all(&self, writes: Vec<Write>) -> Result<(), ServiceError> {
        let (settled, wait) = oneshot::channel();
        let done = Box::new(move |outcome| {
            let _ = settled.send(outcome);
        });
        let set = WriteSet { writes, life: Life::default(), done };
        let gone = ServiceError::Unavailable { what: "the service is closing" };
        self.writer.send(set).await.map_err(|_| gone)?;
        wait.await.unwrap_or(Err(ServiceError::Unavailable { what: "the writer is gone" }))
    }

    /// Hands `set` to the writer; waits while its queue is full. If the writer is
    /// gone, dropping the set tells those who wait. Not on a thread of the runtime.
    pub(super) fn hand_over(&self, set: WriteSet) {
        if self.writer.blocking_send(set).is_err() {
            tracing::error!("the writer is gone");
        }
    }

    /// Waits until everything sent to the writer so far is settled, so that what is
    /// read next is what was written last. Not on a thread of the runtime.
    pub(super) fn fence(&self) -> Result<(), ServiceError> {
        let (settled, wait) = oneshot::channel();
        let done = Box::new(move |_| {
            let _ = settled.send(());
        });
        self.hand_over(WriteSet { writes: Vec::new(), life: Life::default(), done });
        wait.blocking_recv().map_err(|_| ServiceError::Unavailable { what: "the writer is gone" })
    }

    /// Waits for an answer of the store. Not on a thread of the runtime.
    pub(super) fn wait<T>(&self, answer: impl Future<Output = T>) -> T {
        self.runtime.block_on(answer)
    }
}
