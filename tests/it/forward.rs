//! The edge agent `offbd forward`, as a process, between a device and the real service.

mod answers;
mod coding;
mod damage;
#[cfg(target_os = "linux")]
mod failing_disk;
#[cfg(unix)]
mod files;
mod set_aside;
#[cfg(unix)]
mod stop;
mod strangers;
mod token;

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, mpsc};

use crate::support::device::Random;
use crate::support::process::{Process, ended};
use crate::support::proxy::LossyProxy;
use crate::support::{Client, DEADLINE, ServiceFixture, batch, csv, eventually, judged, rig};
use reqwest::Method;
use serde_json::{Value, json};

/// An agent that can be killed.
struct Agent {
    child: Child,
    client: Client,
    /// The fields of each line that it has logged.
    log: Arc<Mutex<Vec<Value>>>,
}

impl Agent {
    fn start(spool: &Path, to: &str, more: &[&str]) -> Self {
        Self::start_with(spool, to, more, &[])
    }

    /// Starts an agent with additional environment variables.
    fn start_with(spool: &Path, to: &str, more: &[&str], environment: &[(&str, &Path)]) -> Self {
        let mut command = command(spool, to, &["--listen", "127.0.0.1:0"]);
        command.args(more).envs(environment.iter().copied());
        let mut child = command.spawn().unwrap();
        let (send, address) = mpsc::channel();
        let lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let log = Arc::<Mutex<Vec<Value>>>::default();
        let logged = log.clone();
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                let fields = serde_json::from_str::<Value>(&line).unwrap_or_default();
                if fields["message"] == "forwarding" {
                    let _ = send.send(fields["address"].as_str().unwrap().to_owned());
                }
                logged.lock().unwrap().push(fields);
            }
        });
        let client = Client::new(address.recv_timeout(DEADLINE).expect("the agent starts"));
        Self { child, client, log }
    }

    /// Waits until `message` is logged `n` times or more; returns the reasons.
    async fn logged(&self, message: &str, n: usize) -> Vec<String> {
        eventually(|| async {
            let log = self.log.lock().unwrap();
            let lines = log.iter().filter(|fields| fields["message"] == message);
            let reasons = lines.map(|fields| fields["reason"].as_str().unwrap_or("").to_owned());
            let reasons: Vec<String> = reasons.collect();
            (reasons.len() >= n).then_some(reasons)
        })
        .await
    }

    async fn status(&self) -> Value {
        self.client.get("spool").await.expect(200)
    }

    /// Waits until nothing waits; returns the status.
    async fn drained(&self) -> Value {
        eventually(|| async {
            let status = self.status().await;
            (status["waiting_batches"] == 0).then_some(status)
        })
        .await
    }
}

impl Drop for Agent {
    /// Kills the process with SIGKILL.
    fn drop(&mut self) {
        let _ = self.child.kill();
        self.child.wait().unwrap();
    }
}

fn command(spool: &Path, to: &str, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_offbd"));
    command.args(["forward", "--log-format", "json", "--to", to, "--spool"]).arg(spool);
    command.args(more).stderr(Stdio::piped());
    command
}

