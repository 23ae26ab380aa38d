//! A database of each earlier schema is brought to the present one: everything is there to
//! the bit, and the service goes on with it.
//!
//! A service fills a database of the present schema. For each earlier one its rows are copied
//! into tables made by the migrations up to there, which have fewer columns and, before the
//! checksums, an older format of samples.

mod schema;

use std::ffi::OsStr;
use std::process::Command;

use offbd::store::Store;
use schema::{Filled, JOURNAL, latest};
use serde_json::{Value, json};
use sqlx::Executor;

use crate::support::process::{Process, ended, program};
use crate::support::{Client, config, connection, eventually, judged, on_postgres, rig, url};

/// Samples of the session that is open while the schema changes, and how many of them are
/// sent before.
const OPEN: (usize, usize) = (900, 500);

/// The first schema without samples in files.
const NO_COLD_FILES: usize = 23;

/// What the service shows, and the first schema that holds all of it.
const VIEWS: [(&str, usize); 9] = [
    ("assets/a", 9),
    ("assets/b", 9),
    ("assets/a/calibrations", 1),
    ("sessions?asset=a", 5),
    ("sessions?asset=b", 5),
    ("assets/a/faults?status=all", 2),
    ("assets/b/faults?status=all", 2),
    ("assets/a/faults/x_servo/history", 2),
    ("assets/a/trends", 4),
];

/// Makes rows in every table: an ended session with a fault that a person acknowledges, its
/// replay, a calibration that fails, a token, an open session.
async fn fill(client: &Client) {
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(1500, 500)).await;
    let id = client.end("a", "s").await["id"].as_str().unwrap().to_owned();
    let acknowledged = client.post("assets/a/faults/x_servo/acknowledge?by=ann", &json!({})).await;
    acknowledged.expect(200);
    let replay = client.post(&format!("sessions/{id}/replays"), &json!({})).await.expect(202);
    let calibration = json!({ "sessions": [id] });
    let calibration = client.post("assets/a/calibrations", &calibration).await.expect(202);
    for path in [
        format!("replays/{}", replay["id"].as_str().unwrap()),
        format!("assets/a/calibrations/{}", calibration["id"].as_str().unwrap()),
    ] {
        eventually(async || {
            let state = client.get(&path).await.expect(200)["state"].clone();
            (state == "done" || state == "failed").then_some(())
        })
        .await;
    }
    let token = json!({ "name": "ann", "role": "viewer" });
    client.post("tokens", &token).await.expect(201);
    client.asset("b").await;
    for part in rig(OPEN.0, 300)[..OPEN.1].chunks(50) {
        client.telemetry("b", Some("s"), part).await;
    }
}

/// Returns what the service shows of what a database of schema `n` holds.
async fn views(client: &Client, n: usize) -> Value {
    // Loads the engine, whose monitors are known then.
    client.load("b").await;
    let mut shown = Vec::new();
    for (path, _) in VIEWS.iter().filter(|(_, since)| n >= *since) {
        shown.push((*path, client.get(path).await.expect(200)));
    }
    json!(shown)
}

/// Compares recordings, verdicts and faults, and goes on with the open session.
async fn go_on(client: &Client, n: usize) {
    assert_eq!(client.recording("a", "s").await, rig(1500, 500), "schema {n}");
    let samples = rig(OPEN.0, 300);
    assert_eq!(client.recording("b", "s").await, samples[..OPEN.1], "schema {n}");
    let verdict = &client.session("a", "s").await["verdict"];
    assert_eq!(verdict["verdict_hash"], judged("a", &rig(1500, 500)).0, "schema {n}");
    let fault = client.get("assets/a/faults/x_servo").await.expect(200);
    assert_eq!(fault["status"], "confirmed", "schema {n}: {fault}");
    // The device repeats its last batch.
    for part in samples[OPEN.1 - 50..].chunks(100) {
        client.telemetry("b", Some("s"), part).await;
    }
    let verdict = &client.end("b", "s").await["verdict"];
    assert_eq!(verdict["verdict_hash"], judged("b", &samples).0, "schema {n}");
    assert_eq!(client.recording("b", "s").await, samples, "schema {n}");
    client.telemetry("a", Some("later"), &rig(300, 300)).await;
    client.end("a", "later").await;
}

