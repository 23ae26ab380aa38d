//! The store: assets, sessions, telemetry and faults in a database of SQLite or
//! PostgreSQL.
//!
//! Many connections read, one [`Writer`] writes. It applies changes in groups, one
//! transaction per group (group commit), and a change is durable when [`Writer::commit`]
//! returns. The store has SQL and the chunk format; it does not interpret the JSON
//! documents in its rows, and it knows neither engines nor HTTP status codes nor a clock.
//!
//! A recording, the samples of one session, is stored in two steps, because many sessions
//! receive a few samples each at the same time:
//!
//! 1. A commit appends one row for all its sessions to the *journal* (`journal.rs`). This
//!    costs a few pages however many sessions there are, and makes the samples durable.
//! 2. Later the writer *folds* the journal (`write/fold.rs`): it moves the samples of a
//!    session into *chunks* (`codec.rs`), rows that hold up to 8192 samples of one
//!    session, and removes them from the journal in the same transaction. Small chunks at
//!    the end of a session, its *tail* (`tail.rs`), are merged into larger ones.
//!
//! So every sample is in the journal or in a chunk, never in both or in neither, and
//! readers combine the two. With SQLite, a second connection copies the write-ahead log into
//! the database file while commits go on (`checkpoint.rs`).

mod access;
mod alarm;
mod asset_record;
mod backup;
mod check;
mod checkpoint;
pub mod codec;
mod condition;
mod execute;
mod expiry;
mod file;
mod fleet;
mod from_row;
mod journal;
mod location;
mod log_damage;
mod migrations;
mod multi_row;
mod notification;
mod notifications;
mod page_checksums;
mod partition;
mod present;
mod progress;
mod query_builder;
mod read;
mod recording;
mod remark;
mod rows;
mod session_inputs;
mod snapshot;
mod tag;
mod tail;
mod write;
mod writer_lock;

use std::path::PathBuf;
use std::time::Duration;

use migrations::MIGRATIONS;
use offbd_core::vocabulary::Sample;
use sqlx::AnyPool;
use sqlx::migrate::MigrateError;
use sqlx::postgres::{PgDatabaseError, PgSeverity};

pub use access::{AccessWrite, AuditRow, LAST_ID, MAX_LOGINS, TokenRow};
pub use alarm::{AlarmWrite, CommunicationChange, CommunicationRow, MuteRow, NoteRow, OpenLink};
pub use asset_record::{AssetRecord, EndedSessionRow, MAX_ASSETS_AT_ONCE, MAX_ENDED_SESSIONS};
pub use backup::{back_up, restore};
pub use check::{CheckReport, check};
pub use condition::{ConditionalWrite, EditWrite, Expectation, Refusal};
pub use expiry::SessionSize;
pub use file::private_file;
pub use location::Location;
pub use notification::{
    ChannelRow, DeliveryRow, NotificationWrite, PlannedEventRow, ReminderRow, RuleRow,
};
pub use notifications::{Notification, Notifications};
pub use page_checksums::install_drivers;
pub use partition::{
    EVENTS, MAX_PARTITIONS, NodeIdentity, NodeRow, PartitionId, PartitionRow, Partitions,
    TRANSFERS, subject_token,
};
pub use present::PresentFaultRow;
pub use read::{AssetFilter, FaultFilter, FaultOrder, SessionFilter};
pub use recording::RecordingReader;
pub use remark::{RemarkRow, RemarkWrite};
pub use rows::{
    ActionKind, ActionRow, AssetRow, CalibrationRow, EventRow, FaultRow, Micros, ReplayRow,
    SessionEnd, SessionProgress, SessionRow, TransitionRow, TrendEntry, TrendRow, WarningRow,
};
pub use session_inputs::SessionInputs;
pub use snapshot::Snapshot;
pub use tag::TagsByAsset;
pub use tail::{FULL_CHUNK_SAMPLES, MAX_TAIL_CHUNKS};
pub use write::{ChangeSet, Write, Writer};
#[cfg(feature = "commit-faults")]
pub use write::{CommitFault, CommitPoint, FaultPlan};

