//! The spool: batches that wait, in an SQLite file.

use std::borrow::Cow;
use std::path::Path;

use serde::Serialize;
use sqlx::sqlite::{
    SqliteAutoVacuum, SqliteConnectOptions, SqliteJournalMode, SqliteLockingMode, SqliteSynchronous,
};
use sqlx::{ConnectOptions, Connection, Row, SqliteConnection};
use tokio::sync::{Mutex, Notify};

use super::reserve::{RESERVE_BYTES, Reserve};

/// Default of the most bytes of batches that a spool holds; further ones are refused with 429.
/// Chosen: ten hours of one rig at 100 Hz as JSON.
pub const MAX_SPOOL_BYTES: u64 = 512 << 20;

/// What a batch counts beyond its body, bytes: its row and its place in the index.
const ROW_BYTES: u64 = 256;

/// Why a spool cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SpoolError {
    /// Nothing of the batch was taken.
    #[error("the spool is full: {used} of {limit} bytes wait for the service")]
    Full { used: u64, limit: u64 },
    /// Nothing of the batch was taken.
    #[error("the disk is full: it has no room for the {RESERVE_BYTES} bytes that deletions need")]
    NoReserve,
    #[error("the spool is locked by an agent that is running")]
    Locked,
    /// Nothing was changed.
    #[error("no batch {0} is set aside")]
    NotSetAside(i64),
    #[error("the spool has the format {0} of a later version of offbd; this one knows {VERSION}")]
    Later(i64),
    #[error("the spool cannot be used: {0}")]
    File(#[from] std::io::Error),
    #[error("the spool cannot be used: {0}")]
    Sql(#[from] sqlx::Error),
}

impl SpoolError {
    fn is_of_full_disk(&self) -> bool {
        /// `SQLITE_FULL`
        const FULL: &str = "13";
        matches!(self, Self::Sql(error) if code(error).as_deref() == Some(FULL))
    }
}

/// The code of an error of SQLite.
fn code(error: &sqlx::Error) -> Option<Cow<'_, str>> {
    error.as_database_error().and_then(|error| error.code())
}

/// A batch as a device has sent it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewBatch {
    pub asset: String,
    /// The query of the request, without the question mark.
    pub query: String,
    pub media_type: String,
    pub body: Vec<u8>,
}

/// A batch that waits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct WaitingBatch {
    pub id: i64,
    pub batch: NewBatch,
}

/// How much waits.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SpoolStatus {
    /// Batches that wait for the service.
    pub waiting_batches: u64,
    /// Bytes of the spool in use, with what is set aside.
    pub used_bytes: u64,
    pub limit_bytes: u64,
    /// Bytes on the disk that are kept for deletions; 0 on a full disk, and then no batch is taken.
    pub reserve_bytes: u64,
    /// What the service has refused for good, at most 100 batches, the oldest first.
    pub refused: Vec<RefusedBatch>,
}

/// A batch that the service has refused for good, or the samples of one that it has rejected.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RefusedBatch {
    pub id: i64,
    pub asset: String,
    pub bytes: u64,
    pub reason: String,
}

/// Most batches, and most assets, that a status names.
pub(super) const MAX_NAMED: usize = 100;

/// The spool. One process at a time uses its file.
#[derive(Debug)]
pub struct Spool {
    limit_bytes: u64,
    file: Mutex<SpoolFile>,
    /// Notified when a batch has been added.
    pub(super) added: Notify,
    /// Notified when room has become free.
    pub(super) freed: Notify,
}

#[derive(Debug)]
struct SpoolFile {
    connection: SqliteConnection,
    used_bytes: u64,
    reserve: Reserve,
}

impl SpoolFile {
    /// Makes a change, if need be with the room of the reserve.
    async fn change(
        &mut self,
        change: impl AsyncFn(&mut SqliteConnection) -> Result<(), SpoolError>,
    ) -> Result<(), SpoolError> {
        let mut changed = change(&mut self.connection).await;
        if changed.as_ref().is_err_and(SpoolError::is_of_full_disk) && self.reserve.release() {
            tracing::error!("the disk is full; the agent takes nothing until it has room again");
            changed = change(&mut self.connection).await;
        }
        if changed.is_ok() && !self.reserve.is_kept() {
            // The next change overwrites the log instead of making it longer. It does not matter
            // if that fails, as the change is in the log.
            let _ = sqlx::raw_sql(CHECKPOINT).execute(&mut self.connection).await;
        }
        changed
    }

