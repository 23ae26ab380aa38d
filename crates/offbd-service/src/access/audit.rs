//! Entries of the audit log: who did what, when, from where.

use uuid::Uuid;

use offbd_store::{AuditRow, Micros};

/// An entry of the audit log, without actor and time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditEntry {
    /// The operation of the API, such as `clear_fault`.
    pub action: String,
    /// What it was done to: a path of the API.
    pub target: String,
    /// The client's address; `None` for a command on the machine itself.
    pub address: Option<String>,
    /// The name that the request gives as that of the person; it counts only without a token.
    pub by: Option<String>,
}

impl AuditEntry {
    /// The row that is stored; `actor` is a token's name and id.
    #[must_use]
    pub fn row(self, actor: (&str, Option<&str>), at: Micros) -> AuditRow {
        let Self { action, target, address, .. } = self;
        let id = Uuid::now_v7().to_string();
        let (actor, token) = (actor.0.to_owned(), actor.1.map(str::to_owned));
        AuditRow { id, at, actor, token, act: action, target, address }
    }
}
