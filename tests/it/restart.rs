//! After a restart the engine of an open session goes on where it was: from a snapshot, or
//! else from the recording, while the other assets are served.

use crate::support::process::Process;
use crate::support::{
    Client, batch, columns, connection, eventually, on_postgres, read_csv, rig, url,
};
use offbd_core::vocabulary::Sample;
use serde_json::{Value, json};
use sqlx::{AnyConnection, AssertSqlSafe, Executor};
use tempfile::TempDir;

/// Samples that a batch of a test has.
const BATCH: usize = 5000;

/// Returns a recording of `n` samples that is long for a test, and quickly made: the same
/// session again and again, in which the x servo dies, on a clock that goes on.
fn long_rig(n: usize) -> Vec<Sample> {
    let one = rig(20_000, 15_000);
    let sample = |i: usize| {
        let sample = one[i % one.len()];
        Sample { seq: Some(i as u64), t_s: i as f64 * 0.01, ..sample }
    };
    (0..n).map(sample).collect()
}

async fn send(client: &Client, asset: &str, samples: &[Sample]) {
    for part in samples.chunks(BATCH) {
        client.telemetry(asset, Some("s"), part).await;
    }
}

/// Ends session `s` of `asset`; returns its verdict hash and its transitions.
async fn outcome(client: &Client, asset: &str) -> (Value, Value) {
    let session = client.end(asset, "s").await;
    let id = session["id"].as_str().unwrap();
    let mut faults = client.get(&format!("sessions/{id}/faults?limit=500")).await.expect(200);
    for fault in faults["items"].as_array_mut().unwrap() {
        for of_this_asset in ["id", "asset", "session_id", "at", "noted_at"] {
            fault.as_object_mut().unwrap().remove(of_this_asset);
        }
    }
    (session["verdict"]["verdict_hash"].clone(), faults["items"].clone())
}

/// Kills the service, executes `sql` in its store, and starts it again.
async fn restart_after(service: Process, data: &TempDir, sql: &'static str) -> Process {
    drop(service);
    let mut store = connection(&url(data.path())).await;
    store.execute(AssertSqlSafe(sql)).await.unwrap();
    drop(store);
    Process::start(data.path())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_engine_goes_on_from_its_snapshot() {
    let data = tempfile::tempdir().unwrap();
    let mut service = Process::start(data.path());
    let samples = long_rig(45_000);
    service.client.asset("a").await;
    // With actions before and after the snapshot, and at its very sample.
    for (from, to) in [(0, 20_000), (20_000, 35_000), (35_000, 45_000)] {
        send(&service.client, "a", &samples[from..to]).await;
        service.client.delete("assets/a/faults/x_servo").await.expect(204);
        if to < 45_000 {
            drop(service);
            service = Process::start(data.path());
            assert_eq!(service.client.n_evaluated_again().await, 0.0, "nobody has asked yet");
            service.client.load("a").await;
            let n = service.client.n_evaluated_again().await;
            assert!(n < 16_384.0 + BATCH as f64, "{n}");
        }
    }
    let client = &service.client;
    let live = outcome(client, "a").await;
    assert!(live.1.as_array().unwrap().len() > 1, "{live:?}");
    // Without a snapshot, the recording is evaluated from its start.
    let id = client.session("a", "s").await["id"].as_str().unwrap().to_owned();
    let replay = client.post(&format!("sessions/{id}/replays"), &json!({})).await.expect(202);
    let path = format!("replays/{}", replay["id"].as_str().unwrap());
    let replayed = loop {
        let replay = client.get(&path).await.expect(200);
        if replay["state"] == "done" {
            break replay;
        }
        assert_ne!(replay["state"], "failed", "{replay}");
    };
    assert_eq!(replayed["result"]["summary"]["verdict_hash"], live.0, "{replayed}");
}

/// A question about a rig loads no engine: until another request does, what it shows is that of
/// the last snapshot, with its time.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_query_shows_the_last_stored_state_and_loads_no_engine() {
    let data = tempfile::tempdir().unwrap();
    let mut service = Process::start(data.path());
    let samples = long_rig(24_000);
    let last_t_s = samples.last().map(|sample| sample.t_s).unwrap();
    service.client.asset("a").await;
    send(&service.client, "a", &samples).await;
    let monitor = async |client: &Client| {
        client.get("assets/a/faults/x_servo").await.expect(200)["monitor"].clone()
    };
    let live = monitor(&service.client).await;
    assert_eq!(live["t_s"], last_t_s, "{live}");

    drop(service);
    service = Process::start(data.path());
    let client = &service.client;
    let stored = monitor(client).await;
    assert!(stored["t_s"].as_f64().is_some_and(|t_s| 0.0 < t_s && t_s < last_t_s), "{stored}");
    let all = client.get("assets/a/faults?status=all").await.expect(200);
    assert_eq!(all["items"][0]["monitor"]["t_s"], stored["t_s"], "{all}");
    let state = client.get("assets/a/state").await.expect(200);
    assert_eq!((&state["t_s"], &state["samples"]), (&stored["t_s"], &json!(samples.len())));
    assert!((1..samples.len() as u64).contains(&state["judged"].as_u64().unwrap()), "{state}");
    assert_eq!(state["monitors"].as_array().unwrap().len(), 4, "{state}");
    let learning = client.get("assets/a/learning").await.expect(200);
    assert_eq!(learning["t_s"], stored["t_s"], "{learning}");
    assert_eq!(client.n_engines().await, 0.0);
    assert_eq!(client.n_evaluated_again().await, 0.0, "no engine is loaded");

    client.load("a").await;
    assert_eq!(monitor(client).await, live);
    assert_eq!(client.get("assets/a/state").await.expect(200)["t_s"], last_t_s);
}

