//! A spool whose disk is full or fails.

use std::path::Path;

use serde_json::json;

use super::{Agent, nowhere};
use crate::support::calls::FaultySystem;
use crate::support::liar::LyingProxy;
use crate::support::{ServiceFixture, batch, eventually, rig};

/// Samples of a batch.
const N: usize = 1000;

/// The bytes of the spool's files.
fn used(folder: &Path) -> u64 {
    let files = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    let spooled =
        files.filter(|file| file.file_name().to_str().unwrap().starts_with("offbd.sqlite"));
    spooled.map(|file| file.metadata().unwrap().len()).sum()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_spool_on_a_full_disk_is_emptied_and_then_takes_batches_again() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("offbd.sqlite");
    let system = FaultySystem::new(directory.path());
    system.set(&format!("room {}", 24 << 20));
    let agent = Agent::start_with(&spool, &nowhere(), &[], &system.environment());
    let samples = rig(200 * N, usize::MAX);
    let mut parts = samples.chunks(N);
    let mut n_taken = 0;
    let refusal = loop {
        let body = batch(Some("s"), parts.next().unwrap());
        let answer = agent.client.post("assets/a/telemetry", &body).await;
        if answer.status != 200 {
            break answer;
        }
        n_taken += N;
    };
    assert!(refusal.problem(503)["detail"].as_str().unwrap().contains("full"));
    assert!(n_taken >= 10 * N, "{n_taken}");
    drop(agent);

    // Others have taken the rest of the disk.
    system.set(&format!("room {}", used(directory.path())));
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let proxy = LyingProxy::start(&fixture.client.address).await;
    let agent = Agent::start_with(&spool, &proxy.url, &[], &system.environment());
    let status = agent.drained().await;
    assert_eq!(fixture.client.recording("a", "s").await, samples[..n_taken]);
    assert_eq!((&status["used_bytes"], &status["refused"]), (&json!(0), &json!([])));
    // The room of what was deleted is enough.
    let next = &samples[n_taken..n_taken + N];
    agent.client.telemetry("a", Some("t"), next).await;
    agent.drained().await;
    assert_eq!(fixture.client.recording("a", "t").await, next);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_refused_while_the_disk_is_full_is_set_aside() {
    const N_BATCHES: usize = 3;
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("offbd.sqlite");
    let system = FaultySystem::new(directory.path());
    let agent = Agent::start_with(&spool, &nowhere(), &[], &system.environment());
    let samples = rig(N_BATCHES * N, usize::MAX);
    for part in samples.chunks(N) {
        agent.client.telemetry("a", Some("s"), part).await;
    }
    drop(agent);
    system.set(&format!("room {}", used(directory.path())));
    let fixture = ServiceFixture::start().await;
    let proxy = LyingProxy::start(&fixture.client.address).await;
    let refusal = json!({ "type": "urn:offbd:problem:malformed", "title": "Malformed body",
        "status": 400, "detail": "of no use" });
    proxy.tell(Some((400, "application/problem+json", refusal.to_string())));
    let agent = Agent::start_with(&spool, &proxy.url, &[], &system.environment());
    let status = agent.drained().await;
    assert_eq!(status["refused"].as_array().unwrap().len(), N_BATCHES, "{status}");
    agent.logged("the disk is full; the agent takes nothing until it has room again", 1).await;
    assert_eq!(status["reserve_bytes"], 0);
    let refused = agent.client.post("assets/a/telemetry", &batch(Some("s"), &samples[..1])).await;
    assert!(refused.problem(503)["detail"].as_str().unwrap().contains("full"));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_spool_that_fails_is_tried_again() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("offbd.sqlite");
    let system = FaultySystem::new(directory.path());
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let proxy = LyingProxy::start(&fixture.client.address).await;
    proxy.tell(Some((502, "text/html", String::new())));
    let agent = Agent::start_with(&spool, &proxy.url, &[], &system.environment());
    let samples = rig(30, usize::MAX);
    for part in samples.chunks(10) {
        agent.client.telemetry("a", Some("s"), part).await;
    }
    system.set("write 5");
    proxy.tell(None);
    eventually(|| async {
        let status = agent.status().await;
        let reason = status["held_up"][0]["reason"].as_str().unwrap_or_default().to_owned();
        reason.contains("os error 5").then_some(())
    })
    .await;
    system.clear();
    agent.drained().await;
    assert_eq!(fixture.client.recording("a", "s").await, samples);
}