    /// Gives the pages of deleted batches back to the disk.
    async fn shrink(&mut self) -> Result<(), SpoolError> {
        let mut n_before = i64::MAX;
        loop {
            let count = sqlx::query_scalar("PRAGMA freelist_count");
            let n: i64 = count.fetch_one(&mut self.connection).await?;
            if n == 0 || n >= n_before {
                return Ok(());
            }
            n_before = n;
            sqlx::raw_sql(VACUUM).execute(&mut self.connection).await?;
            sqlx::raw_sql(CHECKPOINT).execute(&mut self.connection).await?;
        }
    }
}

/// Pages at a time, so that the log stays short.
const VACUUM: &str = "PRAGMA incremental_vacuum(256)";
const CHECKPOINT: &str = "PRAGMA wal_checkpoint(RESTART)";

/// Version of the format, `PRAGMA user_version` of the file.
const VERSION: i64 = 1;

const SCHEMA: &str = "
    PRAGMA user_version = 1;
    CREATE TABLE IF NOT EXISTS batch (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        asset TEXT NOT NULL,
        query TEXT NOT NULL,
        media_type TEXT NOT NULL,
        body BLOB NOT NULL,
        refusal TEXT
    );
    CREATE INDEX IF NOT EXISTS waiting ON batch (asset, id) WHERE refusal IS NULL;";

impl Spool {
    /// Opens the spool at `path`, or creates it. Batches of up to `limit_bytes` fit.
    ///
    /// # Errors
    /// [`SpoolError`] if the file cannot be used, another process uses it, or a later version of
    /// offbd has written it.
    pub async fn open(path: &Path, limit_bytes: u64) -> Result<Self, SpoolError> {
        super::files::prepare(path)?;
        let options = SqliteConnectOptions::new()
            .filename(path)
            .locking_mode(SqliteLockingMode::Exclusive)
            .auto_vacuum(SqliteAutoVacuum::Incremental)
            .journal_mode(SqliteJournalMode::Wal)
            // A commit is on the disk before it returns, also after a power cut.
            .synchronous(SqliteSynchronous::Full);
        let mut connection = options.connect().await.map_err(open_error)?;
        let version = sqlx::query_scalar("PRAGMA user_version").fetch_one(&mut connection);
        let version: i64 = version.await.map_err(open_error)?;
        if version > VERSION {
            return Err(SpoolError::Later(version));
        }
        sqlx::raw_sql(SCHEMA).execute(&mut connection).await.map_err(open_error)?;
        let used_bytes = used_bytes(&mut connection).await?;
        let mut reserve = Reserve::of(path);
        if let Err(error) = reserve.keep().await {
            tracing::error!(%error, "no room for the reserve; the agent takes nothing");
        }
        let file = Mutex::new(SpoolFile { connection, used_bytes, reserve });
        Ok(Self { limit_bytes, file, added: Notify::new(), freed: Notify::new() })
    }

    /// Adds a batch; it is durable when this returns.
    ///
    /// # Errors
    /// [`SpoolError`] if there is no room, or the file fails.
    pub async fn put(&self, batch: &NewBatch) -> Result<(), SpoolError> {
        let mut file = self.file.lock().await;
        let bytes = cost(&batch.body);
        if file.used_bytes + bytes > self.limit_bytes {
            return Err(SpoolError::Full { used: file.used_bytes, limit: self.limit_bytes });
        }
        if !file.reserve.is_kept() {
            return Err(SpoolError::NoReserve);
        }
        insert(&mut file.connection, batch).await?;
        file.used_bytes += bytes;
        self.added.notify_one();
        Ok(())
    }

    /// Adds a batch beyond the limit, if need be in the room of the reserve: what the agent has
    /// read when it is told to stop.
    pub(super) async fn put_last(&self, batch: &NewBatch) -> Result<(), SpoolError> {
        let mut file = self.file.lock().await;
        file.change(async |connection| insert(connection, batch).await).await?;
        file.used_bytes += cost(&batch.body);
        Ok(())
    }

