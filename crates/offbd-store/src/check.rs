//! Goes through a database and names what is damaged: the structure of the database, the
//! checksum and the place of every chunk, journal row and snapshot, and every stored
//! document.

use std::collections::BTreeMap;

use futures_util::TryStreamExt;
use serde::de::IgnoredAny;
use sqlx::{AnyConnection, Connection, Executor};

use super::codec::ChunkKey;
use super::from_row::from_row;
use super::journal::JournalRun;
use super::read::VISIBLE;
use super::{
    Location, Snapshot, Store, StoreError, decode_chunk, journal, migrations, page_checksums,
};

/// Most findings that are listed; the search ends there.
const MAX_FINDINGS: usize = 1000;

/// Chunks that are read at a time, some 50 kB each.
const CHUNKS_AT_ONCE: i64 = 16;

/// The stored documents, each with the key of its row.
const DOCUMENTS: &[(&str, &str)] = &[
    ("asset file of", "SELECT name, document FROM asset"),
    ("learning record of", "SELECT name, learning FROM asset WHERE learning IS NOT NULL"),
    ("set-up of session", "SELECT id, setup FROM session"),
    ("fault memory before session", "SELECT id, baseline FROM session"),
    ("verdict of session", "SELECT id, verdict FROM session WHERE verdict IS NOT NULL"),
    ("transition", "SELECT CAST(id AS TEXT), document FROM transition"),
    ("fault of", "SELECT asset || ', ' || code, record FROM fault"),
    ("provenance of the fault of", "SELECT asset || ', ' || code, provenance FROM fault"),
    ("settings of replay", "SELECT id, settings FROM replay"),
    ("result of replay", "SELECT id, result FROM replay WHERE result IS NOT NULL"),
    ("sessions of calibration", "SELECT id, sessions FROM calibration"),
    ("calibration", "SELECT id, document FROM calibration WHERE document IS NOT NULL"),
];

/// What a check went through and what it found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CheckReport {
    pub n_sessions: u64,
    pub n_samples: u64,
    pub n_documents: u64,
    /// Whether the pages of an SQLite file have checksums; `None` for PostgreSQL.
    pub page_checksums: Option<bool>,
    /// What is damaged, in words; at most 1000 findings.
    pub findings: Vec<String>,
}

impl CheckReport {
    fn add(&mut self, finding: String) {
        if self.findings.len() < MAX_FINDINGS {
            self.findings.push(finding);
        }
    }
}

/// Checks the contents of the database at `location`, also while a service uses it. Nothing
/// is changed.
///
/// # Errors
/// [`StoreError`] if the database cannot be opened or has the schema of another version.
pub async fn check(location: &Location) -> Result<CheckReport, StoreError> {
    let mut db = location.reader().await?;
    check_version(&mut db).await?;
    let report = check_contents(&mut db, location).await?;
    db.close().await?;
    Ok(report)
}

/// Checks the contents of a copy of the database at `location`.
///
/// # Errors
/// [`StoreError::Damaged`] with the first finding.
pub(super) async fn check_copy(
    copy: &mut AnyConnection,
    location: &Location,
) -> Result<(), StoreError> {
    whole(check_contents(copy, location).await?)
}

/// Checks the structure of an SQLite database, whatever its schema.
///
/// # Errors
/// [`StoreError::Damaged`] with the first finding.
pub(super) async fn check_pages(db: &mut AnyConnection) -> Result<(), StoreError> {
    let mut report = CheckReport::default();
    check_structure(db, &mut report).await?;
    whole(report)
}

fn whole(report: CheckReport) -> Result<(), StoreError> {
    match report.findings.into_iter().next() {
        Some(found) => Err(StoreError::Damaged { found }),
        None => Ok(()),
    }
}

async fn check_contents(
    db: &mut AnyConnection,
    location: &Location,
) -> Result<CheckReport, StoreError> {
    let mut report = CheckReport::default();
    if location.file().is_some() {
        report.page_checksums = Some(page_checksums::are_verified(db).await?);
        check_structure(db, &mut report).await?;
    }
    check_open(db, location, &mut report).await;
    check_ended(db, &mut report).await;
    check_snapshots(db, &mut report).await;
    check_documents(db, &mut report).await;
    Ok(report)
}

async fn check_version(db: &mut AnyConnection) -> Result<(), StoreError> {
    let (found, expected) = (migrations::schema(db).await?, migrations::latest());
    if found == expected { Ok(()) } else { Err(StoreError::Schema { found, expected }) }
}

/// SQLite's own check of pages, indexes and constraints.
async fn check_structure(
    db: &mut AnyConnection,
    report: &mut CheckReport,
) -> Result<(), StoreError> {
    match structure(db, "PRAGMA integrity_check").await {
        Ok(findings) => findings.into_iter().for_each(|finding| report.add(finding)),
        Err(error) if error.is_damage() => report.add(error.to_string()),
        Err(error) => return Err(error),
    }
    Ok(())
}

