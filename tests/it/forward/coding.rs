//! Compressed batches: the agent takes what the service takes.

use std::io::{self, Read};

use super::{Agent, nowhere};
use crate::coding::{CODINGS, compressed, post};
use crate::support::{ServiceFixture, batch, csv, rig};
use serde_json::json;

const PATH: &str = "assets/a/telemetry";

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_compressed_batch_is_forwarded_like_the_plain_one() {
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let to = format!("http://{}", fixture.client.address);
    let agent = Agent::start(&directory.path().join("spool"), &to, &[]);
    let samples = rig(500, 500);
    let json = batch(None, &samples).to_string();
    for coding in CODINGS {
        for (kind, plain) in [("text/csv", csv(&samples)), ("application/json", json.clone())] {
            let session = format!("{coding}-{}", kind.rsplit('/').next().unwrap());
            let path = format!("{PATH}?session={session}");
            let body = compressed(coding, plain.as_bytes());
            let ack = post(&agent.client, &path, kind, coding, body).await.expect(200);
            assert_eq!(ack["accepted"], 500, "{session}: {ack}");
            agent.drained().await;
            assert_eq!(fixture.client.recording("a", &session).await, samples, "{session}");
        }
    }
    assert_eq!(agent.status().await["refused"], json!([]));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_batch_that_cannot_be_decompressed_within_the_limit_is_refused() {
    const LIMIT: u64 = 4 << 20;
    let directory = tempfile::tempdir().unwrap();
    let agent = Agent::start(&directory.path().join("spool"), &nowhere(), &[]);
    let client = &agent.client;
    for coding in CODINGS {
        let bomb = compressed(coding, io::repeat(b' ').take(2 * LIMIT));
        let problem = post(client, PATH, "text/csv", coding, bomb).await.problem(413);
        assert_eq!(problem["detail"], "the body is longer than 4194304 bytes, decompressed");
        let problem = post(client, PATH, "text/csv", coding, b"t_s".to_vec()).await.problem(400);
        assert!(
            problem["detail"].as_str().unwrap().contains("cannot be decompressed"),
            "{problem}"
        );
    }
    let answer = post(client, PATH, "text/csv", "br", b"t_s".to_vec()).await;
    assert_eq!(answer.problem(415)["type"], "urn:offbd:problem:content-encoding");
    assert_eq!(answer.headers["accept-encoding"], "gzip, zstd");
    assert_eq!(agent.status().await["waiting_batches"], 0);
}
