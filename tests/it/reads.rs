//! Questions about rigs do not load their engines: they are answered from what is stored.

use std::collections::BTreeMap;

use crate::support::process::{Process, ended};
use crate::support::{Client, eventually, rig};
use futures_util::StreamExt;
use reqwest::Method;
use serde_json::Value;
use tokio_tungstenite::connect_async;

/// The rigs of the service under test.
const RIGS: [&str; 3] = ["a", "b", "c"];

/// Samples after which the state of an engine is stored while it runs.
const OF_A_SNAPSHOT: usize = 16_384;

/// Starts a session of each rig, that of rig `a` with `n` samples, in which the x servo dies; returns
/// the id of that session.
async fn begin_sessions(client: &Client, n: usize) -> String {
    let samples = rig(n, n / 2);
    for asset in RIGS {
        client.asset(asset).await;
        let n = if asset == "a" { n } else { n / 100 };
        for part in samples[..n].chunks(OF_A_SNAPSHOT / 4) {
            client.telemetry(asset, Some("s"), part).await;
        }
    }
    client.session("a", "s").await["id"].as_str().unwrap().to_owned()
}

/// The paths of all operations that only read, about rig `a` and its `session`; without the drive
/// cycle, which takes long to compute from the asset file alone.
fn paths(session: &str) -> Vec<String> {
    let document = serde_json::to_value(offbd::http::openapi()).unwrap();
    let items = document["paths"].as_object().unwrap().iter();
    let reads = items.filter(|(_, item)| item.get("get").is_some()).map(|(path, _)| path);
    let reads = reads.filter(|path| !path.ends_with("/drive-cycle"));
    let about = |path: &String| {
        let path = path.replace("{asset}", "a").replace("{code}", "x_servo");
        path.replace("{data}", "state").replace("/sessions/{id}", &format!("/sessions/{session}"))
    };
    let all = ["/api/v1/assets/a/faults?status=all", "/api/v1/faults?status=all"];
    reads.map(about).chain(all.map(str::to_owned)).collect()
}

/// Whether the response changes by itself: it shows the link, when a rig was last seen, that its data
/// stay away, or the process itself.
fn changes_by_itself(path: &str) -> bool {
    let ends = ["/link", "/fleet", "/alarms", "/metrics", "/readyz", "/cluster"];
    ends.iter().any(|end| path.ends_with(end))
}

/// The responses to all operations that only read.
async fn responses(client: &Client, session: &str) -> BTreeMap<String, (u16, String)> {
    let mut found = BTreeMap::new();
    for path in paths(session) {
        let response = client.request(Method::GET, &path).send().await.unwrap();
        let status = response.status().as_u16();
        // Events have no end.
        let text =
            if path.ends_with("/events") { String::new() } else { response.text().await.unwrap() };
        let text = if status == 200 { text } else { String::new() };
        found.insert(path, (status, text));
    }
    found
}

/// The first state in the stream of rig `a`.
async fn streamed_state(client: &Client) -> Value {
    let url = format!("ws://{}/api/v1/assets/a/stream?state=50&trace=true", client.address);
    let (mut socket, _) = connect_async(url).await.unwrap();
    loop {
        let frame = socket.next().await.unwrap().unwrap();
        let mut frame: Value = serde_json::from_str(frame.to_text().unwrap()).unwrap();
        if frame["type"] == "state" {
            frame.as_object_mut().unwrap().retain(|key, _| key != "type" && key != "trace");
            return frame;
        }
    }
}

/// Asks everything before and after a restart, which `stop` begins.
async fn compare(n: usize, stop: impl AsyncFnOnce(Process)) {
    let data = tempfile::tempdir().unwrap();
    let process = Process::start(data.path());
    let session = begin_sessions(&process.client, n).await;
    let before = responses(&process.client, &session).await;
    let state = streamed_state(&process.client).await;
    assert_eq!(process.client.n_engines().await, RIGS.len() as f64);
    stop(process).await;

    let process = Process::start(data.path());
    let client = &process.client;
    for ((path, before), after) in
        before.iter().zip(responses(client, &session).await.into_values())
    {
        assert_eq!(client.n_engines().await, 0.0, "{path}");
        assert_eq!(after.0, before.0, "{path}: {}", after.1);
        assert!(changes_by_itself(path) || after.1 == before.1, "{path}: {} {}", after.1, before.1);
    }
    for path in ["state", "faults", "learning", "link", "tags", "mutes", "trends"] {
        assert_eq!(before[&format!("/api/v1/assets/a/{path}")].0, 200, "{path}");
    }
    let link = client.get("assets/a/link").await.expect(200);
    assert_eq!((&link["expected_rate_hz"], &link["session"]), (&100.0.into(), &Value::Null));
    assert_eq!(streamed_state(client).await, state);
    assert_eq!(client.n_engines().await, 0.0, "the stream only shows the rig");

    client.load("a").await;
    // The gauge is read by another thread than the one that has answered.
    eventually(async || (client.n_engines().await == 1.0).then_some(())).await;
    assert_eq!(
        client.n_evaluated_again().await,
        0.0,
        "nothing was recorded after the stored state"
    );
    assert_eq!(streamed_state(client).await, state);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn after_a_stop_all_reads_answer_as_before_and_load_no_engine() {
    let stop = async |mut process: Process| {
        process.terminate();
        assert!(ended(&mut process.child).await.success());
    };
    compare(2000, stop).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn after_a_kill_at_a_snapshot_all_reads_answer_as_before_and_load_no_engine() {
    compare(OF_A_SNAPSHOT, async |process| drop(process)).await;
}
