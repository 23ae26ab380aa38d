//! The workers that run background jobs. A job that a shutdown interrupts restarts with the
//! next start.

use std::sync::Arc;

use tokio::sync::Semaphore;
use tokio::task::JoinHandle;

use super::context::JobContext;
use super::quiet::Quiet;
use super::{calibration, replay};
use crate::Limits;
use crate::background::Priority;
use crate::job::{Job, JobQueue, JobQueues};

/// Automatic calibrations that run at a time. One, because they take what the rest leaves of
/// the processors.
const AUTOMATIC_WORKERS: usize = 1;

/// Runs the jobs of `queue` until the service shuts down. If there is a `quiet`, samples that are
/// queued hold them back.
async fn work(context: JobContext, queue: JobQueue, priority: Priority, quiet: Option<Quiet>) {
    loop {
        let next = async {
            queue.wait().await;
            if let Some(quiet) = &quiet {
                quiet.wait().await;
            }
        };
        if context.handles.closing.run_until_cancelled(next).await.is_none() {
            return;
        }
        let Some(running) = queue.begin(&context.handles.closing) else { continue };
        let id = running.job.id();
        context.progress.set(id, 0.0);
        let done = match &running.job {
            Job::Replay(_) => replay::run(&context, &running, priority).await,
            Job::Calibration(_) => calibration::run(&context, &running, priority, &quiet).await,
        };
        context.progress.remove(id);
        if let Err(error) = done {
            tracing::error!(job = ?running.job, %error, "cannot store the outcome of a background job");
        }
    }
}

/// Starts the workers for the jobs that persons ask for, and those for automatic calibrations,
/// which are held back while few permits of `in_flight` are left.
pub(crate) fn spawn(
    limits: &Limits,
    context: &JobContext,
    queues: &JobQueues,
    in_flight: &Arc<Semaphore>,
) -> Vec<JoinHandle<()>> {
    let asked = (0..limits.workers.jobs)
        .map(|_| work(context.clone(), queues.asked.clone(), Priority::Low, None));
    let automatic = (0..AUTOMATIC_WORKERS).map(|_| {
        let quiet = Some(Quiet::new(in_flight.clone(), limits.requests.in_flight_samples));
        work(context.clone(), queues.automatic.clone(), Priority::Lowest, quiet)
    });
    asked.chain(automatic).map(tokio::spawn).collect()
}
