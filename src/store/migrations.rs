//! The migrations, embedded: `migrations/NUMBER_NAME.sql`, in order.
//!
//! Not by `sqlx::migrate!`, nor are rows read by `derive(FromRow)`: sqlx's
//! macros bring its drivers into the build a second time, SQLite with them, a
//! tenth of the first build.

use std::sync::LazyLock;

use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::{AssertSqlSafe, SqlSafeStr};

#[derive(rust_embed::RustEmbed)]
#[folder = "$CARGO_MANIFEST_DIR/migrations"]
struct Files;

pub(super) static MIGRATIONS: LazyLock<Migrator> =
    LazyLock::new(|| Migrator::with_migrations(Files::iter().filter_map(|f| of(&f)).collect()));

/// The migration in `file`; `None` if its name is not one of a migration.
fn of(file: &str) -> Option<Migration> {
    let (number, name) = file.strip_suffix(".sql")?.split_once('_')?;
    let sql = String::from_utf8(Files::get(file)?.data.into_owned()).ok()?;
    let (number, name) = (number.parse().ok()?, name.replace('_', " "));
    let sql = AssertSqlSafe(sql).into_sql_str();
    Some(Migration::new(number, name.into(), MigrationType::Simple, sql, false))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checksums are kept in databases: theirs are those that sqlx itself makes.
    #[tokio::test]
    async fn they_are_what_sqlx_reads_from_the_files() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/migrations");
        let read = Migrator::new(std::path::Path::new(folder)).await.unwrap();
        let key = |m: &Migration| (m.version, m.description.clone(), m.checksum.clone());
        let embedded: Vec<_> = MIGRATIONS.iter().map(key).collect();
        assert_eq!(embedded, read.iter().map(key).collect::<Vec<_>>());
        assert!(embedded.len() >= 9, "{}", embedded.len());
    }
}
