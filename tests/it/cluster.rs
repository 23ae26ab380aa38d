//! Several nodes on one PostgreSQL database: any of them answers, those that are killed,
//! stopped or paused lose nothing, and none writes what it does not own any more.

#[cfg(all(feature = "nats", feature = "mqtt"))]
mod bus;
mod old_copy;
mod outage;
mod ownership;
mod streams;
mod versions;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use reqwest::Method;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::support::cluster::{Cluster, N_NODES, call};
use crate::support::device::{DeviceLoad, Random};
use crate::support::held_socket::HeldSocket;
use crate::support::postgres;
use crate::support::process::{Process, Refusal};
use crate::support::{Client, Events, batch, eventually, judged, registration, rig};
use offbd_core::vocabulary::Sample;

/// Faults of the long test, unless the environment variable FAULTS is set.
const FAULTS: usize = 6;

/// Registers rigs through the first node: many, so that each node owns some.
async fn register_rigs(cluster: &Cluster) -> Vec<String> {
    let names: Vec<_> = (0..12).map(|i| format!("rig-{i:02}")).collect();
    for name in &names {
        call(&cluster.client(0), Method::POST, "assets", &registration(name)).await;
    }
    names
}

/// Sends samples of each rig to `client`; all are accepted.
async fn send_all(client: &Client, names: &[String], samples: &[Sample]) {
    for name in names {
        let path = format!("assets/{name}/telemetry");
        let sent = batch(Some("s"), samples);
        let (status, ack) = call(client, Method::POST, &path, &sent).await;
        assert_eq!((status, &ack["accepted"]), (200, &json!(samples.len())), "{ack}");
    }
}

