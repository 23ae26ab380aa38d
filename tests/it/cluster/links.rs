//! The links of a node are cut one way, slow or lossy: to the database, to NATS,
//! and from the other nodes.
//! What depends on them goes on elsewhere, nothing is lost, and afterwards the node takes part.

use std::time::Duration;

use reqwest::Method;
use serde_json::{Value, json};

use super::bus::devices;
use super::clients::{RecordedClients, Subscriber};
use super::{history, register_rigs};
use crate::support::broker::{NATS_PASSWORD, Nats, free_port};
use crate::support::bus_device::BusDevice;
use crate::support::cluster::{Cluster, NodeKind, call};
use crate::support::history::Recorder;
use crate::support::link::{Link, LinkMode};
use crate::support::postgres::{self, Postgres};
use crate::support::{eventually, registration, rig};
use offbd_core::vocabulary::Sample;

const NODES: usize = 2;

/// Samples that are acknowledged while a link fails, and again once it does not.
const SAMPLES: u64 = 150;

const SLOW: LinkMode = LinkMode::Delay(Duration::from_millis(100));

/// The faults of a link, each with the modes of both directions. Those that cut it are first; a
/// connection to the database needs about 2 kB before it can be used.
const LINK_FAULTS: [(LinkMode, LinkMode); 7] = [
    (LinkMode::Drop, LinkMode::Pass),
    (LinkMode::Pass, LinkMode::Drop),
    (LinkMode::Drop, LinkMode::Drop),
    (SLOW, LinkMode::Pass),
    (LinkMode::Pass, SLOW),
    (LinkMode::CutAfter(20_000), LinkMode::Pass),
    (LinkMode::Pass, LinkMode::CutAfter(20_000)),
];

/// The faults without those that are `long`, unless the environment variable FAULTS is set.
fn faults(long: &[(LinkMode, LinkMode)]) -> Vec<(LinkMode, LinkMode)> {
    let all = std::env::var_os("FAULTS").is_some();
    LINK_FAULTS.into_iter().filter(|fault| all || !long.contains(fault)).collect()
}

/// Two nodes, of which each has its own links.
struct LinkedCluster {
    cluster: Cluster,
    to_database: Vec<(Link, tempfile::TempDir)>,
    between: Vec<Link>,
    to_nats: Vec<Link>,
}

impl LinkedCluster {
    async fn start() -> Self {
        Self::start_with(None).await
    }

    /// Starts the nodes, which serve the devices of a NATS server if there is one.
    async fn start_with(nats: Option<&Nats>) -> Self {
        let server = Postgres::new();
        // The database has to exist before the first node connects.
        server.database("cluster");
        let (mut to_database, mut between, mut kinds) = (Vec::new(), Vec::new(), Vec::new());
        let mut to_nats = Vec::new();
        for _ in 0..NODES {
            let (link, directory) = Link::to_database(server.directory());
            let url = postgres::url(directory.path(), "cluster");
            to_database.push((link, directory));
            let port = free_port();
            let (link, linked) = Link::to_port(port).await;
            between.push(link);
            let mut environment = vec![
                ("OFFBD_DATABASE", url),
                ("OFFBD_CLUSTER__LISTEN", format!("127.0.0.1:{port}")),
                ("OFFBD_CLUSTER__ADVERTISE", format!("127.0.0.1:{linked}")),
            ];
            if let Some(nats) = nats {
                let (link, linked) = Link::to_port(nats.port).await;
                to_nats.push(link);
                environment.extend(of_nats(nats, linked));
            }
            kinds.push(NodeKind { environment, ..NodeKind::default() });
        }
        let cluster = Cluster::begin(server, kinds).await;
        Self { cluster, to_database, between, to_nats }
    }

    /// Starts clients at the first node, and registers a rig that they look at.
    async fn clients(&self) -> RecordedClients {
        let client = self.cluster.client(0);
        call(&client, Method::POST, "assets", &registration("rig")).await;
        RecordedClients::start(&self.cluster, &client, 3, &["rig".to_owned()]).await
    }

    /// The node that owns most.
    async fn greatest(&self) -> usize {
        eventually(|| async {
            let (_, view) =
                call(&self.cluster.client(0), Method::GET, "cluster", &Value::Null).await;
            let nodes = view["nodes"].as_array().filter(|nodes| nodes.len() == NODES)?;
            let greatest = nodes.iter().max_by_key(|node| node["partitions"].as_u64())?;
            (0..NODES).find(|i| greatest["name"] == format!("node-{i}").as_str())
        })
        .await
    }

    /// Waits until all nodes answer, and samples are taken through each.
    async fn goes_on(&self, clients: &RecordedClients) {
        self.cluster.complete(NODES).await;
        for client in self.cluster.clients() {
            client.readiness(200).await;
            clients.link().set_service(&client);
            clients.link().wait_for_samples(SAMPLES).await;
        }
    }
}

