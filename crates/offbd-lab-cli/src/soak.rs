//! `offbd soak`: simulates days of healthy operation of many rigs; every confirmed fault is
//! a false alarm.

mod counts;
mod figures;
mod watch;

use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;

use super::session::write_session;
use counts::SoakCounts;
use offbd_core::engine::{CannotCalibrate, Setup, calibrate};
use offbd_core::vocabulary::{Invalid, Sample};
use offbd_file_cli::calibrate::write_asset;
use offbd_file_cli::replay::{in_threads, progress};
use offbd_lab::simulation::{Disturbances, Reference, RigModel, SimulatedRig, Variety};
use offbd_terminal::errors::InputError;
use offbd_terminal::output::{OutputFormat, value_parser};

/// Runs many healthy simulated rigs for days and counts the false alarms.
///
/// The rigs are drawn at random. `real` draws the properties of real rigs: slow and
/// noisy sensors that repeat and hold their readings, servos with whole degrees, balls
/// on beams, origins off centre, stiction up to 2°, levels and gains that differ
/// between sessions; `presets` draws the parameters of the presets, the same in every
/// session. A rig is calibrated on sessions of two minutes, then watched for sessions
/// of an hour with pushes by hand, gusts, and gaps in the log. A rig whose calibration
/// is refused is named and not watched.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd soak                                   # ten days, some minutes\n  \
    offbd soak --rig-days 1 --per-year 8760      # limits for one an hour\n  \
    offbd soak --calibration-sessions 1 --rig-days 1\n  \
    offbd soak --rig-days 2 --format json | jq .alarms_per_rig_day")]
pub struct SoakArgs {
    /// Days of operation, over all rigs
    #[arg(long, value_name = "DAYS", default_value_t = 10.0, value_parser = days)]
    rig_days: f64,
    /// Population from which the rigs are drawn
    #[arg(long, default_value = "real",
          value_parser = value_parser::<Variety>(Variety::ALL.map(Variety::as_str)))]
    variety: Variety,
    /// Number of healthy sessions on which each rig is calibrated
    #[arg(long, value_name = "N", default_value_t = 3,
          value_parser = clap::value_parser!(u64).range(1..=MAX_CALIBRATION_SESSIONS))]
    calibration_sessions: u64,
    /// Accepted false alarms per rig and year [default: that of the diagnosis]
    #[arg(long, value_name = "N")]
    per_year: Option<f64>,
    /// How long a failure must last before a test fails, s [default: that of the diagnosis]
    #[arg(long, value_name = "S")]
    debounce: Option<f64>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// A table for people, or one JSON object
    #[arg(long, value_enum, default_value = "table")]
    format: OutputFormat,
    /// Write recordings with a false alarm, and the recordings on which their rigs
    /// were calibrated, into this directory
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Number of sessions in parallel [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
}

/// Maximum duration of operation, days; chosen: some hours of computing.
const MAX_DAYS: f64 = 1000.0;
/// Maximum number of calibration sessions; chosen: an hour of recordings.
const MAX_CALIBRATION_SESSIONS: u64 = 30;
/// Duration of a session, s; chosen: an hour.
const SESSION_S: f64 = 3600.0;
/// Duration of a calibration session, s; chosen.
const CALIBRATION_S: f64 = 120.0;
/// Reference motions of the calibration sessions, in turn.
const CALIBRATION: [Reference; 3] = [Reference::Lissajous, Reference::Circle, Reference::Steps];
/// Number of sessions per rig; chosen: one per reference motion.
const SESSIONS_PER_RIG: u64 = 4;
/// Disturbances of the sessions; chosen.
const DISTURBANCES: Disturbances = Disturbances { pushes_per_minute: 2.0, gusts_per_minute: 1.0 };

fn days(word: &str) -> Result<f64, String> {
    let value: Option<f64> = word.parse().ok();
    let in_range = |v: &f64| *v > 0.0 && *v <= MAX_DAYS;
    value.filter(in_range).ok_or_else(|| format!("not above 0 and at most {MAX_DAYS} days"))
}

