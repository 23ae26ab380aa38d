//! Writing and reading the audit log.

use crate::access::{AuditEntry, Caller};
use crate::clock::rfc3339;
use crate::{Service, ServiceError, views};
use offbd_store::{AccessWrite, AuditRow, LAST_ID, Write};
use offbd_wire::access::AuditView;
use offbd_wire::service::Page;

/// The actor in the audit log if authentication is off and the request names nobody.
const ANONYMOUS: &str = "anyone";

impl Service {
    /// Adds `entry` to the audit log; durable on return.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] or [`ServiceError::NotStored`] if it cannot be stored.
    pub async fn audit_action(
        &self,
        caller: &Caller,
        entry: AuditEntry,
    ) -> Result<(), ServiceError> {
        let principal = caller.principal();
        let by = entry.by.clone();
        let name = caller.name().or(by.as_deref()).unwrap_or(ANONYMOUS);
        let actor = (name, principal.map(|principal| principal.id.as_str()));
        let row = entry.row(actor, self.inner.handles.clock.now());
        self.inner.handles.write_unpartitioned(Write::Access(AccessWrite::Audit(row))).await
    }

    /// Returns a page of the audit log, newest first.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for an invalid cursor.
    pub async fn audit(
        &self,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<AuditView>, ServiceError> {
        let before = cursor.map(views::cursor::<String>).transpose()?;
        let before = before.as_deref().unwrap_or(LAST_ID);
        let rows = self.inner.handles.store.audit(before, limit + 1).await?;
        views::page(rows, limit, |row| row.id.clone(), |row| Ok(view(row)))
    }
}

fn view(row: AuditRow) -> AuditView {
    let AuditRow { id, at, actor, token, act, target, address } = row;
    AuditView { id, at: rfc3339(at), actor, token_id: token, act, target, address }
}
