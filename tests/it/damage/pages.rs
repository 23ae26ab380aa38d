//! Checksums of the pages of an SQLite file: which files have them, and what a damaged page
//! stops.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;
use std::process::{Command, ExitStatus};

use super::check;
use crate::support::process::{Process, Refusal};
use crate::support::{connection, on_postgres, rig, url};
use sqlx::{AssertSqlSafe, Connection, Executor};

/// Copies the store in `data` to a file without checksums, as an earlier version has made it.
async fn remove_checksums(data: &Path) {
    let (file, plain) = (data.join("offbd.sqlite"), data.join("plain"));
    std::fs::write(&plain, []).unwrap();
    let mut db = connection(&format!("sqlite://{}", plain.display())).await;
    db.execute("PRAGMA foreign_keys = off").await.unwrap();
    let attach = format!("ATTACH '{}' AS source", file.display());
    db.execute(AssertSqlSafe(attach)).await.unwrap();
    let schema = "SELECT type, name, sql FROM source.sqlite_schema WHERE sql IS NOT NULL";
    let schema: Vec<(String, String, String)> =
        sqlx::query_as(schema).fetch_all(&mut db).await.unwrap();
    for (kind, name, create) in schema {
        db.execute(AssertSqlSafe(create)).await.unwrap();
        if kind == "table" {
            let rows = format!("INSERT INTO main.{name} SELECT * FROM source.{name}");
            db.execute(AssertSqlSafe(rows)).await.unwrap();
        }
    }
    db.close().await.unwrap();
    std::fs::rename(plain, file).unwrap();
}

fn offbd(command: &str, data: &Path, rest: &[&str]) {
    let mut offbd = Command::new(env!("CARGO_BIN_EXE_offbd"));
    let output = offbd.args([command, "--data"]).arg(data).args(rest).output().unwrap();
    assert!(output.status.success(), "{output:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_backup_adds_checksums_to_a_file_without_them() {
    if on_postgres() {
        return;
    }
    let data = tempfile::tempdir().unwrap();
    let samples = rig(3000, 1000);
    let mut process = Process::start(data.path());
    process.client.asset("a").await;
    process.client.telemetry("a", Some("s"), &samples).await;
    process.client.end("a", "s").await;
    let (status, printed) = check(data.path());
    assert_eq!(status, Some(0), "{printed}");
    assert!(printed.contains("their checksums match"), "{printed}");
    drop(process);
    check(data.path());
    remove_checksums(data.path()).await;
    let (status, printed) = check(data.path());
    assert_eq!(status, Some(0), "{printed}");
    assert!(printed.contains("without checksums"), "{printed}");
    // It works as before.
    process = Process::start(data.path());
    assert_eq!(process.client.recording("a", "s").await, samples);
    process.client.telemetry("a", Some("t"), &samples[..500]).await;
    drop(process);
    let copy = data.path().join("copy").display().to_string();
    offbd("backup", data.path(), &[&copy]);
    offbd("restore", data.path(), &[&copy, "--replace"]);
    let (status, printed) = check(data.path());
    assert_eq!(status, Some(0), "{printed}");
    assert!(printed.contains("their checksums match"), "{printed}");
    process = Process::start(data.path());
    assert_eq!(process.client.recording("a", "s").await, samples);
    assert_eq!(process.client.recording("a", "t").await, samples[..500]);
}

/// Changes one bit of that of `pages` which has the text `with`; it must not have the text
/// `without`.
fn damage_page_with(file: &Path, pages: &[i64], with: &str, without: &str) {
    let bytes = std::fs::read(file).unwrap();
    let has = |page: &[u8], text: &str| page.windows(text.len()).any(|w| w == text.as_bytes());
    let starts = pages.iter().map(|page| (usize::try_from(*page).unwrap() - 1) * 4096);
    let at = starts.into_iter().find(|&at| has(&bytes[at..at + 4096], with)).unwrap();
    assert!(!has(&bytes[at..at + 4096], without));
    // Not through a truncated file: the service has it open.
    let mut file = File::options().write(true).open(file).unwrap();
    file.seek(SeekFrom::Start(at as u64 + 2000)).unwrap();
    file.write_all(&[bytes[at + 2000] ^ 16]).unwrap();
}

/// The writer meets a page of one asset that was damaged while the service runs.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_damaged_page_stops_no_other_asset() {
    if on_postgres() {
        return;
    }
    let data = tempfile::tempdir().unwrap();
    let process = Process::start(data.path());
    let (client, samples) = (&process.client, rig(1000, 1000));
    for asset in ["a", "c", "d", "e", "f", "b"] {
        client.asset(asset).await;
        client.telemetry(asset, Some("s"), &samples[..400]).await;
    }
    let id = async |asset| client.session(asset, "s").await["id"].as_str().unwrap().to_owned();
    let (damaged, whole) = (id("a").await, id("b").await);
    let mut store = connection(&url(data.path())).await;
    store.execute("PRAGMA wal_checkpoint(TRUNCATE)").await.unwrap();
    let leaves = "SELECT pageno FROM dbstat WHERE name = 'session' AND pagetype = 'leaf'";
    let leaves: Vec<i64> = sqlx::query_scalar(leaves).fetch_all(&mut store).await.unwrap();
    damage_page_with(&data.path().join("offbd.sqlite"), &leaves, &damaged, &whole);
    // Another connection's change makes the writer read its pages again.
    store.execute("UPDATE counter SET value = value + 1 WHERE name = 'probe'").await.unwrap();
    let body = crate::support::batch(Some("other"), &samples[400..500]);
    let refused = client.post("assets/a/telemetry", &body).await;
    assert_eq!(refused.problem(500)["type"], "urn:offbd:problem:corrupt");
    client.telemetry("b", Some("s"), &samples[400..]).await;
    assert_eq!(client.get("/readyz").await.status, 200);
    client.post(&format!("sessions/{whole}/end"), &serde_json::Value::Null).await.expect(200);
    let (status, printed) = check(data.path());
    assert_eq!(status, Some(1), "{printed}");
    assert!(printed.contains("session: Tree"), "{printed}");
}