pub(super) fn run(args: &SoakArgs) -> anyhow::Result<()> {
    let n_sessions = (args.rig_days * 86_400.0 / SESSION_S).ceil() as u64;
    let n_rigs = n_sessions.div_ceil(SESSIONS_PER_RIG);
    let bar = progress(n_sessions as usize);
    let soak = |n_rig: u64| {
        let n = SESSIONS_PER_RIG.min(n_sessions - n_rig * SESSIONS_PER_RIG);
        let found = soak_rig(args, args.seed.wrapping_mul(1_000_003).wrapping_add(n_rig), n);
        bar.inc(n);
        found
    };
    let each: Vec<SoakCounts> = in_threads(args.jobs, || {
        (0..n_rigs).into_par_iter().map(soak).collect::<anyhow::Result<Vec<_>>>()
    })??;
    bar.finish_and_clear();
    // In the order of the rigs, independent of the order of the threads.
    let found = each.into_iter().fold(SoakCounts::default(), SoakCounts::with);
    found.refusals.iter().for_each(|refusal| anstream::eprintln!("not watched: {refusal}"));
    found.alarms.iter().for_each(|alarm| anstream::eprintln!("{alarm}"));
    figures::write(args.format, &found)
}

/// Calibrates the rig of `seed` and judges its sessions.
fn soak_rig(args: &SoakArgs, seed: u64, n_sessions: u64) -> anyhow::Result<SoakCounts> {
    let model = args.variety.rig(seed).map_err(cannot)?;
    let healthy = calibration(&model, seed, args.calibration_sessions)?;
    match calibrated(args, &model, &healthy)? {
        Err(refusal) => Ok(SoakCounts::refused(&model.rig.name, &refusal)),
        Ok(setup) => watched(args, &model, &setup, &healthy, seed, n_sessions),
    }
}

fn cannot(error: Invalid) -> InputError {
    InputError::new("cannot soak", error)
}

/// Simulates a healthy session of the rig, with that session's level and gain.
fn session(
    model: &RigModel,
    reference: Reference,
    disturbances: Disturbances,
    seed: u64,
    seconds: f64,
) -> Result<Vec<Sample>, InputError> {
    let mut rig =
        SimulatedRig::new(model.of_session(seed), reference, disturbances, seed).map_err(cannot)?;
    Ok(rig.record(seconds))
}

/// Simulates the calibration sessions, without disturbances. Their seeds count down in the
/// upper 32 bits; those of the other sessions count up.
fn calibration(model: &RigModel, seed: u64, n: u64) -> Result<Vec<Vec<Sample>>, InputError> {
    let of = |i: u64| {
        let reference = CALIBRATION[i as usize % CALIBRATION.len()];
        session(
            model,
            reference,
            Disturbances::default(),
            seed.wrapping_sub(i << 32),
            CALIBRATION_S,
        )
    };
    (0..n).map(of).collect()
}

fn calibrated(
    args: &SoakArgs,
    model: &RigModel,
    healthy: &[Vec<Sample>],
) -> Result<Result<Setup, CannotCalibrate>, InputError> {
    let mut rig = model.rig.clone();
    rig.calibration = match calibrate(&rig, healthy) {
        Ok(calibration) => Some(Box::new(calibration)),
        Err(refusal) => return Ok(Err(refusal)),
    };
    rig.diagnostics.false_alarms_per_rig_year = args.per_year;
    rig.diagnostics.debounce_s = args.debounce;
    Setup::new(rig, None).map(Ok).map_err(cannot)
}

fn watched(
    args: &SoakArgs,
    model: &RigModel,
    setup: &Setup,
    healthy: &[Vec<Sample>],
    seed: u64,
    n_sessions: u64,
) -> anyhow::Result<SoakCounts> {
    let mut all = SoakCounts::rig();
    for n in 0..n_sessions {
        let reference = Reference::ALL[n as usize % Reference::ALL.len()];
        let seed = seed.wrapping_add((n + 1) << 32);
        let samples = session(model, reference, DISTURBANCES, seed, SESSION_S)?;
        let found = watch::session(setup, &format!("{} {reference}", setup.rig.name), &samples);
        if let (Some(dir), false) = (&args.keep, found.alarms.is_empty()) {
            let dir = dir.join(&setup.rig.name);
            keep(&dir, setup, healthy)?;
            write_session(&dir.join(format!("{reference}.csv")), &samples, false)?;
        }
        all = all.with(found);
    }
    Ok(all.of_one_rig())
}

/// Writes the asset file of a rig and its calibration sessions into `dir`.
fn keep(dir: &Path, setup: &Setup, healthy: &[Vec<Sample>]) -> anyhow::Result<()> {
    std::fs::create_dir_all(dir).map_err(|e| InputError::new(dir.display(), e))?;
    write_asset(&setup.rig, &dir.join("rig.json"))?;
    for (i, samples) in healthy.iter().enumerate() {
        write_session(&dir.join(format!("calibration-{}.csv", i + 1)), samples, false)?;
    }
    Ok(())
}