/// A snapshot that cannot be used costs time, and changes nothing.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_snapshot_that_is_damaged_or_of_another_version_is_not_used() {
    let data = tempfile::tempdir().unwrap();
    let mut service = Process::start(data.path());
    let samples = long_rig(30_000);
    service.client.asset("a").await;
    service.client.asset("b").await;
    let (first, rest) = samples.split_at(20_000);
    send(&service.client, "b", &samples).await;
    let expected = outcome(&service.client, "b").await;
    let damage = if on_postgres() {
        "UPDATE snapshot SET data = set_byte(data, 700, get_byte(data, 700) # 4)"
    } else {
        "UPDATE snapshot SET data =
         CAST(substr(data, 1, 700) || x'f1' || substr(data, 702) AS BLOB)"
    };
    let spoil = [damage, "UPDATE snapshot SET version = '0.0'"];
    send(&service.client, "a", first).await;
    for sql in spoil {
        service = restart_after(service, &data, sql).await;
        let fault = service.client.get("assets/a/faults/x_servo").await.expect(200);
        assert_eq!((&fault["monitor"], &fault["session_open"]), (&Value::Null, &json!(true)));
        let state = service.client.get("assets/a/state").await.expect(200);
        assert_eq!((&state["samples"], &state["judged"]), (&json!(20_000), &json!(0)));
        assert_eq!((&state["monitors"], &state["t_s"]), (&json!([]), &Value::Null));
        service.client.load("a").await;
        let n = service.client.n_evaluated_again().await;
        assert_eq!(n, 20_000.0, "{sql}");
    }
    send(&service.client, "a", rest).await;
    assert_eq!(outcome(&service.client, "a").await, expected);
}

