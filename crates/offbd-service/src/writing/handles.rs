//! The handles that every part of the service uses: the store, the writer's queue, the
//! clock, the runtime, and the shutdown signal.

use std::future::Future;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use tokio::runtime::Handle;
use tokio::sync::mpsc::OwnedPermit;
use tokio::sync::mpsc::error::{SendTimeoutError, TrySendError};
use tokio::sync::{mpsc, oneshot, watch};
use tokio_util::sync::CancellationToken;

use super::commit::Outage;
use super::events::READ_TIMEOUT;
use super::write_set::{EngineGeneration, WriteSet};
use crate::limits::SessionLimits;
use crate::ownership::Ownership;
use crate::{Clock, Limits, ServiceError};
use offbd_store::{
    ConditionalWrite, EditWrite, Expectation, PartitionId, Store, StoreError, Write,
};

/// The shared handles of the service. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Handles {
    pub(crate) store: Store,
    pub(crate) clock: Clock,
    pub(crate) runtime: Handle,
    /// Cancelled when the service shuts down.
    pub(crate) closing: CancellationToken,
    /// How long sessions may be.
    pub(crate) sessions: SessionLimits,
    pub(crate) ownership: Ownership,
    writer: mpsc::Sender<WriteSet>,
    pub(crate) outage: watch::Receiver<Outage>,
    /// Whether a barrier has timed out and is not complete yet.
    is_stuck: Arc<AtomicBool>,
    /// Whether the writer's queue had no room for too long, and has not had any since.
    is_full: Arc<AtomicBool>,
    /// Commits what is queued, in a simulation without a writer thread.
    #[cfg(test)]
    pub(crate) commit_queued: Arc<std::sync::OnceLock<CommitQueued>>,
    /// Number of the next reads that fail, in a simulation.
    #[cfg(test)]
    pub(crate) failing_reads: Arc<std::sync::atomic::AtomicU32>,
}

#[cfg(test)]
type CommitQueued = Box<dyn Fn() + Send + Sync>;

/// Longest time for a barrier, and longest wait for room in the writer's queue. Chosen: much
/// longer than a commit, and short enough for the other assets of a shard to wait.
const WRITER_TIMEOUT: Duration = Duration::from_secs(5);

fn stopped() -> ServiceError {
    ServiceError::Unavailable { what: "the writer has stopped" }
}

impl Handles {
    /// Returns handles on the current runtime.
    pub(crate) fn new(
        store: Store,
        clock: Clock,
        limits: &Limits,
        ownership: Ownership,
        writer: mpsc::Sender<WriteSet>,
        outage: watch::Receiver<Outage>,
        closing: CancellationToken,
    ) -> Self {
        Self {
            store,
            clock,
            runtime: Handle::current(),
            closing,
            sessions: SessionLimits::of(limits),
            ownership,
            writer,
            outage,
            is_stuck: Arc::default(),
            is_full: Arc::default(),
            #[cfg(test)]
            commit_queued: Arc::default(),
            #[cfg(test)]
            failing_reads: Arc::default(),
        }
    }

    /// Returns the writer's queue, for its state and length.
    pub(crate) const fn writer(&self) -> &mpsc::Sender<WriteSet> {
        &self.writer
    }

    /// Makes a change durable that concerns no asset.
    pub(crate) async fn write_unpartitioned(&self, write: Write) -> Result<(), ServiceError> {
        self.commit(None, vec![write]).await
    }

    /// Makes an edit durable if what it replaces is still as it was read; returns whether it is.
    /// `asset` is `None` for an edit that concerns none.
    ///
    /// # Errors
    /// As for [`write`](Self::write).
    pub(crate) async fn edit(
        &self,
        asset: Option<&str>,
        expected: Expectation,
        edit: EditWrite,
    ) -> Result<bool, ServiceError> {
        let (write, refusal) = ConditionalWrite::new(expected, edit);
        let partition = asset.map(|asset| self.ownership.partition_of(asset));
        self.commit(partition, vec![Write::Conditional(write)]).await?;
        Ok(!refusal.is_refused())
    }

    /// Makes changes of `asset` durable together that do not belong to its engine.
    ///
    /// # Errors
    /// [`ServiceError::Moving`] if this process does not own the asset's partition.
    pub(crate) async fn write(&self, asset: &str, writes: Vec<Write>) -> Result<(), ServiceError> {
        self.commit(Some(self.ownership.partition_of(asset)), writes).await
    }

    /// Makes changes durable together that one process of a cluster makes for all: the owner of
    /// the first partition.
    ///
    /// # Errors
    /// [`ServiceError::Moving`] if this process does not own it.
    pub(crate) async fn write_as_leader(&self, writes: Vec<Write>) -> Result<(), ServiceError> {
        self.commit(Some(PartitionId(0)), writes).await
    }

    /// Whether this process does what one of a cluster does for all.
    pub(crate) fn is_leader(&self) -> bool {
        self.ownership.epoch(PartitionId(0)).is_some()
    }

    async fn commit(
        &self,
        partition: Option<PartitionId>,
        writes: Vec<Write>,
    ) -> Result<(), ServiceError> {
        let (sender, receiver) = oneshot::channel();
        let completion = Box::new(move |outcome| {
            let _ = sender.send(outcome);
        });
        let generation = EngineGeneration::default();
        let set = WriteSet { partition, writes, can_wait: false, generation, completion };
        let closing = ServiceError::Unavailable { what: "the service is shutting down" };
        self.writer.send(set).await.map_err(|_| closing)?;
        receiver.await.unwrap_or_else(|_| Err(stopped()))
    }

