//! What the service refuses or rejects: it is kept with the reason, and can be listed, sent again
//! and removed.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::{Value, json};

use super::{Agent, command};
use crate::support::liar::LyingProxy;
use crate::support::process::program;
use crate::support::{ServiceFixture, batch, csv, eventually, rig};

/// Runs `offbd forward COMMAND --spool SPOOL ARGUMENTS`.
pub(super) fn run(spool: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(program());
    command.args(["forward", arguments[0], "--spool"]).arg(spool).args(&arguments[1..]);
    command.output().unwrap()
}

/// Returns what is listed as set aside.
pub(super) fn listed(spool: &Path) -> Vec<Value> {
    let listed = run(spool, &["list", "--format", "json"]);
    assert!(listed.status.success(), "{}", String::from_utf8_lossy(&listed.stderr));
    let lines = String::from_utf8(listed.stdout).unwrap();
    lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Waits until something is set aside and nothing waits; returns what is set aside.
async fn set_aside(agent: &Agent) -> Value {
    eventually(|| async {
        let status = agent.status().await;
        let is_done = status["waiting_batches"] == 0 && status["refused"] != json!([]);
        is_done.then(|| status["refused"].clone())
    })
    .await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn samples_that_the_service_rejects_are_kept_with_the_reason() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("spool");
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let to = format!("http://{}", fixture.client.address);
    let agent = Agent::start(&spool, &to, &[]);
    let samples = rig(1000, usize::MAX);
    agent.client.telemetry("a", Some("s"), &samples).await;
    agent.drained().await;
    let mut others = samples.clone();
    others.iter_mut().skip(10).for_each(|sample| sample.x_m = Some(0.01));
    assert_eq!(agent.client.telemetry("a", Some("s"), &others).await["accepted"], 1000);
    let refused = set_aside(&agent).await;
    let reason = refused[0]["reason"].as_str().unwrap();
    assert!(reason.starts_with("990 of 1000 rows rejected: row 10 and 989 more: "), "{reason}");
    assert!(reason.contains("another sample with this seq"), "{reason}");
    assert_eq!(agent.logged("samples are rejected and set aside", 1).await, [reason]);
    drop(agent);
    assert_eq!(listed(&spool), *refused.as_array().unwrap());
    assert_eq!(fixture.client.recording("a", "s").await, samples);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn rejected_samples_can_be_sent_again_and_go_to_their_session() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("spool");
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let proxy = LyingProxy::start(&fixture.client.address).await;
    let samples = rig(100, usize::MAX);
    let rejected = [3, 7].map(|index| json!({ "index": index, "reason": format!("no {index}") }));
    let ack = json!({ "session": "s 1", "session_id": "1", "accepted": 90, "duplicate": 8,
        "rejected": rejected, "late": [], "last_seq": 99 });
    proxy.tell(Some((200, "application/json", ack.to_string())));
    let agent = Agent::start(&spool, &proxy.url, &[]);
    agent.client.telemetry("a", None, &samples).await;
    let refused = set_aside(&agent).await;
    let reason = "2 of 100 rows rejected: row 3: no 3; row 7: no 7";
    assert_eq!((&refused[0]["reason"], &refused[0]["asset"]), (&json!(reason), &json!("a")));
    let used = agent.status().await["used_bytes"].as_u64().unwrap();
    assert!((512..2048).contains(&used) && used > refused[0]["bytes"].as_u64().unwrap(), "{used}");
    proxy.tell(None);
    drop(agent);

    let id = refused[0]["id"].to_string();
    assert!(run(&spool, &["send-again", &id]).status.success());
    assert_eq!(listed(&spool), [] as [Value; 0]);
    let agent = Agent::start(&spool, &proxy.url, &[]);
    let status = agent.drained().await;
    assert_eq!((&status["used_bytes"], &status["refused"]), (&json!(0), &json!([])));
    assert_eq!(fixture.client.recording("a", "s 1").await, [samples[3], samples[7]]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn rows_that_the_agent_has_rejected_itself_are_not_kept() {
    let directory = tempfile::tempdir().unwrap();
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let to = format!("http://{}", fixture.client.address);
    let agent = Agent::start(&directory.path().join("spool"), &to, &[]);
    let mut rows = batch(Some("s"), &rig(2, usize::MAX));
    rows["samples"].as_array_mut().unwrap().insert(1, json!({ "t_s": "now" }));
    let told = agent.client.post("assets/a/telemetry", &rows).await.expect(200);
    assert_eq!((&told["accepted"], &told["rejected"][0]["index"]), (&json!(2), &json!(1)));
    assert_eq!(agent.drained().await["refused"], json!([]));
    assert_eq!(fixture.client.recording("a", "s").await.len(), 2);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn refused_batches_can_be_listed_sent_again_and_removed() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("spool");
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let proxy = LyingProxy::start(&fixture.client.address).await;
    let samples = rig(40, usize::MAX);
    let refusal = json!({ "type": "urn:offbd:problem:malformed", "title": "Malformed body",
        "status": 400, "detail": "of no use" });
    proxy.tell(Some((400, "application/problem+json", refusal.to_string())));
    let agent = Agent::start(&spool, &proxy.url, &[]);
    for part in samples.chunks(10) {
        agent.client.telemetry("a", Some("s"), part).await;
    }
    eventually(|| async {
        let status = agent.status().await;
        (status["refused"].as_array().unwrap().len() == 4).then_some(())
    })
    .await;
    assert_eq!(agent.logged("a batch is refused and set aside", 4).await.len(), 4);
    // The file is the agent's while it runs.
    let locked = run(&spool, &["list"]);
    let told = String::from_utf8(locked.stderr).unwrap();
    assert!(locked.status.code() == Some(3) && told.contains("stop it first"), "{told}");
    drop(agent);

    let refused = listed(&spool);
    assert_eq!(refused.len(), 4);
    assert!(refused[0]["reason"].as_str().unwrap().contains("of no use"), "{refused:?}");
    let ids: Vec<_> = refused.iter().map(|batch| batch["id"].to_string()).collect();
    let table = String::from_utf8(run(&spool, &["list"]).stdout).unwrap();
    assert!(table.contains("reason") && table.contains("400 Bad Request"), "{table}");
    // All or nothing.
    assert_eq!(run(&spool, &["remove", &ids[0], "99"]).status.code(), Some(2));
    assert_eq!(listed(&spool), refused);
    assert!(run(&spool, &["remove", &ids[0], &ids[2]]).status.success());
    assert!(run(&spool, &["send-again", &ids[1]]).status.success());
    assert_eq!(listed(&spool), refused[3..]);

    proxy.tell(None);
    let agent = Agent::start(&spool, &proxy.url, &[]);
    assert_eq!(agent.drained().await["refused"], json!(refused[3..]));
    assert_eq!(fixture.client.recording("a", "s").await, samples[10..20]);
    drop(agent);
    assert!(run(&spool, &["send-again", "--all"]).status.success());
    let agent = Agent::start(&spool, &proxy.url, &[]);
    assert_eq!(agent.drained().await["used_bytes"], 0);
    assert_eq!(
        fixture.client.recording("a", "s").await,
        [&samples[10..20], &samples[30..]].concat()
    );
}

#[test]
fn a_spool_that_is_not_there_is_not_created() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("spool");
    for arguments in [&["list"][..], &["send-again", "--all"], &["remove", "1"]] {
        assert_eq!(run(&spool, arguments).status.code(), Some(3));
        assert!(!spool.exists());
    }
    for arguments in [&["remove"][..], &["send-again", "1", "--all"], &["list", "--to", "x"]] {
        assert_eq!(run(&spool, arguments).status.code(), Some(2));
    }
}

#[test]
fn lines_that_are_not_samples_and_samples_that_are_rejected_are_told() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("spool");
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let fixture = runtime.block_on(ServiceFixture::start());
    runtime.block_on(fixture.client.asset("a"));
    let to = format!("http://{}", fixture.client.address);
    let mut samples = rig(20, usize::MAX);
    // The same number with another position.
    samples[9] = rig(9, usize::MAX)[8];
    samples[9].x_m = Some(0.01);
    let text = csv(&samples).replacen("\n5,", "\nfive,", 1);
    let mut child = command(&spool, &to, &["--asset", "a", "--session", "s"])
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    let ended = child.wait_with_output().unwrap();
    let told = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(1), "{told}");
    for part in [
        "a line is not a sample",
        "\"`seq` is not a whole number\"",
        "1 of 20 rows rejected: row 9",
        "offbd forward list",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    assert_eq!(listed(&spool).len(), 1);
    let stored = runtime.block_on(fixture.client.recording("a", "s"));
    assert_eq!(stored, [&samples[..5], &samples[6..9], &samples[10..]].concat());
}
