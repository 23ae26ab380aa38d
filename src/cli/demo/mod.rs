//! `offbd demo`: the service with its embedded store, and a simulated rig that streams to
//! it in real time over HTTP and WebSocket, as a device does.
//!
//! The demo reads the detected faults from the interface (Server-Sent Events), like any
//! other client, although it runs in the same process.

mod client;
mod comparison;
mod controls;
mod events;
mod plan;
mod show;

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;
use data_encoding::HEXLOWER;

use crate::config::Config;
use crate::server;
use client::Client;
use controls::VisitorControls;
use offbd_core::engine::Rig;
use offbd_file_cli::calibrate;
use offbd_lab::simulation::{Disturbances, Fault, Preset, Reference, SimulatedRig};
use offbd_lab_cli::simulate;
use offbd_terminal::table;
use offbd_wire::session_csv;
use sha2::{Digest, Sha256};
use show::Show;

/// Demonstrates the service: a simulated rig streams to it, faults are found.
///
/// Starts the service on its embedded store, registers and calibrates a
/// simulated rig with PID control, streams it in real time over WebSocket and
/// HTTP, injects faults, and prints those found. Open the address it prints.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd demo\n  \
    offbd demo --seconds 60\n  \
    offbd demo --seconds 90 --fault y_servo:gain=0.3@20 --fault sensor:freeze@60\n  \
    offbd demo --seconds 120 --speed 10 --port 0\n\n\
    With --seconds, a script breaks and repairs the rig from the beginning, and\n\
    clears a code before it injects its fault again. Without, the rig stays healthy\n\
    for a minute, so that you can inject faults yourself on the page Lessons; then\n\
    the script breaks and repairs it, and what was found stays on record until you\n\
    clear it, or heals after enough sessions without it. On that page you can tune\n\
    the controller as well.\n\n\
    A fault is CODE:KIND[=SIZE]@START[-END]; `offbd simulate --help` lists them.\n\n\
    Exit status with --seconds: 0 if what was injected and what was found agree,\n\
    else 1.")]
pub(super) struct DemoArgs {
    /// Port of the service on 127.0.0.1; 0 takes a free one
    #[arg(long, default_value_t = 8087, value_name = "P")]
    port: u16,
    /// Directory of the store [default: a temporary one]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// End after this long on the rig's clock, s [default: until Ctrl-C]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = simulate::seconds)]
    seconds: Option<f64>,
    /// A fault to inject; may be repeated [default: a sequence of faults]
    #[arg(long, value_name = "CODE:KIND@T")]
    fault: Vec<Fault>,
    /// Speed: seconds of the rig's clock per second
    #[arg(long, default_value_t = 1.0, value_name = "X", allow_negative_numbers = true,
          value_parser = speed)]
    speed: f64,
    /// Seed of the simulated rig
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// The name of the demo's rig.
const ASSET: &str = "demo-rig";
/// Duration of a demo without `--seconds`, s; chosen: a day.
const ENDLESS_S: f64 = 86_400.0;
/// Duration of the calibration session, s; chosen.
const HEALTHY_S: f64 = 120.0;
/// Maximum speed. Chosen: the simulation alone is some hundreds of times faster than real
/// time.
const MAX_SPEED: f64 = 100.0;

fn speed(word: &str) -> Result<f64, String> {
    let value: Option<f64> = word.parse().ok();
    let in_range = |v: &f64| (0.1..=MAX_SPEED).contains(v);
    value.filter(in_range).ok_or_else(|| format!("not from 0.1 to {MAX_SPEED}"))
}

pub(super) fn run(args: &DemoArgs) -> anyhow::Result<()> {
    offbd_terminal::block_on(demo(args))
}

async fn demo(args: &DemoArgs) -> anyhow::Result<()> {
    let store = StoreDirectory::new(args.data.as_ref());
    let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, args.port));
    let data = store.path.clone();
    let config = Config { listen, data, ..Config::default() };
    let gains = Preset::Chapter.model()?.gains();
    let (controls, routes) = controls::visitor_controls(ASSET, gains);
    let server = server::start_with(config, Some(routes));
    let server = server.await.context("cannot start; --port 0 takes a free port")?;
    let result = show(args, &server.address.to_string(), &store, controls).await;
    server.shutdown().await?;
    let outcome = result?;
    if args.seconds.is_some() && !outcome.interrupted && !outcome.agreed {
        bail!("what was injected and what was found do not agree");
    }
    Ok(())
}

