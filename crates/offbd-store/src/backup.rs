//! Backup and restore of an SQLite database as one file. PostgreSQL has its own tools.

use std::fs::File;
use std::path::{Path, PathBuf};

use sqlx::{AnyConnection, AssertSqlSafe, Connection, Executor};

use super::check::{check_copy, check_pages};
use super::file::{create_private, file_url, sync_directory_of};
use super::page_checksums::{self, open};
use super::{Location, StoreError, migrations};

/// Copies the database file at `location` to the new file `copy`, also while a service uses
/// it. The copy is a consistent state of the database with all commits before the call; its
/// pages have checksums, its contents are checked, and it is on the disk on return.
///
/// # Errors
/// [`StoreError`] if the database does not exist or is newer than this version, which cannot check
/// it, `copy` exists, or it cannot be written.
pub async fn back_up(location: &Location, copy: &Path) -> Result<(), StoreError> {
    let file = location.file().ok_or(StoreError::NotSqlite)?;
    check_absent(copy)?;
    let part = with_suffix(copy, ".part");
    remove_if_exists(&part)?;
    location.check_log().await?;
    // Fails if there is no such database.
    let mut source = open(file).await?;
    migrations::refuse_newer(&mut source).await?;
    source.close().await?;
    page_checksums::create(&part).await?;
    let mut written = open(&part).await?;
    copy_rows(&mut written, file).await?;
    written.close().await?;
    let mut written = open(&part).await?;
    check_copy(&mut written, location).await?;
    written.close().await?;
    publish(&part, copy)
}

/// Replaces the database file at `location` by `copy`, with the schema brought to this
/// version. An existing file is an error or, with `replace`,
/// renamed to `*.replaced`. No service may use the database meanwhile.
///
/// # Errors
/// [`StoreError`] if the copy is damaged, is not a database of offbd, or is newer than
/// this version; then nothing is changed.
pub async fn restore(location: &Location, copy: &Path, replace: bool) -> Result<(), StoreError> {
    let file = location.file().ok_or(StoreError::NotSqlite)?;
    check_regular(copy)?;
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
    migrations::schema(&mut connection).await?;
    migrations::migrate(&mut connection).await?;
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

/// Copies the schema and all rows of the database `file` to the empty database `copy`.
/// `VACUUM INTO` would write pages before the first one, which turns the checksums on.
async fn copy_rows(copy: &mut AnyConnection, file: &Path) -> Result<(), StoreError> {
    // An incomplete copy is of no use, and a complete one is synchronised at the end.
    copy.execute("PRAGMA journal_mode = off; PRAGMA synchronous = off").await?;
    // With foreign keys SQLite would not copy whole records.
    copy.execute("PRAGMA foreign_keys = off").await?;
    let source = file_url(file, "rw")?.replacen("sqlite:", "file:", 1);
    sqlx::query("ATTACH $1 AS source").bind(source).execute(&mut *copy).await?;
    copy.execute("BEGIN").await?;
    let schema: Vec<(String, String, String)> = sqlx::query_as(
        "SELECT type, name, sql FROM source.sqlite_schema
         WHERE sql IS NOT NULL AND name NOT LIKE 'sqlite^_%' ESCAPE '^' ORDER BY rowid",
    )
    .fetch_all(&mut *copy)
    .await?;
    // The indexes first, so that SQLite copies them too instead of sorting the rows again.
    for (_, _, create) in &schema {
        copy.execute(AssertSqlSafe(create.clone())).await?;
    }
    for (_, table, _) in schema.iter().filter(|(kind, ..)| kind == "table") {
        let rows = format!("INSERT INTO main.\"{table}\" SELECT * FROM source.\"{table}\"");
        copy.execute(AssertSqlSafe(rows)).await?;
    }
    copy.execute("COMMIT").await?;
    copy.execute("DETACH source").await?;
    Ok(())
}

/// Gives the finished `part` the name `file`; contents and name are on the disk on return.
///
/// # Errors
/// [`StoreError::Exists`] if there is a file of this name meanwhile, which is kept.
fn publish(part: &Path, file: &Path) -> Result<(), StoreError> {
    use std::io::ErrorKind::{AlreadyExists, PermissionDenied, Unsupported};
    File::open(part).and_then(|file| file.sync_all()).map_err(file_error(part))?;
    // A second name, because renaming would replace the other file.
    match std::fs::hard_link(part, file) {
        Ok(()) => remove_if_exists(part)?,
        Err(error) if error.kind() == AlreadyExists => {
            return Err(StoreError::Exists { file: file.to_owned() });
        }
        // A file system without second names.
        Err(error) if matches!(error.kind(), Unsupported | PermissionDenied) => {
            check_absent(file)?;
            std::fs::rename(part, file).map_err(file_error(file))?;
        }
        Err(error) => return Err(file_error(file)(error)),
    }
    sync_directory_of(file)
}

/// Checks that `copy` is a file with an end, and not a device.
fn check_regular(copy: &Path) -> Result<(), StoreError> {
    let metadata = std::fs::metadata(copy).map_err(file_error(copy))?;
    if metadata.is_file() {
        return Ok(());
    }
    Err(file_error(copy)(std::io::Error::other("is not a regular file")))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ChangeSet;
    use crate::{AssetRow, Store, Write};

    /// A file that appears while the copy is made is somebody else's.
    #[test]
    fn a_file_that_has_appeared_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let (part, file) = (folder.path().join("copy.part"), folder.path().join("copy"));
        std::fs::write(&part, "new").unwrap();
        std::fs::write(&file, "theirs").unwrap();
        assert!(matches!(publish(&part, &file), Err(StoreError::Exists { .. })));
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "theirs");
        std::fs::remove_file(&file).unwrap();
        publish(&part, &file).unwrap();
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "new");
        assert!(!part.exists());
    }

    /// A device has no end.
    #[cfg(unix)]
    #[tokio::test]
    async fn only_a_regular_file_is_restored() {
        let folder = tempfile::tempdir().unwrap();
        let location = Location::File(folder.path().join("offbd.db"));
        let restored = restore(&location, Path::new("/dev/zero"), false);
        let restored = tokio::time::timeout(std::time::Duration::from_secs(60), restored).await;
        let error = restored.expect("it ends").unwrap_err();
        assert_eq!(error.to_string(), "/dev/zero: is not a regular file");
    }

    /// More rows than the page cache of a connection holds.
    #[tokio::test]
    async fn all_pages_of_a_large_copy_have_checksums() {
        let folder = tempfile::tempdir().unwrap();
        let location = Location::File(folder.path().join("offbd.db"));
        let (_store, mut writer) = Store::open(&location).await.unwrap();
        let asset = |name: usize| {
            Write::CreateAsset(AssetRow {
                name: name.to_string(),
                document: format!("\"{}\"", "x".repeat(20_000)),
                revision: 1,
                created_at: 0,
                updated_at: 0,
            })
        };
        let mut assets: Vec<_> = (0..400).map(asset).collect();
        writer.commit(&mut [ChangeSet::unpartitioned(&mut assets)]).await.unwrap();
        let copy = Location::File(folder.path().join("copy"));
        back_up(&location, copy.file().unwrap()).await.unwrap();
        writer.close().await.unwrap();
        let report = crate::check(&copy).await.unwrap();
        assert_eq!(report, crate::check(&location).await.unwrap());
        assert_eq!((report.page_checksums, report.n_documents), (Some(true), 400));
        assert_eq!(report.findings, [""; 0]);
        let header = std::fs::read(copy.file().unwrap()).unwrap();
        assert_eq!(header[20], 8, "the number of reserved bytes");
    }
}
