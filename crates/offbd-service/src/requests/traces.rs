//! The trace of a session, for plots and as a table.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};
use tokio::task::JoinHandle;

use crate::reanalysis::evaluation::Evaluation;
use crate::reanalysis::trace::{TraceBlock, send_blocks, trace};
use crate::replay_settings::find_calibration;
use crate::{Service, ServiceError, TraceQuery};
use offbd_core::vocabulary::TimeRange;
use offbd_wire::asset::CalibrationView;
use offbd_wire::service::ReplaySettingsView;
use offbd_wire::session_file::SessionInfo;
use offbd_wire::trace::{ThresholdsView, TraceView};

/// Blocks of a trace that wait for its reader.
const MAX_WAITING_BLOCKS: usize = 2;

/// All points of a trace, block by block.
pub struct TraceReader {
    /// What a file says about the session that is judged.
    pub info: SessionInfo,
    pub thresholds: Vec<ThresholdsView>,
    /// The first block, until it is read.
    first: Option<TraceView>,
    blocks: mpsc::Receiver<TraceBlock>,
    /// The evaluation, until it has ended.
    task: Option<JoinHandle<()>>,
}

impl TraceReader {
    /// Returns the next points; `None` after the last.
    ///
    /// # Errors
    /// Those of reading the recording; [`ServiceError::Unavailable`] if the service shuts down.
    pub async fn next(&mut self) -> Option<Result<TraceView, ServiceError>> {
        if let Some(first) = self.first.take() {
            return Some(Ok(first));
        }
        match (self.blocks.recv().await, self.task.take()) {
            (Some(block), task) => {
                self.task = task;
                Some(block)
            }
            // A part of a trace must not be taken for the whole.
            (None, Some(task)) => task.await.is_err().then_some(Err(FAILED)),
            (None, None) => None,
        }
    }
}

impl Service {
    /// Returns the trace of a session.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`]; [`ServiceError::UnknownCalibration`];
    /// [`ServiceError::Invalid`] for invalid settings;
    /// [`ServiceError::TooMany`] if the range is too long; [`ServiceError::Busy`].
    pub async fn trace(&self, id: &str, query: TraceQuery) -> Result<TraceView, ServiceError> {
        let session = self.session_row(id).await?;
        let learnt = self.requested_calibration(&session.asset, &query.settings).await?;
        let permit = permit(&self.inner.computing.traces)?;
        let handles = self.inner.handles.clone();
        let task = tokio::task::spawn_blocking(move || {
            let trace = trace(&handles, &session, &query, learnt.as_ref());
            drop(permit);
            trace
        });
        task.await.unwrap_or(Err(FAILED))
    }

    /// Returns all points of the trace of a session, which are computed while they are read.
    ///
    /// # Errors
    /// As [`Service::trace`]; those of reading the first block.
    pub async fn whole_trace(
        &self,
        id: &str,
        range: TimeRange,
        settings: ReplaySettingsView,
    ) -> Result<TraceReader, ServiceError> {
        let session = self.session_row(id).await?;
        let learnt = self.requested_calibration(&session.asset, &settings).await?;
        // A slow reader keeps no chart waiting.
        let permit = permit(&self.inner.computing.whole_traces)?;
        let handles = self.inner.handles.clone();
        let begun = tokio::task::spawn_blocking(move || {
            let learnt = learnt.as_ref();
            let evaluation = Evaluation::begin(&handles, &session, range, &settings, learnt)?;
            let info = evaluation.info(&session, &settings)?;
            Ok((evaluation, info, handles, session))
        });
        let (evaluation, info, handles, session) = begun.await.unwrap_or(Err(FAILED))?;
        let thresholds = evaluation.thresholds();
        let (sender, mut blocks) = mpsc::channel(MAX_WAITING_BLOCKS);
        let task = tokio::task::spawn_blocking(move || {
            send_blocks(evaluation, &handles, &session, &sender);
            drop(permit);
        });
        let first = blocks.recv().await.ok_or(FAILED)??;
        Ok(TraceReader { info, thresholds, first: Some(first), blocks, task: Some(task) })
    }

    async fn requested_calibration(
        &self,
        asset: &str,
        settings: &ReplaySettingsView,
    ) -> Result<Option<CalibrationView>, ServiceError> {
        let Some(id) = settings.calibration.clone() else { return Ok(None) };
        let found = find_calibration(&self.inner.handles.store, asset, &id).await?;
        let unknown = || ServiceError::UnknownCalibration { asset: asset.to_owned(), id };
        found.ok_or_else(unknown).map(Some)
    }
}

const FAILED: ServiceError = ServiceError::Unavailable { what: "evaluating the recording failed" };

fn permit(semaphore: &Arc<Semaphore>) -> Result<OwnedSemaphorePermit, ServiceError> {
    let busy = |_| ServiceError::Busy { what: "the limit of concurrent traces is reached" };
    semaphore.clone().try_acquire_owned().map_err(busy)
}
