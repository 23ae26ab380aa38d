//! The audit log: who did what, when, from where. Added to, never changed.

use uuid::Uuid;

use super::Caller;
use crate::service::clock::rfc3339;
use crate::service::{Service, ServiceError, views};
use crate::store::{AccessWrite, AuditRow, LAST_ID, Micros, Write};
use crate::wire::access::AuditView;
use crate::wire::service::Page;

/// The actor where nobody is asked for a token.
const ANYONE: &str = "anyone";

/// Something that was done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Deed {
    /// The operation of the interface, as `clear_fault`.
    pub act: String,
    /// What it was done to: an address of the interface.
    pub target: String,
    /// From where; none at the machine itself.
    pub address: Option<String>,
}

impl Deed {
    /// The entry of it; `actor` is a token's name and id.
    #[must_use]
    pub fn row(self, actor: (&str, Option<&str>), at: Micros) -> AuditRow {
        let Self { act, target, address } = self;
        let id = Uuid::now_v7().to_string();
        let (actor, token) = (actor.0.to_owned(), actor.1.map(str::to_owned));
        AuditRow { id, at, actor, token, act, target, address }
    }
}

impl Service {
    /// Adds to the audit log; durable on return.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] if the store does not take it.
    pub async fn note(&self, caller: &Caller, deed: Deed) -> Result<(), ServiceError> {
        let pass = caller.pass();
        let actor = (caller.name().unwrap_or(ANYONE), pass.map(|pass| pass.id.as_str()));
        let row = deed.row(actor, self.inner.handles.clock.now());
        self.inner.handles.write(Write::Access(AccessWrite::Audit(row))).await
    }

    /// The audit log, the latest first.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for a cursor that is none.
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
