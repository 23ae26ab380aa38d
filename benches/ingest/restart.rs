//! A restart after SIGKILL: when the service answers, when the first device is acknowledged,
//! and when all devices are that come back at the same time.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Result;
use axum::body::Bytes;
use tokio::task::JoinSet;

use crate::client::Client;
use crate::load::{DEVICES as CONNECTIONS, columns_as_msgpack, recording};
use crate::process::Process;
use crate::{resident, telemetry};

/// Samples of a request before the kill, and after it.
const BATCH: usize = 5000;
const LIVE_BATCH: usize = 10;

pub(crate) async fn measure(assets: usize, samples: usize) -> Result<()> {
    let data = tempfile::tempdir()?;
    let limits = format!("[limits]\nassets = {assets}\n");
    let recorded = recording(samples + LIVE_BATCH, None)?;
    let (before, after) = recorded.split_at(samples);
    let before: Vec<Bytes> = before.chunks(BATCH).map(|b| columns_as_msgpack(b).into()).collect();
    let after: Bytes = columns_as_msgpack(after).into();
    let service = Process::start(data.path(), &limits)?;
    let clock = Instant::now();
    post_all(service.address, assets, |n| {
        let asset = serde_json::json!({ "name": format!("device-{n}") }).to_string();
        vec![("/api/v1/assets".to_owned(), "application/json", asset.into())]
    })
    .await?;
    post_all(service.address, assets, move |n| before.iter().map(|b| batch(n, b)).collect())
        .await?;
    println!("{assets} assets with {samples} samples each, filled in {:.0?}", clock.elapsed());
    drop(service);

    let clock = Instant::now();
    let service = Process::start(data.path(), &limits)?;
    let mut client = Client::connect(service.address).await?;
    client.get("/api/v1/assets").await?;
    println!("first answer after the start: {:.2?}", clock.elapsed());
    let clock = Instant::now();
    let (path, media_type, body) = batch(assets / 2, &after);
    client.post(&path, media_type, &body).await?;
    println!("first acknowledgement after its request: {:.1?}", clock.elapsed());
    let clock = Instant::now();
    let mut times = post_all(service.address, assets, move |n| vec![batch(n, &after)]).await?;
    let all = clock.elapsed();
    times.sort();
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    let [half, most, worst] = [0.5, 0.99, 1.0].map(at);
    println!("all acknowledged, from {CONNECTIONS} connections: {all:.1?}");
    println!("of each: median {half:.1?}, p99 {most:.1?}, worst {worst:.1?}");
    println!("memory: {:.0} MiB", resident(service.id())? / f64::from(1 << 20));
    Ok(())
}

/// A path, a media type and a body.
type Request = (String, &'static str, Bytes);

fn batch(device: usize, body: &Bytes) -> Request {
    (telemetry(device), "application/msgpack", body.clone())
}

/// Posts the requests of each device, on many connections at once. Returns the time of each
/// device.
async fn post_all(
    address: SocketAddr,
    devices: usize,
    requests: impl Fn(usize) -> Vec<Request> + Send + Sync + 'static,
) -> Result<Vec<Duration>> {
    let requests = Arc::new(requests);
    let mut clients = JoinSet::new();
    for first in 0..CONNECTIONS {
        let requests = requests.clone();
        clients.spawn(async move {
            let mut client = Client::connect(address).await?;
            let mut times = Vec::new();
            for device in (first..devices).step_by(CONNECTIONS) {
                let clock = Instant::now();
                for (path, media_type, body) in requests(device) {
                    client.post(&path, media_type, &body).await?;
                }
                times.push(clock.elapsed());
            }
            Ok::<_, anyhow::Error>(times)
        });
    }
    let mut times = Vec::new();
    while let Some(done) = clients.join_next().await {
        times.extend(done??);
    }
    Ok(times)
}