/// The scrub names what is damaged, and replaces an engine that differs from its recording.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_scrub_finds_damaged_recordings_and_engines_that_differ() {
    let data = tempfile::tempdir().unwrap();
    let service = Process::start(data.path());
    let samples = long_rig(30_000);
    for asset in ["damaged", "live", "through"] {
        service.client.asset(asset).await;
        send(&service.client, asset, &samples[..20_000]).await;
    }
    service.client.end("damaged", "s").await;
    send(&service.client, "through", &samples[20_000..]).await;
    let expected = outcome(&service.client, "through").await;
    let live = service.client.session("live", "s").await["id"].as_str().unwrap().to_owned();
    drop(service);
    let mut store = connection(&url(data.path())).await;
    put_off_by_one(&mut store, &live).await;
    let damage = "DELETE FROM chunk WHERE first_index > 0 AND session IN
                  (SELECT id FROM session WHERE asset = 'damaged')";
    store.execute(damage).await.unwrap();
    drop(store);
    let service = Process::start(data.path());
    service.client.load("live").await;
    eventually(|| async {
        let text = service.client.get("/metrics").await.text;
        let found =
            |kind| text.contains(&format!("offbd_scrub_findings_total{{kind=\"{kind}\"}} 1"));
        (found("recording") && found("engine")).then_some(())
    })
    .await;
    send(&service.client, "live", &samples[20_000..]).await;
    assert_eq!(outcome(&service.client, "live").await, expected);
}

/// The scrub judges one in 16 ended sessions again, if this version has judged them.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_scrub_finds_verdicts_that_differ() {
    let data = tempfile::tempdir().unwrap();
    let mut service = Process::start(data.path());
    service.client.asset("a").await;
    let samples = long_rig(600);
    for name in 0..16 {
        service.client.telemetry("a", Some(&name.to_string()), &samples).await;
    }
    service.client.end("a", "15").await;
    let wrong_hash = "UPDATE session SET verdict_hash = 'x' || substr(verdict_hash, 2)";
    let by_another = r#"UPDATE session SET
        verdict = REPLACE(verdict, '"judged_by":"', '"judged_by":"9')"#;
    let by_this = r#"UPDATE session SET
        verdict = REPLACE(verdict, '"judged_by":"9', '"judged_by":"')"#;
    for (damage, n_found) in [("SELECT 1", 0), (by_another, 0), (wrong_hash, 0), (by_this, 1)] {
        service = restart_after(service, &data, damage).await;
        let text = eventually(|| async {
            let text = service.client.get("/metrics").await.text;
            let series = |name: &str| {
                let line = text.lines().find_map(|line| line.strip_prefix(name));
                line.map_or(0, |n| n.trim().parse::<u32>().unwrap())
            };
            let found = series("offbd_scrub_findings_total{kind=\"verdict\"}");
            (series("offbd_scrub_sessions_total") + found == 16).then_some(text)
        })
        .await;
        let found = format!("offbd_scrub_findings_total{{kind=\"verdict\"}} {n_found}\n");
        assert!(text.contains(&found), "after {damage}: {text}");
    }
}

/// Stores the snapshot of `session` as one after a sample less, with a valid checksum.
async fn put_off_by_one(store: &mut AnyConnection, session: &str) {
    let select = "SELECT n_samples, version, data FROM snapshot WHERE session = $1";
    let (n, version, data): (i64, String, Vec<u8>) =
        sqlx::query_as(select).bind(session).fetch_one(&mut *store).await.unwrap();
    let mut hasher = crc32fast::Hasher::new();
    for part in [session.as_bytes(), &(n - 1).to_le_bytes(), version.as_bytes(), &data[4..]] {
        hasher.update(part);
    }
    let data = [&hasher.finalize().to_le_bytes(), &data[4..]].concat();
    sqlx::query("UPDATE snapshot SET n_samples = n_samples - 1, data = $2 WHERE session = $1")
        .bind(session)
        .bind(data)
        .execute(store)
        .await
        .unwrap();
}

/// While the engine of one asset is rebuilt from a long recording, the others are served.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_long_recording_holds_up_only_its_own_asset() {
    let data = tempfile::tempdir().unwrap();
    let mut service = Process::start(data.path());
    let samples = long_rig(300_000);
    for asset in ["long", "other"] {
        service.client.asset(asset).await;
    }
    send(&service.client, "long", &samples[..299_000]).await;
    service = restart_after(service, &data, "DELETE FROM snapshot").await;
    let client = &service.client;
    let body = batch(Some("s"), &samples[299_000..]);
    let refused = client.post("assets/long/telemetry", &body).await;
    let problem = refused.problem(503);
    assert_eq!(problem["type"], "urn:offbd:problem:rebuilding", "{problem}");
    assert!(refused.headers.contains_key("retry-after"));
    client.telemetry("other", None, &samples[..100]).await;
    client.get("/readyz").await.expect(200);
    client.get("fleet").await.expect(200);
    let ack = loop {
        let answer = client.post("assets/long/telemetry", &body).await;
        if answer.status == 200 {
            break answer.json();
        }
        assert_eq!(answer.problem(503)["type"], "urn:offbd:problem:rebuilding");
    };
    assert_eq!(ack["accepted"], 1000, "{ack}");
    assert_eq!(client.get("/readyz").await.expect(200)["rebuilding"], 0);
    // The rebuilt engine has left a snapshot.
    drop(service);
    let service = Process::start(data.path());
    service.client.load("long").await;
    let n = service.client.n_evaluated_again().await;
    assert!(n < 20_000.0, "{n}");
}

