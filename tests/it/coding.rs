//! Compressed request bodies: gzip and zstd, within the limits of plain bodies. Those of the agent
//! are in `forward/coding.rs`.

use std::io::{self, Read, Write};

use crate::support::{Answer, Client, ServiceFixture, batch, csv, packed, rig};
use reqwest::Method;
use serde_json::{Value, json};

pub(crate) const CODINGS: [&str; 2] = ["gzip", "zstd"];

/// Limit of a batch and of an import in these tests, bytes.
const LIMIT: usize = 1 << 20;

fn gzip(mut plain: impl Read) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    io::copy(&mut plain, &mut encoder).unwrap();
    encoder.finish().unwrap()
}

/// Compresses with a window of `log` bits.
fn zstd(mut plain: impl Read, log: u32) -> Vec<u8> {
    let mut encoder = zstd::Encoder::new(Vec::new(), 1).unwrap();
    encoder.window_log(log).unwrap();
    io::copy(&mut plain, &mut encoder).unwrap();
    encoder.flush().unwrap();
    encoder.finish().unwrap()
}

pub(crate) fn compressed(coding: &str, plain: impl Read) -> Vec<u8> {
    if coding == "gzip" { gzip(plain) } else { zstd(plain, 20) }
}

pub(crate) async fn post(
    client: &Client,
    path: &str,
    kind: &str,
    coding: &str,
    body: Vec<u8>,
) -> Answer {
    let request = client.request(Method::POST, path).header("content-type", kind);
    client.send(request.header("content-encoding", coding).body(body)).await
}

async fn service() -> ServiceFixture {
    let fixture = ServiceFixture::start_with(|config| {
        config.limits.batch_bytes = LIMIT;
        config.limits.import_bytes = LIMIT;
    })
    .await;
    fixture.client.asset("a").await;
    fixture
}

#[tokio::test]
async fn a_compressed_batch_or_import_counts_like_the_plain_one() {
    let fixture = service().await;
    let client = &fixture.client;
    let samples = rig(500, 500);
    let document = batch(None, &samples);
    let lines = document["samples"].as_array().unwrap().iter().map(Value::to_string);
    let lines = lines.collect::<Vec<_>>().join("\n");
    for (format, kind, plain) in [
        ("json", "application/json", document.to_string().into_bytes()),
        ("msgpack", "application/msgpack", packed(&document)),
        ("ndjson", "application/x-ndjson", lines.into_bytes()),
        ("csv", "text/csv", csv(&samples).into_bytes()),
    ] {
        for coding in ["gzip", "zstd", "x-gzip", "GZIP", "identity"] {
            let session = format!("{format}-{coding}");
            let body = match coding {
                "identity" => plain.clone(),
                coding => compressed(&coding.to_lowercase().replace("x-", ""), plain.as_slice()),
            };
            let path = format!("assets/a/telemetry?session={session}");
            let ack = post(client, &path, kind, coding, body).await.expect(200);
            assert_eq!(ack["accepted"], 500, "{session}: {ack}");
            assert_eq!(client.recording("a", &session).await, samples, "{session}");
        }
    }
    for coding in CODINGS {
        // Two members, as a file has to which a program appends.
        let text = csv(&samples);
        let (first, second) = text.split_at(text.len() / 2);
        let body = [compressed(coding, first.as_bytes()), compressed(coding, second.as_bytes())];
        let path = format!("assets/a/sessions/import?name=file-{coding}");
        post(client, &path, "text/csv", coding, body.concat()).await.expect(201);
        assert_eq!(client.recording("a", &format!("file-{coding}")).await, samples);
    }
}

#[tokio::test]
async fn what_a_body_expands_to_is_limited() {
    let fixture = service().await;
    let client = &fixture.client;
    for coding in CODINGS {
        // 64 times the limit, and below a tenth of it as it arrives.
        let bomb = compressed(coding, io::repeat(b' ').take(64 * LIMIT as u64));
        assert!(bomb.len() < LIMIT / 10, "{}", bomb.len());
        for path in ["assets/a/telemetry", "assets/a/sessions/import"] {
            let problem = post(client, path, "text/csv", coding, bomb.clone()).await.problem(413);
            let detail = problem["detail"].as_str().unwrap();
            assert_eq!(detail, "the body is longer than 1048576 bytes, decompressed", "{path}");
        }
        // Nothing but members without content: they count as they arrive.
        let empty = compressed(coding, io::empty());
        let nothing = empty.repeat(2 * LIMIT / empty.len());
        let answer = post(client, "assets/a/telemetry", "text/csv", coding, nothing).await;
        assert_eq!(answer.problem(413)["detail"], "the body is longer than 1048576 bytes");
    }
    assert_eq!(fixture.client.metric("offbd_bodies_bytes").await, 0.0, "their memory is released");
    client.telemetry("a", None, &rig(1, 1)).await;
}

#[tokio::test]
async fn another_coding_gets_415_with_those_that_are_accepted() {
    let fixture = service().await;
    let client = &fixture.client;
    for coding in ["br", "deflate", "gzip, zstd", "gzip, gzip", "gzip;q=1"] {
        for path in ["assets/a/telemetry", "assets/a/sessions/import", "assets"] {
            let answer = post(client, path, "application/json", coding, b"{}".to_vec()).await;
            let problem = answer.problem(415);
            assert_eq!(problem["type"], "urn:offbd:problem:content-encoding");
            let detail = problem["detail"].as_str().unwrap();
            assert!(detail.contains(&format!("`{coding}`")), "{detail}");
            assert!(detail.contains("use one of gzip, zstd"), "{detail}");
            assert_eq!(answer.headers["accept-encoding"], "gzip, zstd");
        }
    }
    let answer = client.post_text("assets/a/telemetry", "text/html", "").await;
    answer.problem(415);
    assert!(!answer.headers.contains_key("accept-encoding"), "the media type is the reason");
}

#[tokio::test]
async fn a_damaged_or_unfinished_compressed_body_is_refused_whole() {
    let fixture = service().await;
    let client = &fixture.client;
    let plain = json!({"samples": [{"t_s": 0, "x_m": 0}]}).to_string();
    for coding in CODINGS {
        let whole = compressed(coding, plain.as_bytes());
        let mut bodies: Vec<_> = (1..whole.len()).map(|n| whole[..n].to_vec()).collect();
        bodies.push([whole.as_slice(), b"more"].concat());
        bodies.push(plain.clone().into_bytes());
        for body in bodies {
            let answer = post(client, "assets/a/telemetry", "application/json", coding, body).await;
            let problem = answer.problem(400);
            let detail = problem["detail"].as_str().unwrap();
            assert!(detail.contains("cannot be decompressed"), "{coding}: {detail}");
        }
    }
    // 16 MiB, of which the standard permits a decoder to refuse.
    let wide = zstd(io::repeat(b' ').take(1 << 10), 24);
    let answer = post(client, "assets/a/telemetry", "text/csv", "zstd", wide).await;
    let problem = answer.problem(400);
    assert!(problem["detail"].as_str().unwrap().contains("cannot be decompressed"), "{problem}");
    assert_eq!(client.get("sessions?asset=a").await.json()["items"], json!([]));
}
