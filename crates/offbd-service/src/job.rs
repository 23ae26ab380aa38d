//! The queues of background jobs, and the progress of the running ones.
//!
//! Jobs that a person asked for and calibrations that rigs start by themselves have a queue
//! each, with its own workers: what a person asked for does not wait for automatic calibrations.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore};
use tokio_util::sync::CancellationToken;

use offbd_wire::service::JobWaitView;
use offbd_wire::words::JobWaitReason;

/// Limit of waiting jobs that persons asked for; at the limit further ones are refused.
const MAX_QUEUED: usize = 64;

/// Limit of waiting automatic calibrations; at the limit a rig tries again with a later batch or
/// session. Chosen: 200 bytes each.
const MAX_AUTOMATIC: usize = 1024;

/// A background job, by the id of its row in the store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Job {
    Replay(String),
    Calibration(String),
}

impl Job {
    pub(super) fn id(&self) -> &str {
        let (Self::Replay(id) | Self::Calibration(id)) = self;
        id
    }
}

/// A job, the rig that it is for, and its cost in units that are the same for all jobs.
#[derive(Clone, Debug)]
pub(super) struct NewJob {
    pub(super) job: Job,
    pub(super) asset: String,
    pub(super) cost: u64,
}

/// Samples that are replayed in the time in which a calibration uses one of its samples.
/// Measured: 12 µs against 0.8 µs.
const CALIBRATION_COST: u64 = 15;

/// Returns the cost of a replay of so many samples.
pub(super) fn replay_cost(n_samples: i64) -> u64 {
    u64::try_from(n_samples).unwrap_or_default()
}

/// Returns the cost of a calibration that learns from so many samples.
pub(super) fn calibration_cost(n_samples: i64) -> u64 {
    replay_cost(n_samples).saturating_mul(CALIBRATION_COST)
}

/// The queues of a service. Cheap to clone.
#[derive(Clone, Debug)]
pub(super) struct JobQueues {
    /// Jobs that persons asked for.
    pub(super) asked: JobQueue,
    /// Calibrations that rigs start by themselves.
    pub(super) automatic: JobQueue,
}

impl JobQueues {
    /// Returns why the job `id` waits; `None` if it does not wait here.
    pub(super) fn wait(&self, id: &str) -> Option<JobWaitView> {
        let jobs = |n_before| JobWaitView { reason: JobWaitReason::Jobs, n_before };
        let automatic = |n_before| match n_before {
            0 => JobWaitView { reason: JobWaitReason::Samples, n_before },
            n => jobs(n),
        };
        let asked = self.asked.n_before(id).map(jobs);
        asked.or_else(|| self.automatic.n_before(id).map(automatic))
    }

    /// Cancels the job `id`: takes it out of its queue, or asks the worker that runs it to stop.
    /// Returns `None` if it is in no queue.
    pub(super) fn cancel(&self, id: &str) -> Option<CancelledJob> {
        self.asked.cancel(id).or_else(|| self.automatic.cancel(id))
    }
}

impl Default for JobQueues {
    fn default() -> Self {
        Self { asked: JobQueue::new(MAX_QUEUED), automatic: JobQueue::new(MAX_AUTOMATIC) }
    }
}

/// A queue of jobs with a limit. Cheap to clone.
///
/// The order is that of self-clocked fair queuing (Golestani, INFOCOM 1994): the turn of a job
/// is its cost after that of the last waiting one of its rig, or after that of the job that
/// began last. The earliest turn is next. So short jobs come first, the rigs have equal shares,
/// and no other rig passes a job with more work than that of the job.
#[derive(Clone, Debug)]
pub(super) struct JobQueue(Arc<SharedQueue>);

#[derive(Debug)]
struct SharedQueue {
    /// One permit for each job that may wait.
    room: Arc<Semaphore>,
    order: Mutex<JobOrder>,
    /// Wakes a worker.
    added: Notify,
}

#[derive(Debug, Default)]
struct JobOrder {
    /// The next one first.
    waiting: Vec<WaitingJob>,
    running: Vec<(Job, CancellationToken)>,
    /// The turn of the job that began last.
    reached: u64,
}

#[derive(Debug)]
struct WaitingJob {
    job: Job,
    asset: String,
    turn: u64,
    /// `None` for a job that a former process left.
    _room: Option<OwnedSemaphorePermit>,
}

/// Room for a job in a queue.
#[derive(Debug)]
pub(super) struct JobRoom {
    queue: JobQueue,
    permit: OwnedSemaphorePermit,
}

