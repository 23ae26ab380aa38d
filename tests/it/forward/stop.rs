//! An agent that is told to stop: what it has read is in its spool.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};

use serde_json::json;

use super::{Agent, command, nowhere};
use crate::support::process::{ended, terminate};
use crate::support::{ServiceFixture, batch, csv, eventually, rig};

/// Starts an agent that reads lines, writes `text` to it, and returns it once a batch waits.
async fn reading(
    spool: &Path,
    asset: &str,
    more: &[&str],
    text: &str,
) -> (Child, std::process::ChildStdin) {
    let more = [&["--asset", asset, "--session", "s"], more].concat();
    let mut child = command(spool, &nowhere(), &more).stdin(Stdio::piped()).spawn().unwrap();
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(text.as_bytes()).unwrap();
    let mut log = child.stderr.take().unwrap();
    let (send, waits) = tokio::sync::oneshot::channel();
    std::thread::spawn(move || {
        let (mut send, mut text, mut part) = (Some(send), String::new(), [0; 1000]);
        while let Ok(n @ 1..) = log.read(&mut part) {
            text += &String::from_utf8_lossy(&part[..n]);
            if text.contains("a batch waits") {
                send.take().into_iter().for_each(|send| send.send(()).unwrap());
            }
        }
    });
    waits.await.unwrap();
    (child, pipe)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn lines_that_were_written_before_the_agent_is_told_to_stop_are_in_the_spool() {
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start().await;
    let to = format!("http://{}", fixture.client.address);
    let samples = rig(250, usize::MAX);
    // The last line is not complete.
    let text = csv(&samples) + "251,2.";
    for (signal, more) in [("-TERM", &[][..]), ("-INT", &["--max-bytes", "10000"])] {
        let asset = signal.trim_start_matches('-');
        fixture.client.asset(asset).await;
        let spool = directory.path().join(asset);
        let (mut child, pipe) = reading(&spool, asset, more, &text).await;
        terminate(&child, signal);
        assert!(ended(&mut child).await.success());
        drop(pipe);
        let agent = Agent::start(&spool, &to, &[]);
        agent.drained().await;
        assert_eq!(fixture.client.recording(asset, "s").await, samples);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_batch_that_is_arriving_when_the_agent_is_told_to_stop_is_taken() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("spool");
    let mut agent = Agent::start(&spool, &nowhere(), &[]);
    let address = agent.client.address.clone();
    let body = batch(Some("s"), &rig(10, usize::MAX)).to_string();
    let mut device = TcpStream::connect(&address).unwrap();
    let head = format!(
        "POST /api/v1/assets/a/telemetry HTTP/1.1\r\nHost: {address}\r\n\
        Content-Type: application/json\r\nContent-Length: {}\r\n\r\n",
        body.len()
    );
    device.write_all((head + &body[..20]).as_bytes()).unwrap();
    // It is accepted before this one, which is answered.
    agent.status().await;
    terminate(&agent.child, "-TERM");
    eventually(async || TcpStream::connect(&address).is_err().then_some(())).await;
    device.write_all(&body.as_bytes()[20..]).unwrap();
    let mut answer = String::new();
    device.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 200 OK\r\n"), "{answer}");
    assert!(ended(&mut agent.child).await.success());
    let agent = Agent::start(&spool, &nowhere(), &[]);
    assert_eq!(agent.status().await["waiting_batches"], json!(1));
}

/// Ends at once although clients keep their connections.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_idle_connection_does_not_keep_the_agent_from_stopping() {
    let directory = tempfile::tempdir().unwrap();
    let mut agent = Agent::start(&directory.path().join("spool"), &nowhere(), &[]);
    agent.status().await;
    let _silent = TcpStream::connect(&agent.client.address).unwrap();
    terminate(&agent.child, "-TERM");
    assert!(ended(&mut agent.child).await.success());
}