/// Longest time for the database to answer a ping.
const PING_TIMEOUT: Duration = Duration::from_secs(2);

/// An error of the store.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    #[error("database: {0}")]
    Database(#[source] sqlx::Error),
    #[error("database migration: {0}")]
    Migration(#[source] MigrateError),
    /// The database has read something that it has not written.
    #[error("a part of the database is damaged or was not readable; `offbd check` names it ({0})")]
    DamagedPage(#[source] sqlx::Error),
    #[error("the header of the database file is damaged: its pages had checksums")]
    DamagedHeader,
    /// The write-ahead log of an SQLite file; `n_bytes` of it precede the damage.
    #[error(
        "{part} of the write-ahead log {} is damaged, and the commits behind it cannot be read: \
         restore a backup, or stop the service and continue without them, after \
         `truncate --size {n_bytes} {}`",
        log.display(),
        log.display()
    )]
    DamagedLog { part: String, log: PathBuf, n_bytes: u64 },
    #[error("chunk {first_index} of session {session}: {source}")]
    Chunk { session: String, first_index: i64, source: codec::CodecError },
    #[error("session {session} is damaged: sample {found} of {expected} is missing")]
    Incomplete { session: String, found: i64, expected: i64 },
    #[error("session {session} has been deleted")]
    Deleted { session: String },
    #[error("the snapshot of session {session} after {n_samples} samples is damaged")]
    Snapshot { session: String, n_samples: i64 },
    #[error("journal row {id}: {reason}")]
    Journal { id: i64, reason: String },
    #[error("{column} has the value `{found}`, which is unknown to this version")]
    UnknownValue { column: &'static str, found: String },
    #[error("another process uses this database")]
    InUse,
    /// Another process has written to the database, or it was replaced by an older copy.
    #[error(
        "the database is not as it was left: {found} commits instead of {expected}; \
         restart the service to continue with the present contents"
    )]
    UnexpectedCommits { expected: i64, found: i64 },
    #[error(
        "another node of the cluster has the name `{name}`: each node needs its own \
         `cluster.name`"
    )]
    NameInUse { name: String },
    /// The database does not list this node any more; it registers when it connects again.
    #[error("the database has forgotten this node of the cluster, which registers again")]
    Forgotten,
    /// Other nodes of the cluster have taken these partitions. Nothing was changed.
    #[error("{} partitions now belong to other nodes", partitions.len())]
    Overtaken { partitions: Vec<PartitionId> },
    #[error(
        "the database is divided into {found} partitions, and `cluster.partitions` is {expected}: \
         the number is fixed by the first start as a cluster"
    )]
    PartitionCount { found: u32, expected: u32 },
    #[error("a PostgreSQL database is backed up with pg_dump and restored with pg_restore")]
    NotSqlite,
    #[error("{} already exists", file.display())]
    Exists { file: PathBuf },
    #[error("{}: {source}", file.display())]
    File { file: PathBuf, source: std::io::Error },
    #[error("cannot write the names of the files in {} to the disk: {source}", directory.display())]
    Directory { directory: PathBuf, source: std::io::Error },
    #[error("{} was removed or replaced while the service was running; restart the service", file.display())]
    FileGone { file: PathBuf },
    #[error("the copy is damaged: {found}")]
    Damaged { found: String },
    #[error(
        "the database has schema {found}, and this version has {expected}: {}",
        if found > expected {
            "use a newer version of offbd"
        } else {
            "start the service or run `offbd migrate` first"
        }
    )]
    Schema { found: i64, expected: i64 },
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        if page_checksums::is_damage(&error) {
            return Self::DamagedPage(error);
        }
        Self::Database(error)
    }
}

