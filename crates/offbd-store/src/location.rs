//! The location of the database, an SQLite file or a PostgreSQL server, and connections
//! to it.
//!
//! Statements are the same for both, through sqlx's `Any`. What differs is here, in
//! `checkpoint.rs` and `backup.rs` (SQLite only), and in the error codes of `lib.rs`.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use sqlx::any::{AnyConnectOptions, AnyPoolOptions};
use sqlx::postgres::PgConnectOptions;
use sqlx::{AnyConnection, AnyPool, AssertSqlSafe, ConnectOptions, Connection, Executor};

use super::StoreError;
use super::checkpoint::{self, AUTOCHECKPOINT_PAGES};
use super::file::{file_url, sync_directory_of};
use super::log_damage::check_log;
use super::page_checksums::{self, install_drivers};
use super::writer_lock::{self, Backend, LockMode, WriterRole};

/// Connections for reading; a reader without one waits.
const MAX_READERS: u32 = 4;

/// Page cache of a connection to a file, KiB. That of the main writer has room for the
/// pages of a large group, because pages that do not fit are written twice; readers
/// rarely need a page again.
const MAIN_CACHE_KIB: u32 = 8192;
const CACHE_KIB: u32 = 512;

/// How long a reader waits for a free connection before it fails.
const READER_TIMEOUT: Duration = Duration::from_secs(10);

/// Longest wait for the answer of a connection for reading that is no longer used; then it is
/// closed. One whose read was given up may never answer, and sqlx would wait for it.
const RELEASE_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest time to establish a connection.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// The location of a database.
#[derive(Clone, PartialEq, Eq)]
pub enum Location {
    /// An SQLite file.
    File(PathBuf),
    /// The URL of a PostgreSQL database, the password included.
    Server(String),
}

impl Location {
    /// Parses a URL `sqlite:FILE` or `postgres://…`.
    ///
    /// # Errors
    /// The reason why it is invalid, without the URL, which may contain a password.
    pub fn of_url(url: &str) -> Result<Self, String> {
        if let Some(file) = url.strip_prefix("sqlite://").or_else(|| url.strip_prefix("sqlite:")) {
            let named = !file.is_empty();
            return named.then(|| Self::File(file.into())).ok_or("names no file".to_owned());
        }
        if !url.starts_with("postgres://") && !url.starts_with("postgresql://") {
            return Err("is neither `sqlite:FILE` nor `postgres://…`".to_owned());
        }
        match PgConnectOptions::from_str(url) {
            Ok(_) => Ok(Self::Server(url.to_owned())),
            Err(error) => Err(format!("is not a valid PostgreSQL URL: {error}")),
        }
    }

