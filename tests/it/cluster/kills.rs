//! Nodes are killed, paused and stopped under load, one after the other.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use reqwest::Method;

use super::clients::RecordedClients;
use super::{count, register_rigs};
use crate::support::cluster::{Cluster, N_NODES, call};
use crate::support::device::Random;
use crate::support::history::Recorder;
use crate::support::{Client, batch, eventually, rig};
use offbd_core::vocabulary::Sample;

/// Faults, unless the environment variable FAULTS is set.
const FAULTS: usize = 8;

/// The kinds of the faults, in turns.
const KINDS: [&str; 8] = ["kill", "pause", "kill", "stop", "kill", "kill", "pause", "kill"];

/// Rigs that are asked, at each fault of their node, for an acknowledgement.
struct Probes {
    names: Vec<String>,
    samples: Vec<Sample>,
    /// How long the first acknowledgement took after a fault, by its kind; of a node that is
    /// stopped, the longest until it had ended.
    times: BTreeMap<&'static str, Vec<Duration>>,
    recorder: Recorder,
}

impl Probes {
    fn new(names: Vec<String>, recorder: &Recorder) -> Self {
        let recorder = recorder.clone();
        Self { names, samples: rig(6000, 6000), times: BTreeMap::new(), recorder }
    }

    /// The question of this fault, asked of `client`.
    fn question(&self, fault: usize, client: Client) -> ProbeQuestion {
        let at = fault * 10 % self.samples.len();
        let part = self.samples[at..at + 10].to_vec();
        ProbeQuestion { client, part, recorder: self.recorder.clone() }
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

/// A batch whose acknowledgement the test waits for.
struct ProbeQuestion {
    client: Client,
    part: Vec<Sample>,
    recorder: Recorder,
}

impl ProbeQuestion {
    /// Sends the batch of each rig until it is acknowledged, and again until `ended`. Returns
    /// the longest time that took, of each.
    async fn longest_times(self, names: Vec<String>, ended: Arc<AtomicBool>) -> Vec<Duration> {
        let longest = async |name: &String| {
            let mut longest = self.time(name).await;
            while !ended.load(Ordering::SeqCst) {
                longest = longest.max(self.time(name).await);
            }
            longest
        };
        futures_util::future::join_all(names.iter().map(longest)).await
    }

    #[expect(clippy::disallowed_methods, reason = "the time is measured")]
    async fn time(&self, name: &str) -> Duration {
        let start = Instant::now();
        let number = self.recorder.lock().send_batch(name, "s", &self.part);
        let (path, sent) = (format!("assets/{name}/telemetry"), batch(Some("s"), &self.part));
        let (status, ack) = call(&self.client, Method::POST, &path, &sent).await;
        assert_eq!(status, 200, "{ack}");
        self.recorder.lock().tell_batch(number, &ack);
        start.elapsed()
    }
}

/// How often a node was refused because another one had taken what it owned.
async fn n_refused(client: &Client) -> f64 {
    let lost = count(client, "offbd_partitions_lost_total").await;
    lost + count(client, "offbd_commits_overtaken_total").await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_that_are_killed_paused_and_stopped_lose_nothing() {
    let n_faults = std::env::var("FAULTS").map_or(FAULTS, |n| n.parse().unwrap());
    let mut cluster = Cluster::start().await;
    let names = register_rigs(&cluster).await;
    let clients = RecordedClients::start(&cluster, &cluster.client(0), 4, &names).await;
    let (mut probes, mut n_met) = (Probes::new(names, &clients.subscriber.recorder), 0);
    let link = clients.link();
    let mut random = Random(7);
    let mut n_by_kind = BTreeMap::<&str, usize>::new();
    for fault in 0..n_faults {
        link.wait_for_samples(random.below(400) as u64 + 50).await;
        let node = random.below(N_NODES);
        let other = (node + 1 + random.below(N_NODES - 1)) % N_NODES;
        let kind = KINDS[fault % KINDS.len()];
        *n_by_kind.entry(kind).or_default() += 1;
        let names = cluster.rigs_of(node, &probes.names).await;
        let owned_any = !names.is_empty();
        let ended = Arc::new(AtomicBool::new(kind != "stop"));
        let question = probes.question(fault, cluster.client(other));
        let asked = question.longest_times(names, ended.clone());
        let times = match kind {
            "kill" => {
                cluster.kill(node);
                link.set_service(&cluster.client(other));
                let asked = tokio::spawn(asked);
                cluster.restart(node);
                asked.await.unwrap()
            }
            "pause" => {
                let n_before = n_refused(&cluster.client(node)).await;
                cluster.signal(node, "-STOP");
                link.set_service(&cluster.client(other));
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
                link.set_service(&cluster.client(other));
                let asked = tokio::spawn(asked);
                cluster.stop(node).await;
                ended.store(true, Ordering::SeqCst);
                cluster.restart(node);
                asked.await.unwrap()
            }
        };
        probes.add(kind, times);
        // After each fault everything goes on, through each node.
        link.set_service(&cluster.client(random.below(N_NODES)));
        link.wait_for_samples(50).await;
    }
    println!("{n_by_kind:?}");
    probes.print();
    cluster.settled(N_NODES).await;
    clients.stop_and_check(&cluster).await;
    assert!(n_met > 0 || n_faults < 2, "no node was paused that owned something");
}
