//! The service: many assets, each with its running engine, over one store.
//!
//! Every asset belongs to one *shard*, a thread that owns its engine and does
//! one thing after the other for it. What follows from it goes to the one
//! *writer*, which commits everything that waits in one transaction; only then
//! is the answer given and the events sent out. So an acknowledgement means
//! durable, and many small batches share one commit. When a commit fails, the
//! engines concerned are thrown away and rebuilt from the store on next touch:
//! the rebuild replays the recording and comes to the same state.
//!
//! Knows no HTTP and no SQL. Reads the clock for what is stored beside the
//! samples (arrival, opening, actions); no judgement depends on it.

pub mod access;
mod assets;
mod calibrations;
mod clock;
mod commit;
mod deletion;
mod drive_cycles;
mod error;
mod events;
mod faults;
mod fleet;
mod handles;
mod history;
mod import;
mod jobs;
mod learning;
mod limits;
mod playback;
mod presence;
mod rebuild;
mod recent;
mod recordings;
mod replays;
mod retention;
mod running;
mod sessions;
mod shard;
mod telemetry;
mod traces;
mod trends;
mod views;
mod watchdog;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use futures_util::{StreamExt, stream};
use tokio::sync::{Semaphore, mpsc, oneshot, watch};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

pub use clock::{Clock, moment};
pub use error::ServiceError;
pub use events::{Event, EventFeed};
pub use faults::FaultQuery;
pub use limits::{Limits, RETRY_AFTER_S};
pub use recordings::Around;
pub use retention::Retention;
pub use sessions::Recording;
pub use telemetry::Pending;
pub use traces::{MAX_TRACE_POINTS, TraceQuery};

use self::access::{Passes, Provider};
use self::commit::{Committer, Outage};
use self::deletion::Deleter;
use self::events::Events;
use self::handles::Handles;
use self::jobs::JobContext;
use self::presence::Presences;
use self::retention::Sweeper;
use self::running::{Running, Work};
use self::shard::{Context, Job, Shards};
use self::watchdog::{STALLED_AFTER, Watchdog};
use crate::store::{Store, StoreError, Writer};

/// Cheap to clone; all clones are one service.
#[derive(Clone)]
pub struct Service {
    inner: Arc<Inner>,
}

struct Inner {
    handles: Handles,
    limits: Limits,
    events: Events,
    presences: Presences,
    passes: Passes,
    provider: Option<Provider>,
    shards: Shards,
    outage: watch::Receiver<Outage>,
    deleter: Deleter,
    jobs: mpsc::Sender<jobs::Job>,
    job_context: JobContext,
    /// One permit for each sample between arrival and commit.
    in_flight: Arc<Semaphore>,
    /// Whether those are at their limit and none becomes durable.
    stalled: Arc<AtomicBool>,
    /// One permit for each recording of a fault that is being made.
    recordings: Arc<Semaphore>,
    /// One permit for each trace that is being made.
    traces: Arc<Semaphore>,
    /// One permit for each drive cycle that is being computed.
    drive_cycles: Arc<Semaphore>,
}

/// What waits for something to be done with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Load {
    /// Samples between arrival and commit.
    pub samples: usize,
    /// Requests that wait for each shard.
    pub shards: Vec<usize>,
    /// Sets of changes that wait for the writer.
    pub writer: usize,
}

fn waiting<T>(queue: &mpsc::Sender<T>) -> usize {
    queue.max_capacity() - queue.capacity()
}

/// What runs behind a [`Service`]; ends when all its clones are dropped.
pub struct Workers {
    shards: Vec<std::thread::JoinHandle<()>>,
    jobs: Vec<JoinHandle<()>>,
    closing: CancellationToken,
    committer: std::thread::JoinHandle<Option<Writer>>,
}

impl Workers {
    /// Breaks off background jobs and deletions (they begin anew or go on with the next
    /// start). From now on a database that is away is waited for no longer than some
    /// seconds: what waits for it is refused then.
    pub fn close(&self) {
        self.closing.cancel();
    }

    /// Closes, waits until everything queued is judged and committed, and closes the
    /// store's writer. All clones of the service must be dropped before.
    pub async fn finish(self) {
        self.close();
        for worker in self.jobs {
            if worker.await.is_err() {
                tracing::error!("a worker ended by panic");
            }
        }
        for shard in self.shards {
            if joined(shard).await.is_none() {
                tracing::error!("a shard ended by panic");
            }
        }
        let Some(writer) = joined(self.committer).await else {
            return tracing::error!("the writer ended by panic");
        };
        let Some(writer) = writer else { return };
        if let Err(error) = writer.close().await {
            tracing::error!(%error, "closing the store");
        }
    }
}

/// Waits for a thread; none if it ended by panic.
async fn joined<T: Send + 'static>(thread: std::thread::JoinHandle<T>) -> Option<T> {
    tokio::task::spawn_blocking(|| thread.join()).await.ok()?.ok()
}