    /// Returns the assets of which batches wait, in the order of their oldest batch.
    pub(super) async fn assets(&self) -> Result<Vec<String>, SpoolError> {
        // Seeks each asset in the index, instead of reading an entry for each batch.
        let select = "WITH RECURSIVE waits(asset, id) AS (
                SELECT * FROM (SELECT asset, id FROM batch
                    WHERE refusal IS NULL ORDER BY asset, id LIMIT 1)
                UNION ALL
                SELECT next.asset, next.id FROM waits JOIN batch AS next ON next.id = (
                    SELECT id FROM batch WHERE refusal IS NULL AND asset > waits.asset
                    ORDER BY asset, id LIMIT 1))
            SELECT asset FROM waits ORDER BY id";
        let mut file = self.file.lock().await;
        Ok(sqlx::query_scalar(select).fetch_all(&mut file.connection).await?)
    }

    /// Returns the oldest batch of `asset` that waits.
    pub(super) async fn oldest(&self, asset: &str) -> Result<Option<WaitingBatch>, SpoolError> {
        let select = "SELECT id, asset, query, media_type, body FROM batch \
            WHERE refusal IS NULL AND asset = $1 ORDER BY id LIMIT 1";
        let mut file = self.file.lock().await;
        let row = sqlx::query(select).bind(asset).fetch_optional(&mut file.connection).await?;
        let waiting = |row: sqlx::sqlite::SqliteRow| -> Result<_, sqlx::Error> {
            let (asset, query) = (row.try_get("asset")?, row.try_get("query")?);
            let (media_type, body) = (row.try_get("media_type")?, row.try_get("body")?);
            let batch = NewBatch { asset, query, media_type, body };
            Ok(WaitingBatch { id: row.try_get("id")?, batch })
        };
        Ok(row.map(waiting).transpose()?)
    }

    /// Removes a batch that the service has stored.
    pub(super) async fn remove(&self, stored: &WaitingBatch) -> Result<(), SpoolError> {
        let mut file = self.file.lock().await;
        file.change(async |connection| {
            let delete = sqlx::query("DELETE FROM batch WHERE id = $1").bind(stored.id);
            delete.execute(connection).await?;
            Ok(())
        })
        .await?;
        file.used_bytes = file.used_bytes.saturating_sub(cost(&stored.batch.body));
        drop(file);
        self.freed.notify_waiters();
        Ok(())
    }

    /// Sets a batch aside that the service has refused for good: all of it, or those of its
    /// samples that the service does not have.
    pub(super) async fn set_aside(
        &self,
        refused: &WaitingBatch,
        kept: &NewBatch,
        reason: &str,
    ) -> Result<(), SpoolError> {
        let update = "UPDATE batch SET query = $1, media_type = $2, body = $3, refusal = $4 \
            WHERE id = $5";
        let mut file = self.file.lock().await;
        file.change(async |connection| {
            sqlx::query(update)
                .bind(&kept.query)
                .bind(&kept.media_type)
                .bind(&kept.body)
                .bind(reason)
                .bind(refused.id)
                .execute(connection)
                .await?;
            Ok(())
        })
        .await?;
        file.used_bytes += cost(&kept.body);
        file.used_bytes = file.used_bytes.saturating_sub(cost(&refused.batch.body));
        drop(file);
        self.freed.notify_waiters();
        Ok(())
    }

    /// Returns all that is set aside, the oldest first.
    ///
    /// # Errors
    /// [`SpoolError::Sql`] if the file fails.
    pub async fn refused(&self) -> Result<Vec<RefusedBatch>, SpoolError> {
        refused(&mut self.file.lock().await.connection, usize::MAX).await
    }

    /// Lets batches that are set aside wait for the service again.
    ///
    /// # Errors
    /// [`SpoolError`] if one of them is not set aside, or the file fails. Nothing is changed then.
    pub async fn send_again(&self, ids: &[i64]) -> Result<(), SpoolError> {
        self.change(ids, "UPDATE batch SET refusal = NULL WHERE id = $1 AND refusal IS NOT NULL")
            .await?;
        self.added.notify_one();
        Ok(())
    }

    /// Deletes batches that are set aside.
    ///
    /// # Errors
    /// As [`Self::send_again`].
    pub async fn delete(&self, ids: &[i64]) -> Result<(), SpoolError> {
        self.change(ids, "DELETE FROM batch WHERE id = $1 AND refusal IS NOT NULL").await
    }

    /// Makes a change to each of the batches, or to none.
    async fn change(&self, ids: &[i64], change: &'static str) -> Result<(), SpoolError> {
        let mut file = self.file.lock().await;
        file.change(async |connection| {
            let mut changes = connection.begin().await?;
            for id in ids {
                let changed = sqlx::query(change).bind(id).execute(&mut *changes).await?;
                if changed.rows_affected() == 0 {
                    return Err(SpoolError::NotSetAside(*id));
                }
            }
            Ok(changes.commit().await?)
        })
        .await?;
        file.used_bytes = used_bytes(&mut file.connection).await?;
        drop(file);
        self.freed.notify_waiters();
        Ok(())
    }

    /// Makes the reserve again once a full disk has room, or can be given it. Tries at most every
    /// [`LONGEST_DELAY`](super::delays::LONGEST_DELAY), and when nothing waits.
    pub(super) async fn regain_reserve(&self, is_empty: bool) {
        let mut file = self.file.lock().await;
        if file.reserve.is_kept() || !(is_empty || file.reserve.is_due()) {
            return;
        }
        // What is not given back now is given back at the next attempt.
        let _ = file.shrink().await;
        if file.reserve.keep().await.is_ok() {
            tracing::info!("the disk has room again");
            drop(file);
            self.freed.notify_waiters();
        }
    }

    /// Returns how much waits.
    ///
    /// # Errors
    /// [`SpoolError::Sql`] if the file fails.
    pub async fn status(&self) -> Result<SpoolStatus, SpoolError> {
        let mut file = self.file.lock().await;
        let count = sqlx::query_scalar("SELECT COUNT(*) FROM batch WHERE refusal IS NULL");
        let waiting: i64 = count.fetch_one(&mut file.connection).await?;
        let refused = refused(&mut file.connection, MAX_NAMED).await?;
        Ok(SpoolStatus {
            waiting_batches: waiting.unsigned_abs(),
            used_bytes: file.used_bytes,
            limit_bytes: self.limit_bytes,
            reserve_bytes: if file.reserve.is_kept() { RESERVE_BYTES } else { 0 },
            refused,
        })
    }
}