    /// Blocks until there is room for a write set in the writer's queue, and reserves it.
    /// Must not run on a thread of the runtime.
    ///
    /// # Errors
    /// [`ServiceError::Outage`] after 5 s without room, and at once from then on until there is
    /// some, so that a shard still answers what changes nothing;
    /// [`ServiceError::Unavailable`] if the writer has stopped.
    pub(crate) fn reserve(&self) -> Result<OwnedPermit<WriteSet>, ServiceError> {
        let room = match self.writer.clone().try_reserve_owned() {
            Err(TrySendError::Full(_)) if self.is_full.load(Ordering::Relaxed) => None,
            Err(TrySendError::Full(writer)) => {
                let room =
                    async { tokio::time::timeout(WRITER_TIMEOUT, writer.reserve_owned()).await };
                self.runtime.block_on(room).ok()
            }
            Err(TrySendError::Closed(_)) => return Err(stopped()),
            Ok(permit) => Some(Ok(permit)),
        };
        self.is_full.store(room.is_none(), Ordering::Relaxed);
        match room {
            Some(permit) => permit.map_err(|_| stopped()),
            None => Err(self.stuck()),
        }
    }

    /// Blocks until everything submitted so far is committed or refused, so that the next
    /// read sees it. Must not run on a thread of the runtime.
    ///
    /// # Errors
    /// [`ServiceError::Outage`] after 5 s, and at once as long as that barrier is not complete,
    /// so that assets that must be read do not hold up the others of their shard; those of
    /// [`reserve`](Self::reserve).
    pub(crate) fn barrier(&self) -> Result<(), ServiceError> {
        self.check_barriers()?;
        let (set, done) = self.new_barrier();
        self.reserve()?.send(set);
        #[cfg(test)]
        if let Some(commit_queued) = self.commit_queued.get() {
            commit_queued();
        }
        self.runtime.block_on(self.passed(done))
    }

    /// Waits like [`barrier`](Self::barrier), on the runtime. Barriers that wait at the same time
    /// are complete after one commit.
    ///
    /// # Errors
    /// As for [`barrier`](Self::barrier).
    pub(crate) async fn barrier_async(&self) -> Result<(), ServiceError> {
        self.check_barriers()?;
        let (set, done) = self.new_barrier();
        match self.writer.send_timeout(set, WRITER_TIMEOUT).await {
            Ok(()) => self.passed(done).await,
            Err(SendTimeoutError::Timeout(_)) => Err(self.stuck()),
            Err(SendTimeoutError::Closed(_)) => Err(stopped()),
        }
    }

    /// Whether the database is known to be unavailable, or a barrier has timed out.
    pub(crate) fn is_away(&self) -> bool {
        self.is_stuck.load(Ordering::SeqCst) || self.outage.borrow().is_some()
    }

    fn check_barriers(&self) -> Result<(), ServiceError> {
        if self.is_stuck.load(Ordering::SeqCst) { Err(self.stuck()) } else { Ok(()) }
    }

    fn new_barrier(&self) -> (WriteSet, oneshot::Receiver<()>) {
        let (sender, done) = oneshot::channel();
        let is_stuck = self.is_stuck.clone();
        let completion = Box::new(move |_| {
            // In this order, so that a barrier that times out now sees one of the two.
            let _ = sender.send(());
            is_stuck.store(false, Ordering::SeqCst);
        });
        let generation = EngineGeneration::default();
        let (partition, writes) = (None, Vec::new());
        (WriteSet { partition, writes, can_wait: false, generation, completion }, done)
    }

    async fn passed(&self, mut done: oneshot::Receiver<()>) -> Result<(), ServiceError> {
        if let Ok(done) = tokio::time::timeout(WRITER_TIMEOUT, &mut done).await {
            return done.map_err(|_| stopped());
        }
        self.is_stuck.store(true, Ordering::SeqCst);
        if done.try_recv().is_ok() {
            self.is_stuck.store(false, Ordering::SeqCst);
            return Ok(());
        }
        Err(self.stuck())
    }

    fn stuck(&self) -> ServiceError {
        let reason = self.outage.borrow().clone();
        let reason = reason.unwrap_or_else(|| "nothing was committed for 5 s".to_owned());
        ServiceError::Outage { reason }
    }

    /// Blocks until a read of the store completes. Must not run on a thread of the runtime.
    ///
    /// # Errors
    /// Those of the read; [`StoreError`] if it takes longer than 20 s.
    pub(crate) fn wait<T, E: From<StoreError>>(
        &self,
        answer: impl Future<Output = Result<T, E>>,
    ) -> Result<T, E> {
        #[cfg(test)]
        let one_fewer = |n: u32| n.checked_sub(1);
        #[cfg(test)]
        if self.failing_reads.try_update(Ordering::SeqCst, Ordering::SeqCst, one_fewer).is_ok() {
            return Err(StoreError::too_slow().into());
        }
        self.runtime.block_on(async {
            let late = |_| StoreError::too_slow();
            tokio::time::timeout(READ_TIMEOUT, answer).await.map_err(late)?
        })
    }
}
