//! Several nodes on one PostgreSQL database: any of them answers, those that are killed,
//! stopped or paused lose nothing, and none writes what it does not own any more.

#[cfg(all(feature = "nats", feature = "mqtt"))]
mod bus;
mod clients;
#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod clocks;
mod events;
mod history;
mod kills;
mod link_figures;
#[cfg(all(feature = "nats", feature = "mqtt"))]
mod links;
#[cfg(all(target_os = "linux", target_env = "gnu", feature = "nats", feature = "mqtt"))]
mod lossy;
mod old_copy;
mod outage;
mod ownership;
mod streams;
#[cfg(all(feature = "nats", feature = "mqtt"))]
mod tokens;
#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod vanishing;
mod versions;
mod zombies;

use std::path::Path;

use reqwest::Method;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::support::cluster::{Cluster, N_NODES, call};
use crate::support::held_socket::HeldSocket;
use crate::support::postgres;
use crate::support::process::{Process, Refusal};
use crate::support::{Client, Events, batch, eventually, judged, registration, rig};
use offbd_core::vocabulary::Sample;

/// Registers rigs through the first node: many, so that each node owns some.
async fn register_rigs(cluster: &Cluster) -> Vec<String> {
    let names: Vec<_> = (0..12).map(|i| format!("rig-{i:02}")).collect();
    for name in &names {
        call(&cluster.client(0), Method::POST, "assets", &registration(name)).await;
    }
    names
}

/// Sends samples of each rig to `client`; all are stored. An answer that was lost while a rig
/// moved is asked for again.
async fn send_all(client: &Client, names: &[String], samples: &[Sample]) {
    for name in names {
        let path = format!("assets/{name}/telemetry");
        let sent = batch(Some("s"), samples);
        let (status, ack) = call(client, Method::POST, &path, &sent).await;
        let n_stored = ack["accepted"].as_u64().zip(ack["duplicate"].as_u64());
        let n_stored = n_stored.map(|(accepted, duplicate)| accepted + duplicate);
        assert_eq!((status, n_stored), (200, Some(samples.len() as u64)), "{ack}");
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

async fn count(client: &Client, metric: &str) -> f64 {
    let text = client.get("/metrics").await.text;
    let value = text.lines().find_map(|line| line.strip_prefix(metric)?.strip_prefix(' '));
    value.map_or(0.0, |value| value.parse().unwrap())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_node_lists_the_samples_of_open_sessions() {
    let (cluster, samples) = (Cluster::start().await, rig(100, 100));
    let names = register_rigs(&cluster).await;
    send_all(&cluster.client(0), &names, &samples).await;
    for client in cluster.clients() {
        let page = client.get("sessions?state=open").await.json();
        let items = page["items"].as_array().unwrap();
        assert_eq!(items.len(), names.len());
        assert!(items.iter().all(|session| session["samples"] == 100), "{page}");
    }
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
    let other = cluster.client(0).get("cluster").await.expect(200)["nodes"][0]["address"].clone();
    let log = refusal(&[("OFFBD_CLUSTER__ADVERTISE", other.as_str().unwrap())]);
    assert!(log.contains("does not lead to this node: nothing arrives here"), "{log}");
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
