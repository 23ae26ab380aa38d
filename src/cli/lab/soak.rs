//! `offbd soak`: days of healthy operation of many simulated rigs; whatever is
//! confirmed is a false alarm.

mod figures;
mod found;
mod watch;

use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;

use super::simulate::{record, write_session};
use crate::cli::calibrate::write_asset;
use crate::cli::output::{Format, words};
use crate::cli::replay::{in_threads, progress};
use crate::cli::unusable::Unusable;
use found::Found;
use offbd_core::engine::{CannotCalibrate, Setup, calibrate};
use offbd_core::vocabulary::{Invalid, Sample};
use offbd_lab::simulation::{Disturbances, Reference, RigModel, SimulatedRig, Variety};

/// Runs many healthy simulated rigs for days and counts the false alarms.
///
/// No two rigs are alike. `real` draws what is seen on real rigs: slow and noisy
/// sensors that repeat and hold their readings, servos in whole degrees, balls on
/// beams, origins off centre, stiction up to 2°, levels and gains that differ
/// between sessions; `presets` draws the presets' numbers anew, the same in every
/// session. A rig is calibrated on sessions of two minutes, then watched for
/// sessions of an hour in which hands push the ball, air moves it and the log has
/// gaps. A rig whose calibration is refused is named and not watched.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd soak                                   # ten days, some minutes\n  \
    offbd soak --rig-days 1 --per-year 8760      # limits for one an hour\n  \
    offbd soak --calibration-sessions 1 --rig-days 1\n  \
    offbd soak --rig-days 2 --format json | jq .alarms_per_rig_day")]
pub(in crate::cli) struct SoakArgs {
    /// Days of operation, over all rigs
    #[arg(long, value_name = "DAYS", default_value_t = 10.0, value_parser = days)]
    rig_days: f64,
    /// What the rigs are drawn from
    #[arg(long, default_value = "real",
          value_parser = words::<Variety>(Variety::ALL.map(Variety::as_str)))]
    variety: Variety,
    /// Healthy sessions that each rig is learnt from
    #[arg(long, value_name = "N", default_value_t = 3,
          value_parser = clap::value_parser!(u64).range(1..=MAX_CALIBRATION_SESSIONS))]
    calibration_sessions: u64,
    /// False alarms that are wanted per rig and year [default: the diagnosis' own]
    #[arg(long, value_name = "N")]
    per_year: Option<f64>,
    /// Seed of all that is random
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// A table for people, or one JSON object
    #[arg(long, value_enum, default_value = "table")]
    format: Format,
    /// Keep the recordings in which there was a false alarm, and what their
    /// rigs were calibrated on, in this directory
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Sessions at a time [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
}

/// Most days that are simulated at once: some hours of computing.
const MAX_DAYS: f64 = 1000.0;
/// Most sessions that a rig is learnt from: an hour of recordings.
const MAX_CALIBRATION_SESSIONS: u64 = 30;
/// Length of a session, s, and of one that a rig is calibrated on.
const SESSION_S: f64 = 3600.0;
const CALIBRATION_S: f64 = 120.0;
/// What the ball is asked to do while a rig is learnt, session after session.
const CALIBRATION: [Reference; 3] = [Reference::Lissajous, Reference::Circle, Reference::Steps];
/// Sessions of one rig.
const SESSIONS_PER_RIG: u64 = 4;
/// Hands and air, per minute.
const HANDS: Disturbances = Disturbances { pushes_per_minute: 2.0, gusts_per_minute: 1.0 };

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
    let each: Vec<Found> = in_threads(args.jobs, || {
        (0..n_rigs).into_par_iter().map(soak).collect::<anyhow::Result<Vec<_>>>()
    })??;
    bar.finish_and_clear();
    // In the order of the rigs, whatever the threads did.
    let found = each.into_iter().fold(Found::default(), Found::with);
    found.refusals.iter().for_each(|refusal| anstream::eprintln!("not watched: {refusal}"));
    found.alarms.iter().for_each(|alarm| anstream::eprintln!("{alarm}"));
    figures::write(args.format, &found)
}

/// Learns the rig of `seed` and watches it.
fn soak_rig(args: &SoakArgs, seed: u64, n_sessions: u64) -> anyhow::Result<Found> {
    let model = args.variety.rig(seed).map_err(cannot)?;
    let healthy = calibration(&model, seed, args.calibration_sessions)?;
    match learnt(args, &model, &healthy)? {
        Err(refusal) => Ok(Found::refused(&model.rig.name, &refusal)),
        Ok(setup) => watched(args, &model, &setup, &healthy, seed, n_sessions),
    }
}

fn cannot(error: Invalid) -> Unusable {
    Unusable::new("cannot soak", error)
}

/// A healthy session of the rig, with that session's level and gain.
fn session(
    model: &RigModel,
    reference: Reference,
    hands: Disturbances,
    seed: u64,
    seconds: f64,
) -> Result<Vec<Sample>, Unusable> {
    let mut rig =
        SimulatedRig::new(model.of_session(seed), reference, hands, seed).map_err(cannot)?;
    Ok(record(&mut rig, seconds))
}

/// The sessions that a rig is learnt from, without hands. Their seeds count down
/// in the upper half, where those that are watched count up.
fn calibration(model: &RigModel, seed: u64, n: u64) -> Result<Vec<Vec<Sample>>, Unusable> {
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

fn learnt(
    args: &SoakArgs,
    model: &RigModel,
    healthy: &[Vec<Sample>],
) -> Result<Result<Setup, CannotCalibrate>, Unusable> {
    let mut rig = model.rig.clone();
    rig.calibration = match calibrate(&rig, healthy, "", "") {
        Ok(calibration) => Some(calibration),
        Err(refusal) => return Ok(Err(refusal)),
    };
    rig.diagnostics.false_alarms_per_rig_year = args.per_year;
    Setup::new(rig, None).map(Ok).map_err(cannot)
}

fn watched(
    args: &SoakArgs,
    model: &RigModel,
    setup: &Setup,
    healthy: &[Vec<Sample>],
    seed: u64,
    n_sessions: u64,
) -> anyhow::Result<Found> {
    let mut all = Found::rig();
    for n in 0..n_sessions {
        let reference = Reference::ALL[n as usize % Reference::ALL.len()];
        let seed = seed.wrapping_add((n + 1) << 32);
        let samples = session(model, reference, HANDS, seed, SESSION_S)?;
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

/// Keeps a rig and what it was calibrated on.
fn keep(dir: &Path, setup: &Setup, healthy: &[Vec<Sample>]) -> anyhow::Result<()> {
    std::fs::create_dir_all(dir).map_err(|e| Unusable::new(dir.display(), e))?;
    write_asset(&setup.rig, &dir.join("rig.json"))?;
    for (i, samples) in healthy.iter().enumerate() {
        write_session(&dir.join(format!("calibration-{}.csv", i + 1)), samples, false)?;
    }
    Ok(())
}
