//! Databases of earlier schemas, with the rows of one of the present schema.

use std::path::{Path, PathBuf};

use sqlx::migrate::Migrator;
use sqlx::{AnyConnection, AssertSqlSafe, Connection, Executor};

use crate::support::{connection, on_postgres, url};

/// The first schema with a journal.
pub const JOURNAL: usize = 6;

/// The first schema whose chunks and rows of the journal have checksums.
const CHECKSUMS: usize = 10;

/// All tables, those first to which others refer.
const TABLES: [&str; 26] = [
    "asset",
    "session",
    "chunk",
    "action",
    "transition",
    "fault",
    "replay",
    "calibration",
    "counter",
    "token",
    "login",
    "audit",
    "trend",
    "journal",
    "snapshot",
    "partition",
    "channel",
    "rule",
    "delivery",
    "reminder",
    "mute",
    "communication",
    "communication_change",
    "note",
    "remark",
    "tag",
];

/// The counter that became a column of `partition`.
const COMMITS: &str = "commit";

fn migrations() -> Vec<PathBuf> {
    let folder = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/migrations")).unwrap();
    let mut files: Vec<_> = folder.map(|file| file.unwrap().path()).collect();
    files.sort();
    files
}

/// The number of the present schema.
pub fn latest() -> usize {
    migrations().len()
}

/// A filled database of the present schema, put aside, in whose place there are databases of
/// earlier schemas.
pub struct Filled {
    data: PathBuf,
}

impl Filled {
    /// Puts the store in `data` aside: into another file, or another namespace.
    pub async fn new(data: &Path) -> Self {
        let mut db = connection(&url(data)).await;
        let aside = if on_postgres() {
            "ALTER SCHEMA public RENAME TO present"
        } else {
            "PRAGMA wal_checkpoint(TRUNCATE)"
        };
        db.execute(aside).await.unwrap();
        db.close().await.unwrap();
        if !on_postgres() {
            std::fs::rename(data.join("offbd.sqlite"), data.join("present")).unwrap();
        }
        Self { data: data.to_owned() }
    }

    /// Opens the database, with the tables of the present schema as `present`.
    async fn open(&self) -> AnyConnection {
        if on_postgres() {
            return connection(&url(&self.data)).await;
        }
        let mut db = connection(&format!("{}?mode=rwc", url(&self.data))).await;
        let present = self.data.join("present");
        let attach = format!("ATTACH DATABASE '{}' AS present", present.display());
        db.execute(AssertSqlSafe(attach)).await.unwrap();
        db
    }

    /// Makes a database of schema `n` with the rows of the present one, and keeps a copy of
    /// its tables.
    pub async fn take_back_to(&self, n: usize) {
        for end in ["", "-wal", "-shm"] {
            // Some are not there.
            let _ = std::fs::remove_file(self.data.join(format!("offbd.sqlite{end}")));
        }
        let mut db = self.open().await;
        if on_postgres() {
            db.execute("DROP SCHEMA IF EXISTS public CASCADE; CREATE SCHEMA public").await.unwrap();
        }
        migrate(&mut db, n).await;
        let mut tables = Vec::new();
        for table in TABLES {
            let columns = columns(&mut db, "public", table).await.join(", ");
            if !columns.is_empty() {
                copy_rows(&mut db, table, &columns).await;
                tables.push((table, columns));
            }
        }
        if n < CHECKSUMS {
            remove_checksums(&mut db, n).await;
        }
        for (table, columns) in tables {
            let keep = format!(
                "DROP TABLE IF EXISTS present.kept_{table};
                 CREATE TABLE present.kept_{table} AS SELECT {columns} FROM {table}"
            );
            db.execute(AssertSqlSafe(keep)).await.unwrap();
        }
        db.close().await.unwrap();
    }

