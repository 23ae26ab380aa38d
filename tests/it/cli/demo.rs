use std::io::{BufRead, BufReader, Lines};
use std::process::{Child, ChildStdout, Command, Stdio};

use super::fixture::CliFixture;
use crate::support::process::program;
use crate::support::{Client, eventually, read_csv};
use serde_json::{Value, json};

/// Options for fifty times real time. The verdict depends on the times in the samples, not on
/// the speed.
const FAST: &str = "--speed 50 --port 0";

#[test]
fn a_demo_finds_the_injected_faults_over_http_and_websocket() {
    let cli = CliFixture::new();
    let done = cli.ok(&format!("demo --seconds 60 {FAST}"));
    assert!(done.stdout.starts_with("dashboard  http://127.0.0.1:"), "{}", done.stdout);
    let table = done.stdout.split("\n\n").last().unwrap();
    let rows: Vec<Vec<&str>> =
        table.lines().skip(1).map(|row| row.split_whitespace().collect()).collect();
    assert_eq!(rows.len(), 2, "{table}");
    assert_eq!((rows[0][0], rows[0][3]), ("x_servo:dead", "x_servo"));
    assert_eq!((rows[1][0], rows[1][3]), ("stuck_ball:glued", "stuck_ball"));
    for transport in ["over WebSocket", "over HTTP batches"] {
        assert!(done.stdout.contains(transport), "nothing was sent {transport}");
    }
    assert!(done.stdout.lines().all(|line| line.chars().count() <= 80));
    let left: Vec<_> = std::fs::read_dir(cli.path(".")).unwrap().collect();
    assert!(left.is_empty(), "left behind: {left:?}");
}

#[test]
fn a_demo_that_misses_a_fault_reports_it_and_fails() {
    let cli = CliFixture::new();
    let done = cli.run(1, &format!("demo --seconds 20 {FAST} --fault x_servo:gain=0.99@5"));
    assert!(done.stdout.contains("not found"), "{}", done.stdout);
    assert!(done.stderr.contains("do not agree"), "{}", done.stderr);
}

#[test]
fn a_demo_can_reuse_a_kept_store() {
    let cli = CliFixture::new();
    let line = format!("demo --seconds 20 {FAST} --data kept --fault sensor:dropout@5");
    for _ in 0..2 {
        assert!(cli.ok(&line).stdout.contains("sensor (dropout)"));
    }
    assert!(cli.path("kept").is_dir());
}

/// A demo without an end. It is killed at the end of the test.
struct EndlessDemo {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
    client: Client,
}

impl EndlessDemo {
    /// Starts the demo with further arguments; returns it with what it says before the show.
    fn start(cli: &CliFixture, arguments: &str) -> (Self, String) {
        let mut child = Command::new(program())
            .args(["demo", "--port", "0", "--data", "store"])
            .args(arguments.split_whitespace())
            .current_dir(cli.path("."))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut demo = Self { child, lines, client: Client::new(String::new()) };
        let said = demo.until(" begins");
        let address = said.split("http://").nth(1).unwrap().split('/').next().unwrap();
        demo.client = Client::new(address.to_owned());
        (demo, said)
    }

    /// Reads up to a line that contains `words`; returns what was read.
    fn until(&mut self, words: &str) -> String {
        let mut read = String::new();
        while !read.contains(words) {
            let line = self.lines.next().expect("the demo has ended").unwrap();
            read += &(line + "\n");
        }
        read
    }
}

impl Drop for EndlessDemo {
    fn drop(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_endless_demo_clears_nothing_that_it_has_found() {
    let cli = CliFixture::new();
    let faults = "--fault x_servo:dead@10-30 --fault x_servo:dead@50";
    let (mut demo, said) = EndlessDemo::start(&cli, &format!("--speed 50 {faults}"));
    assert!(said.contains("stays on record until you clear it"), "{said}");
    demo.until(" confirmed since");
    demo.until(">> x_servo:dead injected");
    let history = demo.client.get("assets/demo-rig/faults/x_servo/history").await.expect(200);
    let entries = history["items"].as_array().unwrap();
    assert!(entries.iter().any(|entry| entry["what"] == "confirmed"), "{history}");
    assert!(entries.iter().all(|entry| entry["by"].is_null()), "{history}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_visitor_tunes_the_controller_of_a_rig_that_stays_healthy_for_a_minute() {
    let cli = CliFixture::new();
    let (demo, said) = EndlessDemo::start(&cli, "");
    assert!(said.contains("the first in 60 s"), "{said}");
    let client = &demo.client;
    let before = client.get("demo/gains").await.expect(200);
    assert_eq!(before["gains"], before["initial"]);
    assert!(before["gains"]["kp"].as_f64() > Some(1.0), "{before}");
    for (gains, pointer) in [
        (json!({ "kp": 1, "ki": 0, "kd": 7.1 }), "/kd"),
        (json!({ "kp": -1, "ki": 0, "kd": 0 }), "/kp"),
        (json!({ "kp": 1, "kd": 0 }), "/ki"),
    ] {
        let problem = client.put("demo/gains", &gains).await.problem(422);
        assert_eq!(problem["pointer"], pointer, "{problem}");
    }
    assert_eq!(client.get("demo/gains").await.expect(200), before);
    // Without gains the command stays as it is, whatever the ball does.
    let none = json!({ "kp": 0.0, "ki": 0.0, "kd": 0.0 });
    let after = client.put("demo/gains", &none).await.expect(200);
    assert_eq!((&after["gains"], &after["initial"]), (&none, &before["initial"]));
    eventually(async || {
        let state = client.get("demo").await.expect(200);
        assert_eq!((&state["script"], &state["broken"]), (&Value::Bool(true), &json!([])));
        let sessions = client.get("sessions?asset=demo-rig").await.expect(200);
        let id = sessions["items"][0]["id"].as_str()?.to_owned();
        let recording = read_csv(&client.get(&format!("sessions/{id}/telemetry")).await.text);
        let last: Vec<_> =
            recording.iter().rev().take(20).map(|s| (s.cmd_qx_rad, s.cmd_qy_rad)).collect();
        (last.len() == 20 && last.iter().all(|commands| *commands == last[0])).then_some(())
    })
    .await;
}
