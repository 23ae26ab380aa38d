//! How fast samples go through, beside what the machine can do at most.
//!
//! `cargo bench --bench ingest [-- ROUNDS]` sends the same samples from the same
//! clients, in one run, to:
//!
//! - *bare*: an axum handler that reads the body and answers, nothing else;
//! - *offbd*: the whole path: parse, diagnose, store durably, acknowledge;
//!
//! and judges with *engine* and *replay*: one core without HTTP, from memory and
//! from CSV. Other words ask for other things:
//!
//! - `-- memory`: what an asset takes, with 10 000 of them;
//! - `-- latency`: from a sample to its fault event, at half the rate;
//! - `-- only WORD`: the loads whose name holds the word, without *bare*;
//! - `-- peer URL`: another database that takes line protocol, see
//!   `benches/ingest/peers`.
//!
//! A client is a bare TCP connection that writes a request and waits for its
//! answer, or a WebSocket with up to 16 batches under way. Left out: TLS, tokens, a
//! network. Unfair to all: the clients share the cores with the server. Samples per
//! second are by the clock; *cores* is the processor time it took, clients included,
//! over the clock: with other work beside it, rate / cores is what compares. Quote
//! the ratios.

#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

mod client;
mod load;

use std::net::SocketAddr;
use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context, Result, ensure};
use axum::Router;
use axum::body::Bytes;
use axum::routing::post;
use futures_util::future::try_join_all;
use offbd::config::Config;
use offbd::server::{self, Server};
use offbd::wire::session_csv;
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Engine, Input, Rig, Setup};
use offbd_core::vocabulary::Sample;
use rustix::time::{ClockId, clock_gettime};

use client::{Client, Socket};
use load::{DEVICES, Load, SAMPLES, Way, columns_as_msgpack, loads, loads_of_peer, recording};

/// Assets whose memory is looked at.
const ASSETS: usize = 10_000;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let rounds = arguments.iter().filter_map(|a| a.parse().ok()).next().unwrap_or(3);
    let word = arguments.iter().position(|a| a == "only").and_then(|i| arguments.get(i + 1));
    let named = |name: &str| word.is_none_or(|word| name.contains(word.as_str()));
    let samples = recording(SAMPLES, None)?;
    match arguments.first().map(String::as_str) {
        Some("memory") => return runtime.block_on(memory()),
        Some("latency") => {
            for (load, batch) in [("WebSocket by 100", 100), ("WebSocket by 10", 10)] {
                runtime.block_on(latency(&samples, load, batch))?;
            }
            return Ok(());
        }
        Some("peer") => {
            let url = arguments.get(1).context("`peer` takes HOST:PORT/PATH")?;
            return peer(&runtime, url, &samples, rounds);
        }
        _ => {}
    }
    println!("{DEVICES} devices; medians of {rounds} rounds");
    println!(
        "{:24}{:>14}{:>8}{:>14}{:>8}{:>10}",
        "", "offbd/s", "cores", "bare/s", "cores", "ratio"
    );
    for load in loads(&samples).iter().filter(|load| named(load.name)) {
        let (mut bare, mut whole) = (vec![], vec![]);
        for _ in 0..rounds {
            whole.push(runtime.block_on(service(load))?);
            if word.is_none() && load.way != Way::Socket {
                bare.push(runtime.block_on(bare_handler(load))?);
            }
        }
        show(load.name, &mut whole, &mut bare);
    }
    for (name, judge) in [("engine", engine_alone as fn(&_) -> _), ("replay", replay_csv)] {
        let rates = (0..rounds).filter(|_| named(name)).map(|_| judge(&samples));
        show(name, &mut rates.collect::<Result<Vec<_>>>()?, &mut []);
    }
    Ok(())
}

fn show(name: &str, rates: &mut [Rate], bare: &mut [Rate]) {
    let Some(rate) = median(rates) else { return };
    let of = |r: Rate| format!("{:>14.0}{:>8.2}", r.rate, r.cores);
    let beside = median(bare).map_or_else(String::new, |bare| {
        format!("{}{:>10.3}", of(bare), rate.per_core() / bare.per_core())
    });
    println!("{name:24}{}{beside}", of(rate));
}

/// Samples per second by the clock, and the processor time over it.
#[derive(Clone, Copy)]
struct Rate {
    rate: f64,
    cores: f64,
}

impl Rate {
    fn per_core(self) -> f64 {
        self.rate / self.cores
    }
}

struct Clocks {
    wall: Instant,
    cpu: Duration,
}

