//! The queues of background jobs.

use crate::asset::LEARNING_ACTOR;
use crate::job::{CancelledJob, Job, JobRoom};
use crate::{Service, ServiceError};
use offbd_store::PartitionId;

impl Service {
    /// Queues the jobs that a previous process left unfinished: of the partitions `owned`, or
    /// of all.
    pub(crate) async fn resume_jobs(
        &self,
        owned: Option<&[PartitionId]>,
    ) -> Result<(), ServiceError> {
        let jobs = &self.inner.jobs;
        for id in self.inner.handles.store.unfinished_replays(owned).await? {
            jobs.asked.resume(Job::Replay(id));
        }
        for (id, by) in self.inner.handles.store.unfinished_calibrations(owned).await? {
            let is_automatic = by.as_deref() == Some(LEARNING_ACTOR);
            let queue = if is_automatic { &jobs.automatic } else { &jobs.asked };
            queue.resume(Job::Calibration(id));
        }
        Ok(())
    }

    /// Reserves room in the queue of what persons ask for, before a job is stored.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] if the queue is full.
    pub(crate) fn reserve_job(&self) -> Result<JobRoom, ServiceError> {
        let full = ServiceError::Busy { what: "the queue of background jobs is full" };
        self.inner.jobs.asked.reserve().ok_or(full)
    }

    /// Cancels the job `id`; `stored` stores that of one that waits.
    ///
    /// # Errors
    /// [`ServiceError::JobEnded`] if it neither waits nor runs on this node.
    pub(crate) async fn cancel_job(
        &self,
        id: &str,
        stored: impl Future<Output = Result<(), ServiceError>>,
    ) -> Result<(), ServiceError> {
        match self.inner.jobs.cancel(id) {
            Some(CancelledJob::Running) => Ok(()),
            Some(CancelledJob::Waited(queue, job)) => {
                stored.await.inspect_err(|_| queue.resume(job))
            }
            None => Err(ServiceError::JobEnded { id: id.to_owned() }),
        }
    }
}