/// The tables of an SQLite file that [`Store::check_table`] takes; none of PostgreSQL. The
/// chunks are not among them: they are read with their recordings.
const CHECKED_TABLES: &str = "SELECT name FROM sqlite_schema
     WHERE type = 'table' AND name <> 'chunk' ORDER BY name";

impl Store {
    /// The tables whose pages can be checked one table at a time, except the chunks.
    ///
    /// # Errors
    /// [`StoreError`] if the database cannot be read.
    pub async fn tables_to_check(&self) -> Result<Vec<String>, StoreError> {
        if self.location.file().is_none() {
            return Ok(Vec::new());
        }
        Ok(sqlx::query_scalar(CHECKED_TABLES).fetch_all(&self.pool).await?)
    }

    /// Reads all pages of `table` and of its indexes. Returns what is damaged, in words.
    ///
    /// # Errors
    /// [`StoreError`] if the database cannot be read.
    pub async fn check_table(&self, table: &str) -> Result<Vec<String>, StoreError> {
        let check = format!("PRAGMA quick_check('{table}')");
        match structure(&mut *self.pool.acquire().await?, &check).await {
            Err(error) if error.is_damage() => Ok(vec![error.to_string()]),
            found => found,
        }
    }
}

/// Executes one of SQLite's checks. Returns what it found, with the names of tables and
/// indexes.
async fn structure(db: &mut AnyConnection, check: &str) -> Result<Vec<String>, StoreError> {
    let mut found: Vec<String> = Vec::new();
    let mut rows =
        sqlx::query_scalar::<_, String>(sqlx::AssertSqlSafe(check.to_owned())).fetch(&mut *db);
    loop {
        match rows.try_next().await {
            Ok(Some(row)) if row == "ok" => return Ok(Vec::new()),
            Ok(Some(row)) => found.push(row),
            Ok(None) => break,
            // A check ends at a row that it cannot read, and has named its page before.
            Err(_) if !found.is_empty() => break,
            Err(error) => return Err(error.into()),
        }
    }
    drop(rows);
    let trees = sqlx::query_as("SELECT rootpage, name FROM sqlite_schema").fetch_all(db).await;
    // The schema itself may be damaged.
    let trees: Vec<(i64, String)> = trees.unwrap_or_default();
    let lines = found.iter().flat_map(|row| row.lines()).filter(|line| !line.starts_with("***"));
    Ok(lines.map(|line| named(line, &trees)).collect())
}

/// Puts the name of the table or index before a line about a tree of pages.
fn named(line: &str, trees: &[(i64, String)]) -> String {
    let root = line.strip_prefix("Tree ").and_then(|rest| rest.split(' ').next()?.parse().ok());
    match trees.iter().find(|(number, _)| Some(*number) == root) {
        Some((_, name)) => format!("{name}: {line}"),
        None => line.to_owned(),
    }
}

/// A session as its row describes it.
struct CheckedSession {
    id: String,
    n_samples: i64,
}

from_row!(CheckedSession { id, n_samples });

/// Checks the open sessions and the journal, which change together, in one transaction.
async fn check_open(db: &mut AnyConnection, location: &Location, report: &mut CheckReport) {
    let checked = async {
        db.execute(location.begin_read()).await?;
        let mut runs = journal_runs(db, report).await?;
        for session in sessions(db, "open").await? {
            let n_folded = check_chunks(db, &session, report).await;
            check_journal(
                &session,
                n_folded,
                &runs.remove(&session.id).unwrap_or_default(),
                report,
            );
            report.n_sessions += 1;
        }
        db.execute("ROLLBACK").await?;
        Ok::<_, StoreError>(())
    };
    if let Err(error) = checked.await {
        report.add(format!("the open sessions cannot be read: {error}"));
    }
}

async fn check_ended(db: &mut AnyConnection, report: &mut CheckReport) {
    let found = sessions(db, "ended").await;
    let found = found.unwrap_or_else(|error| {
        report.add(format!("the sessions cannot be read: {error}"));
        Vec::new()
    });
    for session in found {
        let n = check_chunks(db, &session, report).await;
        if n != session.n_samples && is_visible(db, &session.id).await {
            let CheckedSession { id, n_samples } = &session;
            report.add(format!("session {id}: {n} of {n_samples} samples are there"));
        }
        report.n_sessions += 1;
    }
}

async fn sessions(
    db: &mut AnyConnection,
    state: &'static str,
) -> Result<Vec<CheckedSession>, StoreError> {
    let sql =
        format!("SELECT id, n_samples FROM session WHERE {VISIBLE} state = '{state}' ORDER BY id");
    Ok(sqlx::query_as(sqlx::AssertSqlSafe(sql)).fetch_all(db).await?)
}

/// Whether the session is still there: retention may have deleted it meanwhile.
async fn is_visible(db: &mut AnyConnection, id: &str) -> bool {
    let sql = format!("SELECT id FROM session WHERE {VISIBLE} id = $1");
    let found = sqlx::query_scalar::<_, String>(sqlx::AssertSqlSafe(sql)).bind(id);
    found.fetch_optional(db).await.map_or(true, |id| id.is_some())
}

