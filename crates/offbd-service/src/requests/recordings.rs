//! The recording of a fault.

use crate::reanalysis::fault_recording::{fault_recording, last_failure};
use crate::{RecordingWindow, Service, ServiceError};
use offbd_core::vocabulary::FaultCode;
use offbd_wire::recording::{RecordingRow, RecordingView};

impl Service {
    /// Returns the recording of the last occurrence of a fault: its description, with
    /// empty columns, and its rows.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::UnknownCode`];
    /// [`ServiceError::NoRecording`] if the code never failed or the session was deleted;
    /// [`ServiceError::Invalid`] for an invalid window; [`ServiceError::TooMany`] if the
    /// window has too many samples or too many before it; [`ServiceError::Busy`].
    pub async fn fault_recording(
        &self,
        asset: &str,
        word: &str,
        window: RecordingWindow,
    ) -> Result<(RecordingView, Vec<RecordingRow>), ServiceError> {
        window.check()?;
        let entry = self.fault(asset, word).await?;
        let gone = || ServiceError::NoRecording { asset: asset.to_owned(), code: word.to_owned() };
        let occurrence = entry.provenance.last_occurrence.ok_or_else(gone)?;
        let session =
            self.inner.handles.store.session(&occurrence.session_id).await?.ok_or_else(gone)?;
        let code: FaultCode = word.parse().map_err(ServiceError::UnknownCode)?;
        let failure =
            last_failure(&self.inner.handles.store, &session.id, code).await?.ok_or_else(gone)?;
        let busy = |_| ServiceError::Busy { what: "the limit of concurrent recordings is reached" };
        let permit = self.inner.computing.recordings.clone().try_acquire_owned().map_err(busy)?;
        let handles = self.inner.handles.clone();
        let task = tokio::task::spawn_blocking(move || {
            let recording = fault_recording(&handles, &session, code, &failure, window);
            drop(permit);
            recording
        });
        let failed = ServiceError::Unavailable { what: "evaluating the recording failed" };
        task.await.unwrap_or(Err(failed))
    }
}
