//! Devices over NATS and a cluster: nodes and servers fail, and nothing is lost or doubled.

use offbd_core::vocabulary::Sample;
use serde_json::json;

use super::{count, register_rigs};
use crate::support::broker::{Mosquitto, NATS_PASSWORD, Nats, NatsServers, mqtt_config};
use crate::support::bus_device::{BusDevice, MqttDevice, numbered};
use crate::support::cluster::{Cluster, N_NODES, NodeKind};
use crate::support::link::Link;
use crate::support::postgres::Postgres;
use crate::support::{Client, batch, eventually, read_csv, rig};

/// Samples of a batch.
const BATCH: usize = 10;

/// Starts nodes that serve the devices of these servers, and registers rigs.
async fn start(servers: &str, seed: &std::path::Path) -> (Cluster, Vec<String>) {
    start_with(vec![
        ("OFFBD_NATS__URL", servers.to_owned()),
        ("OFFBD_NATS__USER", "offbd".to_owned()),
        ("OFFBD_NATS__PASSWORD", NATS_PASSWORD.to_owned()),
        ("OFFBD_NATS__ISSUER_SEED", seed.display().to_string()),
        ("OFFBD_NATS__ACCOUNT", "OFFBD".to_owned()),
    ])
    .await
}

async fn start_with(environment: Vec<(&'static str, String)>) -> (Cluster, Vec<String>) {
    let kind = NodeKind { environment, ..NodeKind::default() };
    let cluster = Cluster::of(Postgres::new(), vec![kind; N_NODES]).await;
    let names = register_rigs(&cluster).await;
    (cluster, names)
}

/// Connects a device of each of `names`.
pub(super) async fn devices(client: &Client, names: &[String], ports: &[u16]) -> Vec<BusDevice> {
    let mut devices = Vec::new();
    for name in names {
        let token = json!({ "name": name, "role": "device", "asset": name });
        let made = client.post("tokens", &token).await.expect(201);
        let login = (name.as_str(), made["secret"].as_str().unwrap());
        devices.push(BusDevice::nats_of(ports, name, login).await);
    }
    devices
}

/// Sends `samples` of each device, all at the same time.
async fn deliver(devices: &mut [BusDevice], samples: &[Sample]) {
    let delivered = devices.iter_mut().map(|device| device.deliver(samples, BATCH));
    futures_util::future::join_all(delivered).await;
}

/// Waits until all nodes are connected to the MQTT broker.
async fn are_connected(cluster: &Cluster) {
    for client in cluster.clients() {
        let connected = async || count(&client, "offbd_bus_connected{bus=\"mqtt\"}").await == 1.0;
        eventually(|| async { connected().await.then_some(()) }).await;
    }
}

async fn are_stored_once(client: &Client, names: &[String], samples: &[Sample]) {
    for name in names {
        assert_eq!(client.recording(name, "s").await, samples, "{name}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_that_are_killed_and_paused_lose_nothing_of_devices_over_nats() {
    let (nats, samples) = (Nats::start(), rig(900, 300));
    let seed = nats.config().issuer_seed.unwrap();
    let (mut cluster, names) = start(&nats.config().url, &seed).await;
    let owned = [cluster.owned_by(1, &names).await, cluster.owned_by(2, &names).await].concat();
    let mut devices = devices(&cluster.client(0), &owned, &[nats.port]).await;
    deliver(&mut devices, &samples[..300]).await;
    cluster.kill(1);
    deliver(&mut devices, &samples[300..600]).await;
    cluster.restart(1);
    cluster.signal(2, "-STOP");
    deliver(&mut devices, &samples[600..800]).await;
    // What was sent meanwhile reaches the node when it wakes up: it is not its any more.
    cluster.signal(2, "-CONT");
    deliver(&mut devices, &samples[800..]).await;
    cluster.settled(N_NODES).await;
    are_stored_once(&cluster.client(2), &owned, &samples).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_killed_server_of_three_stops_no_request_and_devices_are_answered_by_another() {
    let (mut servers, samples) = (NatsServers::start(3), rig(900, 300));
    let (cluster, names) = start(&servers.url(), &servers.seed()).await;
    let (by_nats, by_http) = names.split_at(4);
    let mut devices = devices(&cluster.client(0), by_nats, &servers.ports).await;
    deliver(&mut devices, &samples[..300]).await;
    for i in 0..3 {
        servers.kill(i);
        let part = &samples[300 + i * 200..500 + i * 200];
        let over_http = async {
            for part in part.chunks(BATCH) {
                for (n, name) in by_http.iter().enumerate() {
                    // At once, without another try.
                    cluster.client(n % N_NODES).telemetry(name, Some("s"), part).await;
                }
            }
        };
        tokio::join!(over_http, deliver(&mut devices, part));
        servers.restart(i);
    }
    are_stored_once(&cluster.client(0), by_nats, &samples).await;
    are_stored_once(&cluster.client(0), by_http, &samples[300..]).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_broker_serves_all_nodes_at_the_same_time() {
    let (mosquitto, samples) = (Mosquitto::start(), rig(300, 300));
    let (cluster, names) = start_with(vec![("OFFBD_MQTT__URL", mosquitto.config().url)]).await;
    are_connected(&cluster).await;
    for name in &names {
        let mut device = BusDevice::mqtt(mosquitto.port, name, None).await;
        for (i, part) in samples.chunks(30).enumerate() {
            // Once: a node that another one has thrown off would not get it.
            let answer = device.ask(numbered(&i.to_string(), part)).await;
            assert_eq!(answer["accepted"], json!(part.len()), "{answer}");
        }
    }
    are_stored_once(&cluster.client(0), &names, &samples).await;
}

/// Publishes batches at QoS 1, and leaves them to the broker.
pub(super) async fn leave_to_broker(device: &mut MqttDevice, names: &[String], samples: &[Sample]) {
    for part in samples.chunks(BATCH) {
        for name in names {
            let topic = format!("offbd/v1/{name}/telemetry");
            let document = batch(Some("s"), part).to_string();
            device.leave(&topic, false, document).await;
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_that_are_paused_and_killed_lose_nothing_that_a_broker_has_at_qos_1() {
    let (mosquitto, samples) = (Mosquitto::start(), rig(400, 400));
    let (mut cluster, names) = start_with(vec![("OFFBD_MQTT__URL", mosquitto.config().url)]).await;
    are_connected(&cluster).await;
    let mut device = MqttDevice::connect(mosquitto.port, "all", None).await;
    leave_to_broker(&mut device, &names, &samples[..100]).await;
    cluster.owned_by(1, &names).await;
    cluster.signal(1, "-STOP");
    // Some arrive before the others know that it is paused, some while nobody owns its rigs.
    leave_to_broker(&mut device, &names, &samples[100..200]).await;
    cluster.taken_over_from(1).await;
    cluster.owned_by(2, &names).await;
    cluster.kill(2);
    leave_to_broker(&mut device, &names, &samples[200..]).await;
    cluster.taken_over_from(2).await;
    for name in &names {
        let client = cluster.client(0);
        let stored = async || recorded(&client, name, samples.len()).await;
        let mut stored = eventually(stored).await;
        stored.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        assert_eq!(stored, samples, "{name}");
    }
    cluster.signal(1, "-CONT");
    cluster.settled(2).await;
}

/// Returns the recording of the only session of an asset once it has `n` samples. Before its first
/// batch, the session is not there, and while the asset moves nothing is answered.
async fn recorded(client: &Client, asset: &str, n: usize) -> Option<Vec<Sample>> {
    let sessions = client.get(&format!("sessions?asset={asset}")).await.json();
    let session = &sessions["items"][0];
    if session["samples"].as_u64()? < n as u64 {
        return None;
    }
    let id = session["id"].as_str()?;
    let recording = client.get(&format!("sessions/{id}/telemetry")).await;
    (recording.status == 200).then(|| read_csv(&recording.text))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn batches_of_a_killed_owner_disconnect_no_node_from_the_broker() {
    let (mosquitto, samples) = (Mosquitto::start(), rig(200, 200));
    let (link, port) = Link::to_port(mosquitto.port).await;
    let (mut cluster, names) = start_with(vec![("OFFBD_MQTT__URL", mqtt_config(port).url)]).await;
    are_connected(&cluster).await;
    let mut device = MqttDevice::connect(mosquitto.port, "all", None).await;
    let owned = cluster.owned_by(1, &names).await;
    leave_to_broker(&mut device, &owned, &samples[..100]).await;
    cluster.kill(1);
    leave_to_broker(&mut device, &owned, &samples[100..]).await;
    cluster.taken_over_from(1).await;
    for name in &owned {
        let client = cluster.client(0);
        let stored = async || recorded(&client, name, samples.len()).await;
        let mut stored = eventually(stored).await;
        stored.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        assert_eq!(stored, samples, "{name}");
    }
    assert_eq!(link.n_connections(), N_NODES);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_owner_alone_refuses_a_batch_that_is_too_long_and_names_it() {
    let nats = Nats::start();
    let seed = nats.config().issuer_seed.unwrap();
    let (cluster, names) = start(&nats.config().url, &seed).await;
    let mut devices = devices(&cluster.client(0), &names[..1], &[nats.port]).await;
    let mut long = br#"{"id":"long","note":""#.to_vec();
    long.resize(5 << 20, b'x');
    let answer = devices[0].ask(long).await;
    assert_eq!((&answer["status"], &answer["id"]), (&json!(413), &json!("long")), "{answer}");
    let of_all = async |outcome: &str| {
        let series = format!("offbd_bus_messages_total{{bus=\"nats\",outcome=\"{outcome}\"}}");
        let mut n = 0.0;
        for client in cluster.clients() {
            n += count(&client, &series).await;
        }
        n
    };
    // Each node has got it.
    eventually(async || {
        let n = of_all("too_large").await + of_all("elsewhere").await;
        (n >= N_NODES as f64).then_some(())
    })
    .await;
    assert_eq!(of_all("too_large").await, 1.0);
}
