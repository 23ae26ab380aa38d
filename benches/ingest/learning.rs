//! Ingest beside rigs that learn: the rate, and the time from a sample to its fault event, with
//! all rigs learning and with none, one after the other.
//!
//! Both send the same samples. Before the measurement each rig shows the motion that it needs;
//! with none learning, it is discarded as that of a rig that was not healthy.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use axum::body::Bytes;
use futures_util::future::try_join_all;
use offbd_core::vocabulary::Sample;

use crate::client::{Client, Socket};
use crate::load::{DEVICES, Load, SAMPLES, columns_as_msgpack, loads, recording};
use crate::{Clocks, Device, OFFSET, Rate, Target, median, send_all, start};

/// Samples of a batch.
const BATCH: usize = 100;
/// Batches of each device before the measurement: 70 s of motion, of which a rig needs 60.
const WARM_UP: usize = 70;

/// What was measured of the rounds in which rigs learnt, or did not.
#[derive(Default)]
struct Measured {
    rates: Vec<Rate>,
    latencies: Vec<Duration>,
    /// Calibrations that ended during the measurements.
    n_learnt: usize,
}

impl Measured {
    fn rate(&mut self) -> Result<Rate> {
        median(&mut self.rates).context("no round")
    }

    fn latency(&mut self, share: f64) -> Result<Duration> {
        ensure!(!self.latencies.is_empty(), "no fault was found");
        self.latencies.sort();
        Ok(self.latencies[((self.latencies.len() - 1) as f64 * share) as usize])
    }
}

pub(crate) async fn measure(samples: &[Sample], rounds: usize) -> Result<()> {
    for name in ["MessagePack by 100", "WebSocket by 100"] {
        let loads = loads(samples);
        let load = loads.iter().find(|load| load.name == name).context("no such load")?;
        let (mut still, mut learning) = (Measured::default(), Measured::default());
        for _ in 0..rounds {
            for (learns, measured) in [(false, &mut still), (true, &mut learning)] {
                let (rate, n_learnt) = rate(load, learns).await?;
                measured.rates.push(rate);
                measured.n_learnt += n_learnt;
            }
        }
        let (without, with) = (still.rate()?, learning.rate()?);
        println!("{name}, {DEVICES} devices, medians of {rounds} rounds:");
        println!("  none learns: {:.0} samples/s, {:.2} cores", without.rate, without.cores);
        println!(
            "  all learn: {:.0} samples/s, {:.2} cores, {} calibrations; {:.3} of the rate",
            with.rate,
            with.cores,
            learning.n_learnt,
            with.rate / without.rate
        );
        ensure!(still.n_learnt == 0, "a rig has learnt");
    }
    latencies(samples, rounds).await
}

async fn latencies(samples: &[Sample], rounds: usize) -> Result<()> {
    let loads = loads(samples);
    let load = loads.iter().find(|load| load.name == "WebSocket by 100");
    let pace = rate(load.context("no such load")?, false).await?.0.rate / 2.0;
    let sick = recording(SAMPLES, Some("x_servo:held@150-160"))?;
    let (mut still, mut learning) = (Measured::default(), Measured::default());
    for _ in 0..rounds {
        for (learns, measured) in [(false, &mut still), (true, &mut learning)] {
            let (latencies, n_learnt) = latency(&sick, pace, learns).await?;
            measured.latencies.extend(latencies);
            measured.n_learnt += n_learnt;
        }
    }
    println!("from a sample to its fault event, WebSocket by 100, {pace:.0} samples/s:");
    for (name, measured) in [("none learns", &mut still), ("all learn", &mut learning)] {
        let (half, nearly_all) = (measured.latency(0.5)?, measured.latency(0.99)?);
        let (n_events, n_learnt) = (measured.latencies.len(), measured.n_learnt);
        println!(
            "  {name}: median {half:.1?}, p99 {nearly_all:.1?}, {n_events} events, {n_learnt} \
             calibrations"
        );
    }
    let ratio = learning.latency(0.99)?.as_secs_f64() / still.latency(0.99)?.as_secs_f64();
    println!("  p99, ratio: {ratio:.2}");
    Ok(())
}