/// A row of the table of chunks.
struct StoredChunk {
    first_index: i64,
    n: i64,
    min_t_s: f64,
    max_t_s: f64,
    data: Vec<u8>,
}

from_row!(StoredChunk { first_index, n, min_t_s, max_t_s, data });

/// Checks the chunks of `session`. Returns the number of samples from the start on without
/// a gap.
async fn check_chunks(
    db: &mut AnyConnection,
    session: &CheckedSession,
    report: &mut CheckReport,
) -> i64 {
    let (mut next, mut n_good) = (0, 0);
    loop {
        let chunks: Result<Vec<StoredChunk>, _> = sqlx::query_as(
            "SELECT first_index, n, min_t_s, max_t_s, data FROM chunk
             WHERE session = $1 AND first_index >= $2 ORDER BY first_index LIMIT $3",
        )
        .bind(&session.id)
        .bind(next)
        .bind(CHUNKS_AT_ONCE)
        .fetch_all(&mut *db)
        .await;
        let chunks = chunks.unwrap_or_else(|error| {
            let error = StoreError::from(error);
            report.add(format!("session {} from chunk {next} on: {error}", session.id));
            Vec::new()
        });
        let Some(last) = chunks.last() else { return n_good };
        next = last.first_index + 1;
        for chunk in &chunks {
            match check_chunk(&session.id, chunk) {
                Ok(n) => {
                    report.n_samples += n.unsigned_abs();
                    if chunk.first_index == n_good {
                        n_good += n;
                    }
                }
                Err(finding) => report.add(finding),
            }
        }
    }
}

/// Checks one chunk. Returns the number of its samples, or what is damaged.
fn check_chunk(session: &str, chunk: &StoredChunk) -> Result<i64, String> {
    let StoredChunk { first_index, n, min_t_s, max_t_s, ref data } = *chunk;
    let key = ChunkKey { session, first_index };
    let samples = decode_chunk(data, key).map_err(|error| error.to_string())?;
    let times = || samples.iter().map(|sample| sample.t_s);
    let found = (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max));
    if i64::try_from(samples.len()) != Ok(n) || found != (min_t_s, max_t_s) {
        return Err(format!("chunk {first_index} of session {session}: its row is damaged"));
    }
    Ok(n)
}

/// The runs of each session in the journal, in order.
async fn journal_runs(
    db: &mut AnyConnection,
    report: &mut CheckReport,
) -> Result<BTreeMap<String, Vec<JournalRun>>, StoreError> {
    let rows: Vec<(i64, Vec<u8>)> =
        sqlx::query_as("SELECT id, data FROM journal ORDER BY id").fetch_all(db).await?;
    let mut runs: BTreeMap<String, Vec<JournalRun>> = BTreeMap::new();
    for (id, data) in rows {
        match journal::runs(id, &data) {
            Ok(found) => {
                for run in found {
                    runs.entry(run.session.clone()).or_default().push(run);
                }
            }
            Err(error) => report.add(error.to_string()),
        }
    }
    Ok(runs)
}

/// Checks that the chunks of an open session and its runs in the journal follow each other.
fn check_journal(
    session: &CheckedSession,
    n_folded: i64,
    runs: &[JournalRun],
    report: &mut CheckReport,
) {
    let CheckedSession { id, n_samples } = session;
    if n_folded != *n_samples {
        report.add(format!("session {id}: {n_folded} of {n_samples} samples are there"));
        return;
    }
    let mut next = n_folded;
    for run in runs.iter().filter(|run| run.first_index >= n_folded) {
        if run.first_index != next {
            report.add(format!("session {id}: sample {next} is missing in the journal"));
            return;
        }
        next += run.n;
        report.n_samples += run.n.unsigned_abs();
    }
}

async fn check_snapshots(db: &mut AnyConnection, report: &mut CheckReport) {
    let mut rows = sqlx::query_as::<_, (String, i64, String, Vec<u8>)>(
        "SELECT session, n_samples, version, data FROM snapshot",
    )
    .fetch(db);
    loop {
        match rows.try_next().await {
            Ok(Some((session, n_samples, version, data))) => {
                let snapshot =
                    Snapshot { session, n_samples, kept: false, version, state: Vec::new() };
                if let Err(error) = snapshot.open(&data) {
                    report.add(error.to_string());
                }
            }
            Ok(None) => break,
            Err(error) => {
                let error = StoreError::from(error);
                report.add(format!("the snapshots cannot be read: {error}"));
                break;
            }
        }
    }
}

async fn check_documents(db: &mut AnyConnection, report: &mut CheckReport) {
    for &(what, sql) in DOCUMENTS {
        let mut rows = sqlx::query_as::<_, (String, String)>(sql).fetch(&mut *db);
        loop {
            match rows.try_next().await {
                Ok(Some((key, document))) => {
                    report.n_documents += 1;
                    if let Err(error) = serde_json::from_str::<IgnoredAny>(&document) {
                        report.add(format!("{what} {key}: {error}"));
                    }
                }
                Ok(None) => break,
                Err(error) => {
                    report.add(format!("{what}: {}", StoreError::from(error)));
                    break;
                }
            }
        }
    }
}
