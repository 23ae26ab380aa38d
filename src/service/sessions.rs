//! Sessions: opening, ending, listing, reading the recording.

use super::clock::rfc3339;
use super::limits::MAX_SESSION_NAME;
use super::telemetry::{Switched, switch};
use super::{Service, ServiceError, views};
use crate::store::{SessionFilter, SessionRow, Store, Write};
use crate::wire::service::{Page, SessionView};
use offbd_core::vocabulary::{Invalid, Sample};

/// A session's name must be text that fits a line.
pub(super) fn check_name(name: &str) -> Result<(), ServiceError> {
    let fits = (1..=MAX_SESSION_NAME).contains(&name.len());
    if fits && !name.chars().any(char::is_control) {
        return Ok(());
    }
    let reason = format!("must be 1 to {MAX_SESSION_NAME} bytes without control characters");
    Err(Invalid::new("/session", reason).into())
}

/// A session's samples in order of arrival, read chunk by chunk.
pub struct Recording {
    store: Store,
    session: String,
    next: i64,
}

impl Recording {
    /// The next chunk; none at the end.
    ///
    /// # Errors
    /// [`ServiceError::Store`].
    pub async fn next(&mut self) -> Result<Option<Vec<Sample>>, ServiceError> {
        let samples = self.store.samples_from(&self.session, self.next).await?;
        let n = samples.as_ref().map_or(0, Vec::len);
        self.next += i64::try_from(n).unwrap_or(i64::MAX);
        Ok(samples)
    }
}

impl Service {
    /// Opens a session, ending the asset's open one; named by this moment
    /// without a name.
    ///
    /// # Errors
    /// [`ServiceError::SessionExists`]; [`ServiceError::Invalid`] for the name.
    pub async fn open_session(
        &self,
        asset: &str,
        name: Option<String>,
    ) -> Result<SessionView, ServiceError> {
        self.open_as(asset, name, false).await
    }

    /// Opens a session for live samples or, with `importing`, for a recording.
    pub(super) async fn open_as(
        &self,
        asset: &str,
        name: Option<String>,
        importing: bool,
    ) -> Result<SessionView, ServiceError> {
        let id = self
            .call(asset, move |context, running, work| {
                if running.open.as_ref().is_some_and(|open| open.importing) {
                    let what = "a recording is being imported into this asset";
                    return Err(ServiceError::Busy { what });
                }
                let name = name.unwrap_or_else(|| rfc3339(work.at));
                let open = running.open.as_ref().is_some_and(|open| open.name == name);
                if open || matches!(switch(context, running, &name, work)?, Switched::Ended(_)) {
                    let asset = running.row.name.clone();
                    return Err(ServiceError::SessionExists { asset, name });
                }
                let Some(open) = &mut running.open else {
                    return Err(ServiceError::Unavailable { what: "the session did not open" });
                };
                open.importing = importing;
                Ok(open.id.clone())
            })
            .await?;
        self.session(&id).await
    }

    /// The asset of a session; none if there is no such session.
    ///
    /// # Errors
    /// [`ServiceError::Store`] if the store cannot be read.
    pub async fn asset_of_session(&self, id: &str) -> Result<Option<String>, ServiceError> {
        Ok(self.inner.handles.store.session(id).await?.map(|row| row.asset))
    }

    /// Ends a session; one that has ended stays as it is.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`].
    pub async fn end_session(&self, id: &str) -> Result<SessionView, ServiceError> {
        let row = self.session_row(id).await?;
        let wanted = row.id.clone();
        self.call(&row.asset, move |context, running, work| {
            if running.open.as_ref().is_some_and(|open| open.id == wanted) {
                running.end(context, work)?;
            }
            Ok(())
        })
        .await?;
        self.session(id).await
    }

    /// Deletes a session with its recording and transitions. The asset's fault
    /// memory keeps what the session left in it. It is hidden at once; what is stored
    /// of it goes in pieces, also if the caller goes away. Until then its name is
    /// taken.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`], also while it is being deleted;
    /// [`ServiceError::NotStored`] if the store does not take a piece: the next sweep
    /// of retention goes on.
    pub async fn delete_session(&self, id: &str) -> Result<(), ServiceError> {
        let SessionRow { id, asset, .. } = self.session_row(id).await?;
        let this = self.clone();
        let deletion = async move {
            let session = id.clone();
            this.call(&asset, move |context, running, work| {
                let open = running.open.as_ref().is_some_and(|open| open.id == session);
                if running.learning.forget(&session, open) {
                    running.keep_learning(work)?;
                }
                if open {
                    running.end(context, work)?;
                }
                work.writes.push(Write::ExpireSession { session, at: work.at });
                Ok(())
            })
            .await?;
            this.inner.deleter.session(&id).await
        };
        self.to_the_end(deletion).await
    }

    /// # Errors
    /// [`ServiceError::UnknownSession`].
    pub async fn session(&self, id: &str) -> Result<SessionView, ServiceError> {
        views::session(self.session_row(id).await?)
    }

    pub(super) async fn session_row(&self, id: &str) -> Result<SessionRow, ServiceError> {
        let row = self.inner.handles.store.session(id).await?;
        row.ok_or_else(|| ServiceError::UnknownSession { id: id.to_owned() })
    }

    /// Sessions, newest first; `state` is `open` or `ended`.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for a cursor that is none.
    pub async fn sessions(
        &self,
        asset: Option<String>,
        state: Option<String>,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<SessionView>, ServiceError> {
        let before = cursor.map(views::cursor::<(i64, String)>).transpose()?;
        let filter = SessionFilter { asset, state, before };
        let rows = self.inner.handles.store.sessions(&filter, limit + 1).await?;
        views::page(rows, limit, |row| (row.opened_at, row.id.clone()), views::session)
    }

    /// The recording of a session.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`].
    pub async fn recording(&self, id: &str) -> Result<(SessionView, Recording), ServiceError> {
        let session = self.session(id).await?;
        let store = self.inner.handles.store.clone();
        Ok((session, Recording { store, session: id.to_owned(), next: 0 }))
    }
}
