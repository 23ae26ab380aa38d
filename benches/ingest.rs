//! How fast samples go through, beside what the machine can do at most.
//!
//! `cargo bench --bench ingest [-- ROUNDS]` compares in one run, on the same
//! bodies (JSON columns, 100 samples each) from the same clients:
//!
//! - *bare*: an axum handler that reads the body and answers, nothing else;
//! - *offbd*: the whole path: parse, diagnose, store durably, acknowledge;
//! - *engine* and *replay*: one core without HTTP, from memory and from CSV.
//!
//! Left out: TLS, tokens, a network. Unfair to all: the clients share the
//! cores with the server. Quote the ratios; the machine is part of the rest.

#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

use std::net::SocketAddr;
use std::time::Instant;

use anyhow::{Result, ensure};
use axum::Router;
use axum::body::Bytes;
use axum::routing::post;
use offbd::config::Config;
use offbd::diagnosis::FaultMemory;
use offbd::engine::{Engine, Input, Rig, Setup};
use offbd::server;
use offbd::simulation::{Disturbances, Preset, Reference, SimulatedRig};
use offbd::vocabulary::Sample;
use offbd::wire::session_csv;

/// Devices that stream at once, each on a connection of its own.
const DEVICES: usize = 16;
/// Samples in a batch.
const BATCH: usize = 100;
/// Batches that each device sends a round.
const BATCHES: usize = 300;

fn main() -> Result<()> {
    let rounds = std::env::args().filter_map(|a| a.parse().ok()).next().unwrap_or(3);
    let samples = recording(BATCH * BATCHES);
    let bodies: Vec<Bytes> = samples.chunks(BATCH).map(columns).collect();
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    println!("{DEVICES} devices, batches of {BATCH}, {BATCHES} batches each; samples per second");
    let (mut bare, mut whole, mut engine, mut replay) = (vec![], vec![], vec![], vec![]);
    for round in 1..=rounds {
        bare.push(runtime.block_on(bare_handler(&bodies))?);
        whole.push(runtime.block_on(service(&bodies))?);
        engine.push(engine_alone(&samples)?);
        replay.push(replay_csv(&samples)?);
        let last = |v: &Vec<f64>| v[round - 1];
        println!(
            "round {round}: bare {:.0}  offbd {:.0}  engine {:.0}  replay {:.0}",
            last(&bare),
            last(&whole),
            last(&engine),
            last(&replay)
        );
    }
    println!("median");
    for (name, rates) in
        [("bare", &bare), ("offbd", &whole), ("engine", &engine), ("replay", &replay)]
    {
        println!(
            "  {name:8} {:>12.0}  {:.3} of bare",
            median(rates),
            median(rates) / median(&bare)
        );
    }
    Ok(())
}

fn median(rates: &[f64]) -> f64 {
    let mut sorted = rates.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

fn recording(n: usize) -> Vec<Sample> {
    let model = Preset::Chapter.model().expect("the preset is valid");
    let mut rig = SimulatedRig::new(model, Reference::Circle, Disturbances::default(), 1)
        .expect("the preset is valid");
    (0..n).map(|_| rig.next_sample()).collect()
}

fn columns(batch: &[Sample]) -> Bytes {
    let column = |of: fn(&Sample) -> Option<f64>| batch.iter().map(of).collect::<Vec<_>>();
    let body = serde_json::json!({
        "seq": batch.iter().map(|s| s.seq).collect::<Vec<_>>(),
        "t_s": column(|s| Some(s.t_s)),
        "cmd_qx_rad": column(|s| s.cmd_qx_rad),
        "cmd_qy_rad": column(|s| s.cmd_qy_rad),
        "x_m": column(|s| s.x_m),
        "y_m": column(|s| s.y_m),
    });
    Bytes::from(body.to_string())
}

async fn bare_handler(bodies: &[Bytes]) -> Result<f64> {
    let app = Router::new().route(
        "/api/v1/assets/{asset}/telemetry",
        post(|body: Bytes| async move { body.len().to_string() }),
    );
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await?;
    let address = listener.local_addr()?;
    let server = tokio::spawn(async move { axum::serve(listener, app).await });
    let rate = stream(address, bodies).await;
    server.abort();
    rate
}

async fn service(bodies: &[Bytes]) -> Result<f64> {
    let data = tempfile::tempdir()?;
    let mut config = Config { data: data.path().to_owned(), ..Config::default() };
    config.listen.set_port(0);
    let server = server::start(config).await?;
    let client = reqwest::Client::new();
    for device in 0..DEVICES {
        let url = format!("http://{}/api/v1/assets", server.address);
        let asset = serde_json::json!({ "name": format!("device-{device}") });
        client.post(url).json(&asset).send().await?.error_for_status()?;
    }
    let rate = stream(server.address, bodies).await;
    server.shutdown().await?;
    rate
}

/// Every device sends every body, one after the other; returns samples per
/// second over all devices.
async fn stream(address: SocketAddr, bodies: &[Bytes]) -> Result<f64> {
    let start = Instant::now();
    let devices: Vec<_> = (0..DEVICES)
        .map(|device| {
            let url = format!("http://{address}/api/v1/assets/device-{device}/telemetry");
            let bodies = bodies.to_vec();
            tokio::spawn(async move {
                let client = reqwest::Client::builder().pool_max_idle_per_host(1).build()?;
                for body in bodies {
                    let request = client.post(&url).header("content-type", "application/json");
                    let answer = request.body(body).send().await?;
                    ensure!(answer.status().is_success(), "{}", answer.text().await?);
                    answer.bytes().await?;
                }
                Ok(())
            })
        })
        .collect();
    for device in devices {
        device.await??;
    }
    let n = bodies.len() * BATCH * DEVICES;
    Ok(n as f64 / start.elapsed().as_secs_f64())
}

fn judge(samples: impl Iterator<Item = Sample>) -> Result<f64> {
    let setup = Setup::new(Rig::chapter("a"), None)?;
    let mut engine = Engine::new(setup, FaultMemory::default());
    let (mut outputs, mut n, start) = (Vec::new(), 0_u64, Instant::now());
    for sample in samples {
        engine.handle(Input::Sample(sample), &mut outputs);
        outputs.clear();
        n += 1;
    }
    ensure!(engine.state().n_judged > 0, "nothing was judged");
    Ok(n as f64 / start.elapsed().as_secs_f64())
}

fn engine_alone(samples: &[Sample]) -> Result<f64> {
    judge(samples.iter().copied())
}

fn replay_csv(samples: &[Sample]) -> Result<f64> {
    let mut file = Vec::new();
    session_csv::write(&mut file, samples)?;
    judge(session_csv::Reader::new(file.as_slice())?.map_while(Result::ok))
}
