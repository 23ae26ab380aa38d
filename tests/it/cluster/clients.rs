//! Clients of a cluster that go on while it fails, and whose history is recorded: devices that
//! send until they are acknowledged, one that sends everything once, people who acknowledge and
//! clear faults and look at rigs, and a subscriber.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use offbd_core::vocabulary::FaultCode;
use reqwest::Method;
use tokio::task::JoinHandle;

use super::history::{self, CommitLog};
use crate::support::cluster::Cluster;
use crate::support::device::{DeviceLoad, Random, ServiceLink};
use crate::support::history::Recorder;
use crate::support::{Client, batch, rig};

/// Samples of others after which a person does something.
const ACT_EVERY: u64 = 40;
/// Samples of others after which the careless device sends.
const SEND_EVERY: u64 = 20;
/// Samples of a batch of the careless device.
const BATCH: usize = 25;
/// A person does something to the rig of one of so many batches that were sent last.
const RECENT: usize = 10;

/// A subscriber, whose events and whose requests of others are recorded.
pub struct Subscriber {
    pub recorder: Recorder,
    pub link: ServiceLink,
    task: JoinHandle<()>,
}

impl Subscriber {
    /// Follows the events, at first at the node of `client`, and begins to note what is
    /// committed.
    pub async fn start(cluster: &Cluster, client: &Client) -> Self {
        CommitLog::install(&cluster.url()).await;
        Self::start_on(Recorder::default(), ServiceLink::to(client), client)
    }

    fn start_on(recorder: Recorder, link: ServiceLink, client: &Client) -> Self {
        let (writer, client, address) = (recorder.clone(), client.clone(), link.address());
        let task = tokio::spawn(async move { writer.follow(client, address).await });
        Self { recorder, link, task }
    }
}

impl Drop for Subscriber {
    fn drop(&mut self) {
        self.task.abort();
    }
}

pub struct RecordedClients {
    pub subscriber: Subscriber,
    load: DeviceLoad,
    others: Vec<JoinHandle<()>>,
    stopped: Arc<AtomicBool>,
}

impl RecordedClients {
    /// Starts `n` devices and the others, at first at the node of `client`. `watched` are rigs
    /// whose session stays open.
    pub async fn start(cluster: &Cluster, client: &Client, n: usize, watched: &[String]) -> Self {
        CommitLog::install(&cluster.url()).await;
        let (recorder, stopped) = (Recorder::default(), Arc::<AtomicBool>::default());
        let load = DeviceLoad::start_recorded(n, client, cluster.data.path(), &recorder);
        let link = &load.link;
        let subscriber = Subscriber::start_on(recorder.clone(), link.clone(), client);
        let one = RecordedClient { link: link.clone(), recorder, stopped: stopped.clone() };
        let watched = watched.to_vec();
        let others = vec![tokio::spawn(one.clone().act(watched)), tokio::spawn(one.send_once())];
        Self { subscriber, load, others, stopped }
    }

    pub const fn link(&self) -> &ServiceLink {
        &self.load.link
    }

    /// Stops the clients, and compares their history with what is stored.
    pub async fn stop_and_check(self, cluster: &Cluster) {
        self.stopped.store(true, Ordering::SeqCst);
        for other in self.others {
            other.await.unwrap();
        }
        let (n_samples, laps) = (self.load.link.acknowledged(), self.load.stop().await);
        println!("{laps} recordings, {n_samples} samples acknowledged");
        history::check(cluster, &self.subscriber.recorder).await;
    }
}

/// A client that does something now and then.
#[derive(Clone)]
struct RecordedClient {
    link: ServiceLink,
    recorder: Recorder,
    stopped: Arc<AtomicBool>,
}

impl RecordedClient {
    /// Waits until others have sent `n` samples; returns whether to go on.
    async fn goes_on_after(&self, n: u64) -> bool {
        self.link.wait_for_samples(n).await;
        !self.stopped.load(Ordering::SeqCst)
    }

    /// Acknowledges and clears faults, and looks at the rigs `watched`.
    async fn act(self, watched: Vec<String>) {
        let (mut random, mut address) = (Random(5), self.link.address());
        while self.goes_on_after(ACT_EVERY).await {
            let client = self.link.client();
            address.mark_unchanged();
            let done = async {
                if let Some(name) = watched.get(random.below(2 * watched.len().max(1))) {
                    return self.recorder.look(&client, name).await;
                }
                let kind = ["acknowledge", "clear"][random.below(2)];
                if let Some(asset) = self.recent_asset(random.below(RECENT)) {
                    self.recorder.act(&client, &asset, FaultCode::XServo, kind).await;
                }
            };
            tokio::select! {
                () = done => {}
                // What was asked of a node that fails may be done or not.
                _ = address.changed() => {}
            }
        }
    }

    /// The asset of the batch before the last `n` ones.
    fn recent_asset(&self, n: usize) -> Option<String> {
        let history = self.recorder.lock();
        history.batches.iter().rev().nth(n).map(|batch| batch.asset.clone())
    }

    /// Sends recordings, each batch once, whatever becomes of it.
    async fn send_once(self) {
        let (samples, mut address) = (rig(600, 200), self.link.address());
        for lap in 0.. {
            let asset = format!("once-{lap}");
            self.link.register(&asset).await;
            for part in samples.chunks(BATCH) {
                if !self.goes_on_after(SEND_EVERY).await {
                    return;
                }
                address.mark_unchanged();
                let number = self.recorder.lock().send_batch(&asset, "s", part);
                let request =
                    self.link.client().request(Method::POST, &format!("assets/{asset}/telemetry"));
                tokio::select! {
                    answer = request.json(&batch(Some("s"), part)).send() => {
                        let Some(ack) = acknowledgement(answer).await else { continue };
                        self.recorder.lock().tell_batch(number, &ack);
                    }
                    _ = address.changed() => {}
                }
            }
        }
    }
}

/// The acknowledgement in an answer, if it is one.
async fn acknowledgement(answer: reqwest::Result<reqwest::Response>) -> Option<serde_json::Value> {
    let answer = answer.ok().filter(|answer| answer.status() == 200)?;
    answer.json().await.ok()
}