async fn insert(connection: &mut SqliteConnection, batch: &NewBatch) -> Result<(), SpoolError> {
    let insert = "INSERT INTO batch (asset, query, media_type, body) VALUES ($1, $2, $3, $4)";
    let insert = sqlx::query(insert).bind(&batch.asset).bind(&batch.query);
    insert.bind(&batch.media_type).bind(&batch.body).execute(connection).await?;
    Ok(())
}

/// Returns what is set aside, up to `limit` batches, the oldest first.
async fn refused(
    connection: &mut SqliteConnection,
    limit: usize,
) -> Result<Vec<RefusedBatch>, SpoolError> {
    let select = "SELECT id, asset, LENGTH(body), refusal FROM batch \
        WHERE refusal IS NOT NULL ORDER BY id LIMIT $1";
    let select = sqlx::query_as(select).bind(i64::try_from(limit).unwrap_or(i64::MAX));
    let rows: Vec<(i64, String, i64, String)> = select.fetch_all(connection).await?;
    let batches = rows.into_iter().map(|(id, asset, bytes, reason)| {
        let bytes = bytes.unsigned_abs();
        RefusedBatch { id, asset, bytes, reason }
    });
    Ok(batches.collect())
}

/// The bytes of all batches.
async fn used_bytes(connection: &mut SqliteConnection) -> Result<u64, SpoolError> {
    let sum = "SELECT COALESCE(SUM(LENGTH(body)), 0), COUNT(*) FROM batch";
    let (bytes, n): (i64, i64) = sqlx::query_as(sum).fetch_one(connection).await?;
    Ok(bytes.unsigned_abs() + n.unsigned_abs() * ROW_BYTES)
}

/// Returns [`SpoolError::Locked`] if another process uses the file (`SQLITE_BUSY`).
fn open_error(error: sqlx::Error) -> SpoolError {
    /// `SQLITE_BUSY`
    const BUSY: &str = "5";
    if code(&error).as_deref() == Some(BUSY) { SpoolError::Locked } else { error.into() }
}

/// What a batch counts against the limit, bytes.
fn cost(body: &[u8]) -> u64 {
    body.len() as u64 + ROW_BYTES
}
