//! A node is held between two statements of a commit, a take-over or a hand-over while another
//! one takes everything, at each statement in turn. What it goes on with afterwards is refused,
//! nothing is stored twice, and it takes part again.

use std::collections::BTreeSet;
use std::slice::Chunks;

use offbd_core::vocabulary::Sample;
use reqwest::Method;
use serde_json::Value;
use sqlx::{AssertSqlSafe, Executor};
use tokio::task::JoinHandle;

use super::clients::Subscriber;
use super::{count, history};
use crate::support::cluster::{Cluster, NodeKind, call};
use crate::support::history::Recorder;
use crate::support::postgres::{self, Postgres};
use crate::support::process::ended;
use crate::support::statement_gate::{HeldSide, HoldPoint, StatementGate, StatementSequence};
use crate::support::{Client, batch, connection, eventually, registration, rig};

/// The nodes: one is held, and the other one takes over.
const NODES: usize = 2;

const COMMIT: StatementSequence = StatementSequence { first: "BEGIN", last: "COMMIT" };
const TAKE_OVER: StatementSequence =
    StatementSequence { first: "pg_try_advisory_lock(", last: "pg_notify" };
const HAND_OVER: StatementSequence =
    StatementSequence { first: "SET leaving = 1", last: "pg_advisory_unlock(" };

/// A cluster whose nodes can be held.
struct GatedCluster {
    cluster: Cluster,
    gates: Vec<StatementGate>,
    subscriber: Subscriber,
    recorder: Recorder,
    /// The statements at which a node was held.
    met: BTreeSet<String>,
}

/// A batch on its way.
type Sending = JoinHandle<()>;

impl GatedCluster {
    async fn start() -> Self {
        let server = Postgres::new();
        // The database has to exist before the first node connects.
        server.database("cluster");
        let gates: Vec<_> = (0..NODES).map(|_| StatementGate::new(server.directory())).collect();
        let kind = |gate: &StatementGate| {
            let url = postgres::url(gate.directory.path(), "cluster");
            NodeKind { environment: vec![("OFFBD_DATABASE", url)], ..NodeKind::default() }
        };
        let kinds = gates.iter().map(kind).collect();
        let cluster = Cluster::begin(server, kinds).await;
        let subscriber = Subscriber::start(&cluster, &cluster.client(0)).await;
        let recorder = subscriber.recorder.clone();
        Self { cluster, gates, subscriber, recorder, met: BTreeSet::new() }
    }

    /// Sends samples to `client` until they are acknowledged.
    fn send(&self, client: Client, asset: &str, samples: &[Sample]) -> Sending {
        let (recorder, asset, samples) =
            (self.recorder.clone(), asset.to_owned(), samples.to_vec());
        tokio::spawn(async move {
            let number = recorder.lock().send_batch(&asset, "s", &samples);
            let path = format!("assets/{asset}/telemetry");
            let (status, ack) =
                call(&client, Method::POST, &path, &batch(Some("s"), &samples)).await;
            assert_eq!(status, 200, "{ack}");
            recorder.lock().tell_batch(number, &ack);
        })
    }

    async fn register(&self, client: &Client, asset: &str) {
        let (status, made) = call(client, Method::POST, "assets", &registration(asset)).await;
        assert_eq!(status, 201, "{made}");
    }

    /// The node that owns an asset, as all nodes say.
    async fn owner(&self, asset: &str) -> usize {
        let path = format!("cluster?asset={asset}");
        eventually(|| async {
            let mut names = BTreeSet::new();
            for client in self.cluster.clients() {
                let (_, place) = call(&client, Method::GET, &path, &Value::Null).await;
                names.insert(place["asset"]["owner"].as_str()?.to_owned());
            }
            (0..NODES).find(|i| names == BTreeSet::from([format!("node-{i}")]))
        })
        .await
    }

    /// Waits until a node has lost more than `lost` partitions since its start.
    async fn has_lost(&self, client: &Client, lost: f64) {
        eventually(|| async {
            (count(client, "offbd_partitions_lost_total").await > lost).then_some(())
        })
        .await;
    }

    /// Ends the connection with which a node writes.
    async fn end_writer(&self, i: usize) {
        let end = format!(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
             WHERE pid IN (SELECT pid FROM node WHERE name = 'node-{i}')"
        );
        connection(&self.cluster.url()).await.execute(AssertSqlSafe(end)).await.unwrap();
    }

    /// Waits until a node is held and, in its place, another one owns everything. Returns
    /// whether it was held: otherwise there are no more statements.
    async fn replaced(&mut self, i: usize) -> bool {
        let Some(statement) = self.gates[i].held().await else { return false };
        // Where a node is held in practice, the server notices by itself.
        if !["BEGIN", "COMMIT"].contains(&statement.as_str()) {
            self.end_writer(i).await;
        }
        self.met.insert(statement);
        self.cluster.taken_over_from(i).await;
        true
    }

    /// Fails unless a node was held at statements with these words.
    fn has_met(&self, words: &[&str]) {
        for words in words {
            assert!(self.met.iter().any(|sql| sql.contains(words)), "{words}: {:?}", self.met);
        }
    }

    async fn check(self) {
        self.cluster.complete(NODES).await;
        history::check(&self.cluster, &self.recorder).await;
        drop(self.subscriber);
    }
}

