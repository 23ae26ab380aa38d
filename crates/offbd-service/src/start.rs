//! Starts the service and its threads and tasks.

use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, Weak};

use futures_util::{StreamExt, stream};
use tokio::sync::{Notify, Semaphore, mpsc, watch};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use super::access::{PrincipalCache, Provider};
use super::asset::{AssetCommand, Environment, Loader, MANY_SAMPLES, Presences, Shard, Shards};
use super::asset_quota::AssetQuota;
use super::cluster::{self, Cluster, NodeTask};
use super::communication::CommunicationWatch;
use super::job::JobQueues;
use super::jobs::{self, JobContext};
use super::limits::{MAX_DRIVE_CYCLES, MAX_IMPORTS, MAX_RECORDINGS, MAX_TRACES, MAX_WHOLE_TRACES};
use super::mutes::Mutes;
use super::notifications::{NotificationTransport, Notifier};
use super::ownership::Ownership;
use super::requests::LastSearch;
use super::upkeep::{Deleter, Upkeep, Watchdog};
use super::writing::{Committer, Events, FIRST_RETRY, Handles, Pace, Transfers};
use super::{Clock, Limits, Reasons, ServiceError, snapshots};
use offbd_store::{MAX_PARTITIONS, NodeIdentity, PartitionId, Store, Write, Writer};

/// Take-overs whose work waits to be continued. If there are more, the jobs of a partition
/// stay queued until its next owner.
const MAX_RESUMED: usize = 1024;

/// A handle to the running service. Cheap to clone; all clones share one service.
#[derive(Clone)]
pub struct Service {
    pub(super) inner: Arc<Inner>,
}

pub(super) struct Inner {
    pub(super) handles: Handles,
    /// `None` for a process that works alone.
    pub(super) cluster: Option<Cluster>,
    pub(super) limits: Limits,
    pub(super) events: Events,
    pub(super) presences: Presences,
    pub(super) mutes: Mutes,
    /// Wakes the notifier.
    pub(super) wake_notifier: Arc<Notify>,
    pub(super) principals: PrincipalCache,
    pub(super) provider: Option<Provider>,
    pub(super) shards: Shards,
    pub(super) deleter: Deleter,
    pub(super) quota: AssetQuota,
    pub(super) jobs: JobQueues,
    pub(super) job_context: JobContext,
    /// One permit for each sample between arrival and commit.
    pub(super) in_flight: Arc<Semaphore>,
    /// Whether batches wait and nothing is committed.
    pub(super) stalled: Arc<AtomicBool>,
    /// Assets whose engine is still to be rebuilt after the start.
    pub(super) n_rebuilding: AtomicUsize,
    pub(super) computing: Computing,
}

/// One permit for each long computation for a request.
pub(super) struct Computing {
    pub(super) recordings: Arc<Semaphore>,
    pub(super) traces: Arc<Semaphore>,
    pub(super) whole_traces: Arc<Semaphore>,
    pub(super) drive_cycles: Arc<Semaphore>,
    pub(super) last_drive_cycle: Mutex<LastSearch>,
    pub(super) imports: Arc<Semaphore>,
}

impl Computing {
    fn new() -> Self {
        let permits = |n| Arc::new(Semaphore::new(n));
        Self {
            recordings: permits(MAX_RECORDINGS),
            traces: permits(MAX_TRACES),
            whole_traces: permits(MAX_WHOLE_TRACES),
            drive_cycles: permits(MAX_DRIVE_CYCLES),
            last_drive_cycle: Mutex::default(),
            imports: permits(MAX_IMPORTS),
        }
    }
}

/// The threads and tasks of a [`Service`]; they end when all its clones are dropped.
pub struct Workers {
    shards: Vec<std::thread::JoinHandle<()>>,
    jobs: Vec<JoinHandle<()>>,
    closing: CancellationToken,
    committer: std::thread::JoinHandle<Option<Writer>>,
}

