//! The workers that run background jobs. A job that a shutdown interrupts restarts with the
//! next start.

use std::sync::Arc;

use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use super::context::JobContext;
use super::{calibration, replay};
use crate::job::Job;

/// Runs jobs until the queue is closed or the service shuts down.
async fn work(context: JobContext, queue: Arc<tokio::sync::Mutex<mpsc::Receiver<Job>>>) {
    loop {
        let job = async { queue.lock().await.recv().await };
        let job = tokio::select! {
            () = context.handles.closing.cancelled() => return,
            job = job => job,
        };
        let Some(job) = job else { return };
        let (Job::Replay(id) | Job::Calibration(id)) = &job;
        context.progress.set(id, 0.0);
        let done = match &job {
            Job::Replay(id) => replay::run(&context, id).await,
            Job::Calibration(id) => calibration::run(&context, id).await,
        };
        context.progress.remove(id);
        if let Err(error) = done {
            tracing::error!(?job, %error, "cannot store the outcome of a background job");
        }
    }
}

/// Starts `n` workers on `queue`.
pub(crate) fn spawn(
    n: usize,
    context: &JobContext,
    queue: mpsc::Receiver<Job>,
) -> Vec<JoinHandle<()>> {
    let queue = Arc::new(tokio::sync::Mutex::new(queue));
    (0..n).map(|_| tokio::spawn(work(context.clone(), queue.clone()))).collect()
}