/// A stretch of a recording that is too long to be evaluated as a whole can be looked at,
/// exported and learnt from, with the same result as from the start.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stretch_of_a_long_recording_is_served_by_itself() {
    const N: usize = 2_100_000;
    let data = tempfile::tempdir().unwrap();
    let mut service = Process::start(data.path());
    service.client.asset("a").await;
    // Columns in MessagePack are the fastest way in.
    let samples = long_rig(N);
    for part in samples.chunks(10_000) {
        let batch = columns("s", part);
        service.client.post_packed("assets/a/telemetry", &batch).await.expect(200);
    }
    let id = service.client.end("a", "s").await["id"].as_str().unwrap().to_owned();
    let client = &service.client;
    let whole = client.get(&format!("sessions/{id}/trace")).await;
    assert_eq!(whole.problem(413)["type"], "urn:offbd:problem:too-large");
    // Late, so that from the start it would be too much; and early, to compare.
    let late = client.get(&format!("sessions/{id}/trace?from_s=20950&to_s=20980")).await;
    assert!(late.expect(200)["t_s"].as_array().unwrap().len() > 500);
    let early = format!("sessions/{id}/trace?from_s=5000&to_s=5030");
    let with_snapshot = client.get(&early).await.expect(200);
    let fault = client.get("assets/a/faults/x_servo/recording").await.expect(200);

    let exported = format!("sessions/{id}/telemetry?from_s=5000&to_s=5000.5");
    let rows = read_csv(&client.get(&exported).await.text);
    assert_eq!(rows, samples[500_000..=500_050]);
    let outside = format!("sessions/{id}/telemetry?from_s=1e6");
    assert_eq!(read_csv(&client.get(&outside).await.text), []);
    let reversed = format!("sessions/{id}/telemetry?from_s=2&to_s=1");
    assert_eq!(client.get(&reversed).await.problem(400)["parameter"], "to_s");
    let invalid = client.get(&format!("sessions/{id}/telemetry?from_s=NaN")).await;
    assert_eq!(invalid.problem(400)["parameter"], "from_s");

    let stretch = json!({"session": id, "from_s": 200.0, "to_s": 340.0});
    let body = json!({"sessions": [stretch]});
    let job = client.post("assets/a/calibrations", &body).await.expect(202);
    assert_eq!(job["sessions"], body["sessions"]);
    let path = format!("assets/a/calibrations/{}", job["id"].as_str().unwrap());
    let done = eventually(|| async {
        let job = client.get(&path).await.expect(200);
        (job["state"] == "done" || job["state"] == "failed").then_some(job)
    });
    assert_eq!(done.await["error"], Value::Null);
    let reversed = json!({"sessions": [{"session": id, "from_s": 2.0, "to_s": 1.0}]});
    let problem = client.post("assets/a/calibrations", &reversed).await.problem(422);
    assert_eq!(problem["pointer"], "/sessions/0/to_s");

    service = restart_after(service, &data, "DELETE FROM snapshot").await;
    let client = &service.client;
    assert_eq!(client.get(&early).await.expect(200), with_snapshot);
    assert_eq!(client.get("assets/a/faults/x_servo/recording").await.expect(200), fault);
    let late = client.get(&format!("sessions/{id}/trace?from_s=20950&to_s=20980")).await;
    late.problem(413);
}
