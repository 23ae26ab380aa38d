//! Cold data: sessions whose samples have moved to files answer as before, to the bit; nothing
//! is lost or left over whenever the move is interrupted; damage is named.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use offbd::config::{ColdConfig, Config};
use offbd_core::vocabulary::Sample;
use serde_json::{Value, json};

use crate::support::deletions::{block_deletion, deletions, record_deletions, unblock_deletion};
use crate::support::process::Process;
use crate::support::{
    Client, ServiceFixture, config, connection, eventually, on_postgres, rig, url,
};

/// Moves every session as soon as it has ended.
fn set_cold(config: &mut Config, directory: &Path) {
    config.cold = Some(ColdConfig { directory: directory.to_owned(), after_days: Some(0) });
    config.retention.sweep_s = 1;
}

/// As [`set_cold`], for a process.
fn environment(directory: &Path) -> [(&str, &Path); 3] {
    [
        ("OFFBD_COLD__DIRECTORY", directory),
        ("OFFBD_COLD__AFTER_DAYS", Path::new("0")),
        ("OFFBD_RETENTION__SWEEP_S", Path::new("1")),
    ]
}

async fn record(client: &Client, asset: &str, name: &str, samples: &[Sample]) -> String {
    for part in samples.chunks(3000) {
        client.telemetry(asset, Some(name), part).await;
    }
    client.end(asset, name).await["id"].as_str().unwrap().to_owned()
}

/// Waits until the samples of `n` sessions are in files.
async fn wait_until_moved(data: &Path, n: i64) {
    let count = async |sql| -> i64 {
        let mut db = connection(&url(data)).await;
        sqlx::query_scalar(sql).fetch_one(&mut db).await.unwrap()
    };
    eventually(async || {
        let moved = count("SELECT COUNT(*) FROM cold_file WHERE moved_at IS NOT NULL").await;
        (moved == n).then_some(())
    })
    .await;
    let left = "SELECT COUNT(*) FROM chunk WHERE session IN (SELECT session FROM cold_file)";
    eventually(async || (count(left).await == 0).then_some(())).await;
}

/// All files below `directory`.
fn files(directory: &Path) -> Vec<PathBuf> {
    let (mut found, mut todo) = (Vec::new(), vec![directory.to_owned()]);
    while let Some(folder) = todo.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { todo.push(path) } else { found.push(path) }
        }
    }
    found.sort();
    found
}

/// The only file with `part` in its name.
fn file_of(directory: &Path, part: &str) -> PathBuf {
    let mut found = files(directory);
    found.retain(|file| file.to_str().unwrap().contains(part));
    assert_eq!(found.len(), 1, "{found:?}");
    found.remove(0)
}

/// The result of a job: without what differs between two equal ones.
async fn result(client: &Client, start: &str, body: &Value, jobs: &str) -> Value {
    let id = client.post(start, body).await.expect(202)["id"].as_str().unwrap().to_owned();
    let done = eventually(|| async {
        let job = client.get(&format!("{jobs}/{id}")).await.expect(200);
        (job["state"] == "done" || job["state"] == "failed").then_some(job)
    })
    .await;
    let result = &done["result"];
    json!([done["state"], done["error"], result["same"], result["summary"], result["faults"]])
}