impl JobRoom {
    pub(super) fn put(self, new: NewJob) {
        self.queue.add(new, Some(self.permit));
    }
}

/// A job that a worker runs. It counts as running until this is dropped.
#[derive(Debug)]
pub(super) struct RunningJob {
    pub(super) job: Job,
    /// Cancelled once a person cancels the job, and when the service shuts down.
    pub(super) cancelled: CancellationToken,
    queue: JobQueue,
}

impl Drop for RunningJob {
    fn drop(&mut self) {
        self.queue.order().running.retain(|(job, _)| *job != self.job);
    }
}

/// A job that has been cancelled.
#[derive(Debug)]
pub(super) enum CancelledJob {
    /// It is in the queue no longer, and nobody has stored that.
    Waited(JobQueue, Job),
    /// It stops soon; its worker stores that.
    Running,
}

impl JobQueue {
    fn new(limit: usize) -> Self {
        let room = Arc::new(Semaphore::new(limit));
        Self(Arc::new(SharedQueue { room, order: Mutex::default(), added: Notify::new() }))
    }

    fn order(&self) -> MutexGuard<'_, JobOrder> {
        self.0.order.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reserves room for a job; returns `None` at the limit.
    pub(super) fn reserve(&self) -> Option<JobRoom> {
        let permit = self.0.room.clone().try_acquire_owned().ok()?;
        Some(JobRoom { queue: self.clone(), permit })
    }

    /// Queues a job that a former process left, before the others and beyond the limit too: that
    /// process had room for it.
    pub(super) fn resume(&self, job: Job) {
        self.add(NewJob { job, asset: String::new(), cost: 0 }, None);
    }

    fn add(&self, NewJob { job, asset, cost }: NewJob, room: Option<OwnedSemaphorePermit>) {
        let mut order = self.order();
        // A node that gets a partition back may still have the jobs that it resumes.
        let waiting = order.waiting.iter().map(|waiting| &waiting.job);
        if waiting.chain(order.running.iter().map(|(job, _)| job)).any(|known| *known == job) {
            return;
        }
        let of_asset = order.waiting.iter().filter(|waiting| waiting.asset == asset);
        let before = of_asset.map(|waiting| waiting.turn).max().unwrap_or_default();
        let turn = before.max(order.reached).saturating_add(cost);
        let at = order.waiting.partition_point(|waiting| waiting.turn <= turn);
        order.waiting.insert(at, WaitingJob { job, asset, turn, _room: room });
        drop(order);
        self.0.added.notify_one();
    }

    /// Waits until there is a job.
    pub(super) async fn wait(&self) {
        while self.order().waiting.is_empty() {
            self.0.added.notified().await;
        }
    }

    /// Takes the next job, if there is one. `closing` cancels it too.
    pub(super) fn begin(&self, closing: &CancellationToken) -> Option<RunningJob> {
        let mut order = self.order();
        if order.waiting.is_empty() {
            return None;
        }
        let next = order.waiting.remove(0);
        order.reached = next.turn;
        let (job, cancelled) = (next.job, closing.child_token());
        order.running.push((job.clone(), cancelled.clone()));
        Some(RunningJob { job, cancelled, queue: self.clone() })
    }

    /// Lists the jobs: the running ones, then those that wait, the next one first.
    pub(super) fn list(&self) -> Vec<Job> {
        let order = self.order();
        let running = order.running.iter().map(|(job, _)| job);
        running.chain(order.waiting.iter().map(|waiting| &waiting.job)).cloned().collect()
    }

    fn cancel(&self, id: &str) -> Option<CancelledJob> {
        let mut order = self.order();
        if let Some(at) = order.waiting.iter().position(|waiting| waiting.job.id() == id) {
            return Some(CancelledJob::Waited(self.clone(), order.waiting.remove(at).job));
        }
        let (_, cancelled) = order.running.iter().find(|(job, _)| job.id() == id)?;
        cancelled.cancel();
        Some(CancelledJob::Running)
    }

    /// Returns the number of jobs that run or come before the waiting job `id`; `None` if it
    /// does not wait here.
    pub(super) fn n_before(&self, id: &str) -> Option<usize> {
        let order = self.order();
        let at = order.waiting.iter().position(|waiting| waiting.job.id() == id)?;
        Some(order.running.len() + at)
    }
}

/// The progress of each running job, 0 to 1, by its id.
#[derive(Clone, Debug, Default)]
pub(super) struct JobProgress {
    shares: Arc<Mutex<BTreeMap<String, f64>>>,
}