/// The settings of a node that reaches a NATS server on `port`, perhaps that of a link.
pub(super) fn of_nats(nats: &Nats, port: u16) -> Vec<(&'static str, String)> {
    vec![
        ("OFFBD_NATS__URL", format!("nats://127.0.0.1:{port}")),
        ("OFFBD_NATS__USER", "offbd".to_owned()),
        ("OFFBD_NATS__PASSWORD", NATS_PASSWORD.to_owned()),
        ("OFFBD_NATS__ISSUER_SEED", nats.config().issuer_seed.unwrap().display().to_string()),
        ("OFFBD_NATS__ACCOUNT", "OFFBD".to_owned()),
    ]
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_idle_node_whose_answers_of_the_database_are_lost_takes_part_again() {
    let it = LinkedCluster::start().await;
    let node = it.greatest().await;
    let link = &it.to_database[node].0;
    link.set(LinkMode::Pass, LinkMode::Drop);
    it.cluster.taken_over_from(node).await;
    link.set(LinkMode::Pass, LinkMode::Pass);
    // Nothing but its looks at the partitions waits for an answer.
    it.cluster.complete(NODES).await;
    it.cluster.client(node).readiness(200).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_whose_link_to_the_database_fails_loses_nothing_and_takes_part_again() {
    let it = LinkedCluster::start().await;
    let clients = it.clients().await;
    // A node waits 30 s for a commit whose answer is lost.
    let long = [(LinkMode::Pass, LinkMode::Drop), (LinkMode::Drop, LinkMode::Drop)];
    for (up, down) in faults(&long) {
        let node = it.greatest().await;
        let link = &it.to_database[node].0;
        clients.link().set_service(&it.cluster.client(1 - node));
        link.set(up, down);
        if [up, down].contains(&LinkMode::Drop) {
            it.cluster.taken_over_from(node).await;
        }
        clients.link().wait_for_samples(SAMPLES).await;
        link.set(LinkMode::Pass, LinkMode::Pass);
        println!("{up:?}, {down:?}: goes on");
        it.goes_on(&clients).await;
    }
    clients.stop_and_check(&it.cluster).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_that_others_cannot_reach_is_asked_directly_and_then_reached_again() {
    let it = LinkedCluster::start().await;
    let clients = it.clients().await;
    for (up, down) in LINK_FAULTS {
        let node = it.greatest().await;
        let other = it.cluster.client(1 - node);
        it.between[node].set(up, down);
        clients.link().set_service(&other);
        if [up, down].contains(&LinkMode::Drop) {
            // It owns the rigs, so the other one cannot tell what it does.
            let fleet = other.get("fleet").await.expect(200);
            assert_eq!(fleet["missing_nodes"], json!([format!("node-{node}")]), "{fleet}");
            clients.link().set_service(&it.cluster.client(node));
        }
        clients.link().wait_for_samples(SAMPLES).await;
        it.between[node].set(LinkMode::Pass, LinkMode::Pass);
        println!("{up:?}, {down:?}: goes on");
        it.goes_on(&clients).await;
    }
    clients.stop_and_check(&it.cluster).await;
}

/// Samples of a batch over NATS.
const BATCH: usize = 10;

/// Delivers samples of all rigs, all at the same time, and records it.
pub(super) async fn deliver(
    devices: &mut [BusDevice],
    names: &[String],
    recorder: &Recorder,
    samples: &[Sample],
) {
    let delivered = devices.iter_mut().zip(names).map(async |(device, name)| {
        for part in samples.chunks(BATCH) {
            let number = recorder.lock().send_batch(name, "s", part);
            device.deliver(part, BATCH).await;
            recorder.lock().tell_batch(number, &Value::Null);
        }
    });
    futures_util::future::join_all(delivered).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_whose_link_to_nats_fails_loses_nothing_and_answers_again() {
    let (nats, samples) = (Nats::start(), rig(1400, 500));
    let it = LinkedCluster::start_with(Some(&nats)).await;
    let client = it.cluster.client(0);
    let subscriber = Subscriber::start(&it.cluster, &client).await;
    let recorder = &subscriber.recorder;
    let names = register_rigs(&it.cluster).await;
    let names = &names[..4];
    let mut devices = devices(&client, names, &[nats.port]).await;
    let faults = faults(&[(LinkMode::Drop, LinkMode::Drop)]);
    for ((up, down), part) in faults.into_iter().zip(samples.chunks(200)) {
        let (during, after) = part.split_at(100);
        let link = &it.to_nats[it.greatest().await];
        link.set(up, down);
        let heal = async {
            // The others go on at once, and the devices of this node after it has noticed.
            if [up, down].contains(&LinkMode::Drop) {
                link.has_lost(1).await;
                link.set(LinkMode::Pass, LinkMode::Pass);
            }
        };
        tokio::join!(deliver(&mut devices, names, recorder, during), heal);
        link.set(LinkMode::Pass, LinkMode::Pass);
        deliver(&mut devices, names, recorder, after).await;
        println!("{up:?}, {down:?}: goes on");
    }
    history::check(&it.cluster, recorder).await;
}