/// What the service answers about the session `id` of the asset `a`.
async fn answers(client: &Client, id: &str, samples: &[Sample]) -> Vec<Value> {
    let (from_s, to_s) = (samples[samples.len() / 2].t_s, samples[samples.len() / 2 + 50].t_s);
    let mut found = Vec::new();
    for path in [
        "".to_owned(),
        "/telemetry".to_owned(),
        format!("/telemetry?from_s={from_s}&to_s={to_s}"),
        "/trace".to_owned(),
        format!("/trace?from_s={from_s}&to_s={to_s}"),
    ] {
        let answer = client.get(&format!("sessions/{id}{path}")).await;
        assert_eq!(answer.status, 200, "{path}: {}", answer.text);
        found.push(json!([path, answer.text]));
    }
    let replays = format!("sessions/{id}/replays");
    found.push(result(client, &replays, &json!({}), "replays").await);
    let calibrations = "assets/a/calibrations";
    found.push(result(client, calibrations, &json!({ "sessions": [id] }), calibrations).await);
    found
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn moved_sessions_answer_as_before() {
    let directory = tempfile::tempdir().unwrap();
    let mut fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    // More than one chunk, and one short one.
    let recordings = [rig(9000, 5000), rig(1500, 1500)];
    let mut before = Vec::new();
    for (name, samples) in ["long", "short"].iter().zip(&recordings) {
        let id = record(&fixture.client, "a", name, samples).await;
        before.push((id.clone(), answers(&fixture.client, &id, samples).await));
    }
    fixture.client.telemetry("a", Some("open"), &rig(300, 300)).await;
    set_cold(&mut fixture.config, directory.path());
    fixture.restart().await;
    wait_until_moved(fixture.data.path(), 2).await;
    for restarts in 0..2 {
        for ((id, before), samples) in before.iter().zip(&recordings) {
            let file = file_of(directory.path(), id);
            assert!(file.ends_with(format!("partition-00/{id}.parquet")) || on_postgres());
            let after = answers(&fixture.client, id, samples).await;
            for (after, before) in after.iter().zip(before) {
                assert_eq!(after, before, "after {restarts} more restarts");
            }
        }
        for (name, samples) in ["long", "short"].iter().zip(&recordings) {
            assert_eq!(fixture.client.recording("a", name).await, *samples);
        }
        assert_eq!(fixture.client.recording("a", "open").await, rig(300, 300));
        fixture.restart().await;
    }
    let metrics = fixture.client.get("/metrics").await.text;
    assert!(metrics.contains("offbd_cold_failures_total 0"), "{metrics}");
    let cold = fixture.config.cold_directory();
    let location = fixture.config.location().unwrap();
    let report = offbd::store::check(&location, cold.as_ref()).await.unwrap();
    assert_eq!(report.findings, [""; 0]);
    assert!(report.n_samples >= 10_800, "{}", report.n_samples);
}

/// Records a session of twenty chunks, which are more than are deleted in one transaction.
async fn record_twenty_chunks(client: &Client, data: &Path) -> (String, Vec<Sample>) {
    client.asset("a").await;
    let samples = rig(20 * 2048, usize::MAX);
    for part in samples.chunks(2048) {
        client.telemetry("a", Some("long"), part).await;
    }
    let id = client.end("a", "long").await["id"].as_str().unwrap().to_owned();
    assert_eq!(n_chunks(data).await, 20);
    (id, samples)
}

async fn n_chunks(data: &Path) -> i64 {
    let mut db = connection(&url(data)).await;
    sqlx::query_scalar("SELECT COUNT(*) FROM chunk").fetch_one(&mut db).await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_chunks_of_a_long_session_leave_in_parts() {
    let (data, directory) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let process = Process::start(data.path());
    let (_, samples) = record_twenty_chunks(&process.client, data.path()).await;
    drop(process);
    record_deletions(data.path()).await;
    let process = Process::start_with(data.path(), &environment(directory.path()));
    wait_until_moved(data.path(), 1).await;
    assert_eq!(deletions(data.path()).await, (20, 16));
    assert_eq!(process.client.recording("a", "long").await, samples);
}

/// The state that a kill between the parts of a move leaves.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_session_that_has_lost_a_part_of_its_chunks_answers_as_before() {
    let (data, directory) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let process = Process::start(data.path());
    let (id, samples) = record_twenty_chunks(&process.client, data.path()).await;
    let before = answers(&process.client, &id, &samples).await;
    drop(process);
    block_deletion(data.path(), 18 * 2048).await;
    let environment = environment(directory.path());
    // Twice: a start changes nothing while the deletion is refused.
    for _ in 0..2 {
        let process = Process::start_with(data.path(), &environment);
        eventually(async || process.log().contains("are deleted later").then_some(())).await;
        assert_eq!(n_chunks(data.path()).await, 4);
        let after = answers(&process.client, &id, &samples).await;
        for (after, before) in after.iter().zip(&before) {
            assert_eq!(after, before);
        }
        check_half_moved(data.path(), directory.path()).await;
    }
    // What was compared before is no reason to delete anything if the file is another one.
    let file = file_of(directory.path(), &id);
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[1..]).unwrap();
    unblock_deletion(data.path()).await;
    let process = Process::start_with(data.path(), &environment);
    eventually(async || process.log().contains("chunks of a moved session are kept").then_some(()))
        .await;
    assert_eq!(n_chunks(data.path()).await, 4);
    std::fs::write(&file, &whole).unwrap();
    eventually(async || (n_chunks(data.path()).await == 0).then_some(())).await;
    assert_eq!(process.client.recording("a", "long").await, samples);
}

