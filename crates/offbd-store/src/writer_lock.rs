//! The lock of a PostgreSQL database: either one main writer is connected, or nodes of a
//! cluster, which share the lock.
//!
//! The lock belongs to a connection and ends with it. A connection that is lost without
//! the server's knowledge, because a host lost power or a firewall forgot it, must not keep
//! the lock: the server probes idle connections of a writer and drops dead ones within
//! seconds, and a writer that connects again ends its own lost connection first.

use sqlx::{AnyConnection, AssertSqlSafe, Executor};

use super::StoreError;

/// The advisory lock that the main writer of a database holds while it is connected.
const WRITER_LOCK: i64 = i64::from_be_bytes(*b"\0\0\0offbd");

/// How long a writer waits for the lock: the server may still be processing the last
/// statement of a process that was killed, or not know yet that its host is gone.
const LOCK_TIMEOUT: &str = "8s";

/// Settings by which the server finds a dead connection within 6 s: it probes an idle one
/// after 3 s, each second, and gives up after three probes or if data are not
/// acknowledged. Without effect on Unix sockets, which do not die unnoticed.
const KEEPALIVES: &str = "SET tcp_keepalives_idle = 3; SET tcp_keepalives_interval = 1; \
     SET tcp_keepalives_count = 3; SET tcp_user_timeout = '6s'";

/// What a writer may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WriterRole {
    /// Everything, for all partitions. At most one writer of a database has this role, and
    /// it is the only node.
    Main,
    /// Everything, for the partitions that it takes: a node of a cluster (PostgreSQL).
    Node,
    /// Changes that neither cause an event nor concern an engine, such as tokens. It may
    /// run beside other writers, and does not count its transactions.
    Auxiliary,
}

/// A connection as the server knows it. Its process number alone is used again.
#[derive(Clone, Debug)]
pub(super) struct Backend {
    pub(super) pid: i32,
    pub(super) started: String,
}

/// How the lock is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LockMode {
    /// By one writer.
    Exclusive,
    /// By the nodes of a cluster.
    Shared,
}

/// Takes the lock for `connection`. Ends the connection `lost` before, which this process
/// has lost.
///
/// # Errors
/// [`StoreError::InUse`] if another writer holds the lock; [`StoreError`].
pub(super) async fn take(
    connection: &mut AnyConnection,
    mode: LockMode,
    lost: Option<&Backend>,
) -> Result<Backend, StoreError> {
    connection.execute(AssertSqlSafe(KEEPALIVES)).await?;
    if let Some(Backend { pid, started }) = lost {
        sqlx::query(
            "SELECT pg_terminate_backend(pid, 2000) FROM pg_stat_activity
             WHERE pid = $1 AND CAST(backend_start AS TEXT) = $2",
        )
        .bind(pid)
        .bind(started)
        .execute(&mut *connection)
        .await?;
    }
    let lock = format!(
        "SET lock_timeout = '{LOCK_TIMEOUT}'; SELECT pg_advisory_lock{}({WRITER_LOCK});
         SET lock_timeout = DEFAULT",
        if mode == LockMode::Shared { "_shared" } else { "" }
    );
    connection.execute(AssertSqlSafe(lock)).await.map_err(lock_error)?;
    let (pid, started) = sqlx::query_as(
        "SELECT pid, CAST(backend_start AS TEXT) FROM pg_stat_activity
         WHERE pid = pg_backend_pid()",
    )
    .fetch_one(connection)
    .await?;
    Ok(Backend { pid, started })
}

/// Whether no writer is connected.
pub(super) async fn is_free(connection: &mut AnyConnection) -> Result<bool, StoreError> {
    let sql = format!(
        "SELECT CASE WHEN pg_try_advisory_lock({WRITER_LOCK})
         THEN CAST(pg_advisory_unlock({WRITER_LOCK}) AS INT) ELSE 0 END"
    );
    let is_free: i32 = sqlx::query_scalar(AssertSqlSafe(sql)).fetch_one(connection).await?;
    Ok(is_free == 1)
}

/// Converts the error of a failed attempt to take the lock.
fn lock_error(error: sqlx::Error) -> StoreError {
    if is_timeout(&error) { StoreError::InUse } else { error.into() }
}

/// Whether a lock was not free in time.
pub(super) fn is_timeout(error: &sqlx::Error) -> bool {
    /// `lock_not_available`
    const NOT_AVAILABLE: &str = "55P03";
    let code = error.as_database_error().and_then(|error| error.code());
    code.is_some_and(|code| code == NOT_AVAILABLE)
}