    /// The path of an SQLite file; `None` for PostgreSQL.
    #[must_use]
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(file) => Some(file),
            Self::Server(_) => None,
        }
    }

    fn options(&self) -> Result<AnyConnectOptions, StoreError> {
        install_drivers()?;
        match self {
            Self::File(file) => Ok(file_url(file, "rw")?.parse()?),
            Self::Server(url) => Ok(url.parse()?),
        }
    }

    /// Identifies the SQLite file, so that a removed or replaced one is noticed; `None` for
    /// PostgreSQL and where files have no identity.
    #[cfg(unix)]
    pub(super) fn file_identity(&self) -> Option<(u64, u64)> {
        use std::os::unix::fs::MetadataExt;
        let metadata = std::fs::metadata(self.file()?).ok()?;
        Some((metadata.dev(), metadata.ino()))
    }

    #[cfg(not(unix))]
    pub(super) fn file_identity(&self) -> Option<(u64, u64)> {
        None
    }

    /// Opens a connection that may write. For the main writer it has a large page cache
    /// and, in PostgreSQL, takes the lock of the database from the connection `lost`, if
    /// that still holds it; returns what the server knows the new one as. An SQLite file
    /// is locked by the caller.
    ///
    /// The main writer of an SQLite file first copies the whole write-ahead log into the file,
    /// however long that takes. If a sync of the log has failed, SQLite may find commits there
    /// that the system has in memory but no longer writes to the disk; commits after them
    /// would be lost with them.
    ///
    /// The names of the file and of its log are on the disk on return: without its name, a
    /// log and all commits in it are lost in a power cut. SQLite syncs the directory as well,
    /// after the first commit of a connection, and ignores that this fails
    /// (`unixSync` in its `os_unix.c`).
    pub(super) async fn writer(
        &self,
        role: WriterRole,
        lost: Option<&Backend>,
    ) -> Result<(AnyConnection, Option<Backend>), StoreError> {
        let options = self.options()?;
        let connect = async {
            if let Self::File(file) = self {
                page_checksums::create(file).await?;
            }
            let mut connection = options.connect().await?;
            if self.file().is_some() {
                page_checksums::are_verified(&mut connection).await?;
            }
            connection.execute(AssertSqlSafe(self.writer_settings(role))).await?;
            let backend = match self {
                Self::Server(_) if role != WriterRole::Auxiliary => {
                    let mode = match role {
                        WriterRole::Node => LockMode::Shared,
                        _ => LockMode::Exclusive,
                    };
                    Some(writer_lock::take(&mut connection, mode, lost).await?)
                }
                _ => None,
            };
            Ok((connection, backend))
        };
        let (mut connection, backend) = within(connect).await?;
        if let Self::File(file) = self {
            if role == WriterRole::Main {
                checkpoint::copy_all(&mut connection).await?;
            }
            let file = file.clone();
            let synced = tokio::task::spawn_blocking(move || sync_directory_of(&file)).await;
            synced.unwrap_or_else(|panic| std::panic::resume_unwind(panic.into_panic()))?;
        }
        Ok((connection, backend))
    }

    /// Checks the write-ahead log of an SQLite file before the first connection opens it:
    /// SQLite deletes the log with the last one.
    pub(super) async fn check_log(&self) -> Result<(), StoreError> {
        match self {
            Self::File(file) => check_log(file).await,
            Self::Server(_) => Ok(()),
        }
    }

    /// Opens a connection that may only read; the database must exist.
    pub(super) async fn reader(&self) -> Result<AnyConnection, StoreError> {
        install_drivers()?;
        self.check_log().await?;
        let (url, read_only) = match self {
            Self::File(file) => (file_url(file, "rw")?, "PRAGMA query_only = on"),
            Self::Server(url) => (url.clone(), "SET default_transaction_read_only = on"),
        };
        let options: AnyConnectOptions = url.parse()?;
        let connect = async {
            let mut connection = options.connect().await?;
            if self.file().is_some() {
                page_checksums::are_verified(&mut connection).await?;
            }
            connection.execute(read_only).await?;
            Ok(connection)
        };
        within(connect).await
    }

    /// The statement that begins a transaction that reads one state of the database.
    pub(super) const fn begin_read(&self) -> &'static str {
        match self {
            Self::File(_) => "BEGIN",
            Self::Server(_) => "BEGIN ISOLATION LEVEL REPEATABLE READ",
        }
    }

    /// A pool of connections that may only read.
    pub(super) fn readers(&self) -> Result<AnyPool, StoreError> {
        let pool =
            AnyPoolOptions::new().max_connections(MAX_READERS).acquire_timeout(READER_TIMEOUT);
        let (pool, read_only) = match self {
            // Idle connections are kept: they cost nothing, and closing and reopening them
            // would fragment the memory.
            Self::File(_) => (
                pool.idle_timeout(None).max_lifetime(None),
                format!("PRAGMA query_only = on; PRAGMA cache_size = -{CACHE_KIB}"),
            ),
            Self::Server(_) => (
                pool.after_release(|connection, _| Box::pin(is_answering(connection))),
                "SET default_transaction_read_only = on".to_owned(),
            ),
        };
        let pool = pool.after_connect(move |connection, _| {
            let read_only = read_only.clone();
            Box::pin(async move { connection.execute(AssertSqlSafe(read_only)).await.map(drop) })
        });
        Ok(pool.connect_lazy_with(self.options()?))
    }

    /// The settings of a connection that writes: a commit is on the disk when it returns,
    /// whatever the server's own configuration is.
    fn writer_settings(&self, role: WriterRole) -> String {
        match self {
            Self::File(_) => {
                let is_main = role == WriterRole::Main;
                let cache = if is_main { MAIN_CACHE_KIB } else { CACHE_KIB };
                format!(
                    "PRAGMA journal_mode = wal; PRAGMA synchronous = full; \
                     PRAGMA cache_size = -{cache}; \
                     PRAGMA wal_autocheckpoint = {AUTOCHECKPOINT_PAGES}"
                )
            }
            Self::Server(_) => "SET synchronous_commit = on".to_owned(),
        }
    }

    /// The statement that begins a transaction that writes.
    pub(super) const fn begin(&self) -> &'static str {
        match self {
            Self::File(_) => "BEGIN IMMEDIATE",
            Self::Server(_) => "BEGIN",
        }
    }
}

/// Fails if a connection does not answer, so that it is closed.
async fn is_answering(connection: &mut AnyConnection) -> sqlx::Result<bool> {
    let late = |_| sqlx::Error::Io(std::io::ErrorKind::TimedOut.into());
    let ping = Connection::ping(connection);
    tokio::time::timeout(RELEASE_TIMEOUT, ping).await.map_err(late)?.map(|()| true)
}

async fn within<T>(connect: impl Future<Output = Result<T, StoreError>>) -> Result<T, StoreError> {
    let late = |_| sqlx::Error::Io(std::io::ErrorKind::TimedOut.into());
    tokio::time::timeout(CONNECT_TIMEOUT, connect).await.map_err(late)?
}

/// Shows the location without the password.
impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(file) => write!(f, "{}", file.display()),
            Self::Server(url) => match PgConnectOptions::from_str(url) {
                Ok(o) => {
                    let database = o.get_database().unwrap_or(o.get_username());
                    match o.get_socket() {
                        Some(socket) => write!(f, "postgres:{}/{database}", socket.display()),
                        None => {
                            write!(f, "postgres://{}:{}/{database}", o.get_host(), o.get_port())
                        }
                    }
                }
                Err(_) => f.write_str("postgres:"),
            },
        }
    }
}

impl fmt::Debug for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
