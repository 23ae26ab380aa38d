//! The trace of a session, for plots.

use crate::service::reanalysis::trace::trace;
use crate::service::replay_settings::find_calibration;
use crate::service::{Service, ServiceError, TraceQuery};
use crate::wire::asset::CalibrationView;
use crate::wire::trace::TraceView;

impl Service {
    /// Returns the trace of a session.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`]; [`ServiceError::UnknownCalibration`];
    /// [`ServiceError::Invalid`] for invalid settings;
    /// [`ServiceError::TooMany`] if the range is too long; [`ServiceError::Busy`].
    pub async fn trace(&self, id: &str, query: TraceQuery) -> Result<TraceView, ServiceError> {
        let session = self.session_row(id).await?;
        let learnt = self.requested_calibration(&session.asset, &query).await?;
        let busy = |_| ServiceError::Busy { what: "the limit of concurrent traces is reached" };
        let permit = self.inner.computing.traces.clone().try_acquire_owned().map_err(busy)?;
        let handles = self.inner.handles.clone();
        let task = tokio::task::spawn_blocking(move || {
            let trace = trace(&handles, &session, &query, learnt.as_ref());
            drop(permit);
            trace
        });
        let failed = ServiceError::Unavailable { what: "evaluating the recording failed" };
        task.await.unwrap_or(Err(failed))
    }

    async fn requested_calibration(
        &self,
        asset: &str,
        query: &TraceQuery,
    ) -> Result<Option<CalibrationView>, ServiceError> {
        let Some(id) = query.settings.calibration.clone() else { return Ok(None) };
        let found = find_calibration(&self.inner.handles.store, asset, &id).await?;
        let unknown = || ServiceError::UnknownCalibration { asset: asset.to_owned(), id };
        found.ok_or_else(unknown).map(Some)
    }
}
