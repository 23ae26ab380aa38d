//! The handles that every part of the service uses: the store, the writer's queue, the
//! clock, the runtime, and the shutdown signal.

use std::future::Future;

use tokio::runtime::Handle;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

use super::commit::{EngineGeneration, WriteSet};
use crate::service::{Clock, ServiceError};
use crate::store::{Store, Write};

/// The shared handles of the service. Cheap to clone.
#[derive(Clone)]
pub(in crate::service) struct Handles {
    pub(in crate::service) store: Store,
    pub(in crate::service) clock: Clock,
    pub(in crate::service) runtime: Handle,
    /// Cancelled when the service shuts down.
    pub(in crate::service) closing: CancellationToken,
    writer: mpsc::Sender<WriteSet>,
}

impl Handles {
    /// Returns handles on the current runtime.
    pub(in crate::service) fn new(
        store: Store,
        writer: mpsc::Sender<WriteSet>,
        closing: CancellationToken,
    ) -> Self {
        Self { store, clock: Clock, runtime: Handle::current(), closing, writer }
    }

    /// Returns the writer's queue, for its state and length.
    pub(in crate::service) const fn writer(&self) -> &mpsc::Sender<WriteSet> {
        &self.writer
    }

    /// Makes a change durable that does not belong to an engine.
    pub(in crate::service) async fn write(&self, write: Write) -> Result<(), ServiceError> {
        self.write_all(vec![write]).await
    }

    /// Makes changes durable together that do not belong to an engine.
    pub(in crate::service) async fn write_all(
        &self,
        writes: Vec<Write>,
    ) -> Result<(), ServiceError> {
        let (sender, receiver) = oneshot::channel();
        let completion = Box::new(move |outcome| {
            let _ = sender.send(outcome);
        });
        let set = WriteSet { writes, generation: EngineGeneration::default(), completion };
        let closing = ServiceError::Unavailable { what: "the service is shutting down" };
        self.writer.send(set).await.map_err(|_| closing)?;
        let stopped = ServiceError::Unavailable { what: "the writer has stopped" };
        receiver.await.unwrap_or(Err(stopped))
    }

    /// Submits `set` to the writer; blocks while its queue is full. If the writer has
    /// stopped, the set is dropped, which reports an error to its receiver. Must not run on
    /// a thread of the runtime.
    pub(in crate::service) fn submit(&self, set: WriteSet) {
        if self.writer.blocking_send(set).is_err() {
            tracing::error!("the writer has stopped");
        }
    }

    /// Blocks until everything submitted so far is committed or refused, so that the next
    /// read sees it. Must not run on a thread of the runtime.
    pub(in crate::service) fn fence(&self) -> Result<(), ServiceError> {
        let (sender, receiver) = oneshot::channel();
        let completion = Box::new(move |_| {
            let _ = sender.send(());
        });
        let generation = EngineGeneration::default();
        self.submit(WriteSet { writes: Vec::new(), generation, completion });
        let stopped = |_| ServiceError::Unavailable { what: "the writer has stopped" };
        receiver.blocking_recv().map_err(stopped)
    }

    /// Blocks until a query of the store completes. Must not run on a thread of the
    /// runtime.
    pub(in crate::service) fn wait<T>(&self, answer: impl Future<Output = T>) -> T {
        self.runtime.block_on(answer)
    }
}
