//! The queues of all shards.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use tokio::sync::{mpsc, oneshot};

use super::actor::Asset;
use super::command::AssetCommand;
use super::loader::Loader;
use super::message::ShardMessage;
use super::reply::Reply;
use super::shard::Shard;
use super::turn::Environment;
use crate::{Limits, ServiceError};
use offbd_store::PartitionId;

/// The queues of all shards. The hash of its name assigns each asset to one shard. Cheap to
/// clone.
#[derive(Clone)]
pub(crate) struct Shards(Arc<[mpsc::Sender<ShardMessage>]>);

impl Shards {
    /// Returns the queues, the shards that execute them, and the loader of their assets.
    pub(crate) fn new(limits: &Limits, env: &Environment) -> (Self, Vec<Shard>, Loader) {
        let (mut senders, mut queues) = (Vec::new(), Vec::new());
        for _ in 0..limits.workers.shards.max(1) {
            let (sender, queue) = mpsc::channel(limits.workers.queue);
            senders.push(sender);
            queues.push(queue);
        }
        let (loader, loads) = Loader::new(env.handles.clone(), senders.len(), &senders[0]);
        let shard =
            |(number, queue)| Shard::new(number, env.clone(), loads.of(&senders[number]), queue);
        let shards = queues.into_iter().enumerate().map(shard).collect();
        (Self(senders.into()), shards, loader)
    }

    /// Whether the thread of a shard has ended.
    pub(crate) fn is_any_closed(&self) -> bool {
        self.0.iter().any(mpsc::Sender::is_closed)
    }

    /// Returns the number of messages in each queue.
    pub(crate) fn n_queued(&self) -> Vec<usize> {
        self.0.iter().map(|queue| queue.max_capacity() - queue.capacity()).collect()
    }

    fn of(&self, asset: &str) -> &mpsc::Sender<ShardMessage> {
        let mut hasher = DefaultHasher::new();
        asset.hash(&mut hasher);
        let number = hasher.finish() % self.0.len() as u64;
        &self.0[usize::try_from(number).unwrap_or_default()]
    }

    /// Queues `command` for `asset`.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] if the queue is full.
    pub(crate) fn try_send(&self, asset: &str, command: AssetCommand) -> Result<(), ServiceError> {
        let message = ShardMessage::Command { asset: asset.to_owned(), command };
        self.of(asset).try_send(message).map_err(ServiceError::from_full)
    }

    /// Queues `command` for `asset`; waits while the queue is full.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] if the service is shutting down.
    pub(crate) async fn send(
        &self,
        asset: &str,
        command: AssetCommand,
    ) -> Result<(), ServiceError> {
        let message = ShardMessage::Command { asset: asset.to_owned(), command };
        let closing = |_| ServiceError::Unavailable { what: "the service is shutting down" };
        self.of(asset).send(message).await.map_err(closing)
    }

    /// Drops the engines of `partitions`; see [`ShardMessage::Release`].
    pub(crate) async fn release(&self, partitions: Vec<PartitionId>, lost: bool) {
        let partitions: Arc<[PartitionId]> = partitions.into();
        let mut released = Vec::new();
        for queue in &*self.0 {
            let (done, released_here) = oneshot::channel();
            let message = ShardMessage::Release { partitions: partitions.clone(), lost, done };
            if queue.send(message).await.is_ok() {
                released.push(released_here);
            }
        }
        for released in released {
            // An error means that the service shuts down.
            let _ = released.await;
        }
    }

    /// Queues the command that `make` returns and waits for its reply.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] if the queue is full; those of the command.
    pub(crate) async fn call<T>(
        &self,
        asset: &str,
        make: impl FnOnce(Reply<T>) -> AssetCommand,
    ) -> Result<T, ServiceError> {
        let (reply, answer) = Reply::new();
        self.try_send(asset, make(reply))?;
        answer.wait().await
    }

    /// Returns what `look` sees of `asset`; `None` if it is not loaded, which this does not
    /// change.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] if the queue is full; [`ServiceError::Moving`];
    /// [`ServiceError::Unavailable`] if the shard does not answer.
    pub(crate) async fn look<T: Send + 'static>(
        &self,
        asset: &str,
        look: impl FnOnce(&Asset) -> T + Send + 'static,
    ) -> Result<Option<T>, ServiceError> {
        let show = |reply: Reply<Option<T>>| {
            AssetCommand::Look(Box::new(|asset| reply.send(asset.map(|asset| asset.map(look)))))
        };
        self.call(asset, show).await
    }
}