impl Workers {
    /// Interrupts background jobs and deletions, which restart or continue with the next
    /// start. From now on an unavailable database is awaited for a few seconds only; then
    /// the write sets that wait for it are refused.
    pub fn close(&self) {
        self.closing.cancel();
    }

    /// Calls [`Self::close`], waits until all queued commands are executed and committed,
    /// and closes the store's writer. All clones of the service must be dropped before.
    pub async fn finish(self) {
        self.close();
        for worker in self.jobs {
            if worker.await.is_err() {
                tracing::error!("a worker panicked");
            }
        }
        for shard in self.shards {
            if joined(shard).await.is_none() {
                tracing::error!("a shard panicked");
            }
        }
        let Some(writer) = joined(self.committer).await else {
            return tracing::error!("the writer panicked");
        };
        let Some(writer) = writer else { return };
        if let Err(error) = writer.close().await {
            tracing::error!(%error, "cannot close the store");
        }
    }
}

/// Waits for a thread; returns `None` if it panicked.
async fn joined<T: Send + 'static>(thread: std::thread::JoinHandle<T>) -> Option<T> {
    tokio::task::spawn_blocking(|| thread.join()).await.ok()?.ok()
}

/// The parts of a service that work by themselves, before they are started.
pub(super) struct Parts {
    pub(super) committer: Committer,
    pub(super) shards: Vec<Shard>,
    pub(super) loader: Loader,
    pub(super) upkeep: Upkeep,
    pub(super) node: Option<NodeTask>,
    pub(super) communication: CommunicationWatch,
}

impl Parts {
    /// Starts the writer, then the other threads and tasks, and queues unfinished jobs again.
    /// If that fails, nothing of it is left: it would still change the store.
    async fn start(self, service: Service) -> Result<(Service, Workers), ServiceError> {
        let Self { committer, shards, loader, upkeep, node, communication } = self;
        let mut workers = Workers {
            shards: Vec::new(),
            jobs: Vec::new(),
            closing: service.inner.handles.closing.clone(),
            committer: committer.spawn()?,
        };
        let Inner { limits, handles, job_context, jobs, in_flight, .. } = &*service.inner;
        let started = async {
            // Before the sweeper, which deletes them.
            service.discard_imports(handles.ownership.filter().as_deref()).await?;
            service.inner.mutes.load(handles.store.mutes(handles.clock.now()).await?);
            for shard in shards {
                workers.shards.push(shard.spawn()?);
            }
            workers.jobs = jobs::spawn(limits, job_context, jobs, in_flight);
            workers.jobs.push(tokio::spawn(loader.run()));
            workers.jobs.extend(upkeep.spawn());
            let is_node = node.is_some();
            workers.jobs.extend(node.into_iter().flat_map(|node| service.spawn_node(node)));
            workers.jobs.push(tokio::spawn(communication.run()));
            // A node does so for each partition that it takes.
            if is_node { Ok(()) } else { service.resume_jobs(None).await }
        };
        match started.await {
            Ok(()) => Ok((service, workers)),
            Err(error) => {
                drop(service);
                workers.finish().await;
                Err(error)
            }
        }
    }
}

/// The handles that lead to the writer, and what it reports.
struct WayToWriter {
    handles: Handles,
    committer: Committer,
    events: Events,
    n_commits: Arc<AtomicU64>,
    transfers: Transfers,
    /// Partitions that another node has taken.
    lost: mpsc::Receiver<PartitionId>,
}

impl WayToWriter {
    fn new(
        store: Store,
        writer: Writer,
        limits: &Limits,
        clock: Clock,
        is_clustered: bool,
    ) -> Self {
        let events = Events::new(store.clone(), is_clustered);
        let (sets, queue) = mpsc::channel(limits.commit_queue);
        let (outage_sender, outage) = watch::channel(None);
        let closing = CancellationToken::new();
        let n_commits = Arc::new(AtomicU64::new(0));
        let ownership =
            Ownership::new(writer.partitions(), writer.owned(), writer.n_disconnections());
        let (transfers, transfer_requests) = Transfers::new();
        let (lost_sender, lost) = mpsc::channel(MAX_PARTITIONS as usize);
        let committer = Committer {
            writer,
            queue,
            pace: Pace::default(),
            transfers: transfer_requests,
            ownership: ownership.clone(),
            lost: lost_sender,
            events: events.clone(),
            outage: outage_sender,
            reasons: Reasons::default(),
            n_commits: n_commits.clone(),
            closing: closing.clone(),
            journal_bytes: limits.requests.journal_bytes,
            first_retry: FIRST_RETRY,
        };
        let handles = Handles::new(store, clock, limits, ownership, sets, outage, closing);
        Self { handles, committer, events, n_commits, transfers, lost }
    }
}

