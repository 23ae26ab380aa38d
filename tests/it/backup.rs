//! A backup made under load is complete, and a service can continue from it.

use std::path::Path;
use std::process::{Command, Output};

use crate::support::device::{ServiceLink, device};
use crate::support::process::Process;
use crate::support::{judged, rig};
use serde_json::Value;

fn offbd(command: &str, data: &Path, rest: &[&Path]) -> Output {
    let mut offbd = Command::new(env!("CARGO_BIN_EXE_offbd"));
    offbd.args([command, "--data"]).arg(data).args(rest).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_backup_made_under_load_can_be_restored() {
    let data = tempfile::tempdir().unwrap();
    let process = Process::start(data.path());
    let link = ServiceLink::to(&process.client);
    let devices: Vec<_> =
        ["d", "e"].iter().map(|name| device(&link, name, true, data.path(), None)).collect();
    for n in 0..4 {
        link.wait_for_samples(700).await;
        let n_acknowledged = link.acknowledged();
        let elsewhere = tempfile::tempdir().unwrap();
        let copy = data.path().join(format!("copy-{n}"));
        let made = offbd("backup", data.path(), &[&copy]);
        assert!(made.status.success(), "{}", text(&made.stderr));
        let restored = offbd("restore", elsewhere.path(), &[&copy]);
        assert!(restored.status.success(), "{}", text(&restored.stderr));
        check_restored(elsewhere.path(), n_acknowledged).await;
    }
    link.stop_devices();
    for device in devices {
        device.await.unwrap();
    }
}

/// Checks that the store restored to `data` has every acknowledged sample, and that its open
/// sessions can be continued.
async fn check_restored(data: &Path, n_acknowledged: u64) {
    let samples = rig(1500, 500);
    let restored = Process::start(data);
    let client = &restored.client;
    let page = client.get("sessions?limit=500").await.expect(200);
    let sessions = page["items"].as_array().unwrap();
    let n: u64 = sessions.iter().map(|s| s["samples"].as_u64().unwrap()).sum();
    assert!(n >= n_acknowledged, "{n} of {n_acknowledged}");
    for session in sessions {
        let asset = session["asset"].as_str().unwrap();
        let recording = client.recording(asset, "s").await;
        assert_eq!(recording, samples[..recording.len()]);
        if session["state"] == "open" {
            for part in samples.chunks(100) {
                client.telemetry(asset, Some("s"), part).await;
            }
            let ended = client.end(asset, "s").await;
            assert_eq!(ended["verdict"]["verdict_hash"], judged(asset, &samples).0);
        }
        let end = client.session(asset, "s").await;
        assert_eq!(end["samples"], Value::from(samples.len()));
    }
}

/// Returns the range of bytes of an index in the database file, which is not read when the
/// database is opened.
async fn page_of_an_index(file: &Path) -> std::ops::Range<usize> {
    let mut store = crate::support::connection(&format!("sqlite://{}", file.display())).await;
    let (root, size): (i64, i64) = sqlx::query_as(
        "SELECT rootpage, page_size FROM sqlite_master, pragma_page_size
         WHERE name = 'session_by_opening'",
    )
    .fetch_one(&mut store)
    .await
    .unwrap();
    let (root, size) = (usize::try_from(root).unwrap(), usize::try_from(size).unwrap());
    (root - 1) * size..root * size
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_failed_restore_changes_nothing() {
    let data = tempfile::tempdir().unwrap();
    let copy = data.path().join("copy");
    let samples = rig(300, 300);
    {
        let process = Process::start(data.path());
        process.client.asset("a").await;
        process.client.telemetry("a", Some("s"), &samples).await;
        assert!(offbd("backup", data.path(), &[&copy]).status.success());
        let again = offbd("backup", data.path(), &[&copy]);
        assert!(text(&again.stderr).contains("already exists"), "{again:?}");
        let used = offbd("restore", data.path(), &[&copy, Path::new("--replace")]);
        assert!(text(&used.stderr).contains("another process uses"), "{used:?}");
    }
    let there = offbd("restore", data.path(), &[&copy]);
    assert!(text(&there.stderr).contains("without --replace: "), "{there:?}");
    let whole = std::fs::read(&copy).unwrap();
    let mut damaged = whole.clone();
    let page = page_of_an_index(&copy).await;
    damaged[page].fill(0x55);
    let bad = data.path().join("bad");
    for wrong in [&damaged[..], b"no database", &whole[..whole.len() / 2]] {
        std::fs::write(&bad, wrong).unwrap();
        let refused = offbd("restore", data.path(), &[&bad, Path::new("--replace")]);
        assert!(!refused.status.success(), "{refused:?}");
    }
    let process = Process::start(data.path());
    assert_eq!(process.client.recording("a", "s").await, samples);
    process.client.telemetry("a", Some("later"), &samples).await;
    drop(process);
    let replaced = offbd("restore", data.path(), &[&copy, Path::new("--replace")]);
    assert!(replaced.status.success(), "{}", text(&replaced.stderr));
    assert!(data.path().join("offbd.sqlite.replaced").exists());
    let process = Process::start(data.path());
    let page = process.client.get("sessions?asset=a").await.expect(200);
    assert_eq!(page["items"].as_array().unwrap().len(), 1, "{page}");
    assert_eq!(process.client.recording("a", "s").await, samples);
}

#[test]
fn backup_of_a_postgresql_database_refers_to_pg_dump() {
    let data = tempfile::tempdir().unwrap();
    let copy = data.path().join("copy");
    let asked = offbd("backup", data.path(), &[&copy, Path::new("--database=postgres://h/d")]);
    assert!(text(&asked.stderr).contains("pg_dump"), "{asked:?}");
}
