//! What goes, piece by piece: first nobody sees it any more, then it is dropped in
//! parts, and at last the row goes that the parts belong to.

use sqlx::AnyConnection;

use super::Group;
use crate::store::{Micros, StoreError};

impl Group<'_> {
    /// The asset `name` and its sessions are no longer seen. What is small goes at
    /// once; the open session ends without a verdict.
    pub(super) async fn give_up_asset(
        &mut self,
        db: &mut AnyConnection,
        name: &str,
        at: Micros,
    ) -> Result<(), StoreError> {
        let open = sqlx::query_scalar("SELECT id FROM session WHERE state = 'open' AND asset = $1");
        let open: Option<String> = open.bind(name).fetch_optional(&mut *db).await?;
        if let Some(session) = open {
            self.forget(&session);
        }
        for sql in [
            "UPDATE session SET state = 'ended', ended_at = $2, expired_at = $2
             WHERE asset = $1 AND state = 'open'",
            "UPDATE asset SET deleted_at = $2 WHERE name = $1",
        ] {
            sqlx::query(sql).bind(name).bind(at).execute(&mut *db).await?;
        }
        for sql in
            ["DELETE FROM fault WHERE asset = $1", "DELETE FROM calibration WHERE asset = $1"]
        {
            sqlx::query(sql).bind(name).execute(&mut *db).await?;
        }
        Ok(())
    }

    /// The session is gone, with what is left of it.
    pub(super) async fn delete_session(
        &mut self,
        db: &mut AnyConnection,
        session: &str,
    ) -> Result<(), StoreError> {
        self.forget(session);
        sqlx::query("DELETE FROM session WHERE id = $1").bind(session).execute(db).await?;
        Ok(())
    }
}

/// The asset is gone, with what is left of it, if it was given up: another of its name
/// may be there since.
pub(super) async fn delete_asset(db: &mut AnyConnection, name: &str) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM asset WHERE name = $1 AND deleted_at IS NOT NULL")
        .bind(name)
        .execute(db)
        .await?;
    Ok(())
}

pub(super) async fn expire(
    db: &mut AnyConnection,
    session: &str,
    at: Micros,
) -> Result<(), StoreError> {
    sqlx::query("UPDATE session SET expired_at = $2 WHERE id = $1 AND state = 'ended'")
        .bind(session)
        .bind(at)
        .execute(db)
        .await?;
    Ok(())
}

/// Drops the first chunks of `session`.
pub(super) async fn drop_chunks(
    db: &mut AnyConnection,
    session: &str,
    limit: u32,
) -> Result<(), StoreError> {
    let sql = "DELETE FROM chunk WHERE session = $1 AND first_index IN
         (SELECT first_index FROM chunk WHERE session = $1 ORDER BY first_index LIMIT $2)";
    sqlx::query(sql).bind(session).bind(i64::from(limit)).execute(db).await?;
    Ok(())
}

/// Drops the first transitions of `session`.
pub(super) async fn drop_transitions(
    db: &mut AnyConnection,
    session: &str,
    limit: u32,
) -> Result<(), StoreError> {
    let sql = "DELETE FROM transition WHERE session = $1 AND ordinal IN
         (SELECT ordinal FROM transition WHERE session = $1 ORDER BY ordinal LIMIT $2)";
    sqlx::query(sql).bind(session).bind(i64::from(limit)).execute(db).await?;
    Ok(())
}