impl Service {
    /// Starts the shards and the writer on the current tokio runtime, and queues unfinished
    /// jobs again. Tokens of the identity `provider` are accepted in addition to the
    /// service's own.
    ///
    /// # Errors
    /// [`ServiceError`] if the store cannot be read or no thread can be started.
    pub async fn start(
        store: Store,
        writer: Writer,
        limits: Limits,
        provider: Option<Provider>,
    ) -> Result<(Self, Workers), ServiceError> {
        let (service, parts) = Self::assemble(store, writer, limits, provider, None, Clock::System);
        parts.start(service).await
    }

    /// Starts the tasks of a node of a cluster.
    fn spawn_node(&self, node: NodeTask) -> Vec<JoinHandle<()>> {
        let (resume, taken) = mpsc::channel(MAX_RESUMED);
        let closing = self.inner.handles.closing.clone();
        let mut tasks = cluster::spawn(node, &self.inner.events, resume);
        tasks.push(tokio::spawn(resume_taken(Arc::downgrade(&self.inner), taken, closing)));
        tasks
    }

    /// Starts the service as the node `me` of a cluster. It takes partitions by and by.
    ///
    /// # Errors
    /// As for [`Service::start`].
    pub async fn start_node(
        store: Store,
        writer: Writer,
        limits: Limits,
        provider: Option<Provider>,
        me: NodeIdentity,
    ) -> Result<(Self, Workers), ServiceError> {
        let cluster = Some(Cluster::new(me, store.cluster_secret().await?));
        let (service, parts) =
            Self::assemble(store, writer, limits, provider, cluster, Clock::System);
        parts.start(service).await
    }

    /// Continues what former owners of these partitions have left unfinished.
    pub(super) async fn resume(&self, owned: Option<&[PartitionId]>) -> Result<(), ServiceError> {
        let Inner { handles, mutes, .. } = &*self.inner;
        mutes.load(handles.store.mutes(handles.clock.now()).await?);
        self.discard_imports(owned).await?;
        self.resume_jobs(owned).await?;
        self.rebuild_of(owned).await
    }

    /// Returns a service and its parts that are to be started, on the current tokio runtime.
    pub(super) fn assemble(
        store: Store,
        writer: Writer,
        limits: Limits,
        provider: Option<Provider>,
        cluster: Option<Cluster>,
        clock: Clock,
    ) -> (Self, Parts) {
        let way = WayToWriter::new(store, writer, &limits, clock, cluster.is_some());
        let WayToWriter { handles, committer, events, n_commits, transfers, lost } = way;
        let presences = Presences::default();
        let jobs = JobQueues::default();
        let env = Environment {
            handles: handles.clone(),
            presences: presences.clone(),
            jobs: jobs.automatic.clone(),
        };
        let (queues, shards, loader) = Shards::new(&limits, &env);
        let deleter = Deleter::new(handles.clone());
        let quota = AssetQuota::new(limits.requests.assets);
        let in_flight = Arc::new(Semaphore::new(limits.requests.in_flight_samples));
        let stalled = Arc::new(AtomicBool::new(false));
        let watchdog = Watchdog {
            in_flight: in_flight.clone(),
            max_in_flight: limits.requests.in_flight_samples,
            n_commits,
            stalled: stalled.clone(),
            closing: handles.closing.clone(),
        };
        let upkeep = Upkeep::new(&handles, &deleter, &limits, &queues, watchdog);
        let node = cluster.clone().map(|cluster| NodeTask {
            cluster,
            handles: handles.clone(),
            transfers,
            shards: queues.clone(),
            lost,
            clock: Reasons::default(),
        });
        let communication = CommunicationWatch::new(
            handles.clone(),
            presences.clone(),
            limits.communication.clone(),
        );
        let parts = Parts { committer, shards, loader, upkeep, node, communication };
        let inner = Inner {
            job_context: JobContext::new(handles.clone(), queues.clone()),
            handles,
            cluster,
            limits,
            events,
            presences,
            mutes: Mutes::default(),
            wake_notifier: Arc::default(),
            principals: PrincipalCache::default(),
            provider,
            shards: queues,
            deleter,
            quota,
            jobs,
            in_flight,
            stalled,
            n_rebuilding: AtomicUsize::new(0),
            computing: Computing::new(),
        };
        (Self { inner: Arc::new(inner) }, parts)
    }

