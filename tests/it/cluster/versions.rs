//! Nodes of two versions on one database: each takes over what the other one has judged.
//!
//! The environment variable OLDER is the program of the other version, which must have the same
//! schema; it runs as the first node. Without it both nodes are of this version, and another one
//! is told by its snapshots.

use offbd_core::vocabulary::Sample;
use reqwest::Method;
use sqlx::Executor;

use super::{register_rigs, send_all};
use crate::support::cluster::{Cluster, NodeKind, call};
use crate::support::postgres::Postgres;
use crate::support::process::Refusal;
use crate::support::{Client, connection, judged, rig};

/// Samples of each rig before the first hand-over, so that each has a snapshot.
const BEFORE: usize = 20_000;
/// Samples of each rig while one node is away.
const MEANWHILE: usize = 500;
/// Samples of a batch.
const BATCH: usize = 5000;
/// How a node leaves the cluster.
const WAYS: [(&str, usize); 4] = [("stop", 1), ("kill", 1), ("stop", 0), ("kill", 0)];

/// Returns the program of the other version.
fn older() -> NodeKind {
    let own = NodeKind::default();
    NodeKind { program: std::env::var_os("OLDER").map_or(own.program, Into::into), ..own }
}

/// Returns the samples of a rig: one of 60 s, repeated, whose x servo dies each time.
fn recording(n: usize) -> Vec<Sample> {
    let one = rig(6000, 4000);
    let nth = |i: usize| Sample { seq: Some(i as u64), t_s: i as f64 * 0.01, ..one[i % 6000] };
    (0..n).map(nth).collect()
}

async fn send(client: &Client, names: &[String], samples: &[Sample]) {
    for part in samples.chunks(BATCH) {
        send_all(client, names, part).await;
    }
}

/// Compares recordings and verdicts with those of the engine alone.
async fn compare(cluster: &Cluster, names: &[String], samples: &[Sample]) {
    let client = &cluster.clients()[0];
    let (hash, faults) = judged("any", samples);
    assert!(!faults.is_empty());
    for name in names {
        assert_eq!(client.recording(name, "s").await, samples, "{name}");
        let id = client.session(name, "s").await["id"].as_str().unwrap().to_owned();
        let path = format!("sessions/{id}/end");
        let (status, ended) = call(client, Method::POST, &path, &serde_json::Value::Null).await;
        assert_eq!((status, &ended["verdict"]["verdict_hash"]), (200, &hash.as_str().into()));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_of_two_versions_hand_over_to_each_other() {
    let mut cluster = Cluster::of(Postgres::new(), vec![older(), NodeKind::default()]).await;
    let samples = recording(BEFORE + WAYS.len() * MEANWHILE);
    let names = register_rigs(&cluster).await;
    send(&cluster.client(0), &names, &samples[..BEFORE]).await;
    let mut at = BEFORE;
    for (way, i) in WAYS {
        cluster.owned_by(i, &names).await;
        match way {
            "stop" => cluster.stop(i).await,
            _ => cluster.kill(i),
        }
        cluster.taken_over_from(i).await;
        send(&cluster.client(1 - i), &names, &samples[at..at + MEANWHILE]).await;
        at += MEANWHILE;
        match cluster.try_node(i, &[]) {
            Ok(node) => cluster.nodes[i] = Some(node),
            // A newer version may have changed the tables: the older one does not come back.
            Err(Refusal { log, .. }) => {
                let is_said = log.contains("migration") || log.contains("use a newer version");
                assert!(i == 0 && is_said, "{log}");
                println!("the older version does not start on the tables of the newer one");
                break;
            }
        }
        cluster.settled(2).await;
    }
    compare(&cluster, &names, &samples[..at]).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_another_version_has_left_is_judged_again_from_the_recording() {
    let mut cluster = Cluster::of(Postgres::new(), vec![NodeKind::default(); 2]).await;
    let samples = recording(BEFORE + MEANWHILE);
    let names = register_rigs(&cluster).await;
    send(&cluster.client(0), &names, &samples[..BEFORE]).await;
    let n_owned = cluster.owned_by(1, &names).await.len();
    let mut store = connection(&cluster.url()).await;
    store.execute("UPDATE snapshot SET version = '0.0', data = 'unreadable'").await.unwrap();
    let before = cluster.client(0).n_evaluated_again().await;
    cluster.kill(1);
    cluster.taken_over_from(1).await;
    send(&cluster.client(0), &names, &samples[BEFORE..]).await;
    let n = cluster.client(0).n_evaluated_again().await - before;
    assert_eq!(n, (n_owned * BEFORE) as f64);
    // In their place are those of this version.
    let count = "SELECT COUNT(DISTINCT session) FROM snapshot WHERE version <> '0.0'";
    let n: i64 = sqlx::query_scalar(count).fetch_one(&mut store).await.unwrap();
    assert_eq!(n, i64::try_from(n_owned).unwrap());
    compare(&cluster, &names, &samples).await;
}