/// Returns the rate after the warm-up, and the number of rigs learnt meanwhile.
async fn rate(load: &Load, learns: bool) -> Result<(Rate, usize)> {
    let data = tempfile::tempdir()?;
    let server = start(data.path(), DEVICES).await?;
    let target = |device| Target::telemetry(server.address, device);
    let devices = (0..DEVICES).map(|device| Device::connect(load, device, target(device)));
    let mut devices = try_join_all(devices).await?;
    devices = send_all(devices, |bodies| &bodies[..1]).await?;
    discard(server.address, learns).await?;
    devices = send_all(devices, |bodies| &bodies[1..WARM_UP]).await?;
    let before = n_learnt(server.address, learns).await?;
    let clocks = Clocks::start();
    send_all(devices, |bodies| &bodies[WARM_UP..]).await?;
    let rate = clocks.rate((load.bodies(0).len() - WARM_UP) * load.batch * DEVICES);
    let n = n_learnt(server.address, learns).await? - before;
    server.shutdown().await?;
    Ok((rate, n))
}

/// Returns the time from each sample with a fault event to the event, while all devices send
/// `pace` samples/s together, and the number of rigs learnt meanwhile.
async fn latency(sick: &[Sample], pace: f64, learns: bool) -> Result<(Vec<Duration>, usize)> {
    let data = tempfile::tempdir()?;
    let server = start(data.path(), DEVICES).await?;
    let mut sockets = Vec::new();
    for device in 0..DEVICES {
        sockets.push(Socket::connect(server.address, device).await?);
    }
    let warm_up = |device: usize, batches: std::ops::Range<usize>| -> Vec<Bytes> {
        let samples = &sick[device * OFFSET..][batches.start * BATCH..batches.end * BATCH];
        samples.chunks(BATCH).map(|part| columns_as_msgpack(part).into()).collect()
    };
    for (device, socket) in sockets.iter_mut().enumerate() {
        socket.send(&warm_up(device, 0..1)).await?;
    }
    discard(server.address, learns).await?;
    for (device, socket) in sockets.iter_mut().enumerate() {
        socket.send(&warm_up(device, 1..WARM_UP)).await?;
    }
    let before = n_learnt(server.address, learns).await?;
    let period = Duration::from_secs_f64((BATCH * DEVICES) as f64 / pace);
    let begin = Instant::now() + Duration::from_millis(100);
    let run = |(device, mut socket): (usize, Socket)| {
        let rest = sick[device * OFFSET + WARM_UP * BATCH..].to_vec();
        let begin = begin + period.mul_f64(device as f64 / DEVICES as f64);
        tokio::spawn(async move { socket.pace(&rest, BATCH, begin, period).await })
    };
    let mut latencies = Vec::new();
    for device in sockets.into_iter().enumerate().map(run).collect::<Vec<_>>() {
        latencies.extend(device.await??);
    }
    let n = n_learnt(server.address, learns).await? - before;
    server.shutdown().await?;
    Ok((latencies, n))
}

/// Discards the open session of each rig as one to learn from, unless it `learns`.
async fn discard(address: SocketAddr, learns: bool) -> Result<()> {
    let mut client = Client::connect(address).await?;
    for n in (0..DEVICES).filter(|_| !learns) {
        let path = format!("/api/v1/assets/device-{n}/learning/discard");
        client.post(&path, "application/json", b"").await?;
    }
    Ok(())
}

/// Returns the number of rigs that have been learnt, or for which that has failed. Checks that
/// the others are being learnt, or that none is.
async fn n_learnt(address: SocketAddr, learns: bool) -> Result<usize> {
    let mut client = Client::connect(address).await?;
    let mut n = 0;
    for device in 0..DEVICES {
        let view = client.get(&format!("/api/v1/assets/device-{device}/learning")).await?;
        let view: serde_json::Value = serde_json::from_str(&view)?;
        let is_learnt = view["state"] == "offered" || view["refused"].is_string();
        n += usize::from(is_learnt);
        ensure!(is_learnt || (view["state"] == "learning") == learns, "{view}");
    }
    Ok(n)
}