impl From<MigrateError> for StoreError {
    fn from(error: MigrateError) -> Self {
        match error {
            MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _)
                if page_checksums::is_damage(&error) =>
            {
                Self::DamagedPage(error)
            }
            error => Self::Migration(error),
        }
    }
}

impl StoreError {
    /// Returns whether a part of the database is damaged or was not readable. As long as it
    /// is, the same statement fails again, and those that do not need this part succeed.
    #[must_use]
    pub const fn is_damage(&self) -> bool {
        matches!(self, Self::DamagedPage(_) | Self::DamagedHeader | Self::DamagedLog { .. })
    }

    /// Returns whether the change violates a unique or foreign key constraint: a row exists
    /// already, or a row that it refers to is missing.
    #[must_use]
    pub fn is_conflict(&self) -> bool {
        let Self::Database(sqlx::Error::Database(error)) = self else { return false };
        error.is_unique_violation() || error.is_foreign_key_violation()
    }

    /// Returns whether the disk of the database is full (PostgreSQL's `disk_full`, SQLite's 13).
    /// A smaller change may still find room.
    #[must_use]
    pub fn is_full(&self) -> bool {
        let Self::Database(sqlx::Error::Database(error)) = self else { return false };
        error.code().is_some_and(|code| code == "53100" || code == "13")
    }

    /// Returns whether PostgreSQL has answered a statement with it and another connection would not
    /// help: the change is invalid, or the disk is full. Nothing of the transaction is committed,
    /// and the connection and its locks remain.
    #[must_use]
    pub fn leaves_connection(&self) -> bool {
        let Self::Database(sqlx::Error::Database(error)) = self else { return false };
        let of_server = error.try_downcast_ref::<PgDatabaseError>();
        of_server.is_some_and(|error| error.severity() == PgSeverity::Error)
            && (self.is_full() || !self.is_outage())
    }

    /// Returns whether another process is in the place of this one, or the database in the place
    /// of another one: what this node of a cluster owned is not its own any more.
    #[must_use]
    pub const fn is_replaced(&self) -> bool {
        matches!(self, Self::UnexpectedCommits { .. } | Self::NameInUse { .. })
    }

    /// Returns whether the database has the schema of a newer version of offbd.
    #[must_use]
    pub const fn is_newer(&self) -> bool {
        matches!(self, Self::Schema { found, expected } if *found > *expected)
    }

    /// The error of a query that takes too long.
    #[must_use]
    pub fn too_slow() -> Self {
        sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()).into()
    }

    fn journal(id: i64, error: &dyn std::fmt::Display) -> Self {
        Self::Journal { id, reason: error.to_string() }
    }

    /// Returns whether the same change may succeed later, because the database is
    /// unavailable, locked or full. Otherwise the change itself is invalid.
    #[must_use]
    pub fn is_outage(&self) -> bool {
        match self {
            Self::Database(sqlx::Error::Database(error)) => {
                error.code().is_none_or(|code| !is_invalid_change(&code))
            }
            Self::Database(error) => !matches!(
                error,
                sqlx::Error::Encode(_) | sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_)
            ),
            Self::InUse
            | Self::NameInUse { .. }
            | Self::Forgotten
            | Self::UnexpectedCommits { .. }
            | Self::FileGone { .. }
            | Self::Directory { .. } => true,
            Self::Migration(_)
            | Self::DamagedPage(_)
            | Self::DamagedHeader
            | Self::DamagedLog { .. }
            | Self::Overtaken { .. }
            | Self::PartitionCount { .. }
            | Self::Chunk { .. }
            | Self::Incomplete { .. }
            | Self::Snapshot { .. }
            | Self::Deleted { .. }
            | Self::Journal { .. }
            | Self::UnknownValue { .. }
            | Self::NotSqlite
            | Self::Exists { .. }
            | Self::File { .. }
            | Self::Damaged { .. }
            | Self::Schema { .. } => false,
        }
    }
}

