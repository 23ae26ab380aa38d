//! `offbd soak`: days of healthy operation of many simulated rigs; whatever is
//! confirmed is a false alarm.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;
use serde::Serialize;

use super::calibrate::write_asset;
use super::output::{self, Format};
use super::replay::{in_threads, progress};
use super::simulate::{record, write_session};
use super::table;
use super::unusable::Unusable;
use crate::diagnosis::FaultMemory;
use crate::engine::{Engine, Input, Output, Setup, calibrate};
use crate::simulation::{Disturbances, Reference, RigModel, SimulatedRig};
use crate::vocabulary::{Axis, FaultStatus, Sample};

/// Runs many healthy simulated rigs for days and counts the false alarms.
///
/// No two rigs are alike: servos, level, surface, sensor and log rate are drawn
/// anew for each. A rig is calibrated on two minutes, then watched for sessions
/// of an hour in which hands push the ball, air moves it and the log has gaps.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd soak                                   # ten days, some minutes\n  \
    offbd soak --rig-days 1 --per-year 8760      # limits for one an hour\n  \
    offbd soak --rig-days 2 --format json | jq .confirmed")]
pub(super) struct SoakArgs {
    /// Days of operation, over all rigs
    #[arg(long, value_name = "DAYS", default_value_t = 10.0, value_parser = days)]
    rig_days: f64,
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
/// Length of a session, s, and of what a rig is calibrated on.
const SESSION_S: f64 = 3600.0;
const CALIBRATION_S: f64 = 120.0;
/// Sessions of one rig.
const SESSIONS_PER_RIG: u64 = 4;
/// Hands and air, per minute.
const HANDS: Disturbances = Disturbances { pushes_per_minute: 2.0, gusts_per_minute: 1.0 };
/// A gap in the log comes every so often and lasts for so long, s.
const GAP_EVERY_S: f64 = 300.0;
const GAP_S: f64 = 3.0;
/// Evidence whose peaks are counted, nats.
const PEAKS: [f64; 8] = [4.0, 6.0, 8.0, 10.0, 12.0, 15.0, 18.0, 22.0];

fn days(word: &str) -> Result<f64, String> {
    let value: Option<f64> = word.parse().ok();
    let in_range = |v: &f64| *v > 0.0 && *v <= MAX_DAYS;
    value.filter(in_range).ok_or_else(|| format!("not above 0 and at most {MAX_DAYS} days"))
}

/// What one session, or all of them, came to.
#[derive(Clone, Debug, Default, Serialize)]
struct Soaked {
    rig_days: f64,
    samples: u64,
    /// Rigs whose calibration was refused; they are not watched.
    refused: u64,
    /// Confirmed faults by code and kind: false alarms.
    confirmed: BTreeMap<String, u64>,
    /// Faults that were pending and were not confirmed.
    pending: BTreeMap<String, u64>,
    /// Peaks of the evidence against a servo beyond each of some levels, nats.
    peaks: Vec<(f64, u64)>,
    /// Where each false alarm was.
    alarms: Vec<String>,
}

impl Soaked {
    fn with(mut self, other: Self) -> Self {
        self.rig_days += other.rig_days;
        self.samples += other.samples;
        self.refused += other.refused;
        for (into, from) in
            [(&mut self.confirmed, other.confirmed), (&mut self.pending, other.pending)]
        {
            for (code, n) in from {
                *into.entry(code).or_default() += n;
            }
        }
        if self.peaks.is_empty() {
            self.peaks = PEAKS.map(|level| (level, 0)).to_vec();
        }
        for (all, one) in self.peaks.iter_mut().zip(other.peaks) {
            all.1 += one.1;
        }
        self.alarms.extend(other.alarms);
        self
    }