/// Holds a node before each statement in turn, until there are no more, and before the answer to
/// the last one; with the environment variable FAULTS before each answer. `hold` returns whether
/// the node was held.
async fn at_each_point(mut hold: impl AsyncFnMut(HoldPoint) -> bool) {
    let all = std::env::var_os("FAULTS").is_some();
    for number in (1..).map(Some) {
        if !hold(HoldPoint { number, side: HeldSide::Statement }).await {
            break;
        }
        if all && !hold(HoldPoint { number, side: HeldSide::Answer }).await {
            break;
        }
    }
    assert!(hold(HoldPoint { number: None, side: HeldSide::Answer }).await);
}

/// Holds the owner of a new rig in the commit of its first batch.
async fn hold_in_commit(it: &mut GatedCluster, asset: &str, point: HoldPoint) -> bool {
    let samples = rig(1500, 500);
    it.register(&it.cluster.client(0), asset).await;
    let held = it.owner(asset).await;
    let (woken, other) = (it.cluster.client(held), it.cluster.client(1 - held));
    it.subscriber.link.set_service(&other);
    let lost = count(&woken, "offbd_partitions_lost_total").await;
    it.gates[held].hold_at(COMMIT, point);
    let first = it.send(other, asset, &samples[..1000]);
    let is_met = it.replaced(held).await;
    first.await.unwrap();
    if !is_met {
        return false;
    }
    // What is sent to it meanwhile it judges by what it remembers.
    let second = it.send(woken.clone(), asset, &samples[1000..1200]);
    it.gates[held].release();
    second.await.unwrap();
    it.has_lost(&woken, lost).await;
    it.send(woken.clone(), asset, &samples[1200..]).await.unwrap();
    it.recorder.look(&woken, asset).await;
    true
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_that_is_held_in_a_commit_is_refused_and_takes_part_again() {
    let (mut it, mut case) = (GatedCluster::start().await, 0);
    at_each_point(async |point| {
        case += 1;
        hold_in_commit(&mut it, &format!("rig-{case}"), point).await
    })
    .await;
    it.has_met(&["BEGIN", "INTO session", "INTO journal", "INTO transition", "n_commits + 1"]);
    it.has_met(&["COMMIT"]);
    it.check().await;
}

/// Holds a node that takes over what the other one has, which is paused meanwhile.
async fn hold_in_take_over(
    it: &mut GatedCluster,
    parts: &mut Chunks<'_, Sample>,
    point: HoldPoint,
) -> bool {
    let held = 1 - it.owner("rig").await;
    let (woken, other) = (it.cluster.client(held), it.cluster.client(1 - held));
    it.subscriber.link.set_service(&other);
    it.send(other.clone(), "rig", parts.next().unwrap()).await.unwrap();
    let lost = count(&other, "offbd_partitions_lost_total").await;
    it.gates[held].hold_at(TAKE_OVER, point);
    it.cluster.signal(1 - held, "-STOP");
    it.end_writer(1 - held).await;
    let is_met = it.gates[held].held().await.is_some();
    it.cluster.signal(1 - held, "-CONT");
    if !is_met {
        it.has_lost(&other, lost).await;
        return false;
    }
    assert!(it.replaced(held).await);
    it.send(other, "rig", parts.next().unwrap()).await.unwrap();
    let to_woken = it.send(woken.clone(), "rig", parts.next().unwrap());
    it.gates[held].release();
    to_woken.await.unwrap();
    it.recorder.look(&woken, "rig").await;
    true
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_that_is_held_in_a_take_over_is_refused_and_takes_part_again() {
    let (mut it, samples) = (GatedCluster::start().await, rig(1500, 500));
    it.register(&it.cluster.client(0), "rig").await;
    let mut parts = samples.chunks(10);
    at_each_point(async |point| hold_in_take_over(&mut it, &mut parts, point).await).await;
    it.has_met(&["pg_try_advisory_lock(", "BEGIN", "epoch + 1", "COMMIT", "FROM journal"]);
    it.has_met(&["pg_notify"]);
    it.check().await;
}

/// Holds the owner of the rig while it stops, and starts it again. Nothing is lost either way.
async fn hold_in_hand_over(
    it: &mut GatedCluster,
    parts: &mut Chunks<'_, Sample>,
    point: HoldPoint,
) -> bool {
    let held = it.owner("rig").await;
    let (stopping, other) = (it.cluster.client(held), it.cluster.client(1 - held));
    it.subscriber.link.set_service(&other);
    it.gates[held].hold_at(HAND_OVER, point);
    it.send(stopping, "rig", parts.next().unwrap()).await.unwrap();
    it.cluster.nodes[held].as_ref().unwrap().terminate();
    let is_met = it.replaced(held).await;
    it.send(other, "rig", parts.next().unwrap()).await.unwrap();
    it.gates[held].release();
    let mut stopped = it.cluster.nodes[held].take().unwrap();
    assert!(ended(&mut stopped.child).await.success(), "{}", stopped.log());
    it.cluster.restart(held);
    it.send(it.cluster.client(held), "rig", parts.next().unwrap()).await.unwrap();
    is_met
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_that_is_held_in_a_hand_over_ends_and_takes_part_again() {
    let (mut it, samples) = (GatedCluster::start().await, rig(1500, 500));
    it.register(&it.cluster.client(0), "rig").await;
    let mut parts = samples.chunks(10);
    at_each_point(async |point| hold_in_hand_over(&mut it, &mut parts, point).await).await;
    it.has_met(&["SET leaving = 1", "BEGIN", "owner = NULL", "COMMIT", "pg_advisory_unlock("]);
    it.check().await;
}
