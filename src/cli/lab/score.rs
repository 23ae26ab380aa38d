//! `offbd score`: judges a labelled corpus and compares with its labels.
//!
//! Each rig is calibrated on its `calibration.csv`; its other sessions are
//! judged; the first *confirmed* fault of each is compared with the truth.
//! A detection before the onset is a false alarm; delays count from the
//! fault's first chance to be seen, and beside it from the onset. A fault that
//! never had a chance and was not detected is left out of the rates.

mod figures;

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;

use super::labels::{self, Label};
use crate::cli::calibrate;
use crate::cli::judge::{self, Judged};
use crate::cli::output::{self, Format, words};
use crate::cli::replay::{in_threads, progress};
use crate::cli::table;
use crate::cli::unusable::Unusable;
use figures::{Figures, Found};
use offbd_core::diagnosis::Profile;
use offbd_core::engine::Setup;
use offbd_core::vocabulary::FaultStatus;

/// Scores the diagnosis on a labelled corpus: delays, false alarms, isolation.
///
/// The corpus has one folder per rig with rig.json, calibration.csv and
/// sessions, and labels.json beside them.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd simulate --corpus mycorpus\n  \
    offbd score mycorpus\n  \
    offbd score mycorpus --format json --profile textbook | jq .false_alarms\n  \
    offbd score mycorpus --list")]
pub(in crate::cli) struct ScoreArgs {
    /// The corpus' directory
    dir: PathBuf,
    /// A table for people, or one JSON object
    #[arg(long, value_enum, default_value = "table")]
    format: Format,
    /// Judge by this profile instead of the assets'
    #[arg(long, value_parser = words::<Profile>(Profile::ALL.map(Profile::as_str)))]
    profile: Option<Profile>,
    /// A line per session, on stderr
    #[arg(long)]
    list: bool,
    /// Judge without learning the rigs first
    #[arg(long)]
    no_calibration: bool,
    /// Sessions judged at a time [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
}

pub(super) fn run(args: &ScoreArgs) -> anyhow::Result<()> {
    let mut labels = labels::load(&args.dir)?;
    labels.retain(|label| !label.is_calibration());
    let found = in_threads(args.jobs, || judge_all(args, &labels))??;
    if args.list {
        labels.iter().zip(&found).for_each(|(label, found)| list(label, found.as_ref()));
    }
    let figures = figures::figures(labels.iter().zip(found.iter().map(Option::as_ref)));
    let mut out = output::stdout();
    match args.format {
        Format::Json => {
            serde_json::to_writer(&mut out, &figures)?;
            writeln!(out)?;
        }
        Format::Table => write_table(&mut out, &figures)?,
    }
    Ok(out.flush()?)
}

/// The first confirmed fault of each session.
fn judge_all(args: &ScoreArgs, labels: &[Label]) -> Result<Vec<Option<Found>>, Unusable> {
    let mut rigs: Vec<&str> = labels.iter().map(|l| l.rig.as_str()).collect();
    rigs.sort_unstable();
    rigs.dedup();
    let bar = progress(rigs.len() + labels.len());
    let setups = rigs
        .par_iter()
        .map(|rig| {
            bar.inc(1);
            Ok((*rig, set_up(args, &args.dir.join(rig))?))
        })
        .collect::<Result<BTreeMap<&str, Setup>, Unusable>>()?;
    let judged = labels
        .par_iter()
        .map(|label| {
            bar.inc(1);
            judge::judge_file(&setups[label.rig.as_str()], &args.dir.join(&label.file))
        })
        .collect::<Result<Vec<Judged>, Unusable>>()?;
    bar.finish_and_clear();
    check_rows(&args.dir, labels, &judged)?;
    Ok(judged.iter().map(first_confirmed).collect())
}

fn set_up(args: &ScoreArgs, folder: &Path) -> Result<Setup, Unusable> {
    let mut rig = judge::load_rig(Some(&folder.join("rig.json")))?;
    if !args.no_calibration {
        let path = folder.join("calibration.csv");
        let (samples, _) = judge::read_samples(&path)?;
        let data = calibrate::data_hash(std::slice::from_ref(&path))?;
        let learnt = calibrate::learn(&rig, &[samples], &data);
        rig.calibration = Some(learnt.map_err(|e| Unusable::file(&path, e))?);
    }
    judge::set_up(rig, args.profile)
}

/// A corpus whose rows are not those of its labels is not the one labelled.
fn check_rows(dir: &Path, labels: &[Label], judged: &[Judged]) -> Result<(), Unusable> {
    let rows: u64 = labels.iter().map(|l| l.rows).sum();
    let samples: u64 = judged.iter().map(|j| j.summary.samples).sum();
    if rows.abs_diff(samples) as f64 > 0.01 * rows as f64 {
        let reason = format!("the labels count {rows} rows, the sessions have {samples} samples");
        return Err(Unusable::file(dir, reason));
    }
    Ok(())
}

fn first_confirmed(judged: &Judged) -> Option<Found> {
    let confirmed = |f: &&_| {
        let fault: &crate::wire::verdict::FaultView = f;
        fault.status == FaultStatus::Confirmed.as_str()
    };
    let fault = judged.faults.iter().find(confirmed)?;
    Some(Found { code: fault.code.clone(), kind: fault.kind.clone(), t_s: fault.t_s })
}

fn list(label: &Label, found: Option<&Found>) {
    let truth = label
        .fault
        .as_ref()
        .map_or_else(|| "-".to_owned(), |f| format!("{} at {:.2} s", f.kind, f.onset_s));
    let got = found.map_or_else(
        || "none".to_owned(),
        |f| format!("{} ({}) at {:.2} s", f.code, f.kind.as_deref().unwrap_or("-"), f.t_s),
    );
    anstream::eprintln!("{:<22} {:<11} {truth:<24} -> {got}", label.file, label.class);
}

fn write_table(out: &mut impl Write, figures: &Figures) -> anyhow::Result<()> {
    let mut overall = table::table(&["figure", "value"], &[1]);
    for (name, value) in figures.overall() {
        overall.add_row([name.to_owned(), value]);
    }
    let mut kinds =
        table::table(&["kind", "sessions", "detected", "right", "median delay"], &[1, 2, 3, 4]);
    for (name, kind) in &figures.by_kind {
        kinds.add_row([
            name.clone(),
            kind.n.to_string(),
            kind.detected.to_string(),
            kind.right.to_string(),
            kind.delay_median_s.map_or("-".to_owned(), |s| format!("{s:.2} s")),
        ]);
    }
    let mut matrix = table::table(&["truth -> found", "sessions"], &[1]);
    for (pair, n) in &figures.matrix {
        matrix.add_row([pair.clone(), n.to_string()]);
    }
    for (i, part) in [overall, kinds, matrix].iter().enumerate() {
        if i > 0 {
            writeln!(out)?;
        }
        for line in table::lines(part) {
            writeln!(out, "{line}")?;
        }
    }
    Ok(())
}
