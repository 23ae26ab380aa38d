//! The spool of version 0.1, a database of SQLite.

use std::fs::File;
use std::io::{self, Read, Seek};
use std::path::Path;

use futures_util::TryStreamExt;
use sqlx::sqlite::{SqliteConnectOptions, SqliteLockingMode};
use sqlx::{ConnectOptions, Connection, Row};

use super::batch::{NewBatch, SpoolError};
use super::files::with_ending;
use super::log::{self, Log};

/// What a database of SQLite begins with.
const MAGIC: [u8; 16] = *b"SQLite format 3\0";

/// Whether `file` is a database.
pub(super) fn is_database(file: &mut File) -> io::Result<bool> {
    let mut bytes = Vec::new();
    file.rewind()?;
    file.take(MAGIC.len() as u64).read_to_end(&mut bytes)?;
    Ok(bytes == MAGIC)
}

/// Puts the batches of the database at `path` into a file of the current format, which takes its
/// place; returns that file. Until then the database stays as it is.
pub(super) async fn replaced(path: &Path) -> Result<File, SpoolError> {
    let options =
        SqliteConnectOptions::new().filename(path).locking_mode(SqliteLockingMode::Exclusive);
    let mut connection = options.connect().await.map_err(open_error)?;
    let version = sqlx::query_scalar("PRAGMA user_version").fetch_one(&mut connection);
    let version: i64 = version.await.map_err(open_error)?;
    if version > 1 {
        return Err(SpoolError::Later(version));
    }
    let new = with_ending(path, "-new");
    // Of an attempt that did not end.
    let _ = std::fs::remove_file(&new);
    let mut log = Log::open(log::lock(&new)?)?;
    let select = "SELECT id, asset, query, media_type, body, refusal FROM batch ORDER BY id";
    let mut rows = sqlx::query(select).fetch(&mut connection);
    while let Some(row) = rows.try_next().await? {
        let (asset, query) = (row.try_get("asset")?, row.try_get("query")?);
        let (media_type, body) = (row.try_get("media_type")?, row.try_get("body")?);
        let batch = NewBatch { asset, query, media_type, body };
        log.add(row.try_get("id")?, &batch, row.try_get("refusal")?)?;
    }
    drop(rows);
    connection.close().await?;
    let file = log.into_file()?;
    std::fs::rename(&new, path)?;
    for ending in ["-wal", "-shm"] {
        // Usually SQLite has deleted them.
        let _ = std::fs::remove_file(with_ending(path, ending));
    }
    tracing::info!("the spool has the format of this version now");
    Ok(file)
}

/// Returns [`SpoolError::Locked`] if another process uses the file (`SQLITE_BUSY`).
fn open_error(error: sqlx::Error) -> SpoolError {
    /// `SQLITE_BUSY`
    const BUSY: &str = "5";
    let code = error.as_database_error().and_then(|error| error.code());
    if code.as_deref() == Some(BUSY) { SpoolError::Locked } else { error.into() }
}