    /// Compares all rows with those before the migration, in the columns that there were.
    /// Migrations may add counters, nothing else.
    pub async fn compare(&self, n: usize) {
        let mut db = self.open().await;
        for table in TABLES {
            let kept = format!("kept_{table}");
            let columns = columns(&mut db, "present", &kept).await;
            // Each start is another epoch of its partitions.
            let columns =
                Vec::from_iter(columns.into_iter().filter(|name| name != "epoch")).join(", ");
            if columns.is_empty() {
                continue;
            }
            let only = if table == "counter" {
                format!("WHERE name <> '{COMMITS}'")
            } else {
                String::new()
            };
            let (before, now) = (
                format!("SELECT {columns} FROM present.{kept} {only}"),
                format!("SELECT {columns} FROM {table}"),
            );
            let n_lost = count_rows(&mut db, &format!("{before} EXCEPT {now}")).await;
            let n_added = count_rows(&mut db, &now).await - count_rows(&mut db, &before).await;
            assert_eq!(n_lost, 0, "schema {n}: rows of {table} have changed");
            assert!(n_added == 0 || table == "counter", "schema {n}: {n_added} rows of {table}");
        }
        db.close().await.unwrap();
    }
}

/// Applies the first `n` migrations.
async fn migrate(db: &mut AnyConnection, n: usize) {
    let first = tempfile::tempdir().unwrap();
    for file in migrations().iter().take(n) {
        std::fs::copy(file, first.path().join(file.file_name().unwrap())).unwrap();
    }
    let migrator = Migrator::new(first.path()).await.unwrap();
    assert_eq!(migrator.iter().count(), n);
    migrator.run_direct(None, db, false).await.unwrap();
}

/// Copies the rows of the present schema, of counters those that there are.
async fn copy_rows(db: &mut AnyConnection, table: &str, columns: &str) {
    let only = if table == "counter" { "WHERE name IN (SELECT name FROM counter)" } else { "" };
    let copy = format!(
        "CREATE TEMPORARY TABLE copied AS SELECT {columns} FROM present.{table} {only};
         DELETE FROM {table};
         INSERT INTO {table} ({columns}) SELECT {columns} FROM copied;
         DROP TABLE copied"
    );
    let count = format!("SELECT name FROM counter WHERE name = '{COMMITS}'");
    let counts_commits = table == "counter" && count_rows(db, &count).await == 1;
    db.execute(AssertSqlSafe(copy)).await.unwrap();
    if counts_commits {
        let restore = format!(
            "INSERT INTO counter (name, value) SELECT '{COMMITS}', n_commits FROM present.partition"
        );
        db.execute(AssertSqlSafe(restore)).await.unwrap();
    }
}

async fn count_rows(db: &mut AnyConnection, rows: &str) -> i64 {
    let sql = AssertSqlSafe(format!("SELECT COUNT(*) FROM ({rows}) AS counted"));
    sqlx::query_scalar(sql).fetch_one(db).await.unwrap()
}

/// The columns of a table in a namespace, which SQLite calls `main` instead of `public`; none
/// if it is missing.
async fn columns(db: &mut AnyConnection, namespace: &str, table: &str) -> Vec<String> {
    let names = if on_postgres() {
        format!(
            "SELECT column_name::text FROM information_schema.columns
             WHERE table_schema = '{namespace}' AND table_name = '{table}'
             ORDER BY ordinal_position"
        )
    } else {
        let namespace = namespace.replace("public", "main");
        format!("SELECT name FROM pragma_table_info('{table}', '{namespace}')")
    };
    sqlx::query_scalar(AssertSqlSafe(names)).fetch_all(db).await.unwrap()
}

/// Gives chunks and rows of the journal the format without checksums.
async fn remove_checksums(db: &mut AnyConnection, n: usize) {
    let chunks: Vec<(String, i64, Vec<u8>)> =
        sqlx::query_as("SELECT session, first_index, data FROM chunk")
            .fetch_all(&mut *db)
            .await
            .unwrap();
    for (session, first_index, mut data) in chunks {
        data.truncate(data.len() - 4);
        data[0] = 1;
        sqlx::query("UPDATE chunk SET data = $1 WHERE session = $2 AND first_index = $3")
            .bind(data)
            .bind(session)
            .bind(first_index)
            .execute(&mut *db)
            .await
            .unwrap();
    }
    if n < JOURNAL {
        return;
    }
    let rows: Vec<(i64, Vec<u8>)> =
        sqlx::query_as("SELECT id, data FROM journal").fetch_all(&mut *db).await.unwrap();
    assert!(!rows.is_empty(), "the journal was folded");
    for (id, data) in rows {
        sqlx::query("UPDATE journal SET data = $1 WHERE id = $2")
            .bind(&data[5..])
            .bind(id)
            .execute(&mut *db)
            .await
            .unwrap();
    }
}
