//! Trying limits and debounce times on a recorded session.

use crate::reanalysis::trial::try_out;
use crate::{Service, ServiceError};
use offbd_core::engine::Trial;
use offbd_wire::service::ReplaySettingsView;
use offbd_wire::trial::TrialView;

impl Service {
    /// Returns what the monitors find in a session with other limits and debounce times.
    /// Nothing is stored.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`]; [`ServiceError::Invalid`] for invalid settings;
    /// [`ServiceError::TooMany`] if the session is too long; [`ServiceError::Busy`].
    pub async fn try_out(
        &self,
        id: &str,
        settings: ReplaySettingsView,
        trial: Trial,
    ) -> Result<TrialView, ServiceError> {
        let session = self.session_row(id).await?;
        let busy = |_| ServiceError::Busy { what: "the limit of concurrent traces is reached" };
        let permit = self.inner.computing.traces.clone().try_acquire_owned().map_err(busy)?;
        let handles = self.inner.handles.clone();
        let task = tokio::task::spawn_blocking(move || {
            let tried = try_out(&handles, &session, &settings, &trial);
            drop(permit);
            tried
        });
        let failed = ServiceError::Unavailable { what: "evaluating the recording failed" };
        task.await.unwrap_or(Err(failed))
    }
}
