//! Checksums of the pages of an SQLite file, through `crates/sqlite-checksums`.
//!
//! Every connection verifies them. A file gets them when it is created, because the bytes
//! for them must be reserved before the first page is written; a file that an earlier version
//! has created works without them. Which of the two a file is, is known by its application
//! id, so that a damaged number of reserved bytes does not disable the checksums.

use std::path::Path;

use sqlx::any::{AnyConnectOptions, install_default_drivers};
use sqlx::{AnyConnection, AssertSqlSafe, ConnectOptions, Connection, Executor};

use super::StoreError;
use super::file::{create_private, file_url};

/// Marks a file as one with checksums (`PRAGMA application_id`).
const APPLICATION_ID: i32 = i32::from_be_bytes(*b"ofbd");

/// Primary error codes of SQLite for a damaged file: malformed, and not a database.
const SQLITE_DAMAGED: [i32; 2] = [11, 26];

/// Error codes of PostgreSQL for damaged tables and indexes.
const POSTGRES_DAMAGED: [&str; 2] = ["XX001", "XX002"];

/// Makes the databases known to sqlx, and the checksums to SQLite. Connections that are
/// opened before do not verify them.
///
/// # Errors
/// [`StoreError`] if SQLite does not accept its extension.
pub fn install_drivers() -> Result<(), StoreError> {
    install_default_drivers();
    sqlite_checksums::register().map_err(|error| sqlx::Error::Configuration(Box::new(error)).into())
}

/// Creates `file` with an empty database whose pages have checksums, readable by its owner
/// only. A file that is not empty stays as it is.
pub(super) async fn create(file: &Path) -> Result<(), StoreError> {
    create_private(file)?;
    let found = std::fs::metadata(file);
    let found = found.map_err(|source| StoreError::File { file: file.to_owned(), source })?;
    if found.len() > 0 {
        return Ok(());
    }
    let mut db = open(file).await?;
    // The second statement writes the first page.
    let first_page =
        format!("SELECT reserve_page_checksums('main'); PRAGMA application_id = {APPLICATION_ID}");
    db.execute(AssertSqlSafe(first_page)).await?;
    Ok(db.close().await?)
}

/// Opens a connection to the existing `file`.
pub(super) async fn open(file: &Path) -> Result<AnyConnection, StoreError> {
    install_drivers()?;
    Ok(file_url(file, "rw")?.parse::<AnyConnectOptions>()?.connect().await?)
}

/// Returns whether `db`, an SQLite file, has checksums.
///
/// # Errors
/// [`StoreError::DamagedHeader`] if it should have them.
pub(super) async fn are_verified(db: &mut AnyConnection) -> Result<bool, StoreError> {
    let id: i64 = sqlx::query_scalar("PRAGMA application_id").fetch_one(&mut *db).await?;
    let verified: String = sqlx::query_scalar("PRAGMA checksum_verification").fetch_one(db).await?;
    match (verified == "1", id == i64::from(APPLICATION_ID)) {
        (true, _) => Ok(true),
        (false, false) => Ok(false),
        (false, true) => Err(StoreError::DamagedHeader),
    }
}

/// Returns whether the database has found that its file is damaged.
pub(super) fn is_damage(error: &sqlx::Error) -> bool {
    let Some(code) = error.as_database_error().and_then(|error| error.code()) else {
        return false;
    };
    if code.len() == 5 {
        return POSTGRES_DAMAGED.contains(&&*code);
    }
    code.parse::<i32>().is_ok_and(|code| {
        code == sqlite_checksums::DAMAGED_PAGE || SQLITE_DAMAGED.contains(&(code & 0xff))
    })
}
