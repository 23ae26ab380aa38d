//! `kill -9` in the middle of a stream: every acknowledged sample is there once,
//! the faults too, and the verdict is that of an uninterrupted run.

mod support;

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::json;
use support::{Client, judged, rig};

const DATA: &str = "OFFBD_TEST_SERVER_DATA";

/// Not a test of its own: the server that the tests here start as a process,
/// which is this program again.
#[test]
fn server_process() {
    let Some(data) = std::env::var_os(DATA) else { return };
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let config = support::config(Path::new(&data));
        let server = offbd::server::start(config).await.unwrap();
        println!("\nlistening {}", server.address);
        std::future::pending::<()>().await;
    });
}

struct Process {
    child: Child,
    client: Client,
}

impl Process {
    fn start(data: &Path) -> Self {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "server_process", "--nocapture"])
            .env(DATA, data)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let address = lines
            .map_while(Result::ok)
            .find_map(|line| line.strip_prefix("listening ").map(str::to_owned))
            .expect("the server says where it listens");
        Self { child, client: Client::new(address) }
    }
}

impl Drop for Process {
    /// SIGKILL: no warning, no last word.
    fn drop(&mut self) {
        self.child.kill().unwrap();
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