/// The outcome of a demo.
struct DemoOutcome {
    agreed: bool,
    interrupted: bool,
}

async fn show(
    args: &DemoArgs,
    address: &str,
    store: &StoreDirectory,
    controls: VisitorControls,
) -> anyhow::Result<DemoOutcome> {
    let seconds = args.seconds.unwrap_or(ENDLESS_S);
    anstream::println!("dashboard  http://{address}/");
    anstream::println!("interface  http://{address}/docs");
    anstream::println!("store      {}", store.path.display());
    if store.temporary {
        anstream::println!("           removed at the end; --data DIR keeps one");
    }
    let faults = planned(args, seconds);
    if args.seconds.is_none() {
        anstream::println!("{}", table::wrapped("faults     ", &first_fault(args, &faults)));
    }
    let rig = calibrated_rig(args.seed)?;
    let client = Client::new(address.to_owned(), &rig.name)?;
    client.register(&rig).await?;
    let simulated = simulated_rig(Reference::Steps, args.seed)?;
    let clears = args.seconds.is_some();
    let mut show = Show::new(client, simulated, args.speed, controls, clears).await?;
    let interrupted = show.run(plan::episodes(faults, seconds)).await?;
    let agreed = show.conclude()?;
    Ok(DemoOutcome { agreed, interrupted })
}

/// Returns the faults that the script injects within `seconds`.
fn planned(args: &DemoArgs, seconds: f64) -> Vec<Fault> {
    match (args.fault.as_slice(), args.seconds) {
        ([], Some(seconds)) => plan::shown(seconds),
        // A fast rig gives the visitor no less time.
        ([], None) => plan::shown_later(plan::HEALTHY_FIRST_S * args.speed.max(1.0), seconds),
        (asked, _) => asked.to_vec(),
    }
}

/// Says when the script injects the first of `faults`.
fn first_fault(args: &DemoArgs, faults: &[Fault]) -> String {
    let first_s = faults.iter().map(|f| f.onset_s).fold(f64::INFINITY, f64::min) / args.speed;
    format!(
        "the first in {first_s:.0} s, unless you inject one on the page Lessons; what was found \
         stays on record until you clear it, or heals after enough sessions without it"
    )
}

fn simulated_rig(reference: Reference, seed: u64) -> anyhow::Result<SimulatedRig> {
    let model = Preset::Chapter.model()?;
    Ok(SimulatedRig::new(model, reference, Disturbances::default(), seed)?)
}

/// Returns the rig as its owner knows it, calibrated on a healthy session.
fn calibrated_rig(seed: u64) -> anyhow::Result<Rig> {
    let model = Preset::Chapter.model()?;
    let mut rig = Rig { name: ASSET.to_owned(), ..model.rig };
    let mut healthy = simulated_rig(Reference::Lissajous, seed.wrapping_add(1))?;
    let samples = healthy.record(HEALTHY_S);
    let mut file = Vec::new();
    session_csv::write(&mut file, &samples)?;
    let sha256 = HEXLOWER.encode(&Sha256::digest(&file));
    let calibration = calibrate::learn(&rig, &[samples], &sha256)?;
    calibrate::report(&rig, &calibration);
    rig.calibration = Some(Box::new(calibration));
    Ok(rig)
}

/// The directory of the store; a temporary one is removed with the demo.
struct StoreDirectory {
    path: PathBuf,
    temporary: bool,
}

impl StoreDirectory {
    fn new(asked: Option<&PathBuf>) -> Self {
        let temporary =
            || std::env::temp_dir().join(format!("offbd-demo-{}", uuid::Uuid::now_v7()));
        Self { path: asked.cloned().unwrap_or_else(temporary), temporary: asked.is_none() }
    }
}

impl Drop for StoreDirectory {
    fn drop(&mut self) {
        if self.temporary {
            // Files that cannot be removed are left to the system.
            let _ = std::fs::remove_dir_all(&self.path);
        }
    }
}
