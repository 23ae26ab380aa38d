//! Where the database is: a file of SQLite or a server of PostgreSQL. The only
//! module that knows them apart; all else is one SQL for both, through sqlx's
//! `Any`.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use sqlx::any::{AnyConnectOptions, AnyPoolOptions, install_default_drivers};
use sqlx::postgres::PgConnectOptions;
use sqlx::{AnyConnection, AnyPool, AssertSqlSafe, ConnectOptions, Executor};

use super::StoreError;
use super::checkpoint::FULL_PAGES;

/// Connections for reading; more readers wait for one.
const MAX_READERS: u32 = 4;

/// Memory that a connection keeps a file's pages in, KiB. A large group fits into that
/// of the one writer, what does not is written twice; a reader needs few again.
const ONLY_CACHE_KIB: u32 = 8192;
const CACHE_KIB: u32 = 512;

/// How long a reader waits for a connection before it fails.
const READER_WAIT: Duration = Duration::from_secs(10);

/// How long a connection may take to come about.
const CONNECT_WAIT: Duration = Duration::from_secs(10);

/// The advisory lock of PostgreSQL that the one writer of a database holds as
/// long as it is connected.
const WRITER_LOCK: i64 = i64::from_be_bytes(*b"\0\0\0offbd");

/// How long a writer waits for the one before it to be gone: the server may be
/// busy with the last words of a process that was killed.
const LOCK_WAIT: &str = "5s";

/// Where a database is.
#[derive(Clone, PartialEq, Eq)]
pub enum Place {
    /// A file of SQLite.
    File(PathBuf),
    /// The URL of a PostgreSQL database, the password included.
    Server(String),
}

impl Place {
    /// The place that `url` names: `sqlite:FILE` or `postgres://…`.
    ///
    /// # Errors
    /// A reason that does not show the URL, which may hold a password.
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
            Err(error) => Err(format!("is no URL of PostgreSQL: {error}")),
        }
    }

    /// The file, if it is one.
    #[must_use]
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(file) => Some(file),
            Self::Server(_) => None,
        }
    }

    fn options(&self) -> Result<AnyConnectOptions, StoreError> {
        install_default_drivers();
        match self {
            Self::File(file) => Ok(file_url(file, "rwc")?.parse()?),
            Self::Server(url) => Ok(url.parse()?),
        }
    }

    /// A connection that may write. The `only` one has room for large groups, and
    /// takes the lock that the server keeps; that of a file is not the store's.
    pub(super) async fn writer(&self, only: bool) -> Result<AnyConnection, StoreError> {
        let options = self.options()?;
        let connect = async {
            let mut connection = options.connect().await?;
            connection.execute(AssertSqlSafe(self.durable(only))).await?;
            if only && matches!(self, Self::Server(_)) {
                let lock = format!(
                    "SET lock_timeout = '{LOCK_WAIT}'; SELECT pg_advisory_lock({WRITER_LOCK});
                     SET lock_timeout = DEFAULT"
                );
                connection.execute(AssertSqlSafe(lock)).await.map_err(taken)?;
            }
            Ok(connection)
        };
        within(connect).await
    }

    /// Connections that may only read.
    pub(super) fn readers(&self) -> Result<AnyPool, StoreError> {
        let pool = AnyPoolOptions::new().max_connections(MAX_READERS).acquire_timeout(READER_WAIT);
        let (pool, read_only) = match self {
            // One that waits costs nothing; a new one takes its memory from elsewhere than
            // where the one before it left some.
            Self::File(_) => (
                pool.idle_timeout(None).max_lifetime(None),
                format!("PRAGMA query_only = on; PRAGMA cache_size = -{CACHE_KIB}"),
            ),
            Self::Server(_) => (pool, "SET default_transaction_read_only = on".to_owned()),
        };
        let pool = pool.after_connect(move |connection, _| {
            let read_only = read_only.clone();
            Box::pin(async move { connection.execute(AssertSqlSafe(read_only)).await.map(drop) })
        });
        Ok(pool.connect_lazy_with(self.options()?))
    }

    /// A commit is on the disk when it returns, also where the server is set
    /// up otherwise.
    fn durable(&self, only: bool) -> String {
        match self {
            Self::File(_) => {
                let cache = if only { ONLY_CACHE_KIB } else { CACHE_KIB };
                format!(
                    "PRAGMA journal_mode = wal; PRAGMA synchronous = full; \
                     PRAGMA cache_size = -{cache}; PRAGMA wal_autocheckpoint = {FULL_PAGES}"
                )
            }
            Self::Server(_) => "SET synchronous_commit = on".to_owned(),
        }
    }

    /// Begins a transaction that writes.
    pub(super) const fn begin(&self) -> &'static str {
        match self {
            Self::File(_) => "BEGIN IMMEDIATE",
            Self::Server(_) => "BEGIN",
        }
    }
}

/// What it means that the lock of the writer is not to be had.
fn taken(error: sqlx::Error) -> StoreError {
    /// `lock_not_available`
    const NOT_AVAILABLE: &str = "55P03";
    let code = error.as_database_error().and_then(|error| error.code());
    if code.is_some_and(|code| code == NOT_AVAILABLE) { StoreError::Taken } else { error.into() }
}

/// The URL of a file, with `rw` or, to make it if it is not there, `rwc`; every
/// byte that could mean something in a URL is escaped.
pub(super) fn file_url(file: &Path, mode: &str) -> Result<String, StoreError> {
    use fmt::Write;
    let mut url = "sqlite://".to_owned();
    for byte in std::path::absolute(file).map_err(sqlx::Error::Io)?.as_os_str().as_encoded_bytes() {
        match byte {
            b'/' | b'-' | b'.' | b'_' => url.push(char::from(*byte)),
            byte if byte.is_ascii_alphanumeric() => url.push(char::from(*byte)),
            // Writing to a string cannot fail.
            byte => drop(write!(url, "%{byte:02x}")),
        }
    }
    Ok(url + "?mode=" + mode)
}

async fn within<T>(connect: impl Future<Output = Result<T, StoreError>>) -> Result<T, StoreError> {
    let late = |_| sqlx::Error::Io(std::io::ErrorKind::TimedOut.into());
    tokio::time::timeout(CONNECT_WAIT, connect).await.map_err(late)?
}

/// Without the password.
impl fmt::Display for Place {
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

impl fmt::Debug for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
