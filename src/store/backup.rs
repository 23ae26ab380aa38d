//! Backup and restore of an SQLite database as one file. PostgreSQL has its own tools.

use std::fs::File;
use std::path::{Path, PathBuf};

use sqlx::any::AnyConnectOptions;
use sqlx::{AnyConnection, ConnectOptions, Connection};

use super::check::{check_copy, check_pages};
use super::location::create_private;
use super::{Location, MIGRATIONS, StoreError};

/// Copies the database file at `location` to the new file `copy`, also while a service
/// uses it. The copy is a consistent state of the database with all commits before the
/// call; its contents are checked, and it is on the disk on return.
///
/// # Errors
/// [`StoreError`] if there is no such database, `copy` exists, or it cannot be written.
pub async fn back_up(location: &Location, copy: &Path) -> Result<(), StoreError> {
    let file = location.file().ok_or(StoreError::NotSqlite)?;
    check_absent(copy)?;
    let part = with_suffix(copy, ".part");
    remove_if_exists(&part)?;
    let mut connection = open(file).await?;
    create_private(&part)?;
    let target = part.to_string_lossy().into_owned();
    sqlx::query("VACUUM INTO $1").bind(target).execute(&mut connection).await?;
    connection.close().await?;
    let mut written = open(&part).await?;
    check_copy(&mut written, location).await?;
    written.close().await?;
    publish(&part, copy)
}

/// Replaces the database file at `location` by `copy`, with the schema brought to this
/// version. An existing file is an error or, with `replace`, renamed to `*.replaced`. No
/// service may use the database meanwhile.
///
/// # Errors
/// [`StoreError`] if the copy is damaged, is not a database of offbd, or is newer than
/// this version; then nothing is changed.
pub async fn restore(location: &Location, copy: &Path, replace: bool) -> Result<(), StoreError> {
    let file = location.file().ok_or(StoreError::NotSqlite)?;
    if !replace {
        check_absent(file)?;
    }
    let part = with_suffix(file, ".part");
    remove_if_exists(&part)?;
    create_private(&part)?;
    let mut target = File::options().write(true).open(&part).map_err(file_error(&part))?;
    let mut source = File::open(copy).map_err(file_error(copy))?;
    std::io::copy(&mut source, &mut target).map_err(file_error(copy))?;
    let mut connection = open(&part).await?;
    check_pages(&mut connection).await?;
    // Fails if the file is not a database of offbd.
    sqlx::query("SELECT version FROM _sqlx_migrations").execute(&mut connection).await?;
    MIGRATIONS.run_direct(None, &mut connection, false).await?;
    check_copy(&mut connection, location).await?;
    connection.close().await?;
    if file.exists() {
        set_aside(file)?;
    }
    publish(&part, file)
}

/// Renames the old file and its write-ahead log to `*.replaced`.
fn set_aside(file: &Path) -> Result<(), StoreError> {
    let aside = with_suffix(file, ".replaced");
    for end in ["-shm", "-wal", ""] {
        remove_if_exists(&with_suffix(&aside, end))?;
    }
    for end in ["-wal", ""] {
        let from = with_suffix(file, end);
        if from.exists() {
            std::fs::rename(&from, with_suffix(&aside, end)).map_err(file_error(&from))?;
        }
    }
    remove_if_exists(&with_suffix(file, "-shm"))
}

async fn open(file: &Path) -> Result<AnyConnection, StoreError> {
    sqlx::any::install_default_drivers();
    let url = super::location::file_url(file, "rw")?;
    Ok(url.parse::<AnyConnectOptions>()?.connect().await?)
}

/// Renames the finished `part` to `file`; contents and name are on the disk on return.
fn publish(part: &Path, file: &Path) -> Result<(), StoreError> {
    File::open(part).and_then(|file| file.sync_all()).map_err(file_error(part))?;
    std::fs::rename(part, file).map_err(file_error(file))?;
    let directory = file.parent().filter(|directory| !directory.as_os_str().is_empty());
    let directory = directory.unwrap_or(Path::new("."));
    File::open(directory).and_then(|directory| directory.sync_all()).map_err(file_error(directory))
}

fn check_absent(file: &Path) -> Result<(), StoreError> {
    let exists = file.exists();
    if exists { Err(StoreError::Exists { file: file.to_owned() }) } else { Ok(()) }
}

fn remove_if_exists(file: &Path) -> Result<(), StoreError> {
    match std::fs::remove_file(file) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(file_error(file)(error)),
        _ => Ok(()),
    }
}

fn with_suffix(file: &Path, suffix: &str) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

fn file_error(file: &Path) -> impl Fn(std::io::Error) -> StoreError {
    move |source| StoreError::File { file: file.to_owned(), source }
}