    /// Returns the background task of notifications, which sends by `transport`.
    pub fn notifier<T: NotificationTransport>(&self, transport: T) -> Notifier<T> {
        let Inner { handles, mutes, limits, events, wake_notifier, .. } = &*self.inner;
        let settings = limits.notifications.clone();
        let wake = wake_notifier.clone();
        Notifier::new(handles.clone(), mutes.clone(), settings, events.clone(), wake, transport)
    }

    /// Discards the sessions of imports that a stop has interrupted: of the partitions
    /// `owned`, or of all.
    async fn discard_imports(&self, owned: Option<&[PartitionId]>) -> Result<(), ServiceError> {
        let handles = &self.inner.handles;
        let at = handles.clock.now();
        for (session, asset) in handles.store.importing_sessions(owned).await? {
            tracing::warn!(session, "an import was interrupted; its session is discarded");
            handles.write(&asset, vec![Write::DiscardSession { session, at }]).await?;
        }
        Ok(())
    }

    /// Loads the assets whose engine must evaluate a long recording again, because there is
    /// no snapshot of it by this version, so that they are ready when they are asked for.
    /// Those that are asked for meanwhile come first.
    ///
    /// # Errors
    /// [`ServiceError::Store`] if the store cannot be read.
    pub async fn rebuild(&self) -> Result<(), ServiceError> {
        self.rebuild_of(self.inner.handles.ownership.filter().as_deref()).await
    }

    async fn rebuild_of(&self, owned: Option<&[PartitionId]>) -> Result<(), ServiceError> {
        let Inner { handles, shards, limits, n_rebuilding, .. } = &*self.inner;
        let behind =
            handles.store.assets_behind(&snapshots::version(), MANY_SAMPLES, owned).await?;
        n_rebuilding.fetch_add(behind.len(), Ordering::Relaxed);
        let load = async |asset: &String| {
            let loaded = shards.call(asset, |reply| AssetCommand::Load { reply }).await;
            n_rebuilding.fetch_sub(1, Ordering::Relaxed);
            if let Err(error) = loaded {
                tracing::error!(asset, %error, "cannot load the asset");
            }
        };
        stream::iter(&behind).for_each_concurrent(limits.workers.shards, load).await;
        if !behind.is_empty() {
            tracing::info!(n_assets = behind.len(), "all engines are rebuilt");
        }
        Ok(())
    }
}

/// Continues the work of the former owners of partitions that were taken: interrupted
/// imports are discarded, jobs queued again, and engines that are far behind rebuilt.
async fn resume_taken(
    service: Weak<Inner>,
    mut taken: mpsc::Receiver<Vec<PartitionId>>,
    closing: CancellationToken,
) {
    while let Some(Some(partitions)) = closing.run_until_cancelled(taken.recv()).await {
        let Some(inner) = service.upgrade() else { return };
        let service = Service { inner };
        let resume = service.resume(Some(&partitions));
        if let Some(Err(error)) = closing.run_until_cancelled(resume).await {
            tracing::error!(%error, "cannot continue the work of partitions that were taken");
        }
    }
}