/// Pauses a node after a third of `samples` of each rig; the next third goes to the nodes that
/// have taken its rigs over. Returns the names of the rigs.
async fn pause_second_node(cluster: &Cluster, samples: &[Sample]) -> Vec<String> {
    let names = register_rigs(cluster).await;
    send_all(&cluster.client(0), &names, &samples[..300]).await;
    cluster.owned_by(1, &names).await;
    cluster.signal(1, "-STOP");
    cluster.taken_over_from(1).await;
    send_all(&cluster.client(0), &names, &samples[300..600]).await;
    names
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn any_node_answers_for_every_asset() {
    let cluster = Cluster::start().await;
    let samples = rig(1500, 500);
    let (hash, faults) = judged("rig-0", &samples);
    assert!(!faults.is_empty());
    let feed = cluster.client(2).request(Method::GET, "events").send().await.unwrap();
    let mut events = Events::new(feed);
    for i in 0..6 {
        // Registered, filled, looked at and ended through different nodes.
        let asset = format!("rig-{i}");
        let at = |n: usize| cluster.client((i + n) % N_NODES);
        let made = call(&at(0), Method::POST, "assets", &registration(&asset)).await;
        assert_eq!(made.0, 201, "{made:?}");
        for (n, part) in samples.chunks(500).enumerate() {
            let path = format!("assets/{asset}/telemetry");
            let (status, ack) = call(&at(n), Method::POST, &path, &batch(Some("s"), part)).await;
            assert_eq!((status, &ack["accepted"]), (200, &json!(part.len())), "{ack}");
        }
        let state = at(1).get(&format!("assets/{asset}/state")).await.expect(200);
        assert_eq!(state["samples"], samples.len(), "{state}");
        let sessions = at(2).get(&format!("sessions?asset={asset}")).await.expect(200);
        let id = sessions["items"][0]["id"].as_str().unwrap().to_owned();
        let ended = call(&at(1), Method::POST, &format!("sessions/{id}/end"), &Value::Null).await;
        assert_eq!(ended.1["verdict"]["faults"], json!(faults), "{ended:?}");
        if i == 0 {
            assert_eq!(ended.1["verdict"]["verdict_hash"], hash);
        }
        let recording = at(2).recording(&asset, "s").await;
        assert_eq!(recording, samples);
        let known = at(0).get(&format!("assets/{asset}/faults?status=all")).await.expect(200);
        assert!(!known["items"].as_array().unwrap().is_empty());
    }
    let fleet = cluster.client(1).get("fleet").await.expect(200);
    assert_eq!(fleet["items"].as_array().unwrap().len(), 6);
    // One node tells of the events of all, each once and in order.
    let stored = cluster.client(0).get("faults?status=all").await.expect(200);
    let assets: std::collections::BTreeSet<_> =
        stored["items"].as_array().unwrap().iter().map(|f| f["asset"].to_string()).collect();
    assert_eq!(assets.len(), 6);
    let (mut last, mut seen) = (0, std::collections::BTreeSet::new());
    while seen.len() < 6 {
        let event = events.next().await;
        let id = event["id"].as_i64().unwrap();
        assert_eq!(id, last + 1, "no gap, none twice");
        last = id;
        seen.insert(event["asset"].to_string());
    }
}

/// Waits until a node says that it is not ready, in these words.
async fn not_ready(client: &Client, words: &str) {
    eventually(|| async {
        let answer = client.get("/readyz").await;
        (answer.status == 503 && answer.text.contains(words)).then_some(())
    })
    .await;
}

/// Rigs that are asked, at each fault of their node, for an acknowledgement.
struct Probes {
    names: Vec<String>,
    samples: Vec<Sample>,
    /// How long the first acknowledgement took after a fault, by its kind; of a node that is
    /// stopped, the longest until it had ended.
    times: BTreeMap<&'static str, Vec<Duration>>,
}

impl Probes {
    async fn new(cluster: &Cluster) -> Self {
        let names = register_rigs(cluster).await;
        Self { names, samples: rig(6000, 6000), times: BTreeMap::new() }
    }

    /// Returns the batch of this fault.
    fn part(&self, fault: usize) -> Vec<Sample> {
        let at = fault * 10 % self.samples.len();
        self.samples[at..at + 10].to_vec()
    }

    fn add(&mut self, kind: &'static str, times: Vec<Duration>) {
        self.times.entry(kind).or_default().extend(times);
    }

    fn print(&mut self) {
        for (kind, times) in &mut self.times {
            times.sort();
            let at = |percent: usize| times[(times.len() * percent / 100).min(times.len() - 1)];
            if !times.is_empty() {
                let (p50, p99, worst) = (at(50), at(99), at(100));
                let n = times.len();
                println!("{kind}, {n} rigs: p50 {p50:?}, p99 {p99:?}, worst {worst:?}");
            }
        }
    }
}

/// Sends a batch of each rig to `client` until it is acknowledged, and again until `ended`.
/// Returns the longest time that took, of each.
async fn longest_acknowledgements(
    client: Client,
    names: Vec<String>,
    part: Vec<Sample>,
    ended: Arc<AtomicBool>,
) -> Vec<Duration> {
    let longest = async |name: &String| {
        let mut longest = acknowledgement(&client, name, &part).await;
        while !ended.load(Ordering::SeqCst) {
            longest = longest.max(acknowledgement(&client, name, &part).await);
        }
        longest
    };
    futures_util::future::join_all(names.iter().map(longest)).await
}

#[expect(clippy::disallowed_methods, reason = "the time is measured")]
async fn acknowledgement(client: &Client, name: &str, part: &[Sample]) -> Duration {
    let start = Instant::now();
    let path = format!("assets/{name}/telemetry");
    let (status, ack) = call(client, Method::POST, &path, &batch(Some("s"), part)).await;
    assert_eq!(status, 200, "{ack}");
    start.elapsed()
}

/// How often a node was refused because another one had taken what it owned.
async fn n_refused(client: &Client) -> f64 {
    let lost = count(client, "offbd_partitions_lost_total").await;
    lost + count(client, "offbd_commits_overtaken_total").await
}

async fn count(client: &Client, metric: &str) -> f64 {
    let text = client.get("/metrics").await.text;
    let value = text.lines().find_map(|line| line.strip_prefix(metric)?.strip_prefix(' '));
    value.map_or(0.0, |value| value.parse().unwrap())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_that_are_killed_paused_and_stopped_lose_nothing() {
    let n_faults = std::env::var("FAULTS").map_or(FAULTS, |n| n.parse().unwrap());
    let mut cluster = Cluster::start().await;
    let (mut probes, mut n_met) = (Probes::new(&cluster).await, 0);
    let load = DeviceLoad::start(4, &cluster.client(0), cluster.data.path(), Some(&cluster.url()));
    let mut random = Random(7);
    let mut n_by_kind = BTreeMap::<&str, usize>::new();
    for fault in 0..n_faults {
        load.link.wait_for_samples(random.below(400) as u64 + 50).await;
        let node = random.below(N_NODES);
        let other = (node + 1 + random.below(N_NODES - 1)) % N_NODES;
        let kind = ["kill", "pause", "stop"][fault % 3];
        *n_by_kind.entry(kind).or_default() += 1;
        let names = cluster.rigs_of(node, &probes.names).await;
        let owned_any = !names.is_empty();
        let ended = Arc::new(AtomicBool::new(kind != "stop"));
        let asked = longest_acknowledgements(
            cluster.client(other),
            names,
            probes.part(fault),
            ended.clone(),
        );
        let times = match kind {
            "kill" => {
                cluster.kill(node);
                load.link.set_service(&cluster.client(other));
                let asked = tokio::spawn(asked);
                cluster.restart(node);
                asked.await.unwrap()
            }
            "pause" => {
                let n_before = n_refused(&cluster.client(node)).await;
                cluster.signal(node, "-STOP");
                load.link.set_service(&cluster.client(other));
                let times = asked.await;
                cluster.taken_over_from(node).await;
                cluster.signal(node, "-CONT");
                // A node that is not refused when it wakes up has owned nothing.
                if owned_any {
                    let woken = cluster.client(node);
                    eventually(|| async { (n_refused(&woken).await > n_before).then_some(()) })
                        .await;
                    n_met += 1;
                }
                times
            }
            _ => {
                load.link.set_service(&cluster.client(other));
                let asked = tokio::spawn(asked);
                cluster.stop(node).await;
                ended.store(true, Ordering::SeqCst);
                cluster.restart(node);
                asked.await.unwrap()
            }
        };
        probes.add(kind, times);
        // After each fault everything goes on, through each node.
        load.link.set_service(&cluster.client(random.below(N_NODES)));
        load.link.wait_for_samples(50).await;
    }
    let samples = load.link.acknowledged();
    let laps = load.stop().await;
    println!("{n_by_kind:?}; {laps} recordings, {samples} samples: each stored once");
    probes.print();
    cluster.settled(N_NODES).await;
    assert!(n_met > 0 || n_faults < 2, "no node was paused that owned something");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_paused_node_is_refused_when_it_wakes_up_and_takes_part_again() {
    let (cluster, samples) = (Cluster::start().await, rig(900, 300));
    let names = pause_second_node(&cluster, &samples).await;
    cluster.signal(1, "-CONT");
    // The node that was paused may believe that it owns what it owned. Its engines have not
    // seen the second batch: nothing that they say may be stored or answered.
    send_all(&cluster.client(1), &names, &samples[600..]).await;
    cluster.settled(N_NODES).await;
    for name in &names {
        let recording = cluster.client(2).recording(name, "s").await;
        assert_eq!(recording, samples, "{name}");
        let session = cluster.client(1).end(name, "s").await;
        assert_eq!(session["verdict"]["verdict_hash"], judged(name, &samples).0);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_paused_node_that_wakes_up_answers_no_read_from_its_own_past() {
    let (cluster, samples) = (Cluster::start().await, rig(900, 300));
    let names = pause_second_node(&cluster, &samples).await;
    // The requests are there when the node wakes up, before it can look at the database.
    let address = cluster.client(1).address;
    let mut waiting = Vec::new();
    for name in &names {
        let mut stream = TcpStream::connect(&address).await.unwrap();
        let head = format!("GET /api/v1/assets/{name}/state HTTP/1.1\r\nhost: {address}\r\n");
        stream.write_all(format!("{head}connection: close\r\n\r\n").as_bytes()).await.unwrap();
        waiting.push(stream);
    }
    cluster.signal(1, "-CONT");
    for mut stream in waiting {
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await.unwrap();
        if answer.starts_with("HTTP/1.1 200") {
            assert!(answer.contains("\"samples\":600"), "{answer}");
        } else {
            assert!(answer.starts_with("HTTP/1.1 503"), "{answer}");
        }
    }
    // Once it has looked, it answers.
    for name in &names {
        let path = format!("assets/{name}/state");
        let (status, state) = call(&cluster.client(1), Method::GET, &path, &Value::Null).await;
        assert_eq!((status, &state["samples"]), (200, &json!(600)), "{name}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_that_is_cut_off_from_the_database_answers_no_read_from_its_own_past() {
    let mut way = None;
    let cluster = Cluster::start_with(|postgres| {
        let held = way.insert(HeldSocket::new(postgres.directory()));
        // The database has to exist before the first node connects.
        postgres.database("cluster");
        Some(postgres::url(held.directory.path(), "cluster"))
    })
    .await;
    let (way, samples) = (way.unwrap(), rig(900, 300));
    let names = register_rigs(&cluster).await;
    send_all(&cluster.client(0), &names, &samples[..300]).await;
    let owned = cluster.owned_by(1, &names).await;
    way.hold(true);
    cluster.taken_over_from(1).await;
    send_all(&cluster.client(0), &names, &samples[300..600]).await;
    // The node cannot learn that it has lost its rigs: it has to admit that it does not know.
    let client = cluster.client(1);
    let states = owned.iter().map(async |name| client.get(&format!("assets/{name}/state")).await);
    for answer in futures_util::future::join_all(states).await {
        answer.problem(503);
    }
    way.hold(false);
    cluster.settled(N_NODES).await;
    send_all(&client, &names, &samples[600..]).await;
    for name in &names {
        assert_eq!(client.recording(name, "s").await, samples, "{name}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_fleet_is_gathered_from_all_nodes_and_says_which_is_missing() {
    let cluster = Cluster::start().await;
    let samples = rig(300, 100);
    let names = register_rigs(&cluster).await;
    send_all(&cluster.client(0), &names, &samples).await;
    // Only the owner of a rig knows how far the last batch was behind.
    let fleets: Vec<Value> = futures_util::future::join_all(
        cluster.clients().iter().map(async |client| client.get("fleet").await.expect(200)),
    )
    .await;
    for fleet in &fleets {
        assert_eq!(fleet["missing_nodes"], json!([]), "{fleet}");
        assert_eq!(fleet["items"], fleets[0]["items"]);
        for entry in fleet["items"].as_array().unwrap() {
            assert_eq!((&entry["lag_s"], &entry["stale"]), (&json!(0.0), &json!(false)), "{entry}");
        }
    }
    let owned = cluster.owned_by(1, &names).await;
    cluster.signal(1, "-STOP");
    let fleet = cluster.client(0).get("fleet").await.expect(200);
    assert_eq!(fleet["missing_nodes"], json!(["node-1"]), "{fleet}");
    let items = fleet["items"].as_array().unwrap();
    assert_eq!(items.len(), names.len());
    let stale: Vec<_> = items.iter().filter(|entry| entry["stale"] == true).collect();
    let stale: Vec<_> = stale.iter().map(|entry| entry["asset"].as_str().unwrap()).collect();
    assert_eq!(stale, owned);
    cluster.signal(1, "-CONT");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_does_not_belong_to_the_cluster_is_refused() {
    let cluster = Cluster::start().await;
    let refusal = |settings: &[(&str, &str)]| match cluster.try_node(9, settings) {
        Ok(_) => panic!("{settings:?} is accepted"),
        Err(Refusal { log, .. }) => log,
    };
    let log = refusal(&[("OFFBD_CLUSTER__PARTITIONS", "32")]);
    assert!(log.contains("divided into 16 partitions, and `cluster.partitions` is 32"), "{log}");
    let log = refusal(&[("OFFBD_DATABASE", "sqlite:/nowhere/x.sqlite")]);
    assert!(log.contains("`cluster` needs a PostgreSQL database"), "{log}");
    let log = refusal(&[("OFFBD_CLUSTER__NAME", "a b")]);
    assert!(log.contains("`cluster.name` must be 1 to 64 letters"), "{log}");
    let log = refusal(&[("OFFBD_CLUSTER__LISTEN", "0.0.0.0:0")]);
    assert!(log.contains("`cluster.advertise` is missing"), "{log}");
    // A process that works alone would not know of the partitions' owners.
    let url = cluster.url();
    // On a busy machine the attempt to connect may time out before the wait for the lock does.
    eventually(|| async {
        let alone = Process::try_start(cluster.data.path(), &[("OFFBD_DATABASE", Path::new(&url))]);
        let Err(Refusal { log, .. }) = alone else { panic!("it starts beside the cluster") };
        log.contains("another process uses this database").then_some(())
    })
    .await;
}
