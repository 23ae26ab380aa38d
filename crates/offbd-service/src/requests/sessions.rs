//! Opening, ending, deleting and listing sessions, and reading their recordings.

use crate::asset::AssetCommand;
use crate::{Service, ServiceError, views};
use offbd_core::vocabulary::TimeRange;
use offbd_store::{RecordingReader, SessionFilter, SessionRow};
use offbd_wire::asset;
use offbd_wire::service::{Page, SessionCalibrationView, SessionView};
use offbd_wire::session_file::SessionInfo;
use offbd_wire::words::{SessionSort, SessionState, VerdictFilter};

/// The parameters of a query for sessions.
#[derive(Clone, Debug, Default)]
pub struct SessionListQuery {
    pub asset: Option<String>,
    pub state: Option<SessionState>,
    /// How the name begins.
    pub name: Option<String>,
    /// Opened at this time or later, microseconds since 1970.
    pub opened_from: Option<i64>,
    /// Opened before this time, microseconds since 1970.
    pub opened_to: Option<i64>,
    pub verdict: Option<VerdictFilter>,
    /// A tag of the asset.
    pub tag: Option<String>,
    /// `-opened_at` by default.
    pub sort: Option<SessionSort>,
    pub cursor: Option<String>,
}

impl Service {
    /// Checks that the asset of a filter exists.
    pub(crate) async fn check_asset(&self, asset: Option<&str>) -> Result<(), ServiceError> {
        match asset {
            Some(asset) => self.check_known(asset).await,
            None => Ok(()),
        }
    }

    /// Ends the asset's open session and opens a new one, by default named by the current
    /// time.
    ///
    /// # Errors
    /// [`ServiceError::SessionExists`]; [`ServiceError::Invalid`] for an invalid name.
    pub async fn open_session(
        &self,
        asset: &str,
        name: Option<String>,
    ) -> Result<SessionView, ServiceError> {
        self.open_for(asset, name, false).await
    }

    /// Opens a session for live samples or, with `importing`, for a recording.
    pub(crate) async fn open_for(
        &self,
        asset: &str,
        name: Option<String>,
        importing: bool,
    ) -> Result<SessionView, ServiceError> {
        let open = |reply| AssetCommand::OpenSession { name, importing, reply };
        let id = self.inner.shards.call(asset, open).await?;
        self.session(&id).await
    }

    /// Returns the asset of a session; `None` if there is no such session.
    ///
    /// # Errors
    /// [`ServiceError::Store`] if the store cannot be read.
    pub async fn asset_of_session(&self, id: &str) -> Result<Option<String>, ServiceError> {
        Ok(self.inner.handles.store.asset_of_session(id).await?)
    }

    /// Returns the asset of a session, without reading the rest of it.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`].
    pub(crate) async fn session_asset(&self, id: &str) -> Result<String, ServiceError> {
        let asset = self.asset_of_session(id).await?;
        asset.ok_or_else(|| ServiceError::UnknownSession { id: id.to_owned() })
    }

    /// Ends a session; has no effect on one that has ended.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`].
    pub async fn end_session(&self, id: &str) -> Result<SessionView, ServiceError> {
        let row = self.session_row(id).await?;
        let end = |reply| AssetCommand::EndSession { session: row.id, reply };
        self.inner.shards.call(&row.asset, end).await?;
        self.session(id).await
    }

    /// Deletes a session with its recording and transitions. The asset's fault memory is
    /// not changed. The session is hidden immediately; its data are deleted in parts, even
    /// if the caller is dropped. Its name cannot be used again before the deletion is
    /// complete.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`], also while it is being deleted;
    /// [`ServiceError::NotStored`] if the store does not accept a part; the next sweep of
    /// retention continues the deletion.
    pub async fn delete_session(&self, id: &str) -> Result<(), ServiceError> {
        let SessionRow { id, asset, .. } = self.session_row(id).await?;
        let this = self.clone();
        let deletion = async move {
            let delete = |reply| AssetCommand::DeleteSession { session: id.clone(), reply };
            this.inner.shards.call(&asset, delete).await?;
            this.inner.deleter.session(&id).await
        };
        self.inner.deleter.run_to_completion(deletion).await
    }

    /// Returns a session.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`].
    pub async fn session(&self, id: &str) -> Result<SessionView, ServiceError> {
        views::session(self.session_row(id).await?)
    }

    /// Returns the calibration that a session is judged with.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`].
    pub async fn session_calibration(
        &self,
        id: &str,
    ) -> Result<SessionCalibrationView, ServiceError> {
        let rig = views::rig(&self.session_row(id).await?.setup)?;
        Ok(SessionCalibrationView { calibration: asset::view(&rig).calibration })
    }

    pub(crate) async fn session_row(&self, id: &str) -> Result<SessionRow, ServiceError> {
        let row = self.inner.handles.store.session(id).await?;
        row.ok_or_else(|| ServiceError::UnknownSession { id: id.to_owned() })
    }

    /// Returns a page of sessions.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for an invalid cursor; [`ServiceError::UnknownAsset`].
    pub async fn sessions(
        &self,
        query: SessionListQuery,
        limit: u32,
    ) -> Result<Page<SessionView>, ServiceError> {
        self.check_asset(query.asset.as_deref()).await?;
        let filter = SessionFilter {
            asset: query.asset,
            state: query.state.map(|state| state.to_string()),
            name: query.name,
            opened_from: query.opened_from,
            opened_to: query.opened_to,
            found_fault: query.verdict.map(|verdict| verdict == VerdictFilter::Fault),
            tag: query.tag,
            is_ascending: query.sort == Some(SessionSort::Oldest),
            after: query.cursor.as_deref().map(views::cursor::<(i64, String)>).transpose()?,
        };
        let rows = self.inner.handles.store.sessions(&filter, limit + 1).await?;
        views::page(rows, limit, |row| (row.opened_at, row.id.clone()), views::session)
    }

    /// Returns a session, what a file says about it, and a reader of the part of its recording
    /// in `range`.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`].
    pub async fn recording(
        &self,
        id: &str,
        range: TimeRange,
    ) -> Result<(SessionView, SessionInfo, RecordingReader), ServiceError> {
        let row = self.session_row(id).await?;
        let recording = self.inner.handles.store.stretch(&row, range).await?;
        let mut info = views::session_info(&row)?;
        // The hash is that of the whole session.
        info.verdict_hash = info.verdict_hash.filter(|_| range == TimeRange::ALL);
        Ok((views::session(row)?, info, recording))
    }
}