/// After a crash SQLite would take the log up to the damage and delete the rest.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_damaged_log_is_named_before_anything_is_lost() {
    if on_postgres() {
        return;
    }
    let data = tempfile::tempdir().unwrap();
    let samples = rig(2000, 1000);
    let process = Process::start(data.path());
    process.client.asset("a").await;
    for part in samples.chunks(100) {
        process.client.telemetry("a", Some("s"), part).await;
    }
    drop(process);
    let log = data.path().join("offbd.sqlite-wal");
    let whole = std::fs::read(&log).unwrap();
    let mut damaged = whole.clone();
    damaged[whole.len() / 8 * 7] ^= 1;
    std::fs::write(&log, &damaged).unwrap();
    let copy = data.path().join("copy").display().to_string();
    let commands: [&[&str]; 3] = [&["check"], &["backup", &copy], &["migrate"]];
    let run = |command: &[&str]| {
        let mut offbd = Command::new(env!("CARGO_BIN_EXE_offbd"));
        let (name, rest) = command.split_first().unwrap();
        let output = offbd.args([name, "--data"]).arg(data.path()).args(rest).output().unwrap();
        (output.status, String::from_utf8(output.stderr).unwrap())
    };
    let assert_refuses = |what: &str, status: ExitStatus, printed: &str| {
        assert_eq!(status.code(), Some(1), "{what}: {printed}");
        assert!(printed.contains("is damaged"), "{what}: {printed}");
        assert_eq!(std::fs::read(&log).unwrap(), damaged, "{what} leaves it as it is");
    };
    for command in commands {
        let (status, printed) = run(command);
        assert_refuses(command[0], status, &printed);
    }
    let Refusal { status, log: printed } = Process::try_start(data.path(), &[]).err().unwrap();
    assert_refuses("serve", status, &printed);
    let truncate = printed.split('`').nth(1).unwrap();
    // The whole log loses nothing, and the damaged one only what follows the damage.
    std::fs::write(&log, &whole).unwrap();
    let undamaged = tempfile::tempdir().unwrap();
    for end in ["", "-wal"] {
        let name = format!("offbd.sqlite{end}");
        std::fs::copy(data.path().join(&name), undamaged.path().join(&name)).unwrap();
    }
    let mut process = Process::start(undamaged.path());
    assert_eq!(process.client.recording("a", "s").await, samples);
    std::fs::write(&log, &damaged).unwrap();
    assert!(Command::new("sh").args(["-c", truncate]).status().unwrap().success());
    process = Process::start(data.path());
    let kept = process.client.recording("a", "s").await;
    assert!((100..2000).contains(&kept.len()), "{}", kept.len());
    assert_eq!(kept, samples[..kept.len()]);
    process.client.telemetry("a", Some("s"), &samples).await;
    assert_eq!(process.client.recording("a", "s").await, samples);
}
