//! Answers that are not the service's: a captive portal, a proxy, a foreign server.

use serde_json::json;

use super::Agent;
use crate::support::liar::{Lie, LyingProxy};
use crate::support::{ServiceFixture, eventually, rig};

/// Samples of a batch.
const N: usize = 10;

fn html(status: u16) -> Lie {
    (status, "text/html", format!("<html><h1>Log in</h1>{}</html>", "x".repeat(5000)))
}

fn json(status: u16, body: serde_json::Value) -> Lie {
    (status, "application/json", body.to_string())
}

fn problem(status: u16, body: serde_json::Value) -> Lie {
    (status, "application/problem+json", body.to_string())
}

fn row(index: usize) -> serde_json::Value {
    json!({ "index": index, "reason": "bad" })
}

/// An acknowledgement of another batch.
fn ack(accepted: u64, duplicate: u64, rejected: &[serde_json::Value]) -> serde_json::Value {
    json!({ "session": "s", "session_id": "1", "accepted": accepted, "duplicate": duplicate,
        "rejected": rejected, "late": [], "last_seq": 9 })
}

/// Answers after which a batch waits, each with a part of the reason.
fn lies() -> Vec<(Lie, &'static str)> {
    let empty = |status| (status, "text/plain", String::new());
    let of_proxy = json!({ "type": "about:blank", "title": "Bad Request", "status": 400 });
    let of_other_status = json!({ "type": "urn:offbd:problem:malformed", "status": 422 });
    let not_read = json!({ "type": "urn:offbd:problem:busy", "title": "Busy", "status": 429 });
    let n = N as u64;
    vec![
        (html(200), "200 OK, but not an acknowledgement"),
        (empty(200), "200 OK, but not an acknowledgement"),
        (json(200, json!({})), "200 OK, but not an acknowledgement"),
        (json(200, json!({ "accepted": n })), "200 OK, but not an acknowledgement"),
        (empty(204), "204 No Content, not from the service"),
        (json(201, ack(n, 0, &[])), "201 Created, not from the service"),
        (json(202, ack(n, 0, &[])), "202 Accepted, not from the service"),
        (json(200, ack(n - 1, 0, &[])), "of the 10 rows sent"),
        (json(200, ack(n, 1, &[])), "of the 10 rows sent"),
        (json(200, ack(n, 0, &[row(0)])), "of the 10 rows sent"),
        (json(200, ack(n - 1, 0, &[row(N)])), "of the 10 rows sent"),
        (json(200, ack(n - 2, 0, &[row(1), row(1)])), "of the 10 rows sent"),
        // 2^64 + 10 rows.
        (json(200, ack(u64::MAX, n + 1, &[])), "of the 10 rows sent"),
        (html(302), "302 Found, not from the service"),
        (html(400), "400 Bad Request, not from the service"),
        (empty(400), "400 Bad Request, not from the service"),
        (problem(400, of_proxy), "400 Bad Request, not from the service"),
        (problem(400, of_other_status), "400 Bad Request, not from the service"),
        (html(409), "409 Conflict, not from the service"),
        (html(413), "413 Payload Too Large, not from the service"),
        (html(415), "415 Unsupported Media Type, not from the service"),
        (html(422), "422 Unprocessable Entity, not from the service"),
        (problem(429, not_read), "429 Too Many Requests: urn:offbd:problem:busy"),
        (html(502), "502 Bad Gateway, not from the service"),
    ]
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_batch_waits_until_the_service_itself_has_acknowledged_all_its_rows() {
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let proxy = LyingProxy::start(&fixture.client.address).await;
    let agent = Agent::start(&directory.path().join("spool"), &proxy.url, &[]);
    let lies = lies();
    let samples = rig(lies.len() * N, usize::MAX);
    for ((lie, reason), part) in lies.iter().zip(samples.chunks(N)) {
        let n_logged = agent.logged("a batch waits", 0).await.len();
        proxy.tell(Some(lie.clone()));
        agent.client.telemetry("a", Some("s"), part).await;
        proxy.has_told(2).await;
        let status = eventually(|| async {
            let status = agent.status().await;
            (status["held_up"][0]["asset"] == "a").then_some(status)
        })
        .await;
        assert_eq!((&status["waiting_batches"], &status["refused"]), (&json!(1), &json!([])));
        let held_up = &status["held_up"][0];
        assert!(held_up["reason"].as_str().unwrap().contains(reason), "{reason}: {held_up}");
        let answer = held_up["answer"].as_str().unwrap();
        assert!(answer.len() < 2010 && lie.2.starts_with(answer.trim_end_matches('…')), "{answer}");
        proxy.tell(None);
        let status = agent.drained().await;
        assert_eq!(status["held_up"], json!([]));
        // Once, though it was told twice or more.
        let logged = agent.logged("a batch waits", n_logged + 1).await.split_off(n_logged);
        assert!(logged.len() == 1 && logged[0].contains(reason), "{reason}: {logged:?}");
    }
    assert_eq!(fixture.client.recording("a", "s").await, samples);
    assert_eq!(proxy.n_passed(), lies.len());
    assert_eq!(agent.status().await["used_bytes"], 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_lie_about_one_asset_holds_up_no_other() {
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start().await;
    for asset in ["a", "b"] {
        fixture.client.asset(asset).await;
    }
    let proxy = LyingProxy::start(&fixture.client.address).await;
    let agent = Agent::start(&directory.path().join("spool"), &proxy.url, &[]);
    let samples = rig(2 * N, usize::MAX);
    proxy.tell(Some(json(200, ack(20, 0, &[]))));
    agent.client.telemetry("a", Some("s"), &samples[..N]).await;
    proxy.has_told(1).await;
    // By chance the number of rows of this one.
    agent.client.telemetry("b", Some("s"), &samples).await;
    eventually(async || (agent.status().await["waiting_batches"] == 1).then_some(())).await;
    proxy.tell(None);
    agent.drained().await;
    assert_eq!(fixture.client.recording("a", "s").await, samples[..N]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_asset_without_an_answer_holds_up_no_other() {
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start().await;
    let others: Vec<_> = (0..20).map(|n| format!("r{n}")).collect();
    for asset in others.iter().map(String::as_str).chain(["slow"]) {
        fixture.client.asset(asset).await;
    }
    let proxy = LyingProxy::start(&fixture.client.address).await;
    let agent = Agent::start(&directory.path().join("spool"), &proxy.url, &[]);
    let samples = rig(3 * N, usize::MAX);
    proxy.hold(Some("/assets/slow/"));
    agent.client.telemetry("slow", Some("s"), &samples).await;
    eventually(async || (proxy.n_held() == 1).then_some(())).await;
    for part in samples.chunks(N) {
        for asset in &others {
            agent.client.telemetry(asset, Some("s"), part).await;
        }
    }
    eventually(async || (agent.status().await["waiting_batches"] == 1).then_some(())).await;
    // Its first request is still under way.
    assert_eq!((proxy.n_held(), proxy.n_passed()), (1, 3 * others.len()));
    proxy.hold(None);
    agent.drained().await;
    for asset in others.iter().map(String::as_str).chain(["slow"]) {
        assert_eq!(fixture.client.recording(asset, "s").await, samples);
    }
}
