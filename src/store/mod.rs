//! What outlives the process: assets, sessions, telemetry, faults.
//!
//! Many readers, one [`Writer`]: everything that changes goes through it in
//! groups, one transaction each, and is durable when [`Writer::commit`]
//! returns. Documents are JSON text that the store does not read. Knows SQL
//! and the chunk format; knows no status codes, no engine and no clock.

mod access;
pub mod codec;
mod read;
mod rows;
mod tail;
mod write;

use std::path::{Path, PathBuf};
use std::time::Duration;

use sqlx::migrate::Migrator;
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};

pub use access::{AccessWrite, AuditRow, LAST_ID, MAX_LOGINS, TokenRow};
pub use read::{FaultFilter, FaultOrder, SessionFilter};
pub use rows::{
    ActionKind, ActionRow, AssetRow, CalibrationRow, EventRow, FaultRow, JobState, Micros,
    Progress, ReplayRow, SessionRow, TransitionRow, TrendEntry, TrendRow, WarningRow,
};
pub use tail::{FULL_CHUNK_SAMPLES, MAX_TAIL_CHUNKS};
pub use write::{Write, Writer};

static MIGRATIONS: Migrator = sqlx::migrate!("./migrations");

/// Connections for reading; more readers wait for one.
const MAX_READERS: u32 = 4;

/// How long a reader waits for a connection before it fails.
const READER_WAIT: Duration = Duration::from_secs(10);

/// How long SQLite waits for another process's lock before it fails.
const LOCK_WAIT: Duration = Duration::from_secs(5);

/// Why the store could not do it.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    #[error("the database: {0}")]
    Database(#[from] sqlx::Error),
    #[error("the migrations: {0}")]
    Migration(#[from] sqlx::migrate::MigrateError),
    #[error("chunk {first_index} of session {session}: {source}")]
    Chunk { session: String, first_index: i64, source: codec::CodecError },
    #[error("{column} holds `{found}`, which this version does not know")]
    Word { column: &'static str, found: String },
}

impl StoreError {
    /// Whether a row already there, or one missing, stands against the change.
    #[must_use]
    pub fn is_conflict(&self) -> bool {
        let Self::Database(sqlx::Error::Database(error)) = self else { return false };
        error.is_unique_violation() || error.is_foreign_key_violation()
    }
}

/// The readers' side of the store; cheap to clone.
#[derive(Clone, Debug)]
pub struct Store {
    pool: SqlitePool,
    path: PathBuf,
}

impl Store {
    /// Opens the database file at `path`, made and migrated as needed.
    ///
    /// # Errors
    /// [`StoreError`] if the file cannot be opened or is not ours.
    pub async fn open(path: &Path) -> Result<(Self, Writer), StoreError> {
        let writer = Writer::open(path).await?;
        let pool = SqlitePoolOptions::new()
            .max_connections(MAX_READERS)
            .acquire_timeout(READER_WAIT)
            .connect_with(options(path).pragma("query_only", "on"))
            .await?;
        Ok((Self { pool, path: path.to_owned() }, writer))
    }

    /// Brings the database file at `path` to this version's schema; returns
    /// how many migrations it has.
    ///
    /// # Errors
    /// [`StoreError`] if the file cannot be opened or is newer than this version.
    pub async fn migrate(path: &Path) -> Result<usize, StoreError> {
        Writer::open(path).await?.close().await?;
        Ok(MIGRATIONS.iter().count())
    }

    /// The database file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the database answers.
    ///
    /// # Errors
    /// [`StoreError`] if it does not.
    pub async fn ping(&self) -> Result<(), StoreError> {
        sqlx::query("SELECT 1").execute(&self.pool).await?;
        Ok(())
    }

    /// Closes the readers' connections.
    pub async fn close(&self) {
        self.pool.close().await;
    }
}

/// WAL with `synchronous=FULL`: a commit is on the disk when it returns.
fn options(path: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .busy_timeout(LOCK_WAIT)
}
