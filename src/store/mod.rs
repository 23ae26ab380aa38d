//! What outlives the process: assets, sessions, telemetry, faults.
//!
//! Many readers, one [`Writer`]: everything that changes goes through it in
//! groups, one transaction each, and is durable when [`Writer::commit`]
//! returns. Documents are JSON text that the store does not read. Knows SQL
//! and the chunk format; knows no status codes, no engine and no clock.

mod access;
mod backup;
mod checkpoint;
pub mod codec;
mod expiry;
mod fleet;
mod from_row;
mod journal;
mod migrations;
mod place;
mod question;
mod read;
mod rows;
mod rows_at_once;
mod tail;
mod write;

use std::path::PathBuf;
use std::time::Duration;

use migrations::MIGRATIONS;
use sqlx::AnyPool;

pub use access::{AccessWrite, AuditRow, LAST_ID, MAX_LOGINS, TokenRow};
pub use backup::{back_up, restore};
pub use expiry::Bulk;
pub use place::Place;
pub use read::{FaultFilter, FaultOrder, SessionFilter};
pub use rows::{
    ActionKind, ActionRow, AssetRow, CalibrationRow, EventRow, FaultRow, JobState, Micros,
    Progress, ReplayRow, SessionRow, TransitionRow, TrendEntry, TrendRow, WarningRow,
};
pub use tail::{FULL_CHUNK_SAMPLES, MAX_TAIL_CHUNKS};
pub use write::{Write, Writer};

/// How long the database may take to say that it is there.
const PING_WAIT: Duration = Duration::from_secs(2);

/// Why the store could not do it.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    #[error("the database: {0}")]
    Database(#[from] sqlx::Error),
    #[error("the migrations: {0}")]
    Migration(#[from] sqlx::migrate::MigrateError),
    #[error("chunk {first_index} of session {session}: {source}")]
    Chunk { session: String, first_index: i64, source: codec::CodecError },
    #[error("row {id} of the journal: {reason}")]
    Journal { id: i64, reason: String },
    #[error("{column} holds `{found}`, which this version does not know")]
    Word { column: &'static str, found: String },
    #[error("another process uses this database")]
    Taken,
    /// Another process has written, or the database is an older copy of itself.
    #[error(
        "the database is not as it was left: {found} commits instead of {expected}; \
         restart to go on with what it holds"
    )]
    Overtaken { expected: i64, found: i64 },
    #[error("PostgreSQL is backed up and restored by its own pg_dump and pg_restore")]
    OwnTools,
    #[error("{} is there already", file.display())]
    Exists { file: PathBuf },
    #[error("{}: {source}", file.display())]
    File { file: PathBuf, source: std::io::Error },
    #[error("the copy is damaged: {found}")]
    Damaged { found: String },
}

impl StoreError {
    /// Whether a row already there, or one missing, stands against the change.
    #[must_use]
    pub fn is_conflict(&self) -> bool {
        let Self::Database(sqlx::Error::Database(error)) = self else { return false };
        error.is_unique_violation() || error.is_foreign_key_violation()
    }

    fn journal(id: i64, error: &dyn std::fmt::Display) -> Self {
        Self::Journal { id, reason: error.to_string() }
    }

    /// Whether the same change may go through later: the database is away,
    /// locked or full. Otherwise the change itself cannot be.
    #[must_use]
    pub fn is_outage(&self) -> bool {
        match self {
            Self::Database(sqlx::Error::Database(error)) => {
                error.code().is_none_or(|code| !is_of_the_change(&code))
            }
            Self::Database(error) => !matches!(
                error,
                sqlx::Error::Encode(_) | sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_)
            ),
            Self::Taken | Self::Overtaken { .. } => true,
            Self::Migration(_)
            | Self::Chunk { .. }
            | Self::Journal { .. }
            | Self::Word { .. }
            | Self::OwnTools
            | Self::Exists { .. }
            | Self::File { .. }
            | Self::Damaged { .. } => false,
        }
    }
}

/// Whether an error's code means that the change cannot be. Of PostgreSQL the
/// classes 22 (data), 23 (constraints) and 42 (SQL), in five characters; of
/// SQLite, whose low byte is the primary code, 1 (SQL), 18 (too big),
/// 19 (constraints), 20 (type) and 25 (range).
fn is_of_the_change(code: &str) -> bool {
    if code.len() == 5 {
        return ["22", "23", "42"].iter().any(|class| code.starts_with(class));
    }
    code.parse::<i32>().is_ok_and(|code| [1, 18, 19, 20, 25].contains(&(code & 0xff)))
}

/// The readers' side of the store; cheap to clone.
#[derive(Clone, Debug)]
pub struct Store {
    pool: AnyPool,
    place: Place,
    journal: journal::Journal,
}

impl Store {
    /// Opens the database at `place`, migrated as needed; a file is made if it
    /// is not there.
    ///
    /// # Errors
    /// [`StoreError`] if it cannot be opened, is not ours, or another process
    /// writes to it.
    pub async fn open(place: &Place) -> Result<(Self, Writer), StoreError> {
        Self::open_as(place, false).await
    }

    /// Opens the database at `place` beside a service that may be running on
    /// it. This writer must write nothing that an event or an engine follows
    /// from: the service would not know of it.
    ///
    /// # Errors
    /// As for [`Store::open`].
    pub async fn open_beside(place: &Place) -> Result<(Self, Writer), StoreError> {
        Self::open_as(place, true).await
    }

    async fn open_as(place: &Place, guest: bool) -> Result<(Self, Writer), StoreError> {
        let writer = Writer::open(place, guest).await?;
        let (pool, place, journal) = (place.readers()?, place.clone(), writer.journal());
        Ok((Self { pool, place, journal }, writer))
    }

    /// Brings the database at `place` to this version's schema; returns how
    /// many migrations it has.
    ///
    /// # Errors
    /// As for [`Store::open`], or if it is newer than this version.
    pub async fn migrate(place: &Place) -> Result<usize, StoreError> {
        Writer::open(place, false).await?.close().await?;
        Ok(MIGRATIONS.iter().count())
    }

    /// Where the database is.
    #[must_use]
    pub const fn place(&self) -> &Place {
        &self.place
    }

    /// Whether the database answers.
    ///
    /// # Errors
    /// [`StoreError`] if it does not, or not soon.
    pub async fn ping(&self) -> Result<(), StoreError> {
        let ping = sqlx::query("SELECT 1").execute(&self.pool);
        let late = |_| sqlx::Error::Io(std::io::ErrorKind::TimedOut.into());
        tokio::time::timeout(PING_WAIT, ping).await.map_err(late)??;
        Ok(())
    }

    /// Closes the readers' connections.
    pub async fn close(&self) {
        self.pool.close().await;
    }
}
