//! The embedded migrations: `migrations/NUMBER_NAME.sql`, in the order of their numbers.
//!
//! Neither `sqlx::migrate!` nor `derive(FromRow)` is used: the macros of sqlx compile its
//! drivers, and SQLite with them, a second time, which is a tenth of a build from scratch.

use std::sync::LazyLock;

use sqlx::migrate::{MigrateError, Migration, MigrationType, Migrator};
use sqlx::{AnyConnection, AssertSqlSafe, SqlSafeStr};

use super::StoreError;

#[derive(rust_embed::RustEmbed)]
#[folder = "$CARGO_MANIFEST_DIR/migrations"]
struct MigrationFiles;

pub(super) static MIGRATIONS: LazyLock<Migrator> = LazyLock::new(|| {
    Migrator::with_migrations(MigrationFiles::iter().filter_map(|f| migration(&f)).collect())
});

/// The schema of this version: the number of its last migration.
pub(super) fn latest() -> i64 {
    MIGRATIONS.iter().map(|migration| migration.version).max().unwrap_or_default()
}

/// Returns the schema of a database: the number of the last migration that was applied to it, or 0.
pub(super) async fn schema(db: &mut AnyConnection) -> Result<i64, StoreError> {
    let found = sqlx::query_scalar("SELECT MAX(version) FROM _sqlx_migrations").fetch_one(db);
    let found: Option<i64> = found.await?;
    Ok(found.unwrap_or_default())
}

/// Brings the schema of a database to that of this version.
///
/// # Errors
/// [`StoreError::Schema`] if it is the schema of a newer version.
pub(super) async fn migrate(db: &mut AnyConnection) -> Result<(), StoreError> {
    match MIGRATIONS.run_direct(None, db, false).await {
        Err(error @ MigrateError::VersionMissing(_)) => {
            refuse_newer(db).await?;
            Err(error.into())
        }
        migrated => Ok(migrated?),
    }
}

/// # Errors
/// [`StoreError::Schema`] if the database has the schema of a newer version.
pub(super) async fn refuse_newer(db: &mut AnyConnection) -> Result<(), StoreError> {
    let (found, expected) = (schema(db).await?, latest());
    if found > expected { Err(StoreError::Schema { found, expected }) } else { Ok(()) }
}

/// Returns the migration in `file`; `None` if its name is not `NUMBER_NAME.sql`.
fn migration(file: &str) -> Option<Migration> {
    let (number, name) = file.strip_suffix(".sql")?.split_once('_')?;
    let sql = String::from_utf8(MigrationFiles::get(file)?.data.into_owned()).ok()?;
    let (number, name) = (number.parse().ok()?, name.replace('_', " "));
    let sql = AssertSqlSafe(sql).into_sql_str();
    Some(Migration::new(number, name.into(), MigrationType::Simple, sql, false))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Databases store the checksums, so they must equal those that sqlx computes itself.
    #[tokio::test]
    async fn embedded_migrations_equal_those_that_sqlx_reads() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/migrations");
        let read = Migrator::new(std::path::Path::new(folder)).await.unwrap();
        let key = |m: &Migration| (m.version, m.description.clone(), m.checksum.clone());
        let embedded: Vec<_> = MIGRATIONS.iter().map(key).collect();
        assert_eq!(embedded, read.iter().map(key).collect::<Vec<_>>());
        assert!(embedded.len() >= 9, "{}", embedded.len());
    }
}
