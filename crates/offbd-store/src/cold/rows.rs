//! The rows about cold data, and the changes of them.

use sqlx::{AnyConnection, AssertSqlSafe, Executor};

use crate::from_row::from_row;
use crate::query_builder::QueryBuilder;
use crate::{Micros, PartitionId, SessionRow, Store, StoreError, read};

/// Files that are recordings whose chunks are not all deleted yet. The chunks are asked for
/// file by file, because they are many more.
const WITH_CHUNKS: &str = "SELECT * FROM cold_file WHERE moved_at IS NOT NULL AND
     (SELECT n FROM chunk WHERE chunk.session = cold_file.session LIMIT 1) > 0";

/// The file of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColdFileRow {
    pub session: String,
    pub asset: String,
    /// Number of the attempt to write it, from 1.
    pub attempt: i64,
    /// Relative to the directory of cold data.
    pub path: String,
    pub bytes: i64,
    /// SHA-256, hexadecimal.
    pub checksum: String,
    /// When the file became the recording; `None` for a plan.
    pub moved_at: Option<Micros>,
}

from_row!(ColdFileRow { session, asset, attempt, path, bytes, checksum, moved_at });

impl ColdFileRow {
    /// Plans the next attempt to write the samples of `session`: to a file in `folder`, or
    /// where the `earlier` attempt was.
    #[must_use]
    pub fn plan(session: &SessionRow, folder: &str, earlier: Option<&Self>) -> Self {
        let attempt = earlier.map_or(1, |earlier| earlier.attempt + 1);
        Self {
            session: session.id.clone(),
            asset: session.asset.clone(),
            attempt,
            path: path(earlier.map_or(folder, Self::folder), &session.id, attempt),
            bytes: 0,
            checksum: String::new(),
            moved_at: None,
        }
    }

    fn folder(&self) -> &str {
        self.path.rsplit_once('/').map_or("", |(folder, _)| folder)
    }

    /// The paths of the attempts before this one.
    pub fn earlier_paths(&self) -> impl Iterator<Item = String> {
        (1..self.attempt).map(|attempt| path(self.folder(), &self.session, attempt))
    }

    /// Whether the file is the recording.
    #[must_use]
    pub const fn is_moved(&self) -> bool {
        self.moved_at.is_some()
    }

    pub(super) fn unreadable(&self, reason: impl Into<String>) -> StoreError {
        let (session, path) = (self.session.clone(), self.path.clone());
        StoreError::Cold { session, path, reason: reason.into() }
    }
}

fn path(folder: &str, session: &str, attempt: i64) -> String {
    match attempt {
        1 => format!("{folder}/{session}.parquet"),
        _ => format!("{folder}/{session}-{attempt}.parquet"),
    }
}

/// A change of cold data.
#[derive(Clone, Debug)]
pub enum ColdWrite {
    /// Records a plan, instead of an earlier one of its session. A file that is the recording
    /// already stays so.
    Plan(ColdFileRow),
    /// The planned file becomes the recording. Nothing changes if there is no such plan or
    /// session any more.
    Move(ColdFileRow),
    /// Deletes the first chunks of a session whose recording is a file, at most `limit`, and
    /// keeps their places and times.
    DropChunks { session: String, limit: u32 },
    /// Forgets a file that has been removed.
    Forget { session: String },
}

impl ColdWrite {
    /// The session that it concerns.
    pub(crate) fn session(&self) -> &str {
        match self {
            Self::Plan(row) | Self::Move(row) => &row.session,
            Self::DropChunks { session, .. } | Self::Forget { session } => session,
        }
    }

    pub(crate) async fn apply(&self, db: &mut AnyConnection) -> Result<(), StoreError> {
        match self {
            Self::Plan(row) => plan(db, row).await,
            Self::Move(row) => record(db, row).await,
            Self::DropChunks { session, limit } => drop_chunks(db, session, *limit).await,
            Self::Forget { session } => {
                let forget = sqlx::query("DELETE FROM cold_file WHERE session = $1");
                forget.bind(session).execute(db).await?;
                Ok(())
            }
        }
    }
}

async fn plan(db: &mut AnyConnection, row: &ColdFileRow) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO cold_file (session, asset, attempt, path, bytes, checksum)
         VALUES ($1, $2, $3, $4, 0, '')
         ON CONFLICT (session) DO UPDATE SET attempt = excluded.attempt, path = excluded.path
         WHERE cold_file.moved_at IS NULL",
    )
    .bind(&row.session)
    .bind(&row.asset)
    .bind(row.attempt)
    .bind(&row.path)
    .execute(db)
    .await?;
    Ok(())
}

async fn record(db: &mut AnyConnection, row: &ColdFileRow) -> Result<(), StoreError> {
    sqlx::query(
        "UPDATE cold_file SET bytes = $3, checksum = $4, moved_at = $5
         WHERE session = $1 AND path = $2 AND moved_at IS NULL AND EXISTS
             (SELECT 1 FROM session WHERE session.id = cold_file.session)",
    )
    .bind(&row.session)
    .bind(&row.path)
    .bind(row.bytes)
    .bind(&row.checksum)
    .bind(row.moved_at.unwrap_or_default())
    .execute(db)
    .await?;
    Ok(())
}