/// Returns whether a database's error code means that the change itself is invalid. For
/// PostgreSQL, with codes of five characters: the classes 22 (data), 23 (constraints) and
/// 42 (SQL). For SQLite, whose primary code is the low byte: 1 (SQL), 18 (too big),
/// 19 (constraints), 20 (type) and 25 (range).
fn is_invalid_change(code: &str) -> bool {
    if code.len() == 5 {
        return ["22", "23", "42"].iter().any(|class| code.starts_with(class));
    }
    code.parse::<i32>().is_ok_and(|code| [1, 18, 19, 20, 25].contains(&(code & 0xff)))
}

fn decode_chunk(bytes: &[u8], key: codec::ChunkKey<'_>) -> Result<Vec<Sample>, StoreError> {
    codec::decode(bytes, key).map_err(|source| {
        let codec::ChunkKey { session, first_index } = key;
        StoreError::Chunk { session: session.to_owned(), first_index, source }
    })
}

/// The store for reading. Clones share the connections.
#[derive(Clone, Debug)]
pub struct Store {
    pool: AnyPool,
    location: Location,
    journal: journal::Journal,
}

impl Store {
    /// Opens the database at `location` and brings its schema to this version. A missing
    /// SQLite file is created.
    ///
    /// # Errors
    /// [`StoreError`] if the database cannot be opened, has other migrations than this
    /// version, or (PostgreSQL) another process holds the writer's lock.
    pub async fn open(location: &Location) -> Result<(Self, Writer), StoreError> {
        Self::with(location, Writer::open(location).await?)
    }

    /// Opens the PostgreSQL database at `location` for a node of a cluster, which owns no
    /// partition yet. The first node brings the schema to this version and divides the assets
    /// into `partitions`.
    ///
    /// # Errors
    /// As for [`Store::open`]; also if the database has another number of partitions, or a
    /// process uses it that is not a node.
    pub async fn open_node(
        location: &Location,
        node: NodeIdentity,
        partitions: Partitions,
    ) -> Result<(Self, Writer), StoreError> {
        Self::with(location, Writer::open_node(location, node, partitions).await?)
    }

    /// Opens the database at `location` with an auxiliary writer, while a service may be
    /// running on it. This writer must not write anything that causes an event or that an
    /// engine depends on, because the service would not notice.
    ///
    /// # Errors
    /// As for [`Store::open`].
    pub async fn open_auxiliary(location: &Location) -> Result<(Self, Writer), StoreError> {
        Self::with(location, Writer::open_auxiliary(location).await?)
    }

    fn with(location: &Location, writer: Writer) -> Result<(Self, Writer), StoreError> {
        let (pool, location, journal) = (location.readers()?, location.clone(), writer.journal());
        Ok((Self { pool, location, journal }, writer))
    }

    /// Brings the database at `location` to this version's schema. Returns the number of
    /// migrations that it has.
    ///
    /// # Errors
    /// As for [`Store::open`]; also if the schema is newer than this version.
    pub async fn migrate(location: &Location) -> Result<usize, StoreError> {
        Writer::open(location).await?.close().await?;
        Ok(MIGRATIONS.iter().count())
    }

    /// The location of the database.
    #[must_use]
    pub const fn location(&self) -> &Location {
        &self.location
    }

    /// Checks that the database answers.
    ///
    /// # Errors
    /// [`StoreError`] if it does not answer, or not within 2 s.
    pub async fn ping(&self) -> Result<(), StoreError> {
        let ping = sqlx::query("SELECT 1").execute(&self.pool);
        let late = |_| sqlx::Error::Io(std::io::ErrorKind::TimedOut.into());
        tokio::time::timeout(PING_TIMEOUT, ping).await.map_err(late)??;
        Ok(())
    }

    /// Closes the connections for reading.
    pub async fn close(&self) {
        self.pool.close().await;
    }
}
