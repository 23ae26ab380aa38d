//! `kill -9` in the middle of a stream: every acknowledged sample is there once,
//! the faults too, and the verdict is that of an uninterrupted run.

mod support;

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::json;
use support::{Client, judged, rig};

struct Process {
    child: Child,
    client: Client,
}

impl Process {
    fn start(data: &Path) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_offbd"))
            .args(["serve", "--listen", "127.0.0.1:0", "--log-format", "json", "--data"])
            .arg(data)
            .args(support::config(data).database.iter().flat_map(|url| ["--database", url]))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut log = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
        let address = log
            .find_map(|line| {
                let line: serde_json::Value = serde_json::from_str(&line).ok()?;
                (line["message"] == "serving").then(|| line["address"].as_str().unwrap().to_owned())
            })
            .expect("the log says where it listens");
        std::thread::spawn(move || log.for_each(drop));
        Self { child, client: Client::new(address) }
    }
}

impl Drop for Process {
    /// SIGKILL: no warning, no last word.
    fn drop(&mut self) {
        // One that has ended already needs no killing.
        let _ = self.child.kill();
        self.child.wait().unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn killed_in_the_middle_and_started_again() {
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
            // A batch whose acknowledgement nobody reads: it may be lost, or not.
            let (client, unread) =
                (process.client.clone(), support::batch(Some("s"), &samples[(i + 1) * 40..][..40]));
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
                let again = process.client.get("assets/a/faults?status=all").await.expect(200);
                assert_eq!(again, known);
                assert_eq!(process.client.get("assets/a/state").await.expect(200), state);
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

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn asked_to_stop_it_stops_well() {
    let data = tempfile::tempdir().unwrap();
    let mut process = Process::start(data.path());
    process.client.asset("a").await;
    let samples = rig(500, 500);
    process.client.telemetry("a", Some("s"), &samples).await;
    let pid = process.child.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &pid]).status().unwrap().success());
    let status = support::eventually(|| {
        let status = process.child.try_wait().unwrap();
        async move { status }
    })
    .await;
    assert!(status.success(), "{status}");
    process = Process::start(data.path());
    assert_eq!(process.client.recording("a", "s").await, samples);
}
