//! Work in the background: replays and calibrations, a few at a time, the
//! others in a bounded queue. What a stop interrupts begins anew afterwards.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use super::handles::Handles;
use super::shard::Shards;
use super::{Service, ServiceError, calibrations, replays};

/// Jobs that wait; the next is told to come again.
pub(super) const MAX_QUEUED: usize = 64;

/// Something to do in the background; the row with its id is in the store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Job {
    Replay(String),
    Calibration(String),
}

/// Shares of running jobs that are done, by id.
#[derive(Clone, Debug, Default)]
pub(super) struct Progress {
    shares: Arc<Mutex<BTreeMap<String, f64>>>,
}

impl Progress {
    pub(super) fn of(&self, id: &str) -> Option<f64> {
        self.shares.lock().unwrap_or_else(PoisonError::into_inner).get(id).copied()
    }

    pub(super) fn set(&self, id: &str, share: f64) {
        let mut shares = self.shares.lock().unwrap_or_else(PoisonError::into_inner);
        shares.insert(id.to_owned(), share);
    }

    fn forget(&self, id: &str) {
        self.shares.lock().unwrap_or_else(PoisonError::into_inner).remove(id);
    }
}

/// What a job works with.
#[derive(Clone)]
pub(super) struct JobContext {
    pub(super) handles: Handles,
    pub(super) progress: Progress,
    pub(super) shards: Shards,
}

impl JobContext {
    pub(super) fn new(handles: Handles, shards: Shards) -> Self {
        Self { handles, progress: Progress::default(), shards }
    }

    /// Runs jobs until the queue closes or the service does.
    async fn work(self, queue: Arc<tokio::sync::Mutex<mpsc::Receiver<Job>>>) {
        loop {
            let job = async { queue.lock().await.recv().await };
            let job = tokio::select! {
                () = self.handles.closing.cancelled() => return,
                job = job => job,
            };
            let Some(job) = job else { return };
            let (Job::Replay(id) | Job::Calibration(id)) = &job;
            self.progress.set(id, 0.0);
            let done = match &job {
                Job::Replay(id) => replays::run(&self, id).await,
                Job::Calibration(id) => calibrations::run(&self, id).await,
            };
            self.progress.forget(id);
            if let Err(error) = done {
                tracing::error!(?job, %error, "a background job could not be settled");
            }
        }
    }
}

/// Starts `n` workers on `queue`.
pub(super) fn spawn(
    n: usize,
    context: &JobContext,
    queue: mpsc::Receiver<Job>,
) -> Vec<JoinHandle<()>> {
    let queue = Arc::new(tokio::sync::Mutex::new(queue));
    (0..n).map(|_| tokio::spawn(context.clone().work(queue.clone()))).collect()
}

impl Service {
    /// Puts what a former process left unfinished into the queue again, as far
    /// as there is room.
    pub(super) async fn resume_jobs(&self) -> Result<(), ServiceError> {
        let replays = self.inner.handles.store.unfinished_replays().await?;
        let calibrations = self.inner.handles.store.unfinished_calibrations().await?;
        let jobs = replays.into_iter().map(|row| Job::Replay(row.id));
        for job in jobs.chain(calibrations.into_iter().map(|row| Job::Calibration(row.id))) {
            if self.inner.jobs.try_send(job).is_err() {
                tracing::warn!("more unfinished jobs than the queue holds; restart for the rest");
                break;
            }
        }
        Ok(())
    }

    /// A place in the queue, before anything is stored for the job.
    pub(super) fn job_place(&self) -> Result<mpsc::Permit<'_, Job>, ServiceError> {
        let full = |_| ServiceError::Busy { what: "too many background jobs wait" };
        self.inner.jobs.try_reserve().map_err(full)
    }
}