/// Upgrades from each of some schemas. The service is stopped, which folds its journal, or
/// killed.
async fn upgrade_each(schemas: impl Iterator<Item = usize>, is_stopped: bool) {
    let data = tempfile::tempdir().unwrap();
    let mut process = Process::start(data.path());
    fill(&process.client).await;
    let mut shown = Vec::new();
    for n in 1..=latest() {
        shown.push(views(&process.client, n).await);
    }
    if is_stopped {
        process.terminate();
        ended(&mut process.child).await;
    }
    drop(process);
    let filled = Filled::new(data.path()).await;
    for n in schemas {
        filled.take_back_to(n).await;
        let location = config(data.path()).location().unwrap();
        // Dropped as by a kill: the journal stays as it is.
        drop(Store::open(&location).await.unwrap());
        filled.compare(n).await;
        let process = Process::start(data.path());
        assert_eq!(views(&process.client, n).await, shown[n - 1], "schema {n}");
        go_on(&process.client, n).await;
        drop(process);
        let report = offbd::store::check(&location).await.unwrap();
        assert_eq!(report.findings, Vec::<String>::new(), "schema {n}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_schema_without_a_journal_is_brought_to_the_present_one() {
    upgrade_each(1..JOURNAL, true).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_schema_with_a_journal_is_brought_to_the_present_one() {
    upgrade_each(JOURNAL..=latest(), false).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_database_with_samples_in_files_is_not_migrated() {
    let data = tempfile::tempdir().unwrap();
    let process = Process::start(data.path());
    process.client.asset("a").await;
    drop(process);
    let filled = Filled::new(data.path()).await;
    filled.take_back_to(NO_COLD_FILES - 1).await;
    let mut db = connection(&url(data.path())).await;
    let file = "INSERT INTO cold_file VALUES ('s', 'a', 1, 's.parquet', 1, '', 1)";
    db.execute(file).await.unwrap();
    let location = config(data.path()).location().unwrap();
    let error = Store::open(&location).await.map(drop).unwrap_err().to_string();
    assert!(error.contains("back_up_and_restore_with_the_version_before"), "{error}");
    let kept: i64 =
        sqlx::query_scalar("SELECT COUNT(*) FROM cold_file").fetch_one(&mut db).await.unwrap();
    assert_eq!(kept, 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_store_of_a_newer_version_is_refused_with_what_to_do() {
    let data = tempfile::tempdir().unwrap();
    let process = Process::start(data.path());
    process.client.asset("a").await;
    drop(process);
    let copy = data.path().join("copy");
    let mut db = connection(&url(data.path())).await;
    // As if two later migrations were applied.
    for version in [998, 999] {
        let later = "INSERT INTO _sqlx_migrations
            SELECT $1, 'later', installed_on, success, checksum, execution_time
            FROM _sqlx_migrations WHERE version = 1";
        sqlx::query(later).bind(version).execute(&mut db).await.unwrap();
    }
    let folder = data.path().join("data");
    let run = |command: &str, more: &[&OsStr]| {
        let mut run = Command::new(program());
        run.arg(command).args(more).env("OFFBD_LISTEN", "127.0.0.1:0");
        match command {
            "restore" => run.arg("--data").arg(&folder),
            _ => run.args(["--database", &url(data.path())]),
        };
        let output = run.output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        let expected = format!(
            "the database has schema 999, and this version has {}: use a newer version of offbd",
            latest()
        );
        assert!(said.trim_end().ends_with(&expected), "{command}: {said}");
        assert_eq!(output.status.code(), Some(3), "{command}");
    };
    for command in ["serve", "migrate", "check"] {
        run(command, &[]);
    }
    run("token", &["list".as_ref()]);
    if !on_postgres() {
        run("backup", &[copy.as_ref()]);
        assert!(!copy.exists());
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)").await.unwrap();
        std::fs::copy(data.path().join("offbd.sqlite"), &copy).unwrap();
        run("restore", &[copy.as_ref()]);
        assert!(!folder.join("offbd.sqlite").exists());
    }
}
