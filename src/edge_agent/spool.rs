//! The spool: batches that wait, in an SQLite file.

use std::path::Path;

use serde::Serialize;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteLockingMode, SqliteSynchronous};
use sqlx::{ConnectOptions, Row, SqliteConnection};
use tokio::sync::{Mutex, Notify};

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
    #[error("the spool cannot be used: {0}")]
    Sql(#[from] sqlx::Error),
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
    /// Bytes of the spool in use, refused batches included.
    pub used_bytes: u64,
    pub limit_bytes: u64,
    /// Batches that the service has refused for good.
    pub refused: Vec<RefusedBatch>,
}

/// A batch that the service has refused for good.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RefusedBatch {
    pub id: i64,
    pub asset: String,
    pub reason: String,
}

/// Most refused batches that a status names, the oldest first.
const MAX_NAMED_REFUSALS: i64 = 100;

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
}

const SCHEMA: &str = "
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
    /// [`SpoolError::Sql`] if the file cannot be used, or another process uses it.
    pub async fn open(path: &Path, limit_bytes: u64) -> Result<Self, SpoolError> {
        let options = SqliteConnectOptions::new()
            .filename(path)
            .create_if_missing(true)
            .locking_mode(SqliteLockingMode::Exclusive)
            .journal_mode(SqliteJournalMode::Wal)
            // A commit is on the disk before it returns, also after a power cut.
            .synchronous(SqliteSynchronous::Full);
        let mut connection = options.connect().await?;
        sqlx::raw_sql(SCHEMA).execute(&mut connection).await?;
        let sum = "SELECT COALESCE(SUM(LENGTH(body)), 0), COUNT(*) FROM batch";
        let (bytes, n): (i64, i64) = sqlx::query_as(sum).fetch_one(&mut connection).await?;
        let used_bytes = bytes.unsigned_abs() + n.unsigned_abs() * ROW_BYTES;
        let file = Mutex::new(SpoolFile { connection, used_bytes });
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
        let insert = "INSERT INTO batch (asset, query, media_type, body) VALUES ($1, $2, $3, $4)";
        sqlx::query(insert)
            .bind(&batch.asset)
            .bind(&batch.query)
            .bind(&batch.media_type)
            .bind(&batch.body)
            .execute(&mut file.connection)
            .await?;
        file.used_bytes += bytes;
        self.added.notify_one();
        Ok(())
    }

    /// Returns the assets of which batches wait, in the order of their oldest batch.
    pub(super) async fn assets(&self) -> Result<Vec<String>, SpoolError> {
        let select =
            "SELECT asset FROM batch WHERE refusal IS NULL GROUP BY asset ORDER BY MIN(id)";
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
        let delete = sqlx::query("DELETE FROM batch WHERE id = $1").bind(stored.id);
        delete.execute(&mut file.connection).await?;
        file.used_bytes = file.used_bytes.saturating_sub(cost(&stored.batch.body));
        drop(file);
        self.freed.notify_waiters();
        Ok(())
    }

    /// Sets a batch aside that the service has refused for good.
    pub(super) async fn set_aside(&self, id: i64, reason: &str) -> Result<(), SpoolError> {
        let update = "UPDATE batch SET refusal = $1 WHERE id = $2";
        let mut file = self.file.lock().await;
        sqlx::query(update).bind(reason).bind(id).execute(&mut file.connection).await?;
        Ok(())
    }

    /// Returns how much waits.
    ///
    /// # Errors
    /// [`SpoolError::Sql`] if the file fails.
    pub async fn status(&self) -> Result<SpoolStatus, SpoolError> {
        let mut file = self.file.lock().await;
        let count = sqlx::query_scalar("SELECT COUNT(*) FROM batch WHERE refusal IS NULL");
        let waiting: i64 = count.fetch_one(&mut file.connection).await?;
        let select = "SELECT id, asset, refusal FROM batch WHERE refusal IS NOT NULL \
            ORDER BY id LIMIT $1";
        let select = sqlx::query_as(select).bind(MAX_NAMED_REFUSALS);
        let refused: Vec<(i64, String, String)> = select.fetch_all(&mut file.connection).await?;
        let refused = refused.into_iter();
        Ok(SpoolStatus {
            waiting_batches: waiting.unsigned_abs(),
            used_bytes: file.used_bytes,
            limit_bytes: self.limit_bytes,
            refused: refused
                .map(|(id, asset, reason)| RefusedBatch { id, asset, reason })
                .collect(),
        })
    }
}

/// What a batch counts against the limit, bytes.
fn cost(body: &[u8]) -> u64 {
    body.len() as u64 + ROW_BYTES
}
