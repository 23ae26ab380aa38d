//! `kill -9` during operation: every acknowledged sample and every fault is stored once, and
//! the verdict equals that of an uninterrupted run.

use std::path::Path;

use crate::support::device::{Random, ServiceLink, device};
use crate::support::process::{Process, ended, program};
use crate::support::{connection, eventually, judged, on_postgres, rig, url};
use serde_json::json;
use sqlx::Executor;

/// Number of kills, unless the environment variable KILLS is set.
const KILLS: usize = 10;

/// Size limits of the journal, used in turn: every commit is folded; a few batches fit;
/// everything fits.
const JOURNAL_BYTES: [&str; 3] = ["1", "20000", "16777216"];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn killed_many_times_under_load_the_service_loses_no_acknowledged_sample() {
    let n_kills = std::env::var("KILLS").map_or(KILLS, |n| n.parse().unwrap());
    let data = tempfile::tempdir().unwrap();
    let start = |bytes: &str| {
        Process::start_with(data.path(), &[("OFFBD_LIMITS__JOURNAL_BYTES", Path::new(bytes))])
    };
    let mut process = start(JOURNAL_BYTES[0]);
    let link = ServiceLink::to(&process.client);
    let devices = [("numbered", true), ("unnumbered", false), ("numbered-too", true)]
        .map(|(name, numbers)| device(&link, name, numbers, data.path(), None));
    let mut random = Random(1);
    for kill in 0..n_kills {
        link.wait_for_samples(random.below(600) as u64).await;
        drop(process);
        if kill % 5 == 4 {
            Process::start_and_kill(data.path(), random.below(60_000) as u64);
        }
        process = start(JOURNAL_BYTES[kill % JOURNAL_BYTES.len()]);
        link.set_service(&process.client);
    }
    link.stop_devices();
    let mut laps = 0;
    for device in devices {
        laps += device.await.unwrap();
    }
    println!(
        "{n_kills} kills under load, {} at start; {laps} recordings, {} samples: each stored once",
        n_kills / 5,
        link.acknowledged()
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_killed_service_continues_open_sessions_without_loss() {
    let data = tempfile::tempdir().unwrap();
    let samples = rig(4000, 1200);
    let (hash, faults) = judged("a", &samples);
    assert!(faults.contains(&"x_servo".to_owned()), "{faults:?}");

    let mut process = Process::start(data.path());
    process.client.asset("a").await;
    for (i, part) in samples.chunks(40).enumerate() {
        process.client.telemetry("a", Some("s"), part).await;
        if i == 20 || i == 45 || i == 70 {
            let known = process.client.get("assets/a/faults?status=all").await.expect(200);
            let state = process.client.get("assets/a/state").await.expect(200);
            // A batch whose acknowledgement is not read: it may be lost or not.
            let (client, unread) = (
                process.client.clone(),
                crate::support::batch(Some("s"), &samples[(i + 1) * 40..][..40]),
            );
            let sending = tokio::spawn(async move {
                let request = client.request(reqwest::Method::POST, "assets/a/telemetry");
                let _ = request.json(&unread).send().await;
            });
            drop(process);
            sending.await.unwrap();
            process = Process::start(data.path());
            let acknowledged = (i + 1) * 40;
            let recording = process.client.recording("a", "s").await;
            assert!([acknowledged, acknowledged + 40].contains(&recording.len()));
            assert_eq!(recording, samples[..recording.len()]);
            if recording.len() == acknowledged {
                // Loads the engine, whose monitors are known again then.
                process.client.load("a").await;
                assert_eq!(process.client.get("assets/a/state").await.expect(200), state);
                let again = process.client.get("assets/a/faults?status=all").await.expect(200);
                assert_eq!(again, known);
            }
        }
    }
    let events = process.client.get("sessions?asset=a").await.expect(200);
    assert_eq!(events["items"].as_array().unwrap().len(), 1);
    let session = process.client.end("a", "s").await;
    assert_eq!(session["verdict"]["verdict_hash"], hash);
    assert_eq!(session["verdict"]["faults"], json!(faults));
    assert_eq!(process.client.recording("a", "s").await, samples);
}

/// Commits that are in the write-ahead log only might be lost with a log that could not be
/// written, and with them all later ones.
#[cfg(unix)]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_start_waits_until_the_whole_log_is_in_the_database_file() {
    if on_postgres() {
        return;
    }
    let data = tempfile::tempdir().unwrap();
    let process = Process::start(data.path());
    process.client.asset("a").await;
    let samples = rig(500, 500);
    process.client.telemetry("a", Some("s"), &samples[..300]).await;
    // Another program reads the database as it is now.
    let mut reader = connection(&url(data.path())).await;
    for sql in ["BEGIN", "SELECT * FROM asset"] {
        reader.execute(sql).await.unwrap();
    }
    process.client.telemetry("a", Some("s"), &samples[300..]).await;
    drop(process);
    let waiting = async || {
        let starting = Process::begin(&program(), data.path(), &[]);
        eventually(async || starting.log().contains("waits to be copied").then_some(())).await;
        assert!(!starting.log().contains("serving"), "{}", starting.log());
        starting
    };
    let status = waiting().await.stop().await;
    assert!(status.success(), "{status}");
    let starting = waiting().await;
    reader.execute("ROLLBACK").await.unwrap();
    let process = starting.served().unwrap();
    assert_eq!(process.client.recording("a", "s").await, samples);
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn sigterm_stops_the_service_without_loss() {
    let data = tempfile::tempdir().unwrap();
    let mut process = Process::start(data.path());
    process.client.asset("a").await;
    let samples = rig(500, 500);
    process.client.telemetry("a", Some("s"), &samples).await;
    process.terminate();
    let status = ended(&mut process.child).await;
    assert!(status.success(), "{status}");
    process = Process::start(data.path());
    assert_eq!(process.client.recording("a", "s").await, samples);
}
