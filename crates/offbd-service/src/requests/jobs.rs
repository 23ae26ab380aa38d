//! The queue of background jobs.

use tokio::sync::mpsc;

use crate::job::Job;
use crate::{Service, ServiceError};
use offbd_store::PartitionId;

impl Service {
    /// Queues the jobs that a previous process left unfinished, as far as there is room: of
    /// the partitions `owned`, or of all.
    pub(crate) async fn resume_jobs(
        &self,
        owned: Option<&[PartitionId]>,
    ) -> Result<(), ServiceError> {
        let replays = self.inner.handles.store.unfinished_replays(owned).await?;
        let calibrations = self.inner.handles.store.unfinished_calibrations(owned).await?;
        let jobs = replays.into_iter().map(Job::Replay);
        for job in jobs.chain(calibrations.into_iter().map(Job::Calibration)) {
            if self.inner.jobs.try_send(job).is_err() {
                tracing::warn!("the queue is too short for all unfinished jobs; restart later");
                break;
            }
        }
        Ok(())
    }

    /// Reserves room in the queue before a job is stored.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] if the queue is full.
    pub(crate) fn reserve_job(&self) -> Result<mpsc::Permit<'_, Job>, ServiceError> {
        let full = |_| ServiceError::Busy { what: "the queue of background jobs is full" };
        self.inner.jobs.try_reserve().map_err(full)
    }
}