impl Clocks {
    fn start() -> Self {
        Self { wall: Instant::now(), cpu: processor_time() }
    }

    fn rate(&self, n: usize) -> Rate {
        let wall = self.wall.elapsed().as_secs_f64();
        let cpu = (processor_time() - self.cpu).as_secs_f64();
        Rate { rate: n as f64 / wall, cores: cpu / wall }
    }
}

fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// The round in the middle by what a core does; none of none.
fn median(rates: &mut [Rate]) -> Option<Rate> {
    rates.sort_by(|a, b| a.per_core().total_cmp(&b.per_core()));
    rates.get(rates.len() / 2).copied()
}

async fn bare_handler(load: &Load) -> Result<Rate> {
    let app = Router::new().route(
        "/api/v1/assets/{asset}/telemetry",
        post(|body: Bytes| async move { body.len().to_string() }),
    );
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await?;
    let address = listener.local_addr()?;
    let server = tokio::spawn(async move { axum::serve(listener, app).await });
    let rate = stream(address, load, &telemetry).await;
    server.abort();
    rate
}

/// A service on a new store, with assets `device-0` and so on.
async fn start(data: &std::path::Path, assets: usize) -> Result<Server> {
    let mut config = Config { data: data.to_owned(), ..Config::default() };
    config.listen.set_port(0);
    let server = server::start(config).await?;
    let mut client = Client::connect(server.address).await?;
    for device in 0..assets {
        let asset = serde_json::json!({ "name": format!("device-{device}") }).to_string();
        client.post("/api/v1/assets", "application/json", asset.as_bytes()).await?;
    }
    Ok(server)
}

fn telemetry(device: usize) -> String {
    format!("/api/v1/assets/device-{device}/telemetry")
}

async fn service(load: &Load) -> Result<Rate> {
    let data = tempfile::tempdir()?;
    let server = start(data.path(), DEVICES).await?;
    let rate = stream(server.address, load, &telemetry).await;
    server.shutdown().await?;
    rate
}

/// Every device sends every body, one after the other. The first opens the
/// session and is not counted.
async fn stream(
    address: SocketAddr,
    load: &Load,
    path: &(dyn Fn(usize) -> String + Sync),
) -> Result<Rate> {
    let devices = (0..DEVICES).map(|device| Device::connect(address, load, device, path(device)));
    let mut devices = try_join_all(devices).await?;
    devices = send_all(devices, |bodies| &bodies[..1]).await?;
    let clocks = Clocks::start();
    send_all(devices, |bodies| &bodies[1..]).await?;
    Ok(clocks.rate((load.bodies(0).len() - 1) * load.batch * DEVICES))
}

async fn send_all(devices: Vec<Device>, part: fn(&[Bytes]) -> &[Bytes]) -> Result<Vec<Device>> {
    let send =
        |mut device: Device| tokio::spawn(async move { device.send(part).await.map(|()| device) });
    let sending: Vec<_> = devices.into_iter().map(send).collect();
    let mut devices = Vec::new();
    for device in sending {
        devices.push(device.await??);
    }
    Ok(devices)
}

/// A device on its connection.
struct Device {
    line: Line,
    bodies: Vec<Bytes>,
}

enum Line {
    Http { client: Client, path: String, media_type: &'static str },
    Socket(Box<Socket>),
}

impl Device {
    async fn connect(
        address: SocketAddr,
        load: &Load,
        device: usize,
        path: String,
    ) -> Result<Self> {
        let line = match load.way {
            Way::Http(media_type) => {
                Line::Http { client: Client::connect(address).await?, path, media_type }
            }
            Way::Socket => Line::Socket(Box::new(Socket::connect(address, device).await?)),
        };
        Ok(Self { line, bodies: load.bodies(device).to_vec() })
    }

