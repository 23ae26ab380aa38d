//! Every connection to a node loses some of the segments that arrive: those of its clients, of
//! other nodes, of NATS and of the database. Meanwhile nodes are killed and paused under load, and
//! nothing is lost.

use super::bus::devices;
use super::clients::RecordedClients;
use super::links::{deliver, of_nats};
use super::register_rigs;
use crate::support::broker::{Nats, free_port};
use crate::support::cluster::{Cluster, N_NODES, NodeKind};
use crate::support::device::{Random, ServiceLink};
use crate::support::packets::PacketLoss;
use crate::support::postgres::Postgres;
use crate::support::rig;

/// Segments of 100 that are lost.
const PERCENT: u64 = 5;

/// Faults, unless the environment variable FAULTS is set.
const FAULTS: usize = 2;

/// Samples over HTTP that are acknowledged before, during and after a fault.
const SAMPLES: u64 = 100;

/// Samples of each device over NATS for each fault.
const BUS_SAMPLES: usize = 100;

/// Devices over NATS.
const N_DEVICES: usize = 4;

/// Starts nodes that lose segments from their start on.
async fn start(nats: &Nats, losses: &[PacketLoss]) -> Cluster {
    let kind = |loss: &PacketLoss| {
        loss.begin_with(PERCENT);
        let environment = [loss.environment(), of_nats(nats, nats.port)].concat();
        NodeKind { environment, ..NodeKind::default() }
    };
    let kinds = losses.iter().map(kind).collect();
    Cluster::of(Postgres::on_port(free_port()), kinds).await
}

/// Kills and pauses nodes in turn. The clients of `link` change to another node each time.
async fn fail(cluster: &mut Cluster, link: &ServiceLink, n_faults: usize) {
    let mut random = Random(11);
    for fault in 0..n_faults {
        link.wait_for_samples(SAMPLES).await;
        let node = random.below(N_NODES);
        let other = cluster.client((node + 1 + random.below(N_NODES - 1)) % N_NODES);
        if fault % 2 == 0 {
            cluster.kill(node);
            link.set_service(&other);
            link.wait_for_samples(SAMPLES).await;
            cluster.restart(node);
        } else {
            cluster.signal(node, "-STOP");
            link.set_service(&other);
            cluster.taken_over_from(node).await;
            link.wait_for_samples(SAMPLES).await;
            cluster.signal(node, "-CONT");
        }
        link.set_service(&cluster.client(random.below(N_NODES)));
        link.wait_for_samples(SAMPLES).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_whose_connections_lose_segments_lose_nothing() {
    let n_faults = std::env::var("FAULTS").map_or(FAULTS, |n| n.parse().unwrap());
    let (nats, folder) = (Nats::start(), tempfile::tempdir().unwrap());
    let losses = PacketLoss::of_processes(N_NODES, folder.path());
    let mut cluster = start(&nats, &losses).await;
    let names = register_rigs(&cluster).await;
    let client = cluster.client(0);
    let clients = RecordedClients::start(&cluster, &client, 3, &names).await;
    let (names, samples) = (&names[..N_DEVICES], rig(n_faults * BUS_SAMPLES, 100));
    let mut devices = devices(&client, names, &[nats.port]).await;
    let delivered = deliver(&mut devices, names, &clients.subscriber.recorder, &samples);
    tokio::join!(delivered, fail(&mut cluster, clients.link(), n_faults));
    cluster.complete(N_NODES).await;
    for (i, loss) in losses.iter().enumerate() {
        let n = loss.end().await;
        println!("node-{i} had to send {n} segments again");
        assert!(n > 0, "node-{i} has lost nothing");
    }
    clients.stop_and_check(&cluster).await;
}
