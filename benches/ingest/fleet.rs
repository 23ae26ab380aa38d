//! A fleet of many slow rigs on a cluster of three nodes, one of which is killed each minute:
//! how late batches are acknowledged, and how much memory it takes.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use axum::body::Bytes;
use offbd_core::vocabulary::Sample;
use tokio::sync::Semaphore;
use tokio::task::JoinSet;

use crate::client::Client;
use crate::load::{columns_as_msgpack, recording};
use crate::process::Process;
use crate::telemetry;

const NODES: usize = 3;

/// Samples of a batch, and the time from one to the next.
const BATCH: usize = 10;
const EVERY: Duration = Duration::from_secs(30);

/// Time from one kill to the next, and until the node starts again.
const KILL_EVERY: Duration = Duration::from_secs(60);
const DOWN_FOR: Duration = Duration::from_secs(5);

/// Requests under way at a time. So many that those for rigs that are being loaded do not hold
/// up the others: each rig has its own connection in reality.
const CONNECTIONS: usize = 2000;

/// Silence after which the data of a rig count as lost, s: longer than from one batch to the next.
const LOST_AFTER_S: u32 = 120;

/// How long a device waits that was refused without `Retry-After`.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// A device that is refused more often makes the measurement fail.
const MAX_ATTEMPTS: usize = 300;

/// Sends batches for `assets` rigs for so many minutes.
pub(crate) async fn measure(database: &str, assets: usize, minutes: u32) -> Result<()> {
    let data = tempfile::tempdir()?;
    let fleet = Arc::new(Fleet::start(data.path(), database, assets)?);
    let clock = Instant::now();
    let each = |n| {
        let name = format!("device-{n}");
        let rate = BATCH as f64 / EVERY.as_secs_f64();
        let asset = serde_json::json!({ "name": name, "sample_rate_hz": rate });
        vec![Due { at: clock, path: "/api/v1/assets".into(), body: asset.to_string().into() }]
    };
    deliver_all(&fleet, assets, each).await?;
    println!("{assets} assets, registered in {:.0?}", clock.elapsed());

    let bodies = batches(minutes)?;
    let begin = Instant::now();
    let each = |n: usize| {
        let first = begin + EVERY.mul_f64(n as f64 / assets as f64);
        let due = |(k, body): (usize, &Bytes)| Due {
            at: first + EVERY * k as u32,
            path: telemetry(n),
            body: body.clone(),
        };
        bodies.iter().enumerate().map(due).collect()
    };
    let killing = tokio::spawn(kill_each_minute(fleet.clone(), begin, minutes));
    let late = deliver_all(&fleet, assets, each).await?;
    let n_kills = killing.await??;
    show(late, begin.elapsed(), n_kills);
    println!("all nodes: {:.0} MiB", fleet.memory()? / f64::from(1 << 20));
    check(&fleet, assets, bodies.len() * BATCH).await
}

/// The batches of a rig, the same ones for each.
fn batches(minutes: u32) -> Result<Vec<Bytes>> {
    let n = minutes as usize * 60 / EVERY.as_secs() as usize;
    let step_s = EVERY.as_secs_f64() / BATCH as f64;
    let recorded = recording(n * BATCH, None)?.into_iter().enumerate();
    let slow = |(i, sample)| Sample { seq: Some(i as u64), t_s: i as f64 * step_s, ..sample };
    let samples: Vec<Sample> = recorded.map(slow).collect();
    Ok(samples.chunks(BATCH).map(|batch| columns_as_msgpack(batch).into()).collect())
}

/// A request, and when it is due.
struct Due {
    at: Instant,
    path: String,
    body: Bytes,
}

/// Delivers the requests of each rig, one after the other. Returns how late each was
/// acknowledged.
async fn deliver_all(
    fleet: &Arc<Fleet>,
    assets: usize,
    requests: impl Fn(usize) -> Vec<Due>,
) -> Result<Vec<Duration>> {
    let mut devices = JoinSet::new();
    for n in 0..assets {
        let (fleet, requests) = (fleet.clone(), requests(n));
        devices.spawn(async move {
            let mut late = Vec::with_capacity(requests.len());
            for request in requests {
                tokio::time::sleep_until(request.at.into()).await;
                fleet.deliver(n, &request).await?;
                late.push(request.at.elapsed());
            }
            Ok::<_, anyhow::Error>(late)
        });
    }
    let mut late = Vec::new();
    while let Some(of_device) = devices.join_next().await {
        late.extend(of_device??);
    }
    Ok(late)
}

/// Kills one node after the other, and starts it again. Returns the number of kills.
async fn kill_each_minute(fleet: Arc<Fleet>, begin: Instant, minutes: u32) -> Result<usize> {
    for minute in 1..minutes {
        tokio::time::sleep_until((begin + KILL_EVERY * minute).into()).await;
        let i = minute as usize % NODES;
        fleet.set_node(i, None);
        tokio::time::sleep(DOWN_FOR).await;
        let fleet = fleet.clone();
        tokio::task::spawn_blocking(move || fleet.restart(i)).await??;
    }
    Ok(minutes.saturating_sub(1) as usize)
}