    async fn send(&mut self, part: fn(&[Bytes]) -> &[Bytes]) -> Result<()> {
        match &mut self.line {
            Line::Socket(socket) => socket.send(part(&self.bodies)).await,
            Line::Http { client, path, media_type } => {
                for body in part(&self.bodies) {
                    client.post(path, media_type, body).await?;
                }
                Ok(())
            }
        }
    }
}

/// Another database, at `HOST:PORT/PATH`. *cores* is that of the clients alone.
fn peer(
    runtime: &tokio::runtime::Runtime,
    url: &str,
    samples: &[Sample],
    rounds: usize,
) -> Result<()> {
    let (address, path) = url.split_once('/').context("`peer` takes HOST:PORT/PATH")?;
    let (address, path) = (address.parse()?, format!("/{path}"));
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?.as_secs_f64();
    let mut rates = vec![vec![], vec![]];
    for round in 0..rounds {
        // Each round is another time, so that nothing is there already.
        let begin_s = now - 7200.0 * (round + 1) as f64;
        for (load, rates) in loads_of_peer(samples, begin_s).iter().zip(&mut rates) {
            rates.push(runtime.block_on(stream(address, load, &|_| path.clone()))?);
        }
    }
    for (load, rates) in loads_of_peer(&samples[..SAMPLES], now).iter().zip(&mut rates) {
        show(load.name, rates, &mut []);
    }
    Ok(())
}

/// How long a fault takes from its sample to its event on the WebSocket, while every
/// device streams at half the rate at which all can.
async fn latency(samples: &[Sample], load: &str, batch: usize) -> Result<()> {
    /// Samples from the fault of one device to that of the next.
    const APART: usize = 80;
    let most = loads(samples).into_iter().find(|l| l.name == load);
    let rate = service(&most.context("no such load")?).await?.rate / 2.0;
    let sick = recording(SAMPLES, Some("x_servo:held@150-160"))?;
    let data = tempfile::tempdir()?;
    let server = start(data.path(), DEVICES).await?;
    let period = Duration::from_secs_f64((batch * DEVICES) as f64 / rate);
    let begin = Instant::now() + Duration::from_millis(100);
    let pace = |device: usize| {
        let (sick, address) = (sick.clone(), server.address);
        tokio::spawn(async move {
            let mut socket = Socket::connect(address, device).await?;
            let begin = begin + period.mul_f64(device as f64 / DEVICES as f64);
            // No two devices fail at once.
            socket.pace(&sick[device * APART..], batch, begin, period).await
        })
    };
    let mut latencies = Vec::new();
    for device in (0..DEVICES).map(pace).collect::<Vec<_>>() {
        latencies.extend(device.await??);
    }
    server.shutdown().await?;
    latencies.sort();
    ensure!(!latencies.is_empty(), "no fault was found");
    let at = |share: f64| latencies[((latencies.len() - 1) as f64 * share) as usize];
    let [half, most, nearly_all, worst] = [0.5, 0.9, 0.99, 1.0].map(at);
    println!("{load}: {rate:.0} samples/s, {} events:", latencies.len());
    println!("median {half:.1?}, p90 {most:.1?}, p99 {nearly_all:.1?}, worst {worst:.1?}");
    Ok(())
}

/// What the process holds more once each of many assets is in a session, after
/// a first batch and after a minute at 100 Hz.
async fn memory() -> Result<()> {
    let data = tempfile::tempdir()?;
    let samples = recording(6000, None)?;
    let server = start(data.path(), ASSETS).await?;
    let mut client = Client::connect(server.address).await?;
    let before = resident()?;
    let mut sent = 0;
    for upto in [10, 1000, 6000] {
        for part in samples[sent..upto].chunks(1000) {
            let body = columns_as_msgpack(part);
            for device in 0..ASSETS {
                let path = format!("/api/v1/assets/device-{device}/telemetry");
                client.post(&path, "application/msgpack", &body).await?;
            }
        }
        sent = upto;
        let each = (resident()? - before) / ASSETS as f64;
        println!("{ASSETS} assets, {upto} samples each: {:.1} KiB an asset", each / 1024.0);
    }
    server.shutdown().await
}

/// Bytes of memory that the process holds.
fn resident() -> Result<f64> {
    let status = std::fs::read_to_string("/proc/self/status").context("only on Linux")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).context("no VmRSS")?;
    Ok(line.trim().trim_end_matches(" kB").parse::<f64>()? * 1024.0)
}

fn judge(samples: impl Iterator<Item = Sample>) -> Result<Rate> {
    let setup = Setup::new(Rig::chapter("a"), None)?;
    let mut engine = Engine::new(setup, FaultMemory::default());
    let (mut outputs, mut n, clocks) = (Vec::new(), 0, Clocks::start());
    for sample in samples {
        engine.handle(Input::Sample(sample), &mut outputs);
        outputs.clear();
        n += 1;
    }
    ensure!(engine.state().n_judged > 0, "nothing was judged");
    Ok(clocks.rate(n))
}

fn engine_alone(samples: &[Sample]) -> Result<Rate> {
    judge(samples.iter().copied())
}

fn replay_csv(samples: &[Sample]) -> Result<Rate> {
    let mut file = Vec::new();
    session_csv::write(&mut file, samples)?;
    judge(session_csv::Reader::new(file.as_slice())?.map_while(Result::ok))
}
