//! The whole database of SQLite in one file: copied while the service runs,
//! and put back. PostgreSQL has its own tools for that.

use std::fs::File;
use std::path::{Path, PathBuf};

use sqlx::any::AnyConnectOptions;
use sqlx::{AnyConnection, ConnectOptions, Connection};

use super::{MIGRATIONS, Place, StoreError};

/// Copies the database file at `place` to `copy`, which must not be there. The
/// copy holds every commit up to some moment after the call, whole and on the
/// disk; the service goes on meanwhile.
///
/// # Errors
/// [`StoreError`] if there is no such file, or the copy cannot be made.
pub async fn back_up(place: &Place, copy: &Path) -> Result<(), StoreError> {
    let file = place.file().ok_or(StoreError::OwnTools)?;
    absent(copy)?;
    let part = beside(copy, ".part");
    remove(&part)?;
    let mut connection = open(file).await?;
    let target = part.to_string_lossy().into_owned();
    sqlx::query("VACUUM INTO $1").bind(target).execute(&mut connection).await?;
    connection.close().await?;
    let mut written = open(&part).await?;
    sound(&mut written).await?;
    written.close().await?;
    settle(&part, copy)
}

/// Makes the database file at `place` from `copy`, brought to this version's
/// schema. The one that is there is refused or, with `replace`, kept beside it
/// with `.replaced` behind its name. No service may use it meanwhile.
///
/// # Errors
/// [`StoreError`] if the copy is not whole, not ours or newer than this
/// version; then everything is as it was.
pub async fn restore(place: &Place, copy: &Path, replace: bool) -> Result<(), StoreError> {
    let file = place.file().ok_or(StoreError::OwnTools)?;
    if !replace {
        absent(file)?;
    }
    let part = beside(file, ".part");
    remove(&part)?;
    std::fs::copy(copy, &part).map_err(at(copy))?;
    let mut connection = open(&part).await?;
    sound(&mut connection).await?;
    // A file that is none of ours has no migrations.
    sqlx::query("SELECT version FROM _sqlx_migrations").execute(&mut connection).await?;
    MIGRATIONS.run_direct(None, &mut connection, false).await?;
    connection.close().await?;
    if file.exists() {
        set_aside(file)?;
    }
    settle(&part, file)
}

/// Moves the old file away, with the write-ahead log that belongs to it.
fn set_aside(file: &Path) -> Result<(), StoreError> {
    let aside = beside(file, ".replaced");
    for end in ["-shm", "-wal", ""] {
        remove(&beside(&aside, end))?;
    }
    for end in ["-wal", ""] {
        let from = beside(file, end);
        if from.exists() {
            std::fs::rename(&from, beside(&aside, end)).map_err(at(&from))?;
        }
    }
    remove(&beside(file, "-shm"))
}

async fn open(file: &Path) -> Result<AnyConnection, StoreError> {
    sqlx::any::install_default_drivers();
    let url = super::place::file_url(file, "rw")?;
    Ok(url.parse::<AnyConnectOptions>()?.connect().await?)
}

async fn sound(connection: &mut AnyConnection) -> Result<(), StoreError> {
    let found: String =
        sqlx::query_scalar("PRAGMA integrity_check(1)").fetch_one(connection).await?;
    if found == "ok" { Ok(()) } else { Err(StoreError::Damaged { found }) }
}

/// Gives the finished file its name; both are on the disk afterwards.
fn settle(part: &Path, file: &Path) -> Result<(), StoreError> {
    File::open(part).and_then(|file| file.sync_all()).map_err(at(part))?;
    std::fs::rename(part, file).map_err(at(file))?;
    let directory = file.parent().filter(|directory| !directory.as_os_str().is_empty());
    let directory = directory.unwrap_or(Path::new("."));
    File::open(directory).and_then(|directory| directory.sync_all()).map_err(at(directory))
}

fn absent(file: &Path) -> Result<(), StoreError> {
    let there = file.exists();
    if there { Err(StoreError::Exists { file: file.to_owned() }) } else { Ok(()) }
}

fn remove(file: &Path) -> Result<(), StoreError> {
    match std::fs::remove_file(file) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(at(file)(error)),
        _ => Ok(()),
    }
}

fn beside(file: &Path, end: &str) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(end);
    name.into()
}

fn at(file: &Path) -> impl Fn(std::io::Error) -> StoreError {
    move |source| StoreError::File { file: file.to_owned(), source }
}