/// Checks the database of a session that has moved in part, and a backup of it.
async fn check_half_moved(data: &Path, directory: &Path) {
    let mut config = config(data);
    set_cold(&mut config, directory);
    let (location, cold) = (config.location().unwrap(), config.cold_directory());
    let report = offbd::store::check(&location, cold.as_ref()).await.unwrap();
    assert_eq!((report.findings, report.n_samples), (vec![], 20 * 2048));
    if !on_postgres() {
        let copy = data.join("copy");
        let output = offbd("backup", data, Some(directory), &[&copy]);
        assert!(output.status.success(), "{output:?}");
        std::fs::remove_file(copy).unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_retransmission_after_a_part_of_the_chunks_has_left_is_recognised() {
    let (data, directory) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let process = Process::start(data.path());
    process.client.asset("a").await;
    let samples = rig(20 * 2048, usize::MAX);
    let mut name = None;
    for part in samples.chunks(2048) {
        name = Some(process.client.telemetry("a", None, part).await["session"].clone());
    }
    let name = name.as_ref().and_then(Value::as_str).unwrap();
    process.client.end("a", name).await;
    drop(process);
    block_deletion(data.path(), 18 * 2048).await;
    let process = Process::start_with(data.path(), &environment(directory.path()));
    eventually(async || process.log().contains("are deleted later").then_some(())).await;
    // Of chunks that have left and of some that have not.
    for part in [&samples[..100], &samples[samples.len() - 100..]] {
        let ack = process.client.telemetry("a", None, part).await;
        assert_eq!((&ack["duplicate"], &ack["session"]), (&json!(100), &json!(name)), "{ack}");
    }
    assert_eq!(process.client.recording("a", name).await, samples);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_retransmission_of_a_moved_session_is_recognised() {
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start_with(|config| set_cold(config, directory.path())).await;
    fixture.client.asset("a").await;
    let samples = rig(1500, 1500);
    let ack = fixture.client.telemetry("a", None, &samples).await;
    let name = ack["session"].as_str().unwrap();
    fixture.client.end("a", name).await;
    wait_until_moved(fixture.data.path(), 1).await;
    let ack = fixture.client.telemetry("a", None, &samples[..100]).await;
    assert_eq!((&ack["duplicate"], &ack["session"]), (&json!(100), &json!(name)), "{ack}");
    assert_eq!(fixture.client.recording("a", name).await, samples);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_damaged_or_missing_file_is_named_and_the_others_are_served() {
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start_with(|config| set_cold(config, directory.path())).await;
    let client = &fixture.client;
    client.asset("a").await;
    let samples = rig(1500, 1500);
    let bad = record(client, "a", "bad", &samples).await;
    record(client, "a", "good", &samples).await;
    wait_until_moved(fixture.data.path(), 2).await;
    let (file, location) = (file_of(directory.path(), &bad), fixture.config.location().unwrap());
    let cold = fixture.config.cold_directory();
    let findings = async || offbd::store::check(&location, cold.as_ref()).await.unwrap().findings;
    let refused = async |reason: &str| {
        let problem = client.get(&format!("sessions/{bad}/trace")).await.problem(500);
        assert_eq!(problem["type"], "urn:offbd:problem:corrupt");
        let replay =
            result(client, &format!("sessions/{bad}/replays"), &json!({}), "replays").await;
        let error = replay[1].as_str().unwrap();
        assert!(error.contains(reason) && error.contains(&bad), "{replay}");
        let found = findings().await;
        assert!(found.len() == 1 && found[0].contains(&bad), "{found:?}");
        assert!(found[0].contains(reason), "{found:?}");
        assert_eq!(client.recording("a", "good").await, samples);
    };
    let whole = std::fs::read(&file).unwrap();
    // One bit in each of 8 places.
    for place in 0..8 {
        let mut changed = whole.clone();
        changed[place * whole.len() / 8] ^= 1 << place;
        std::fs::write(&file, changed).unwrap();
        refused("is damaged").await;
    }
    std::fs::write(&file, &whole[..whole.len() - 1]).unwrap();
    refused("is damaged").await;
    std::fs::remove_file(&file).unwrap();
    refused("is missing").await;
    std::fs::write(&file, &whole).unwrap();
    assert_eq!(findings().await, [""; 0]);
    assert_eq!(client.recording("a", "bad").await, samples);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_service_that_is_killed_while_it_moves_loses_nothing_and_leaves_nothing() {
    let (data, directory) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let samples = rig(1500, 500);
    let names = ["1", "2", "3", "4", "5", "6"];
    let process = Process::start(data.path());
    process.client.asset("a").await;
    for name in names {
        record(&process.client, "a", name, &samples).await;
    }
    drop(process);
    let environment = environment(directory.path());
    // Killed as soon as there is another file, complete or not.
    for n in 0..names.len() {
        let process = Process::start_with(data.path(), &environment);
        eventually(|| async { (files(directory.path()).len() > n).then_some(()) }).await;
        drop(process);
    }
    let process = Process::start_with(data.path(), &environment);
    wait_until_moved(data.path(), names.len() as i64).await;
    let mut db = connection(&url(data.path())).await;
    let paths: Vec<String> =
        sqlx::query_scalar("SELECT path FROM cold_file").fetch_all(&mut db).await.unwrap();
    let mut recorded: Vec<_> = paths.iter().map(|path| directory.path().join(path)).collect();
    recorded.sort();
    assert_eq!(files(directory.path()), recorded);
    for name in names {
        assert_eq!(process.client.recording("a", name).await, samples, "session {name}");
    }
}

/// The state that a kill between the rename and the commit leaves, and one while writing.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_an_interrupted_move_left_is_replaced() {
    let directory = tempfile::tempdir().unwrap();
    let mut fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let samples = rig(1500, 1500);
    let mut db = fixture.store().await;
    for name in ["written", "partial"] {
        let id = record(&fixture.client, "a", name, &samples).await;
        let path = format!("2026-01-31/partition-00/{id}.parquet");
        sqlx::query(
            "INSERT INTO cold_file (session, asset, attempt, path, bytes, checksum)
             VALUES ($1, 'a', 1, $2, 0, '')",
        )
        .bind(&id)
        .bind(&path)
        .execute(&mut db)
        .await
        .unwrap();
        let end = if name == "partial" { ".part" } else { "" };
        let file = directory.path().join(format!("{path}{end}"));
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, "not a recording").unwrap();
    }
    assert_eq!(fixture.client.recording("a", "written").await, samples);
    set_cold(&mut fixture.config, directory.path());
    fixture.restart().await;
    wait_until_moved(fixture.data.path(), 2).await;
    for name in ["written", "partial"] {
        assert_eq!(fixture.client.recording("a", name).await, samples);
    }
    let left = files(directory.path());
    assert_eq!(left.len(), 2, "{left:?}");
    assert!(left.iter().all(|file| file.to_str().unwrap().ends_with("-2.parquet")), "{left:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_files_of_deleted_sessions_and_assets_are_removed() {
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start_with(|config| set_cold(config, directory.path())).await;
    let client = &fixture.client;
    for asset in ["a", "b"] {
        client.asset(asset).await;
    }
    let samples = rig(500, 500);
    let first = record(client, "a", "first", &samples).await;
    let second = record(client, "a", "second", &samples).await;
    record(client, "b", "third", &samples).await;
    wait_until_moved(fixture.data.path(), 3).await;
    client.delete(&format!("sessions/{first}")).await.expect(204);
    client.delete("assets/b").await.expect(204);
    eventually(|| async { (files(directory.path()).len() == 1).then_some(()) }).await;
    file_of(directory.path(), &second);
    wait_until_moved(fixture.data.path(), 1).await;
    client.get(&format!("sessions/{first}/telemetry")).await.expect(404);
    assert_eq!(client.recording("a", "second").await, samples);
}

fn offbd(command: &str, data: &Path, cold: Option<&Path>, rest: &[&Path]) -> Output {
    let mut offbd = Command::new(env!("CARGO_BIN_EXE_offbd"));
    offbd.args([command, "--data"]).arg(data).args(rest);
    offbd.envs(cold.map(|cold| ("OFFBD_COLD__DIRECTORY", cold)));
    offbd.output().unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_backup_has_the_samples_of_the_files() {
    if on_postgres() {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start_with(|config| set_cold(config, directory.path())).await;
    fixture.client.asset("a").await;
    let samples = rig(9000, 5000);
    record(&fixture.client, "a", "s", &samples).await;
    wait_until_moved(fixture.data.path(), 1).await;
    let (data, cold) = (fixture.data.path(), Some(directory.path()));
    let copy = data.join("copy");
    let text = |output: &Output| {
        String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
    };
    for (command, rest) in [("backup", &[&*copy][..]), ("check", &[])] {
        let output = offbd(command, data, None, rest);
        assert!(!output.status.success(), "{command}");
        assert!(text(&output).contains("cold.directory"), "{}", text(&output));
        let output = offbd(command, data, cold, rest);
        assert!(output.status.success(), "{command}: {}", text(&output));
    }
    let elsewhere = tempfile::tempdir().unwrap();
    let restored = offbd("restore", elsewhere.path(), None, &[&copy]);
    assert!(restored.status.success(), "{}", text(&restored));
    let location = config(elsewhere.path()).location().unwrap();
    let report = offbd::store::check(&location, None).await.unwrap();
    assert_eq!((report.findings.len(), report.n_samples), (0, samples.len() as u64));
    let process = Process::start(elsewhere.path());
    assert_eq!(process.client.recording("a", "s").await, samples);
    assert_eq!(files(directory.path()).len(), 1);
}

#[test]
fn a_directory_that_is_not_there_is_refused_at_the_start() {
    if on_postgres() {
        return;
    }
    let data = tempfile::tempdir().unwrap();
    let missing = data.path().join("not mounted");
    let refused = Process::try_start(data.path(), &[("OFFBD_COLD__DIRECTORY", &missing)]);
    let log = refused.err().unwrap().log;
    assert!(log.contains("cold.directory"), "{log}");
}
