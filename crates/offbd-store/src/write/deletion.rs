//! Deletion of assets and sessions in steps, so that no transaction is long: first they
//! are hidden from all readers, then their parts are deleted in limited numbers, and at
//! last their own row.

use sqlx::AnyConnection;

use super::group::GroupCommit;
use crate::execute::execute;
use crate::{Micros, StoreError};

impl GroupCommit<'_> {
    /// Hides the asset `name` and its sessions, deletes its faults and calibrations, and
    /// ends its open session without a verdict.
    pub(super) async fn hide_asset(
        &mut self,
        db: &mut AnyConnection,
        name: &str,
        at: Micros,
    ) -> Result<(), StoreError> {
        let open = sqlx::query_scalar("SELECT id FROM session WHERE state = 'open' AND asset = $1");
        let open: Option<String> = open.bind(name).fetch_optional(&mut *db).await?;
        if let Some(session) = open {
            self.discard(&session);
        }
        for sql in [
            "UPDATE session SET state = 'ended', ended_at = $2, expired_at = $2
             WHERE asset = $1 AND state = 'open'",
            "UPDATE asset SET deleted_at = $2 WHERE name = $1",
        ] {
            execute!(&mut *db, sql; name, at)?;
        }
        for sql in
            ["DELETE FROM fault WHERE asset = $1", "DELETE FROM calibration WHERE asset = $1"]
        {
            execute!(&mut *db, sql; name)?;
        }
        Ok(())
    }

    /// Ends the open `session` without a verdict, and hides it.
    pub(super) async fn discard_session(
        &mut self,
        db: &mut AnyConnection,
        session: &str,
        at: Micros,
    ) -> Result<(), StoreError> {
        self.discard(session);
        execute!(
            db, "UPDATE session SET state = 'ended', ended_at = $2, expired_at = $2
             WHERE id = $1 AND state = 'open'";
            session, at
        )
    }

    /// Deletes `session`, with what is left of its chunks and transitions.
    pub(super) async fn delete_session(
        &mut self,
        db: &mut AnyConnection,
        session: &str,
    ) -> Result<(), StoreError> {
        self.discard(session);
        execute!(db, "DELETE FROM session WHERE id = $1"; session)
    }
}

/// Deletes the asset `name`, with what is left of it, if it is hidden. A new asset of the
/// same name is not deleted.
pub(super) async fn delete_asset(db: &mut AnyConnection, name: &str) -> Result<(), StoreError> {
    execute!(db, "DELETE FROM asset WHERE name = $1 AND deleted_at IS NOT NULL"; name)
}

/// Hides `session` if it has ended.
pub(super) async fn hide_session(
    db: &mut AnyConnection,
    session: &str,
    at: Micros,
) -> Result<(), StoreError> {
    execute!(
        db, "UPDATE session SET expired_at = $2 WHERE id = $1 AND state = 'ended'";
        session, at
    )
}

/// Deletes the first chunks of `session`, at most `limit`.
pub(super) async fn drop_chunks(
    db: &mut AnyConnection,
    session: &str,
    limit: u32,
) -> Result<(), StoreError> {
    let sql = "DELETE FROM chunk WHERE session = $1 AND first_index IN
         (SELECT first_index FROM chunk WHERE session = $1 ORDER BY first_index LIMIT $2)";
    execute!(db, sql; session, i64::from(limit))
}

/// Deletes the first transitions of `session`, at most `limit`.
pub(super) async fn drop_transitions(
    db: &mut AnyConnection,
    session: &str,
    limit: u32,
) -> Result<(), StoreError> {
    let sql = "DELETE FROM transition WHERE session = $1 AND ordinal IN
         (SELECT ordinal FROM transition WHERE session = $1 ORDER BY ordinal LIMIT $2)";
    execute!(db, sql; session, i64::from(limit))
}
