//! One process for long, with devices that send in all ways, people who look and delete, and one
//! fault after the other: it goes on, nothing acknowledged is lost, and its memory has a bound.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use crate::support::calls::FaultySystem;
use crate::support::device::{DeviceLoad, Random};
use crate::support::process::{Process, ended};
use crate::support::{Client, on_postgres};
use reqwest::Method;
use serde_json::{Value, json};

/// Number of faults, unless the environment variable SOAK_FAULTS is set. These take 4 s.
const FAULTS: usize = 16;

/// The faults, in turn: a full disk, failing writes and syncs, a wall clock that is set, and a
/// process that is stopped for a moment. ENOSPC is 28, EIO is 5.
const KINDS: [&str; 8] =
    ["write 28", "clock 3600", "sync 5", "stop", "torn 5", "clock -3600", "write 5", "clock 86400"];

/// The memory may grow by this factor between the first fifth of the faults and the last one.
/// Chosen.
const MAX_GROWTH: f64 = 1.2;

/// Faults from which on the memory is compared: before, caches are still growing. Chosen.
const MIN_COMPARED: usize = 500;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_process_lives_long_with_one_fault_after_the_other() {
    if on_postgres() {
        return;
    }
    let n_faults = std::env::var("SOAK_FAULTS").map_or(FAULTS, |n| n.parse().unwrap());
    let data = tempfile::tempdir().unwrap();
    let system = FaultySystem::new(data.path());
    let mut environment = system.environment().to_vec();
    environment.push(("OFFBD_LIMITS__JOURNAL_BYTES", Path::new("50000")));
    let mut process = Process::start_with(data.path(), &environment);
    let load = DeviceLoad::start(4, &process.client, data.path(), None);
    let mut random = Random(1);
    let mut memory = Vec::new();
    for kind in KINDS.into_iter().cycle().take(n_faults) {
        load.link.wait_for_samples(300).await;
        fail(&process, &system, kind, &load).await;
        process.client.readiness(200).await;
        act(&process.client, &mut random).await;
        memory.push(process.client.resident_bytes().await);
    }
    let (refused, samples) = (load.link.n_refused(), load.link.acknowledged());
    let laps = load.stop().await;
    process.terminate();
    assert!(ended(&mut process.child).await.success(), "{}", process.log());
    let mut check = Command::new(env!("CARGO_BIN_EXE_offbd"));
    let check = check.arg("check").arg("--data").arg(data.path()).output().unwrap();
    assert!(check.status.success(), "{check:?}");
    let most = |part: &[f64]| part.iter().copied().fold(0.0, f64::max) / f64::from(1 << 20);
    let fifth = n_faults / 5;
    let (first, last) = (most(&memory[..fifth]), most(&memory[n_faults - fifth..]));
    println!(
        "{n_faults} faults, {samples} samples in {laps} recordings, each stored once; {refused} \
         answers 429 and 503; memory {first:.0} MiB in the first fifth, {last:.0} in the last"
    );
    assert!(n_faults < MIN_COMPARED || last <= first * MAX_GROWTH, "{first} MiB, {last} MiB");
}

/// Makes one fault happen and end.
async fn fail(process: &Process, system: &FaultySystem, kind: &str, load: &DeviceLoad) {
    if kind == "stop" {
        let signal = |name: &str| {
            let pid = process.child.id().to_string();
            assert!(Command::new("kill").args([name, &pid]).status().unwrap().success());
        };
        signal("-STOP");
        signal("-CONT");
        return;
    }
    system.set(kind);
    if kind.starts_with("clock") {
        load.link.wait_for_samples(300).await;
    } else {
        process.client.readiness(503).await;
    }
    system.clear();
}

/// Does what people do: looks at something, replays or deletes.
async fn act(client: &Client, random: &mut Random) {
    let ask = async |method: Method, path: &str, body: &Value| {
        let answer = client.request(method, path).json(body).send().await.unwrap();
        let status = answer.status().as_u16();
        let text = answer.text().await.unwrap_or_default();
        assert!([200, 202, 204, 404, 409, 429, 503].contains(&status), "{path}: {status} {text}");
        serde_json::from_str::<Value>(&text).unwrap_or_default()
    };
    for page in ["fleet", "faults", "sessions?state=open"] {
        ask(Method::GET, page, &Value::Null).await;
    }
    let ended = ask(Method::GET, "sessions?state=ended", &Value::Null).await;
    let Some(ended) = ended["items"].as_array().filter(|ended| !ended.is_empty()) else { return };
    let id = ended[random.below(ended.len())]["id"].as_str().unwrap();
    ask(Method::GET, &format!("sessions/{id}/telemetry"), &Value::Null).await;
    ask(Method::GET, &format!("sessions/{id}/trace"), &Value::Null).await;
    ask(Method::POST, &format!("sessions/{id}/replays"), &json!({})).await;
    let assets = ask(Method::GET, "assets?limit=500", &Value::Null).await;
    for asset in finished(&assets) {
        ask(Method::DELETE, &format!("assets/{asset}"), &Value::Null).await;
    }
}

/// The assets that a device has left: all but the last two, whose numbers follow each other.
fn finished(assets: &Value) -> Vec<String> {
    let mut laps: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for asset in assets["items"].as_array().into_iter().flatten() {
        let (device, lap) = asset["name"].as_str().unwrap().split_once('-').unwrap();
        laps.entry(device).or_default().push(lap.parse().unwrap());
    }
    let mut left = Vec::new();
    for (device, mut laps) in laps {
        laps.sort_unstable();
        laps.truncate(laps.len().saturating_sub(2));
        left.extend(laps.into_iter().map(|lap| format!("{device}-{lap}")));
    }
    left
}
