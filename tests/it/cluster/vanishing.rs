//! Packets between nodes vanish silently while each node reaches the database: what a node
//! cannot answer without the other one it refuses in time, and everything goes on when packets
//! pass again.

use std::time::Duration;

use serde_json::Value;
use tokio::time::timeout;

use super::streams::{closed, is_acknowledged, stream};
use super::{register_rigs, send_all};
use crate::support::cluster::{Cluster, NodeKind};
use crate::support::packets::PacketLoss;
use crate::support::postgres::Postgres;
use crate::support::{Client, batch, judged, rig};
use offbd_core::vocabulary::Sample;

const NODES: usize = 2;

/// Longest wait for a refusal. It comes within the bounds of `crates/offbd-http/src/forward.rs`, and without
/// them after a minute.
const REFUSED_WITHIN: Duration = Duration::from_secs(30);

/// The ports of the nodes for each other.
async fn ports(client: &Client) -> Vec<u16> {
    let view = client.get("cluster").await.expect(200);
    let nodes = view["nodes"].as_array().unwrap();
    let port = |node: &Value| node["address"].as_str()?.rsplit(':').next()?.parse().ok();
    nodes.iter().map(|node| port(node).unwrap()).collect()
}

/// Sends a batch that is refused because the owner of the asset does not answer.
async fn is_refused(client: &Client, asset: &str, samples: &[Sample]) {
    let path = format!("assets/{asset}/telemetry");
    let sent = batch(Some("s"), samples);
    let answer = timeout(REFUSED_WITHIN, client.post(&path, &sent)).await.expect("a refusal");
    answer.problem(503);
    assert_eq!(answer.headers["retry-after"], "1");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_that_another_one_vanishes_from_refuses_in_time_and_goes_on_afterwards() {
    let folder = tempfile::tempdir().unwrap();
    let losses = PacketLoss::of_processes(NODES, folder.path());
    let kind =
        |loss: &PacketLoss| NodeKind { environment: loss.environment(), ..NodeKind::default() };
    let cluster = Cluster::of(Postgres::new(), losses.iter().map(kind).collect()).await;
    let (client, samples) = (cluster.client(0), rig(900, 300));
    let names = register_rigs(&cluster).await;
    let (near, far) = (cluster.owned_by(0, &names).await, cluster.owned_by(1, &names).await);
    // Connections between the nodes are there: some that are kept, one in use.
    send_all(&client, &names, &samples[..300]).await;
    let mut socket = stream(&client, &far[0]).await;
    is_acknowledged(&mut socket, &samples[300..310]).await.expect("it is forwarded");
    let ports = ports(&client).await;
    for loss in &losses {
        loss.cut(&ports).await;
    }
    is_refused(&client, &far[0], &samples[310..]).await;
    closed(&mut socket).await;
    is_refused(&client, &far[0], &samples[310..]).await;
    // Each node reaches the database, so nothing moves, and each answers for what it owns.
    assert_eq!(cluster.rigs_of(1, &names).await, far);
    send_all(&client, &near, &samples[300..600]).await;
    send_all(&cluster.client(1), &far[1..], &samples[300..600]).await;
    for loss in &losses {
        loss.end().await;
    }
    send_all(&client, &far[..1], &samples[310..600]).await;
    send_all(&client, &names, &samples[600..]).await;
    for name in &names {
        assert_eq!(client.recording(name, "s").await, samples, "{name}");
        let session = client.end(name, "s").await;
        assert_eq!(session["verdict"]["verdict_hash"], judged(name, &samples).0);
    }
}
