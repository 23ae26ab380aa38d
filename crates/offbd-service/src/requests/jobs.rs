//! The queues of background jobs.

use crate::asset::LEARNING_ACTOR;
use crate::clock::rfc3339;
use crate::job::{CancelledJob, Job, JobRoom};
use crate::{Service, ServiceError};
use offbd_store::PartitionId;
use offbd_wire::service::{JobView, Page};
use offbd_wire::words::{JobKind, JobState};

/// Listed jobs of a queue; of a longer one, the rest is left out.
const MAX_LISTED: usize = 100;

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

    /// Lists the jobs of this node that run or wait, at most 100 of each queue: those that persons
    /// asked for, then those that rigs started by themselves.
    ///
    /// # Errors
    /// [`ServiceError::Outage`] if the store does not answer.
    pub async fn list_jobs(&self) -> Result<Page<JobView>, ServiceError> {
        let jobs = &self.inner.jobs;
        let mut items = Vec::new();
        for (queue, automatic) in [(&jobs.asked, false), (&jobs.automatic, true)] {
            for job in queue.list().into_iter().take(MAX_LISTED) {
                items.extend(self.view_job(&job, automatic).await?);
            }
        }
        Ok(Page { items, next: None })
    }

    /// Returns `None` for a job that has ended meanwhile.
    async fn view_job(&self, job: &Job, automatic: bool) -> Result<Option<JobView>, ServiceError> {
        let store = &self.inner.handles.store;
        let (kind, asset, session_id, created_at) = match job {
            Job::Replay(id) => {
                let Some(row) = store.replay(id).await? else { return Ok(None) };
                let Some(asset) = self.asset_of_session(&row.session).await? else {
                    return Ok(None);
                };
                (JobKind::Replay, asset, Some(row.session), row.created_at)
            }
            Job::Calibration(id) => {
                let Some(row) = store.calibration(id).await? else { return Ok(None) };
                (JobKind::Calibration, row.asset, None, row.made_at)
            }
        };
        let waits = self.inner.jobs.wait(job.id());
        Ok(Some(JobView {
            id: job.id().to_owned(),
            kind,
            asset,
            session_id,
            automatic,
            state: if waits.is_some() { JobState::Queued } else { JobState::Running },
            progress: self.inner.job_context.progress.get(job.id()),
            waits,
            created_at: rfc3339(created_at),
        }))
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