/// An address at which nothing listens.
fn nowhere() -> String {
    let unused = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    format!("http://{}", unused.local_addr().unwrap())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_agent_and_a_service_that_are_killed_on_a_bad_line_lose_and_double_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let (data, spool) = (directory.path().join("data"), directory.path().join("spool"));
    let samples = rig(3000, 1500);
    let mut service = Process::start(&data);
    service.client.asset("a").await;
    let proxy = LossyProxy::start(&service.client.address).await;
    let to = format!("http://127.0.0.1:{}", proxy.port);
    let mut agent = Agent::start(&spool, &to, &[]);
    let mut random = Random(5);
    for (i, part) in samples.chunks(25).enumerate() {
        // The device sends each batch until the agent has it, and some of them twice.
        for _ in 0..=random.below(2) {
            agent.client.telemetry("a", Some("s"), part).await;
        }
        match i % 20 {
            5 => {
                drop(agent);
                agent = Agent::start(&spool, &to, &[]);
            }
            12 => {
                drop(service);
                service = Process::start(&data);
                proxy.set_service(&service.client.address);
            }
            _ => {}
        }
    }
    let status = agent.drained().await;
    assert_eq!((&status["used_bytes"], &status["refused"]), (&json!(0), &json!([])));
    assert!(proxy.n_cut() > 10, "{}", proxy.n_cut());
    let (hash, faults) = judged("a", &samples);
    let session = service.client.end("a", "s").await;
    assert_eq!(session["verdict"]["faults"], json!(faults));
    assert_eq!(session["verdict"]["verdict_hash"], hash);
    assert_eq!(service.client.recording("a", "s").await, samples);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_spool_refuses_and_keeps_what_it_has() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("spool");
    let samples = rig(4000, usize::MAX);
    let agent = Agent::start(&spool, &nowhere(), &["--max-bytes", "60000"]);
    let parts: Vec<_> = samples.chunks(100).collect();
    let mut n_taken = 0;
    let refusal = loop {
        let body = batch(Some("s"), parts[n_taken]);
        let answer = agent.client.post("assets/a/telemetry", &body).await;
        if answer.status != 200 {
            break answer;
        }
        assert_eq!(answer.json()["accepted"], 100);
        n_taken += 1;
    };
    assert!(refusal.problem(429)["detail"].as_str().unwrap().contains("spool is full"));
    assert_eq!(refusal.headers["retry-after"], "5");
    assert_eq!(agent.status().await["waiting_batches"], n_taken);
    assert!(agent.status().await["used_bytes"].as_u64().unwrap() <= 60_000);
    drop(agent);

    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let to = format!("http://{}", fixture.client.address);
    let agent = Agent::start(&spool, &to, &["--max-bytes", "60000"]);
    agent.drained().await;
    agent.client.telemetry("a", Some("s"), parts[n_taken]).await;
    agent.drained().await;
    let stored = fixture.client.recording("a", "s").await;
    assert_eq!(stored, samples[..(n_taken + 1) * 100]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_the_service_refuses_for_good_is_kept_and_named_and_holds_nothing_up() {
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start_with(|config| config.limits.batch_samples = 50).await;
    let to = format!("http://{}", fixture.client.address);
    let agent = Agent::start(&directory.path().join("spool"), &to, &[]);
    let samples = rig(200, usize::MAX);
    // An asset that does not exist yet holds up only itself.
    agent.client.telemetry("later", Some("s"), &samples[..10]).await;
    fixture.client.asset("a").await;
    agent.client.telemetry("a", Some("s"), &samples[..51]).await;
    agent.client.telemetry("a", Some("s"), &samples[51..100]).await;
    let first = eventually(|| async {
        let status = agent.status().await;
        (status["waiting_batches"] == 1 && status["refused"] != json!([])).then_some(status)
    });
    let refused = first.await["refused"].clone();
    assert_eq!(refused.as_array().unwrap().len(), 1);
    assert_eq!(refused[0]["asset"], "a");
    assert!(refused[0]["reason"].as_str().unwrap().contains("at most 50"), "{refused}");
    assert_eq!(fixture.client.recording("a", "s").await, samples[51..100]);
    fixture.client.asset("later").await;
    agent.drained().await;
    assert_eq!(fixture.client.recording("later", "s").await, samples[..10]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_batch_is_checked_like_by_the_service() {
    let directory = tempfile::tempdir().unwrap();
    let agent = Agent::start(&directory.path().join("spool"), &nowhere(), &[]);
    let post = |path, kind, body: &str| agent.client.post_text(path, kind, body.to_owned());
    let path = "assets/a/telemetry";
    let pointer = post(path, "application/json", "{\"samples\":3}").await.problem(400);
    assert_eq!(pointer["pointer"], "/samples");
    post(path, "text/plain", "t_s").await.problem(415);
    post("assets/a%20b/telemetry", "application/json", "{}").await.problem(400);
    let row = json!({"session": "s", "samples": [{"seq": 4, "t_s": 0.5}, {"t_s": "x"}]});
    let acknowledged = agent.client.post(path, &row).await.expect(200);
    assert_eq!((&acknowledged["accepted"], &acknowledged["last_seq"]), (&json!(1), &json!(4)));
    assert_eq!(acknowledged["rejected"][0]["index"], 1);
    assert_eq!(acknowledged["session"], "s");
    let large = agent.client.request(Method::POST, path).body(vec![b' '; 5 << 20]);
    let large = large.header("content-type", "application/json");
    assert_eq!(agent.client.send(large).await.status, 413);
    assert_eq!(agent.status().await["waiting_batches"], 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn lines_of_a_pipe_are_forwarded_to_the_last() {
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let to = format!("http://{}", fixture.client.address);
    let samples = rig(1010, usize::MAX);
    let ndjson: String = samples
        .iter()
        .map(|s| {
            format!("{}\n", serde_json::to_string(&offbd::wire::telemetry::sample_view(s)).unwrap())
        })
        .collect();
    for (format, text) in [("csv", csv(&samples)), ("ndjson", ndjson)] {
        let spool = directory.path().join(format);
        let more =
            ["--asset", "a", "--session", format, "--format", format, "--max-bytes", "30000"];
        let mut child = command(&spool, &to, &more).stdin(Stdio::piped()).spawn().unwrap();
        let mut pipe = child.stdin.take().unwrap();
        std::thread::spawn(move || pipe.write_all(text.trim_end().as_bytes()).unwrap());
        assert!(ended(&mut child).await.success());
        assert_eq!(fixture.client.recording("a", format).await, samples);
    }
}

#[test]
fn two_agents_do_not_share_a_spool() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("spool");
    let _first = Agent::start(&spool, &nowhere(), &[]);
    let second = command(&spool, &nowhere(), &["--listen", "127.0.0.1:0"]).output().unwrap();
    assert_eq!(second.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&second.stderr).contains("locked"));
}
