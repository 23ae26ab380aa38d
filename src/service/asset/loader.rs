//! Loads assets beside the thread of their shard, so that an asset with a long recording, or
//! a database that is slow, does not hold up the others.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use tokio::sync::mpsc::{
    Sender, UnboundedReceiver, UnboundedSender, WeakSender, unbounded_channel,
};
use tokio::sync::{AcquireError, Semaphore};

use super::actor::Asset;
use super::load::StoredAsset;
use super::message::{LoadResult, ShardMessage};
use crate::service::ServiceError;
use crate::service::writing::Handles;

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

/// The queue of assets to load, as a shard sees it. Unbounded, since a shard requests each
/// of its assets once at a time.
#[derive(Clone)]
pub(super) struct LoadQueue {
    requests: UnboundedSender<LoadRequest>,
    n_waiting: Arc<AtomicUsize>,
    /// The queue of the shard, which gets the result.
    shard: WeakSender<ShardMessage>,
}

impl LoadQueue {
    /// Returns the queue for another shard.
    pub(super) fn of(&self, shard: &Sender<ShardMessage>) -> Self {
        Self { shard: shard.downgrade(), ..self.clone() }
    }

    /// Requests to load the asset `name`, whose partition has this epoch; the shard gets the result as a message. Returns why
    /// commands must not wait for it, if many assets are to be loaded before.
    pub(super) fn load(&self, name: &str, epoch: i64) -> Option<ServiceError> {
        let closing = ServiceError::Unavailable { what: "the service is shutting down" };
        let Some(shard) = self.shard.upgrade() else { return Some(closing) };
        let n_before = self.n_waiting.fetch_add(1, Ordering::Relaxed);
        let request = LoadRequest { asset: name.to_owned(), epoch, shard };
        if self.requests.send(request).is_err() {
            return Some(closing);
        }
        let many = ServiceError::Busy { what: "many assets are being loaded" };
        (n_before >= MANY_ASSETS).then_some(many)
    }
}

/// A request to load an asset.
pub(in crate::service) struct LoadRequest {
    asset: String,
    epoch: i64,
    shard: Sender<ShardMessage>,
}

/// Executes the requests of all shards.
pub(in crate::service) struct Loader {
    handles: Handles,
    requests: UnboundedReceiver<LoadRequest>,
    limits: Arc<LoadLimits>,
}

struct LoadLimits {
    /// One permit for each asset that is being loaded, while it has few samples to evaluate.
    few: Semaphore,
    /// One permit for each asset that has many samples to evaluate.
    many: Semaphore,
    n_waiting: Arc<AtomicUsize>,
}

/// An asset after its first step.
enum Progress {
    Loaded(Box<Asset>),
    /// It has many samples to evaluate.
    Behind(Box<StoredAsset>),
}

impl Loader {
    /// Returns the loader of `n_shards` shards, and the queue of the first of them.
    pub(super) fn new(
        handles: Handles,
        n_shards: usize,
        shard: &Sender<ShardMessage>,
    ) -> (Self, LoadQueue) {
        let (sender, requests) = unbounded_channel();
        let n_waiting = Arc::new(AtomicUsize::new(0));
        let (few, many) = (Semaphore::new(2 * n_shards), Semaphore::new(n_shards));
        let limits = LoadLimits { few, many, n_waiting: n_waiting.clone() };
        let queue = LoadQueue { requests: sender, n_waiting, shard: shard.downgrade() };
        (Self { handles, requests, limits: Arc::new(limits) }, queue)
    }