/// Chunks disappear from the first one on, so that a reader that does not find one finds the
/// rest in the file.
async fn drop_chunks(db: &mut AnyConnection, session: &str, limit: u32) -> Result<(), StoreError> {
    let keep = "INSERT INTO cold_chunk (session, first_index, n, min_t_s, max_t_s)
         SELECT session, first_index, n, min_t_s, max_t_s FROM chunk
         WHERE session = $1 AND EXISTS
             (SELECT 1 FROM cold_file WHERE cold_file.session = $1 AND moved_at IS NOT NULL)
         ORDER BY first_index LIMIT $2";
    let kept = sqlx::query(keep).bind(session).bind(i64::from(limit)).execute(&mut *db).await?;
    if kept.rows_affected() == 0 {
        return Ok(());
    }
    let drop = "DELETE FROM chunk WHERE session = $1 AND first_index <=
         (SELECT MAX(first_index) FROM cold_chunk WHERE session = $1)";
    sqlx::query(drop).bind(session).execute(db).await?;
    Ok(())
}

/// All files that are recordings of sessions.
pub(super) async fn moved(db: &mut AnyConnection) -> Result<Vec<ColdFileRow>, StoreError> {
    let sql = "SELECT * FROM cold_file WHERE moved_at IS NOT NULL
               AND session IN (SELECT id FROM session) ORDER BY session";
    Ok(sqlx::query_as(sql).fetch_all(db).await?)
}

/// First index and number of samples of the chunks that `session` had: all from the first
/// one on that are not in the database any more.
pub(super) async fn chunks(
    db: &mut AnyConnection,
    session: &str,
) -> Result<Vec<(i64, i64)>, StoreError> {
    let sql = "SELECT first_index, n FROM cold_chunk WHERE session = $1 ORDER BY first_index";
    Ok(sqlx::query_as(sql).bind(session).fetch_all(db).await?)
}

/// Notes that `session` is deleted, and its file with it, if it has one.
pub(crate) async fn release(db: &mut AnyConnection, session: &str) -> Result<(), StoreError> {
    let release = sqlx::query("UPDATE cold_file SET moved_at = NULL WHERE session = $1");
    release.bind(session).execute(db).await?;
    Ok(())
}

/// Forgets all files.
pub(super) async fn forget_all(db: &mut AnyConnection) -> Result<(), StoreError> {
    db.execute("DELETE FROM cold_chunk").await?;
    db.execute("DELETE FROM cold_file").await?;
    Ok(())
}

impl Store {
    /// The file of `session`, or the plan of one.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails; so do all queries here.
    pub async fn cold_file(&self, session: &str) -> Result<Option<ColdFileRow>, StoreError> {
        let sql = "SELECT * FROM cold_file WHERE session = $1";
        Ok(sqlx::query_as(sql).bind(session).fetch_optional(&self.pool).await?)
    }

    /// The files of sessions that are deleted.
    pub async fn cold_leftovers(&self) -> Result<Vec<ColdFileRow>, StoreError> {
        let sql = "SELECT * FROM cold_file WHERE moved_at IS NULL AND NOT EXISTS
                   (SELECT 1 FROM session WHERE session.id = cold_file.session)
                   ORDER BY session";
        Ok(sqlx::query_as(sql).fetch_all(&self.pool).await?)
    }

    /// The files that are recordings of sessions whose chunks are not all deleted yet.
    pub async fn cold_files_with_chunks(&self) -> Result<Vec<ColdFileRow>, StoreError> {
        let sql = AssertSqlSafe(format!("{WITH_CHUNKS} ORDER BY session"));
        Ok(sqlx::query_as(sql).fetch_all(&self.pool).await?)
    }

    /// Whether the recording of `session` is a file, and not all of its chunks are deleted yet.
    pub async fn has_chunks_of_file(&self, session: &str) -> Result<bool, StoreError> {
        let sql = AssertSqlSafe(format!("{WITH_CHUNKS} AND session = $1"));
        let found: Option<ColdFileRow> =
            sqlx::query_as(sql).bind(session).fetch_optional(&self.pool).await?;
        Ok(found.is_some())
    }

    /// Ended sessions whose samples are in the database and which ended before `moment`: those
    /// after the session `after`, in the order of ids, at most `limit`; of the partitions
    /// `owned`, or of all.
    pub async fn sessions_to_move(
        &self,
        moment: Micros,
        after: &str,
        owned: Option<&[PartitionId]>,
        limit: u32,
    ) -> Result<Vec<SessionRow>, StoreError> {
        let mut query = QueryBuilder::new(read::SESSION);
        query.push(read::VISIBLE).push("state = 'ended' AND n_samples > 0 AND ended_at < ");
        query.bind(moment)?.push(" AND id > ").bind(after.to_owned())?;
        query.push_owned(owned)?;
        query.push(
            " AND NOT EXISTS (SELECT 1 FROM cold_file WHERE cold_file.session = session.id
                               AND moved_at IS NOT NULL)
             ORDER BY id LIMIT ",
        );
        query.bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }
}
