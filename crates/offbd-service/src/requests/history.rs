//! The history of a code, and of a session: transitions and actions of persons.

use crate::clock::rfc3339;
use crate::{Service, ServiceError, views};
use offbd_core::vocabulary::FaultCode;
use offbd_store::{ActionRow, TransitionRow};
use offbd_wire::service::{HistoryView, Page};
use offbd_wire::verdict::FaultView;

impl Service {
    /// Returns a page of the history of a code of an asset, newest first.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::UnknownCode`];
    /// [`ServiceError::Invalid`] for an invalid cursor.
    pub async fn history(
        &self,
        asset: &str,
        word: &str,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<HistoryView>, ServiceError> {
        let code: FaultCode = word.parse().map_err(ServiceError::UnknownCode)?;
        self.check_known(asset).await?;
        let before = cursor.map(views::cursor::<i64>).transpose()?.unwrap_or(i64::MAX);
        let (store, code) = (&self.inner.handles.store, code.as_str());
        let changes = store.transitions_before(asset, code, before, limit + 1).await?;
        let acts = store.actions_before(asset, code, before, limit + 1).await?;
        let changes: Result<Vec<HistoryView>, _> = changes.into_iter().map(change).collect();
        let mut all = changes?;
        for row in acts {
            all.push(act(row)?);
        }
        all.sort_by_key(|entry| std::cmp::Reverse(entry.id));
        all.truncate(limit as usize + 1);
        views::page(all, limit, |entry| entry.id, Ok)
    }

    /// Returns a page of the fault transitions of a session, in order.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`]; [`ServiceError::Invalid`] for an invalid cursor.
    pub async fn session_faults(
        &self,
        id: &str,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<FaultView>, ServiceError> {
        self.session_asset(id).await?;
        let after = cursor.map(views::cursor::<i64>).transpose()?;
        let from = after.map_or(0, |ordinal| ordinal.saturating_add(1));
        let rows = self.inner.handles.store.transitions(id, from, limit + 1).await?;
        views::page(rows, limit, |row| row.ordinal, |row| views::from_json(&row.document))
    }
}

fn change(row: TransitionRow) -> Result<HistoryView, ServiceError> {
    Ok(HistoryView {
        id: row.id,
        at: rfc3339(row.at),
        what: views::word(&row.status)?,
        by: None,
        session_id: Some(row.session),
        fault: Some(views::from_json(&row.document)?),
    })
}

fn act(row: ActionRow) -> Result<HistoryView, ServiceError> {
    Ok(HistoryView {
        id: row.id,
        at: rfc3339(row.at),
        what: views::word(&row.kind)?,
        by: Some(row.actor),
        session_id: row.session,
        fault: None,
    })
}
