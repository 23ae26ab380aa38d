//! Loads assets beside the thread of their shard, so that an asset with a long recording, or
//! a database that is slow, does not hold up the others.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use tokio::sync::mpsc::{Sender, WeakSender};
use tokio::sync::{AcquireError, Semaphore};

use super::actor::Asset;
use super::load::StoredAsset;
use super::shards::ShardMessage;
use crate::service::ServiceError;
use crate::service::writing::Handles;

/// A loaded asset, or why it cannot be loaded.
pub(super) type LoadResult = Result<Box<Asset>, ServiceError>;

/// Samples to evaluate from which on requests are refused instead of waiting: less take some
/// 0.1 s. With a snapshot there are much less.
pub(in crate::service) const MANY_SAMPLES: i64 = 100_000;

/// Samples per second of an engine, for the time after which a client should retry. Chosen:
/// half of what one core does when it does nothing else.
const SAMPLES_PER_S: i64 = 500_000;

/// Longest time after which a client should retry, s. Chosen.
const LONGEST_RETRY_S: i64 = 60;

/// Assets waiting to be loaded above which requests do not wait any more. Chosen: some
/// seconds of work.
const MANY_ASSETS: usize = 256;

/// What the loaders of all shards share.
struct LoadLimits {
    /// One permit for each asset that is being loaded, while it has few samples to evaluate.
    few: Semaphore,
    /// One permit for each asset that has many samples to evaluate.
    many: Semaphore,
    n_waiting: AtomicUsize,
}

/// The loader of one shard. Cheap to clone.
#[derive(Clone)]
pub(super) struct Loader {
    handles: Handles,
    shard: WeakSender<ShardMessage>,
    limits: Arc<LoadLimits>,
}

/// An asset after its first step.
enum Progress {
    Loaded(Box<Asset>),
    /// It has many samples to evaluate.
    Behind(Box<StoredAsset>),
}

impl Loader {
    /// Returns the loader of the first of `shards`, which is cloned for the others.
    pub(super) fn new(handles: Handles, n_shards: usize, shard: &Sender<ShardMessage>) -> Self {
        let (few, many) = (Semaphore::new(2 * n_shards), Semaphore::new(n_shards));
        let limits = LoadLimits { few, many, n_waiting: AtomicUsize::new(0) };
        Self { handles, shard: shard.downgrade(), limits: Arc::new(limits) }
    }

    /// Returns a loader for another shard, with the same limits.
    pub(super) fn of(&self, shard: &Sender<ShardMessage>) -> Self {
        Self { shard: shard.downgrade(), ..self.clone() }
    }

    /// Starts to load the asset `name`; its shard gets the result as a message. Returns why
    /// requests must not wait for it, if many assets are to be loaded before.
    pub(super) fn load(&self, name: &str) -> Option<ServiceError> {
        let Some(shard) = self.shard.upgrade() else {
            return Some(ServiceError::Unavailable { what: "the service is shutting down" });
        };
        let n_waiting = self.limits.n_waiting.fetch_add(1, Ordering::Relaxed);
        let (this, name) = (self.clone(), name.to_owned());
        self.handles.runtime.spawn(async move {
            let result = Box::new(this.result(&name, &shard).await);
            this.limits.n_waiting.fetch_sub(1, Ordering::Relaxed);
            // Fails only if the thread of the shard has panicked.
            let _ = shard.send(ShardMessage::Loaded { asset: name, result }).await;
        });
        let many = ServiceError::Busy { what: "many assets are being loaded" };
        (n_waiting >= MANY_ASSETS).then_some(many)
    }

    async fn result(&self, name: &str, shard: &Sender<ShardMessage>) -> LoadResult {
        let permit = self.limits.few.acquire().await.map_err(closed)?;
        let (handles, asset) = (self.handles.clone(), name.to_owned());
        let stored = blocking(name, move || {
            let stored = StoredAsset::read(&handles, &asset)?;
            if stored.n_behind() >= MANY_SAMPLES {
                return Ok(Progress::Behind(Box::new(stored)));
            }
            stored.catch_up(&handles).map(|asset| Progress::Loaded(Box::new(asset)))
        });
        let stored = match stored.await? {
            Progress::Loaded(asset) => return Ok(asset),
            Progress::Behind(stored) => stored,
        };
        drop(permit);
        let n_behind = stored.n_behind();
        tracing::info!(asset = name, n_behind, "the engine is rebuilt from a long recording");
        let retry_after_s = (1 + n_behind / SAMPLES_PER_S).min(LONGEST_RETRY_S).unsigned_abs();
        let message = ShardMessage::Rebuilding { asset: name.to_owned(), retry_after_s };
        let _ = shard.send(message).await;
        let _permit = self.limits.many.acquire().await.map_err(closed)?;
        let handles = self.handles.clone();
        blocking(name, move || stored.catch_up(&handles).map(Box::new)).await
    }
}

fn closed(_: AcquireError) -> ServiceError {
    ServiceError::Unavailable { what: "the service is shutting down" }
}

/// Runs `work` on a thread that may block.
async fn blocking<T: Send + 'static>(
    asset: &str,
    work: impl FnOnce() -> Result<T, ServiceError> + Send + 'static,
) -> Result<T, ServiceError> {
    tokio::task::spawn_blocking(work).await.unwrap_or_else(|_| {
        tracing::error!(asset, "rebuilding the engine panicked");
        Err(ServiceError::Unavailable { what: "the engine of the asset cannot be rebuilt" })
    })
}