impl Service {
    /// Starts the shards and the writer on the current tokio runtime. The tokens of
    /// `provider` are taken beside the service's own.
    ///
    /// # Errors
    /// [`ServiceError`] if the store cannot be read or no thread can be started.
    pub async fn start(
        store: Store,
        writer: Writer,
        limits: Limits,
        provider: Option<Provider>,
    ) -> Result<(Self, Workers), ServiceError> {
        let events = Events::new(store.clone());
        let (sets, queue) = mpsc::channel(limits.commit_queue);
        let (told, outage) = watch::channel(None);
        let closing = CancellationToken::new();
        let n_commits = Arc::new(AtomicU64::new(0));
        let committer = Committer {
            writer,
            queue,
            events: events.clone(),
            outage: told,
            n_commits: n_commits.clone(),
            closing: closing.clone(),
            journal_bytes: limits.journal_bytes,
        };
        let committer = committer.spawn()?;
        let presences = Presences::default();
        let (jobs, jobs_queue) = mpsc::channel(jobs::MAX_QUEUED);
        let handles = Handles::new(store, sets, closing.clone());
        let context =
            Context { handles: handles.clone(), presences: presences.clone(), jobs: jobs.clone() };
        let (shards, threads) = Shards::start(&limits, context)?;
        let job_context = JobContext::new(handles.clone(), shards.clone());
        let mut workers = jobs::spawn(limits.jobs, &job_context, jobs_queue);
        let deleter = Deleter::new(handles.clone());
        let sweeper = Sweeper {
            handles: handles.clone(),
            deleter: deleter.clone(),
            retention: limits.retention.clone(),
        };
        workers.push(tokio::spawn(sweeper.run()));
        let in_flight = Arc::new(Semaphore::new(limits.in_flight_samples));
        let stalled = Arc::new(AtomicBool::new(false));
        let watchdog = Watchdog {
            in_flight: in_flight.clone(),
            batch_samples: limits.longest_batch(),
            n_commits,
            stalled: stalled.clone(),
            closing: closing.clone(),
        };
        workers.push(tokio::spawn(watchdog.run()));
        let recordings = Arc::new(Semaphore::new(recordings::MAX_AT_ONCE));
        let traces = Arc::new(Semaphore::new(traces::MAX_AT_ONCE));
        let drive_cycles = Arc::new(Semaphore::new(drive_cycles::MAX_AT_ONCE));
        let inner = Inner {
            handles,
            limits,
            events,
            presences,
            passes: Passes::default(),
            provider,
            shards,
            outage,
            deleter,
            jobs,
            job_context,
            in_flight,
            stalled,
            recordings,
            traces,
            drive_cycles,
        };
        let workers = Workers { shards: threads, jobs: workers, closing, committer };
        Ok((Self { inner: Arc::new(inner) }, workers))
    }

    /// Rebuilds the assets that have an open session, so that the first batch
    /// after a restart need not wait, and takes up unfinished jobs. Returns how many there are.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] if the store cannot be read.
    pub async fn resume(&self) -> Result<usize, ServiceError> {
        let assets = self.inner.handles.store.assets_in_session().await?;
        let touch = |asset: &String| {
            let (this, asset) = (self.clone(), asset.clone());
            async move {
                if let Err(error) = this.look(&asset, |_| ()).await {
                    tracing::error!(asset, %error, "cannot resume");
                }
            }
        };
        let at_once = self.inner.limits.shards;
        stream::iter(&assets).for_each_concurrent(at_once, touch).await;
        self.resume_jobs().await?;
        Ok(assets.len())
    }

    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.inner.limits
    }

    /// Whether the store answers, the shards and the writer run, and ingest goes on.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`], [`ServiceError::Outage`] or
    /// [`ServiceError::Stalled`], naming what does not.
    pub async fn ready(&self) -> Result<(), ServiceError> {
        if self.inner.handles.writer().is_closed() {
            return Err(ServiceError::Unavailable { what: "the writer has stopped" });
        }
        if self.inner.shards.iter().any(mpsc::Sender::is_closed) {
            return Err(ServiceError::Unavailable { what: "a shard has stopped" });
        }
        if let Some(reason) = self.inner.outage.borrow().clone() {
            return Err(ServiceError::Outage { reason });
        }
        if self.inner.stalled.load(Ordering::Relaxed) {
            return Err(ServiceError::Stalled { seconds: STALLED_AFTER.as_secs() });
        }
        let away = |error: StoreError| ServiceError::Outage { reason: error.to_string() };
        self.inner.handles.store.ping().await.map_err(away)
    }

    /// What waits now.
    #[must_use]
    pub fn load(&self) -> Load {
        let Inner { shards, handles, in_flight, limits, .. } = &*self.inner;
        let samples = limits.in_flight_samples - in_flight.available_permits();
        let shards = shards.iter().map(waiting).collect();
        Load { samples, shards, writer: waiting(handles.writer()) }
    }

    fn shard(&self, asset: &str) -> &mpsc::Sender<Job> {
        self.inner.shards.of(asset)
    }

    /// Does `act` on the shard of `asset` and gives its answer once what
    /// follows from it is durable.
    async fn call<T: Send + 'static>(
        &self,
        asset: &str,
        act: impl FnOnce(&Context, &mut Running, &mut Work) -> Result<T, ServiceError> + Send + 'static,
    ) -> Result<T, ServiceError> {
        self.inner.shards.call(asset, act).await
    }
}

impl Service {
    /// Looks at `asset` on its shard; what is seen may not be durable yet.
    async fn look<T: Send + 'static>(
        &self,
        asset: &str,
        look: impl FnOnce(&Running) -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        let (reply, answer) = oneshot::channel();
        let name = asset.to_owned();
        let job: Job = Box::new(move |shard| shard.look(&name, look, reply));
        self.shard(asset).try_send(job).map_err(ServiceError::from_full)?;
        settled(answer.await)
    }
}

/// The answer, or that whoever was to give it is gone.
fn settled<T>(
    answer: Result<Result<T, ServiceError>, oneshot::error::RecvError>,
) -> Result<T, ServiceError> {
    answer.unwrap_or(Err(ServiceError::Unavailable { what: "the asset's engine has failed" }))
}