    fn alarms_per_year(&self) -> f64 {
        self.alarms.len() as f64 / self.rig_days * 365.25
    }
}

pub(super) fn run(args: &SoakArgs) -> anyhow::Result<()> {
    let n_sessions = (args.rig_days * 86_400.0 / SESSION_S).ceil() as u64;
    let n_rigs = n_sessions.div_ceil(SESSIONS_PER_RIG);
    let bar = progress(n_sessions as usize);
    let soak = |n_rig: u64| {
        let n = SESSIONS_PER_RIG.min(n_sessions - n_rig * SESSIONS_PER_RIG);
        let soaked = soak_rig(args, args.seed.wrapping_mul(1_000_003).wrapping_add(n_rig), n);
        bar.inc(n);
        soaked
    };
    let each: Vec<Soaked> = in_threads(args.jobs, || {
        (0..n_rigs).into_par_iter().map(soak).collect::<anyhow::Result<Vec<_>>>()
    })??;
    bar.finish_and_clear();
    // In the order of the rigs, whatever the threads did.
    let soaked = each.into_iter().fold(Soaked::default(), Soaked::with);
    soaked.alarms.iter().for_each(|alarm| anstream::eprintln!("{alarm}"));
    let mut out = output::stdout();
    match args.format {
        Format::Json => {
            serde_json::to_writer(&mut out, &soaked)?;
            writeln!(out)?;
        }
        Format::Table => write_table(&mut out, &soaked)?,
    }
    Ok(out.flush()?)
}

fn soak_rig(args: &SoakArgs, seed: u64, n_sessions: u64) -> anyhow::Result<Soaked> {
    let cannot = |e: crate::vocabulary::Invalid| Unusable::new("cannot soak", e);
    let model = RigModel::varied(seed).map_err(cannot)?;
    let session = |reference, hands, seed, seconds| -> Result<Vec<Sample>, Unusable> {
        let mut rig = SimulatedRig::new(model.clone(), reference, hands, seed).map_err(cannot)?;
        Ok(record(&mut rig, seconds))
    };
    let healthy = session(Reference::Lissajous, Disturbances::default(), seed, CALIBRATION_S)?;
    let mut rig = model.rig.clone();
    let Ok(calibration) = calibrate(&rig, std::slice::from_ref(&healthy), "", "") else {
        return Ok(Soaked { refused: 1, ..Soaked::default() });
    };
    rig.calibration = Some(calibration);
    rig.diagnostics.false_alarms_per_rig_year = args.per_year;
    let setup = Setup::new(rig, None).map_err(cannot)?;
    let mut soaked = Soaked::default();
    for n in 0..n_sessions {
        let reference = Reference::ALL[(n % Reference::ALL.len() as u64) as usize];
        let samples = session(reference, HANDS, seed.wrapping_add((n + 1) << 32), SESSION_S)?;
        let name = format!("{} {reference}", setup.rig.name);
        let found = watch(&setup, &name, &samples);
        if let (Some(dir), false) = (&args.keep, found.alarms.is_empty()) {
            let dir = dir.join(&setup.rig.name);
            keep(&dir, &setup, &healthy)?;
            write_session(&dir.join(format!("{reference}.csv")), &samples, false)?;
        }
        soaked = soaked.with(found);
    }
    Ok(soaked)
}

/// Keeps a rig and what it was calibrated on.
fn keep(dir: &Path, setup: &Setup, healthy: &[Sample]) -> anyhow::Result<()> {
    std::fs::create_dir_all(dir).map_err(|e| Unusable::new(dir.display(), e))?;
    write_asset(&setup.rig, &dir.join("rig.json"))?;
    write_session(&dir.join("calibration.csv"), healthy, false)
}

/// Judges one healthy session with its gaps.
fn watch(setup: &Setup, name: &str, samples: &[Sample]) -> Soaked {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let mut soaked = Soaked { rig_days: SESSION_S / 86_400.0, ..Soaked::default() };
    let (mut outputs, mut peaks) = (Vec::new(), [0.0_f64; 2]);
    let mut seen: BTreeMap<&str, FaultStatus> = BTreeMap::new();
    let (mut found, mut on_record) = (Vec::new(), BTreeSet::new());
    for sample in samples.iter().filter(|s| s.t_s % GAP_EVERY_S > GAP_S) {
        engine.handle(Input::Sample(*sample), &mut outputs);
        soaked.samples += 1;
        for output in outputs.drain(..) {
            let Output::Transition(change) = output else { continue };
            if !change.byte.test_failed() {
                on_record.remove(change.code.as_str());
                continue;
            }
            let worst = seen.entry(change.code.as_str()).or_insert(change.status);
            if *worst != FaultStatus::Confirmed {
                *worst = change.status;
            }
            // Told again, with its kind, it is the same.
            let confirmed = change.status == FaultStatus::Confirmed;
            if confirmed && on_record.insert(change.code.as_str()) {
                found.push(format!("{name}: {}", crate::wire::verdict::sentence(&change)));
            }
        }
        let axes = &engine.evidence().axes;
        for axis in Axis::ALL {
            let own = (axes[axis].nats - axes[axis.other()].nats).max(0.0);
            let peak = &mut peaks[axis as usize];
            if own < 1.0 && *peak > 0.0 {
                count(&mut soaked.peaks, *peak);
                *peak = 0.0;
            }
            *peak = peak.max(own);
        }
    }
    for (code, status) in seen {
        let list = match status {
            FaultStatus::Confirmed => &mut soaked.confirmed,
            _ => &mut soaked.pending,
        };
        list.insert(code.to_owned(), 1);
    }
    soaked.alarms = found;
    soaked
}

fn count(peaks: &mut Vec<(f64, u64)>, peak: f64) {
    if peaks.is_empty() {
        *peaks = PEAKS.map(|level| (level, 0)).to_vec();
    }
    peaks.iter_mut().filter(|(level, _)| peak >= *level).for_each(|(_, n)| *n += 1);
}

fn write_table(out: &mut impl Write, soaked: &Soaked) -> anyhow::Result<()> {
    let days = soaked.rig_days;
    let listed = |codes: &BTreeMap<String, u64>| {
        let words: Vec<String> = codes.iter().map(|(code, n)| format!("{code} {n}")).collect();
        if words.is_empty() { "none".to_owned() } else { words.join(", ") }
    };
    let rate = match soaked.alarms.len() {
        // The rule of three: with 95 % confidence the rate is below 3/T.
        0 => format!("below {:.0}", 3.0 / days * 365.25),
        _ => format!("{:.0}", soaked.alarms_per_year()),
    };
    let mut figures = table::table(&["figure", "value"], &[1]);
    figures.add_row(["healthy operation".to_owned(), format!("{days:.2} rig-days")]);
    figures.add_row(["samples".to_owned(), soaked.samples.to_string()]);
    figures.add_row(["calibrations refused".to_owned(), soaked.refused.to_string()]);
    figures.add_row(["false alarms".to_owned(), soaked.alarms.len().to_string()]);
    figures.add_row(["sessions with one".to_owned(), listed(&soaked.confirmed)]);
    figures.add_row(["false alarms per rig-year".to_owned(), rate]);
    figures.add_row(["sessions with pending only".to_owned(), listed(&soaked.pending)]);
    let mut peaks = table::table(&["evidence against a servo beyond", "per rig-day"], &[1]);
    for (level, n) in &soaked.peaks {
        peaks.add_row([format!("{level:.0} nats"), format!("{:.2}", *n as f64 / days)]);
    }
    for (i, part) in [figures, peaks].iter().enumerate() {
        if i > 0 {
            writeln!(out)?;
        }
        for line in table::lines(part) {
            writeln!(out, "{line}")?;
        }
    }
    Ok(())
}
