//! Loads assets beside the threads of their shards, so that an asset with a long recording, or
//! a database that is slow, does not hold up the others. What waits is read in groups: most of
//! the time of reading one asset is spent on the way to the database and back.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use tokio::sync::mpsc::{
    Sender, UnboundedReceiver, UnboundedSender, WeakSender, unbounded_channel,
};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::load::{self, StoredAsset};
use super::message::{LoadResult, ShardMessage};
use crate::ServiceError;
use crate::writing::Handles;
use offbd_store::MAX_ASSETS_AT_ONCE;

/// Samples to evaluate from which on requests are refused instead of waiting: less take some
/// 0.1 s. With a snapshot there are much less.
pub(crate) const MANY_SAMPLES: i64 = 100_000;

/// Samples per second of an engine, for the time after which a client should retry. Chosen:
/// half of what one core does when it does nothing else.
const SAMPLES_PER_S: i64 = 500_000;

/// Longest time after which a client should retry, s. Chosen.
const LONGEST_RETRY_S: i64 = 60;

/// Assets waiting to be loaded above which requests do not wait any more. Chosen: some
/// seconds of work.
const MANY_ASSETS: usize = 4096;

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

    /// Requests to load the asset `name`, whose partition has this epoch; the shard gets the
    /// result as a message. Returns why commands must not wait for it, if many assets are to be
    /// loaded before.
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
#[derive(Clone)]
pub(crate) struct LoadRequest {
    asset: String,
    epoch: i64,
    shard: Sender<ShardMessage>,
}

impl LoadRequest {
    fn answer(&self, result: LoadResult) -> ShardMessage {
        let (asset, epoch, result) = (self.asset.clone(), self.epoch, Box::new(result));
        ShardMessage::Loaded { asset, epoch, result }
    }
}

/// Executes the requests of all shards.
pub(crate) struct Loader {
    handles: Handles,
    requests: UnboundedReceiver<LoadRequest>,
    limits: Arc<LoadLimits>,
}

struct LoadLimits {
    /// Groups that are loaded at a time.
    n_groups: usize,
    /// One permit for each of them.
    groups: Arc<Semaphore>,
    /// One permit for each asset that has many samples to evaluate.
    many: Semaphore,
    n_waiting: Arc<AtomicUsize>,
}

/// An asset of a group.
enum Progress {
    Done(LoadResult),
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
        let limits = LoadLimits {
            n_groups: n_shards,
            groups: Arc::new(Semaphore::new(n_shards)),
            many: Semaphore::new(n_shards),
            n_waiting: n_waiting.clone(),
        };
        let queue = LoadQueue { requests: sender, n_waiting, shard: shard.downgrade() };
        (Self { handles, requests, limits: Arc::new(limits) }, queue)
    }

    /// Executes the next requests if there are some, on this thread.
    #[cfg(test)]
    pub(crate) fn step(&mut self) -> bool {
        let Ok(first) = self.requests.try_recv() else { return false };
        let group = self.group(first);
        let handles = &self.handles;
        let answer = |request: &LoadRequest, result| {
            let sent = request.shard.try_send(request.answer(result));
            assert!(sent.is_ok(), "a simulation leaves room in the queues");
        };
        match handles.barrier() {
            Ok(()) => load_group(handles, &group, |request, progress| match progress {
                Progress::Done(result) => answer(request, result),
                Progress::Behind(stored) => {
                    answer(request, stored.catch_up(handles).map(Box::new));
                }
            }),
            Err(error) => group.iter().for_each(|request| answer(request, Err(error.clone()))),
        }
        self.limits.n_waiting.fetch_sub(group.len(), Ordering::Relaxed);
        true
    }

    /// Executes the requests, in several groups at a time, until all shards have ended.
    pub(crate) async fn run(mut self) {
        while let Some(first) = self.requests.recv().await {
            let permit = self.limits.groups.clone().acquire_owned().await;
            let Ok(permit) = permit else { return };
            let group = self.group(first);
            tokio::spawn(execute(self.handles.clone(), self.limits.clone(), group, permit));
        }
    }

    /// Returns the next group: `first` and others that wait, divided among all groups that
    /// may be loaded at a time.
    fn group(&mut self, first: LoadRequest) -> Vec<LoadRequest> {
        let n_waiting = 1 + self.requests.len();
        let size = n_waiting.div_ceil(self.limits.n_groups).min(MAX_ASSETS_AT_ONCE);
        let mut group = BTreeMap::from([(first.asset.clone(), first)]);
        for _ in 1..size {
            let Ok(next) = self.requests.try_recv() else { break };
            if group.insert(next.asset.clone(), next).is_some() {
                // The shard does not wait for the earlier request any more.
                self.limits.n_waiting.fetch_sub(1, Ordering::Relaxed);
            }
        }
        group.into_values().collect()
    }
}