impl JobProgress {
    pub(super) fn get(&self, id: &str) -> Option<f64> {
        self.shares.lock().unwrap_or_else(PoisonError::into_inner).get(id).copied()
    }

    pub(super) fn set(&self, id: &str, share: f64) {
        let mut shares = self.shares.lock().unwrap_or_else(PoisonError::into_inner);
        shares.insert(id.to_owned(), share);
    }

    pub(super) fn remove(&self, id: &str) {
        self.shares.lock().unwrap_or_else(PoisonError::into_inner).remove(id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(id: &str, asset: &str, cost: u64) -> NewJob {
        NewJob { job: Job::Replay(id.to_owned()), asset: asset.to_owned(), cost }
    }

    /// Puts the jobs, of which each is an id, an asset and a cost.
    fn put(queue: &JobQueue, jobs: &[(&str, &str, u64)]) {
        jobs.iter().for_each(|(id, asset, cost)| {
            queue.reserve().expect("room").put(job(id, asset, *cost));
        });
    }

    fn begin(queue: &JobQueue) -> Option<RunningJob> {
        queue.begin(&CancellationToken::new())
    }

    /// Runs all jobs, one after the other.
    fn run(queue: &JobQueue) -> Vec<String> {
        std::iter::from_fn(|| begin(queue).map(|running| running.job.id().to_owned())).collect()
    }

    #[test]
    fn short_jobs_come_first_and_equal_ones_in_their_order() {
        let queue = JobQueue::new(8);
        put(&queue, &[("long", "a", 100), ("one", "b", 10), ("two", "c", 10), ("short", "d", 1)]);
        assert_eq!(run(&queue), ["short", "one", "two", "long"]);
    }

    #[test]
    fn a_rig_with_many_jobs_has_no_larger_share() {
        let queue = JobQueue::new(8);
        put(&queue, &[("a1", "a", 10), ("a2", "a", 10), ("a3", "a", 10), ("b1", "b", 10)]);
        assert_eq!(run(&queue), ["a1", "b1", "a2", "a3"]);
    }

    #[test]
    fn a_long_job_is_passed_by_no_more_work_than_its_own() {
        let queue = JobQueue::new(8);
        put(&queue, &[("long", "a", 100)]);
        let mut n_passed = 0;
        loop {
            put(&queue, &[(&format!("short {n_passed}"), "b", 10)]);
            let next = begin(&queue).expect("two wait");
            if next.job.id() == "long" {
                break;
            }
            n_passed += 1;
        }
        assert_eq!(n_passed, 9);
    }

    #[test]
    fn a_waiting_job_knows_how_many_come_before_it() {
        let queue = JobQueue::new(8);
        put(&queue, &[("one", "a", 1), ("two", "b", 2)]);
        assert_eq!((queue.n_before("one"), queue.n_before("two")), (Some(0), Some(1)));
        let running = begin(&queue).expect("two wait");
        assert_eq!((queue.n_before("one"), queue.n_before("two")), (None, Some(1)));
        drop(running);
        assert_eq!(queue.n_before("two"), Some(0));
    }

    #[test]
    fn a_cancelled_job_does_not_begin_and_a_running_one_is_told() {
        let queue = JobQueue::new(2);
        put(&queue, &[("one", "a", 1), ("two", "b", 2)]);
        let running = begin(&queue).expect("two wait");
        assert!(matches!(queue.cancel("one"), Some(CancelledJob::Running)));
        assert!(running.cancelled.is_cancelled());
        assert!(matches!(queue.cancel("two"), Some(CancelledJob::Waited(..))));
        drop(running);
        assert!(queue.cancel("one").is_none() && queue.cancel("two").is_none());
        put(&queue, &[("three", "a", 1), ("four", "a", 1)]);
        let running = begin(&queue).expect("two wait");
        assert!(!running.cancelled.is_cancelled());
        queue.resume(running.job.clone());
        assert_eq!(run(&queue), ["four"], "one that runs is not queued again");
    }

    #[test]
    fn a_full_queue_refuses_new_jobs_and_keeps_those_of_a_former_process() {
        let queue = JobQueue::new(1);
        put(&queue, &[("one", "a", 1)]);
        assert!(queue.reserve().is_none());
        queue.resume(Job::Replay("two".to_owned()));
        queue.resume(Job::Replay("two".to_owned()));
        assert_eq!(run(&queue), ["two", "one"], "each once");
        assert!(queue.reserve().is_some());
    }
}