fn show(mut late: Vec<Duration>, took: Duration, n_kills: usize) {
    late.sort();
    let at = |share: f64| late[((late.len() - 1) as f64 * share) as usize];
    println!("{} batches of {BATCH}, {n_kills} kills, {took:.0?}", late.len());
    let [half, most, nearly, worst] = [0.5, 0.99, 0.999, 1.0].map(at);
    println!(
        "acknowledged after they were due: median {half:.2?}, p99 {most:.2?}, p99.9 {nearly:.2?}, \
         worst {worst:.2?}"
    );
}

/// Compares the number of samples of all open sessions with what was acknowledged.
async fn check(fleet: &Fleet, assets: usize, each: usize) -> Result<()> {
    let mut client = fleet.connect(0).await?;
    let (mut n_sessions, mut next) = (0, String::new());
    loop {
        let page = client.get(&format!("/api/v1/sessions?limit=500{next}")).await?;
        let page: serde_json::Value = serde_json::from_str(&page)?;
        for session in page["items"].as_array().context("no items")? {
            ensure!(session["samples"] == each, "{session}");
            n_sessions += 1;
        }
        match page["next"].as_str() {
            Some(cursor) => next = format!("&cursor={cursor}"),
            None => break,
        }
    }
    ensure!(n_sessions == assets, "{n_sessions} sessions of {assets} assets");
    println!("{n_sessions} sessions have their {each} samples");
    Ok(())
}

/// How long a device waits that was refused so.
fn retry_after(refusal: &anyhow::Error) -> Duration {
    let answer = refusal.to_string();
    let seconds = answer.lines().find_map(|line| line.strip_prefix("retry-after: "));
    seconds.and_then(|s| s.trim().parse().ok()).map_or(RETRY_AFTER, Duration::from_secs)
}

/// The nodes, and the connections of the devices to them.
struct Fleet {
    nodes: [Mutex<Option<Process>>; NODES],
    settings: [String; NODES],
    data: Vec<std::path::PathBuf>,
    idle: [Mutex<Vec<Client>>; NODES],
    permits: Semaphore,
}

impl Fleet {
    fn start(data: &Path, database: &str, assets: usize) -> Result<Self> {
        let settings = std::array::from_fn(|i| {
            format!(
                "database = \"{database}\"\n[limits]\nassets = {assets}\n\
                 [communication]\nlost_after_s = {LOST_AFTER_S}\n\
                 [cluster]\nname = \"node-{i}\"\nlisten = \"127.0.0.1:0\"\n"
            )
        });
        let data = (0..NODES).map(|i| data.join(format!("node-{i}"))).collect();
        let (nodes, idle) = (Default::default(), Default::default());
        let this = Self { nodes, settings, data, idle, permits: Semaphore::new(CONNECTIONS) };
        for i in 0..NODES {
            std::fs::create_dir(&this.data[i])?;
            this.restart(i)?;
        }
        Ok(this)
    }

    fn restart(&self, i: usize) -> Result<()> {
        self.set_node(i, Some(Process::start(&self.data[i], &self.settings[i])?));
        Ok(())
    }

    fn set_node(&self, i: usize, node: Option<Process>) {
        self.idle[i].lock().unwrap_or_else(PoisonError::into_inner).clear();
        *self.nodes[i].lock().unwrap_or_else(PoisonError::into_inner) = node;
    }

    async fn connect(&self, i: usize) -> Result<Client> {
        if let Some(client) = self.idle[i].lock().unwrap_or_else(PoisonError::into_inner).pop() {
            return Ok(client);
        }
        let address = {
            let node = self.nodes[i].lock().unwrap_or_else(PoisonError::into_inner);
            node.as_ref().context("the node is down")?.address
        };
        Client::connect(address).await
    }

    /// Sends a request to one node after the other until it is acknowledged.
    async fn deliver(&self, device: usize, request: &Due) -> Result<()> {
        let mut tried = Ok(());
        for attempt in 0..MAX_ATTEMPTS {
            tried = self.try_deliver((device + attempt) % NODES, request).await;
            let Err(refusal) = &tried else { break };
            tokio::time::sleep(retry_after(refusal)).await;
        }
        tried
    }

    async fn try_deliver(&self, i: usize, request: &Due) -> Result<()> {
        let _permit = self.permits.acquire().await?;
        let mut client = self.connect(i).await?;
        let media_type = match request.body.first() {
            Some(b'{') => "application/json",
            _ => "application/msgpack",
        };
        client.post(&request.path, media_type, &request.body).await?;
        self.idle[i].lock().unwrap_or_else(PoisonError::into_inner).push(client);
        Ok(())
    }

    /// The memory of all nodes, bytes.
    fn memory(&self) -> Result<f64> {
        let mut sum = 0.0;
        for node in &self.nodes {
            let node = node.lock().unwrap_or_else(PoisonError::into_inner);
            sum += crate::resident(node.as_ref().context("the node is down")?.id())?;
        }
        Ok(sum)
    }
}
