//! Throughput of ingest, compared with the most that HTTP on this machine allows.
//!
//! `cargo bench --bench ingest [-- ROUNDS]` sends the same samples from the same
//! clients, in one run, to:
//!
//! - *bare*: an axum handler that only reads the body and responds;
//! - *offbd*: the whole service: parse, diagnose, store durably, acknowledge;
//!
//! and measures *engine* and *replay*: diagnosis on one core without HTTP, from memory and
//! from CSV. Other arguments:
//!
//! - `-- memory`: memory per asset, with 10 000 assets;
//! - `-- restart ASSETS SAMPLES`: a restart after a kill, with that many assets and samples in
//!   the open session of each;
//! - `-- cluster ALONE ONE TWO [ROUNDS]`: nodes of a cluster; the URLs of three empty PostgreSQL
//!   databases;
//! - `-- fleet URL ASSETS MINUTES`: many slow rigs on three nodes, one of which is killed each
//!   minute; the URL of an empty PostgreSQL database;
//! - `-- mqtt PORT [ROUNDS]`: devices over an MQTT broker on that port of this machine, with
//!   messages lost on the way (feature `mqtt`);
//! - `-- learning [ROUNDS]`: rate and latency while all rigs learn by themselves, and while none
//!   does;
//! - `-- latency`: time from a sample to its fault event, at half the maximum rate;
//! - `-- only WORD`: only the loads with the word in their name, without *bare*;
//! - `-- peer URL`: another database that accepts line protocol, see
//!   `benches/ingest/peers`.
//!
//! A client is a TCP connection that writes a request and waits for its response, or a
//! WebSocket with up to 16 pending acknowledgements. TLS, tokens and a network are not
//! included. The clients use the same cores as the server. The rate is per second of wall
//! clock time; *cores* is the processor time of server and clients divided by the wall clock
//! time. If the machine has other work, compare rate / cores. Quote only ratios.

#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

mod client;
mod cluster;
mod fleet;
mod learning;
mod load;
#[cfg(feature = "mqtt")]
mod mqtt;
mod process;
mod restart;

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
use offbd::wire::table::{TableOptions, TableReader};
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Engine, Input, Rig, Setup};
use offbd_core::vocabulary::Sample;
use rustix::time::{ClockId, clock_gettime};

use client::{Client, Socket};
use load::{
    DEVICES, Load, SAMPLES, Transport, columns_as_msgpack, loads, loads_of_peer, recording,
};

/// Number of samples between the faults of two devices, so that no two fail at the same time.
const OFFSET: usize = 80;
/// Number of assets for the measurement of memory.
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
        Some("restart") => {
            let number = |n: usize| -> Result<usize> {
                Ok(arguments.get(n).context("`restart` takes ASSETS SAMPLES")?.parse()?)
            };
            return runtime.block_on(restart::measure(number(1)?, number(2)?));
        }
        Some("cluster") => {
            let url =
                |n: usize| arguments.get(n).context("`cluster` takes the URLs of three databases");
            let databases = [url(1)?.as_str(), url(2)?, url(3)?];
            return runtime.block_on(cluster::measure(databases, &samples, rounds));
        }
        Some("fleet") => {
            let usage = "`fleet` takes the URL of a database, ASSETS and MINUTES";
            let argument = |n: usize| arguments.get(n).context(usage);
            let (assets, minutes) = (argument(2)?.parse()?, argument(3)?.parse()?);
            return runtime.block_on(fleet::measure(argument(1)?, assets, minutes));
        }
        #[cfg(feature = "mqtt")]
        Some("mqtt") => {
            let port = arguments.get(1).context("`mqtt` takes the port of a broker")?.parse()?;
            let rounds = arguments.get(2).map_or(Ok(3), |n| n.parse())?;
            return runtime.block_on(mqtt::measure(port, &samples, rounds));
        }
        Some("learning") => return runtime.block_on(learning::measure(&samples, rounds)),
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
            if word.is_none() && load.transport != Transport::Socket {
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
    let columns = |r: Rate| format!("{:>14.0}{:>8.2}", r.rate, r.cores);
    let comparison = median(bare).map_or_else(String::new, |bare| {
        format!("{}{:>10.3}", columns(bare), rate.per_core() / bare.per_core())
    });
    println!("{name:24}{}{comparison}", columns(rate));
}

/// Samples per second of wall clock time, and processor time per wall clock time.
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

/// Returns the round with the median rate per core; `None` without rounds.
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
    let rate = stream(load, &|device| Target::telemetry(address, device)).await;
    server.abort();
    rate
}

/// Starts a service on a new store with the assets `device-0`, `device-1`, ….
async fn start(data: &std::path::Path, assets: usize) -> Result<Server> {
    let mut config = Config { data: data.to_owned(), ..Config::default() };
    config.listen.set_port(0);
    let server = server::start(config).await?;
    register(server.address, 0..assets).await?;
    Ok(server)
}

