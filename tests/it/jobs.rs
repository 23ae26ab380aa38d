//! Background jobs: what a person asks for does not wait for rigs that learn by themselves.

use crate::support::{Client, ServiceFixture, csv, eventually};
use offbd_core::vocabulary::Sample;
use offbd_lab::simulation::{Disturbances, Preset, Reference, SimulatedRig};
use serde_json::{Value, json};

/// Imports `seconds` of a healthy rig with `rate_hz`, at most 100, from which `asset`, which is
/// new, can learn. Returns the session.
async fn import(client: &Client, asset: &str, seconds: usize, rate_hz: usize) -> Value {
    let model = Preset::Chapter.model().unwrap();
    let disturbances = Disturbances::default();
    let mut rig = SimulatedRig::new(model, Reference::Lissajous, disturbances, 1).unwrap();
    let samples: Vec<Sample> =
        (0..seconds * 100).map(|_| rig.next_sample()).step_by(100 / rate_hz).collect();
    let file = json!({ "name": asset, "sample_rate_hz": rate_hz });
    client.post("assets", &file).await.expect(201);
    let path = format!("assets/{asset}/sessions/import?name=s");
    client.post_text(&path, "text/csv", csv(&samples)).await.expect(201)["session"].clone()
}

/// Returns the only calibration of `asset`, once there is one.
async fn calibration(client: &Client, asset: &str) -> Value {
    let path = format!("assets/{asset}/calibrations");
    let made = async || client.get(&path).await.expect(200)["items"].get(0).cloned();
    eventually(made).await
}

fn is_finished(job: &Value) -> bool {
    ["done", "failed"].map(|state| job["state"] == state).contains(&true)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_replay_that_a_person_asks_for_passes_rigs_that_learn() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let rigs = ["one", "two", "three"];
    let mut session = Value::Null;
    for rig in rigs {
        session = import(client, rig, 70, 100).await;
    }
    let waiting = calibration(client, "three").await;
    assert_eq!(waiting["made_by"], "offbd");
    if waiting["state"] == "queued" {
        assert!(waiting["waits"]["n_before"].is_u64(), "{waiting}");
    }
    let path = format!("sessions/{}/replays", session["id"].as_str().unwrap());
    let replay = client.post(&path, &json!({})).await.expect(202);
    let path = format!("replays/{}", replay["id"].as_str().unwrap());
    eventually(|| async { Some(client.get(&path).await.expect(200)).filter(is_finished) }).await;

    let last = calibration(client, "three").await;
    assert!(!is_finished(&last), "the replay has waited for all of them: {last}");
    for rig in rigs {
        let done = async || Some(calibration(client, rig).await).filter(is_finished);
        let done = eventually(done).await;
        assert_eq!((&done["state"], &done["waits"]), (&json!("done"), &Value::Null), "{done}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_person_cancels_a_calibration_that_runs_and_a_replay_that_waits_for_it() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let session = import(client, "a", 400, 100).await;
    let body = json!({ "sessions": [session["id"]] });
    let calibration = client.post("assets/a/calibrations", &body).await.expect(202);
    let calibration = format!("assets/a/calibrations/{}", calibration["id"].as_str().unwrap());
    let runs = |job: &Value| job["state"] == "running";
    eventually(|| async { Some(client.get(&calibration).await.expect(200)).filter(runs) }).await;

    let path = format!("sessions/{}/replays", session["id"].as_str().unwrap());
    let replay = client.post(&path, &json!({})).await.expect(202);
    assert_eq!(replay["waits"], json!({ "reason": "jobs", "n_before": 1 }));
    let replay = format!("replays/{}", replay["id"].as_str().unwrap());
    let cancelled = client.post(&format!("{replay}/cancel"), &json!({})).await.expect(200);
    assert_eq!(cancelled["state"], "failed");
    assert_eq!(cancelled["error"], "it was cancelled");

    client.post(&format!("{calibration}/cancel"), &json!({})).await.expect(200);
    let ended = async || Some(client.get(&calibration).await.expect(200)).filter(is_finished);
    assert_eq!(eventually(ended).await["error"], "it was cancelled");
    for job in [replay, calibration] {
        let again = client.post(&format!("{job}/cancel"), &json!({})).await.expect(409);
        assert_eq!(again["type"], "urn:offbd:problem:job-ended");
    }
}

/// Returns the nice values of the threads of this process with this name.
#[cfg(target_os = "linux")]
fn nice_values(name: &str) -> Vec<i32> {
    let threads = std::fs::read_dir("/proc/self/task").unwrap();
    // A thread may end meanwhile.
    let stat = |thread: std::fs::DirEntry| std::fs::read_to_string(thread.path().join("stat")).ok();
    let stats = threads.filter_map(|thread| stat(thread.ok()?));
    let of_name = stats.filter_map(|stat| {
        let (head, tail) = stat.rsplit_once(')')?;
        let is_named = head.split_once('(')?.1 == name;
        // The nice value is the 19th field, the 17th after the name.
        is_named.then(|| tail.split_whitespace().nth(16)?.parse().ok())?
    });
    of_name.collect()
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rig_learns_on_a_thread_of_the_lowest_priority() {
    let fixture = ServiceFixture::start().await;
    import(&fixture.client, "a", 70, 100).await;
    let path = "assets/a/calibrations";
    let found = eventually(|| async {
        // Another thread of a rig that learns begins with the priority of the service.
        let is_lowest = nice_values("learning").contains(&19);
        let made = fixture.client.get(path).await.expect(200)["items"][0].clone();
        (is_lowest || is_finished(&made)).then_some(is_lowest)
    });
    assert!(found.await, "no such thread while it learnt");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rig_learns_from_the_last_minutes_of_motion_of_a_long_recording() {
    let fixture = ServiceFixture::start().await;
    import(&fixture.client, "a", 400, 25).await;
    let done = async || Some(calibration(&fixture.client, "a").await).filter(is_finished);
    let done = eventually(done).await;
    assert_eq!(done["state"], "done", "{done}");
    let n_samples = done["calibration"]["samples"].as_u64().unwrap();
    // Five times the minute of motion that it takes, during most of which the ball moves.
    assert!((7400..9000).contains(&n_samples), "{n_samples} samples");
}