    /// Executes the next request if there is one, on this thread.
    #[cfg(test)]
    pub(in crate::service) fn step(&mut self) -> bool {
        let Ok(LoadRequest { asset, epoch, shard }) = self.requests.try_recv() else {
            return false;
        };
        self.limits.n_waiting.fetch_sub(1, Ordering::Relaxed);
        let begun = self.handles.fence().and_then(|()| begin(&self.handles, &asset));
        let loaded = begun.map(|progress| match progress {
            Progress::Loaded(asset) => asset,
            Progress::Behind(stored) => Box::new(stored.catch_up(&self.handles).unwrap()),
        });
        let message = ShardMessage::Loaded { asset, epoch, result: Box::new(loaded) };
        assert!(shard.try_send(message).is_ok(), "a simulation leaves room in the queues");
        true
    }

    /// Executes the requests, several at a time, until all shards have ended.
    pub(in crate::service) async fn run(mut self) {
        while let Some(LoadRequest { asset, epoch, shard }) = self.requests.recv().await {
            let (handles, limits) = (self.handles.clone(), self.limits.clone());
            tokio::spawn(async move {
                let result = Box::new(load(&handles, &limits, &asset, &shard).await);
                limits.n_waiting.fetch_sub(1, Ordering::Relaxed);
                // Fails only if the thread of the shard has panicked.
                let _ = shard.send(ShardMessage::Loaded { asset, epoch, result }).await;
            });
        }
    }
}

async fn load(
    handles: &Handles,
    limits: &LoadLimits,
    name: &str,
    shard: &Sender<ShardMessage>,
) -> LoadResult {
    // Before there is a permit, so that one commit completes the fences of all that wait.
    handles.fence_async().await?;
    let permit = limits.few.acquire().await.map_err(closed)?;
    let (for_reading, asset) = (handles.clone(), name.to_owned());
    let stored = match blocking(name, move || begin(&for_reading, &asset)).await? {
        Progress::Loaded(asset) => return Ok(asset),
        Progress::Behind(stored) => stored,
    };
    drop(permit);
    let n_behind = stored.n_behind();
    tracing::info!(asset = name, n_behind, "the engine is rebuilt from a long recording");
    let retry_after_s = (1 + n_behind / SAMPLES_PER_S).min(LONGEST_RETRY_S).unsigned_abs();
    let message = ShardMessage::Rebuilding { asset: name.to_owned(), retry_after_s };
    let _ = shard.send(message).await;
    let _permit = limits.many.acquire().await.map_err(closed)?;
    let handles = handles.clone();
    blocking(name, move || stored.catch_up(&handles).map(Box::new)).await
}

/// Reads the asset `name`, and evaluates its recording unless that takes long.
fn begin(handles: &Handles, name: &str) -> Result<Progress, ServiceError> {
    let stored = StoredAsset::read(handles, name)?;
    if stored.n_behind() >= MANY_SAMPLES {
        return Ok(Progress::Behind(Box::new(stored)));
    }
    stored.catch_up(handles).map(|asset| Progress::Loaded(Box::new(asset)))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::{Clock, Limits, Service};
    use crate::store::{Location, Store};

    #[tokio::test]
    async fn assets_that_load_wait_for_the_same_commit() {
        const N: usize = 50;
        let data = tempfile::tempdir().unwrap();
        let location = Location::File(data.path().join("offbd.sqlite"));
        let (store, writer) = Store::open(&location).await.unwrap();
        let (service, mut parts) =
            Service::assemble(store, writer, Limits::default(), None, None, Clock::System);
        let (shard, mut results) = tokio::sync::mpsc::channel(N);
        let (loader, queue) = Loader::new(service.inner.handles.clone(), 1, &shard);
        tokio::spawn(loader.run());
        for i in 0..N {
            assert!(queue.load(&format!("rig-{i}"), 1).is_none());
        }
        for _ in 0..10 * N {
            tokio::task::yield_now().await;
        }
        assert_eq!(parts.committer.queue.len(), N, "all wait, and nothing is committed");
        assert!(parts.committer.step(N).await);
        for _ in 0..N {
            let Some(ShardMessage::Loaded { result, .. }) = results.recv().await else { panic!() };
            assert!(matches!(*result, Err(ServiceError::UnknownAsset { .. })));
        }
    }
}