/// Registers the assets with these numbers.
async fn register(address: SocketAddr, assets: std::ops::Range<usize>) -> Result<()> {
    let mut client = Client::connect(address).await?;
    for n in assets {
        let asset = serde_json::json!({ "name": format!("device-{n}") }).to_string();
        client.post("/api/v1/assets", "application/json", asset.as_bytes()).await?;
    }
    Ok(())
}

fn telemetry(device: usize) -> String {
    format!("/api/v1/assets/device-{device}/telemetry")
}

async fn service(load: &Load) -> Result<Rate> {
    let data = tempfile::tempdir()?;
    let server = start(data.path(), DEVICES).await?;
    let rate = stream(load, &|device| Target::telemetry(server.address, device)).await;
    server.shutdown().await?;
    rate
}

/// Where a device sends.
struct Target {
    address: SocketAddr,
    /// Number of its asset.
    asset: usize,
    /// Path of its requests over HTTP.
    path: String,
}

impl Target {
    fn telemetry(address: SocketAddr, asset: usize) -> Self {
        Self { address, asset, path: telemetry(asset) }
    }
}

/// Every device sends every body, one after the other. The first body opens the session and
/// is not counted.
async fn stream(load: &Load, target: &(dyn Fn(usize) -> Target + Sync)) -> Result<Rate> {
    let devices = (0..DEVICES).map(|device| Device::connect(load, device, target(device)));
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

/// A device with its connection.
struct Device {
    connection: Connection,
    bodies: Vec<Bytes>,
}

enum Connection {
    Http { client: Client, path: String, media_type: &'static str },
    Socket(Box<Socket>),
}

impl Device {
    async fn connect(
        load: &Load,
        device: usize,
        Target { address, asset, path }: Target,
    ) -> Result<Self> {
        let connection = match load.transport {
            Transport::Http(media_type) => {
                Connection::Http { client: Client::connect(address).await?, path, media_type }
            }
            Transport::Socket => {
                Connection::Socket(Box::new(Socket::connect(address, asset).await?))
            }
        };
        Ok(Self { connection, bodies: load.bodies(device).to_vec() })
    }

    async fn send(&mut self, part: fn(&[Bytes]) -> &[Bytes]) -> Result<()> {
        match &mut self.connection {
            Connection::Socket(socket) => socket.send(part(&self.bodies)).await,
            Connection::Http { client, path, media_type } => {
                for body in part(&self.bodies) {
                    client.post(path, media_type, body).await?;
                }
                Ok(())
            }
        }
    }
}

/// Measures another database at `HOST:PORT/PATH`. *cores* includes only the clients.
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
        // Each round uses other times, so that no sample exists already.
        let begin_s = now - 7200.0 * (round + 1) as f64;
        for (load, rates) in loads_of_peer(samples, begin_s).iter().zip(&mut rates) {
            let target = |asset| Target { address, asset, path: path.clone() };
            rates.push(runtime.block_on(stream(load, &target))?);
        }
    }
    for (load, rates) in loads_of_peer(&samples[..SAMPLES], now).iter().zip(&mut rates) {
        show(load.name, rates, &mut []);
    }
    Ok(())
}

/// Measures the time from a sample to its fault event on the WebSocket, while every device
/// sends at half the maximum rate.
async fn latency(samples: &[Sample], load: &str, batch: usize) -> Result<()> {
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
            socket.pace(&sick[device * OFFSET..], batch, begin, period).await
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

/// Measures the memory per asset with many assets in a session: after a first batch and after
/// a minute at 100 Hz.
async fn memory() -> Result<()> {
    let data = tempfile::tempdir()?;
    let samples = recording(6000, None)?;
    let server = start(data.path(), ASSETS).await?;
    let mut client = Client::connect(server.address).await?;
    let before = resident(std::process::id())?;
    let mut sent = 0;
    for end in [10, 1000, 6000] {
        for part in samples[sent..end].chunks(1000) {
            let body = columns_as_msgpack(part);
            for device in 0..ASSETS {
                let path = format!("/api/v1/assets/device-{device}/telemetry");
                client.post(&path, "application/msgpack", &body).await?;
            }
        }
        sent = end;
        let each = (resident(std::process::id())? - before) / ASSETS as f64;
        println!("{ASSETS} assets, {end} samples each: {:.1} KiB per asset", each / 1024.0);
    }
    server.shutdown().await
}

/// Returns the resident memory of a process, bytes.
fn resident(process: u32) -> Result<f64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status"));
    let status = status.context("only on Linux")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).context("no VmRSS")?;
    Ok(line.trim().trim_end_matches(" kB").parse::<f64>()? * 1024.0)
}

fn judge(samples: impl Iterator<Item = Sample>) -> Result<Rate> {
    let setup = Setup::new(Rig::chapter("a"), None)?;
    let mut engine = Engine::new(setup, FaultMemory::default());
    let (mut transitions, mut n, clocks) = (Vec::new(), 0, Clocks::start());
    for sample in samples {
        engine.handle(Input::Sample(sample), &mut transitions);
        transitions.clear();
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
    judge(TableReader::batch(file.as_slice(), &TableOptions::default())?.map_while(Result::ok))
}