/// Loads a group, and answers each of its requests.
async fn execute(
    handles: Handles,
    limits: Arc<LoadLimits>,
    group: Vec<LoadRequest>,
    permit: OwnedSemaphorePermit,
) {
    let n = group.len();
    let failed = match handles.barrier_async().await {
        Ok(()) => load_blocking(&handles, &limits, &group).await.err(),
        Err(error) => Some(error),
    };
    drop(permit);
    limits.n_waiting.fetch_sub(n, Ordering::Relaxed);
    if let Some(error) = failed {
        for request in group {
            // Fails only if the thread of the shard has panicked.
            let _ = request.shard.send(request.answer(Err(error.clone()))).await;
        }
    }
}

/// Loads a group on a thread that may block.
async fn load_blocking(
    handles: &Handles,
    limits: &Arc<LoadLimits>,
    group: &[LoadRequest],
) -> Result<(), ServiceError> {
    let (handles, limits, group) = (handles.clone(), limits.clone(), group.to_vec());
    let load = move || {
        load_group(&handles, &group, |request, progress| match progress {
            Progress::Done(result) => drop(request.shard.blocking_send(request.answer(result))),
            Progress::Behind(stored) => {
                let rebuilding = rebuild(handles.clone(), limits.clone(), request.clone(), stored);
                drop(handles.runtime.spawn(rebuilding));
            }
        });
    };
    tokio::task::spawn_blocking(load).await.map_err(|_| {
        tracing::error!("loading assets panicked");
        ServiceError::Unavailable { what: "the asset cannot be loaded" }
    })
}

/// Reads the assets of a group, and evaluates their recordings unless that takes long. Passes
/// each to `take` as soon as that is done. Blocks on the store.
fn load_group(
    handles: &Handles,
    group: &[LoadRequest],
    mut take: impl FnMut(&LoadRequest, Progress),
) {
    let names: Vec<_> = group.iter().map(|request| request.asset.clone()).collect();
    let is_behind = |stored: &StoredAsset| stored.n_behind() >= MANY_SAMPLES;
    let mut stored = load::read(handles, &names);
    let few = stored.iter_mut().flatten().filter(|stored| !is_behind(stored));
    let ahead = load::read_ahead(handles, few);
    for (request, stored) in group.iter().zip(stored) {
        let progress = match (stored, &ahead) {
            (Ok(stored), _) if is_behind(&stored) => Progress::Behind(Box::new(stored)),
            (Ok(_), Err(error)) => Progress::Done(Err(error.clone())),
            (Ok(stored), Ok(())) => Progress::Done(stored.catch_up(handles).map(Box::new)),
            (Err(error), _) => Progress::Done(Err(error)),
        };
        take(request, progress);
    }
}

/// Evaluates the long recording of an asset, after telling its shard that this takes long.
async fn rebuild(
    handles: Handles,
    limits: Arc<LoadLimits>,
    request: LoadRequest,
    stored: Box<StoredAsset>,
) {
    let (asset, n_behind) = (request.asset.clone(), stored.n_behind());
    tracing::info!(asset, n_behind, "the engine is rebuilt from a long recording");
    let retry_after_s = (1 + n_behind / SAMPLES_PER_S).min(LONGEST_RETRY_S).unsigned_abs();
    let _ = request.shard.send(ShardMessage::Rebuilding { asset, retry_after_s }).await;
    let Ok(_permit) = limits.many.acquire().await else { return };
    let caught_up = tokio::task::spawn_blocking(move || stored.catch_up(&handles)).await;
    let cannot = ServiceError::Unavailable { what: "the engine of the asset cannot be rebuilt" };
    let result = caught_up.unwrap_or(Err(cannot)).map(Box::new);
    let _ = request.shard.send(request.answer(result)).await;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Clock, Limits, Service};
    use offbd_store::{Location, Store};

    #[tokio::test]
    async fn assets_that_load_wait_for_the_same_barrier() {
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
        assert_eq!(parts.committer.queue.len(), 1, "all wait for one barrier");
        assert!(parts.committer.step(N).await);
        for _ in 0..N {
            let Some(ShardMessage::Loaded { result, .. }) = results.recv().await else { panic!() };
            assert!(matches!(*result, Err(ServiceError::UnknownAsset { .. })));
        }
    }
}
