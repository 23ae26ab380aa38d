//! The table of remarks: what people note on a moment or a stretch of a session.

use sqlx::AnyConnection;

use super::from_row::from_row;
use super::{Micros, Store, StoreError};

/// A remark on a session.
#[derive(Clone, Debug, PartialEq)]
pub struct RemarkRow {
    pub id: String,
    pub session: String,
    pub from_s: f64,
    /// Equal to `from_s` for a moment.
    pub to_s: f64,
    pub text: String,
    pub actor: String,
    pub at: Micros,
}

from_row!(RemarkRow { id, session, from_s, to_s, text, actor, at });

/// A change of the remarks on a session.
#[derive(Clone, Debug)]
pub enum RemarkWrite {
    /// Has no effect if the session is deleted.
    Add(RemarkRow),
    Remove {
        session: String,
        id: String,
    },
}

impl RemarkWrite {
    pub(super) async fn apply(&self, db: &mut AnyConnection) -> Result<(), StoreError> {
        match self {
            Self::Add(row) => add(db, row).await,
            Self::Remove { session, id } => {
                let sql = "DELETE FROM remark WHERE session = $1 AND id = $2";
                sqlx::query(sql).bind(session).bind(id).execute(db).await?;
                Ok(())
            }
        }
    }

    /// The session that the remark is on.
    pub(super) fn session(&self) -> &str {
        match self {
            Self::Add(row) => &row.session,
            Self::Remove { session, .. } => session,
        }
    }
}

async fn add(db: &mut AnyConnection, row: &RemarkRow) -> Result<(), StoreError> {
    let known = sqlx::query_scalar("SELECT id FROM session WHERE id = $1 AND expired_at IS NULL");
    let known: Option<String> = known.bind(&row.session).fetch_optional(&mut *db).await?;
    if known.is_none() {
        return Ok(());
    }
    sqlx::query(
        "INSERT INTO remark (id, session, from_s, to_s, text, actor, at)
         VALUES ($1, $2, $3, $4, $5, $6, $7)",
    )
    .bind(&row.id)
    .bind(&row.session)
    .bind(row.from_s)
    .bind(row.to_s)
    .bind(&row.text)
    .bind(&row.actor)
    .bind(row.at)
    .execute(db)
    .await?;
    Ok(())
}

impl Store {
    /// The remarks on a session, in order of time.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails.
    pub async fn remarks(&self, session: &str) -> Result<Vec<RemarkRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM remark WHERE session = $1 ORDER BY from_s, id")
            .bind(session)
            .fetch_all(&self.pool)
            .await?)
    }
}
