//! Starting replays and reading their results.

use uuid::Uuid;

use crate::clock::rfc3339;
use crate::job::{self, Job, NewJob};
use crate::jobs::replay;
use crate::replay_settings::{calibration, setup};
use crate::{Service, ServiceError, views};
use offbd_store::{ReplayRow, Write};
use offbd_wire::service::{JobWaitView, ReplaySettingsView, ReplayView};
use offbd_wire::words::JobState;

impl Service {
    /// Queues a job that evaluates a recorded session again.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`]; [`ServiceError::Invalid`] for settings
    /// that are invalid; [`ServiceError::Busy`].
    pub async fn replay(
        &self,
        session: &str,
        settings: ReplaySettingsView,
    ) -> Result<ReplayView, ServiceError> {
        let session = self.session_row(session).await?;
        let learnt = calibration(&self.inner.handles.store, &session.asset, &settings).await?;
        setup(&session, &settings, learnt.as_ref())?;
        let room = self.reserve_job()?;
        let row = ReplayRow {
            id: Uuid::now_v7().to_string(),
            session: session.id.clone(),
            state: JobState::Queued.to_string(),
            settings: views::to_json(&settings)?,
            created_at: self.inner.handles.clock.now(),
            finished_at: None,
            result: None,
            error: None,
        };
        let stored =
            self.inner.handles.write(&session.asset, vec![Write::PutReplay(row.clone())]).await;
        // The session may have been deleted meanwhile, and the replay was not stored then.
        self.session_asset(&row.session).await?;
        stored?;
        let (job, cost) =
            (Job::Replay(row.id.clone()), job::replay_cost(session.progress.n_samples));
        room.put(NewJob { job, asset: session.asset, cost });
        let waits = self.inner.jobs.wait(&row.id);
        view(row, 0.0, waits)
    }

    /// Returns the progress of a replay, and its result once it is done.
    ///
    /// # Errors
    /// [`ServiceError::UnknownReplay`].
    pub async fn replay_state(&self, id: &str) -> Result<ReplayView, ServiceError> {
        // Before the row is read, which may say meanwhile that the job has begun.
        let waits = self.inner.jobs.wait(id);
        let progress = self.inner.job_context.progress.get(id);
        let row = self.inner.handles.store.replay(id).await?;
        let row = row.ok_or_else(|| ServiceError::UnknownReplay { id: id.to_owned() })?;
        view(row, progress.unwrap_or(0.0), waits)
    }

    /// Cancels a replay that waits or runs; one that runs may take a moment to stop.
    ///
    /// # Errors
    /// [`ServiceError::UnknownReplay`]; [`ServiceError::JobEnded`].
    pub async fn cancel_replay(&self, id: &str) -> Result<ReplayView, ServiceError> {
        let row = self.inner.handles.store.replay(id).await?;
        let row = row.ok_or_else(|| ServiceError::UnknownReplay { id: id.to_owned() })?;
        let asset = self.session_asset(&row.session).await?;
        let cancelled = replay::cancel_waiting(&self.inner.job_context, &asset, row);
        self.cancel_job(id, cancelled).await?;
        self.replay_state(id).await
    }
}

fn view(
    row: ReplayRow,
    progress: f64,
    waits: Option<JobWaitView>,
) -> Result<ReplayView, ServiceError> {
    let state: JobState = views::word(&row.state)?;
    Ok(ReplayView {
        id: row.id,
        session_id: row.session,
        progress: if state == JobState::Done { 1.0 } else { progress },
        state,
        waits: waits.filter(|_| state == JobState::Queued),
        settings: views::from_json(&row.settings)?,
        created_at: rfc3339(row.created_at),
        finished_at: row.finished_at.map(rfc3339),
        result: row.result.as_deref().map(views::from_json).transpose()?,
        error: row.error,
    })
}
