//! `offbd score`: judges a labelled corpus and compares the verdicts with its labels.
//!
//! Each rig is calibrated on its `calibration.csv`; its other sessions are judged, and the
//! first *confirmed* fault of each is compared with the label. A detection before the
//! onset is a false alarm. Delays count from the first chance, the time at which the fault
//! became detectable, and also from the onset. A fault that never became detectable and
//! was not detected is excluded from the rates.

mod figures;

use offbd_wire::words::StatusWord;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;

use super::labels::{self, Label};
use figures::{FirstConfirmed, ScoreReport};
use offbd_core::diagnosis::Profile;
use offbd_core::engine::Setup;
use offbd_file_cli::calibrate;
use offbd_file_cli::judge::{self, JudgedSession};
use offbd_file_cli::recordings::Recording;
use offbd_file_cli::replay::{in_threads, progress};
use offbd_terminal::errors::InputError;
use offbd_terminal::output::{self, OutputFormat, value_parser};
use offbd_terminal::table;
use offbd_wire::table::TableOptions;

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
pub struct ScoreArgs {
    /// The corpus' directory
    dir: PathBuf,
    /// A table for people, or one JSON object
    #[arg(long, value_enum, default_value = "table")]
    format: OutputFormat,
    /// Judge by this profile instead of the rigs' own
    #[arg(long, value_parser = value_parser::<Profile>(Profile::ALL.map(Profile::as_str)))]
    profile: Option<Profile>,
    /// Print a line per session to stderr
    #[arg(long)]
    list: bool,
    /// Judge without calibrating the rigs
    #[arg(long)]
    no_calibration: bool,
    /// Number of sessions judged in parallel [default: one per core]
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
        OutputFormat::Json => {
            serde_json::to_writer(&mut out, &figures)?;
            writeln!(out)?;
        }
        OutputFormat::Table => write_table(&mut out, &figures)?,
    }
    Ok(out.flush()?)
}

/// Judges all sessions; returns the first confirmed fault of each.
fn judge_all(
    args: &ScoreArgs,
    labels: &[Label],
) -> Result<Vec<Option<FirstConfirmed>>, InputError> {
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
        .collect::<Result<BTreeMap<&str, Setup>, InputError>>()?;
    let judged = labels
        .par_iter()
        .map(|label| {
            bar.inc(1);
            let path = args.dir.join(&label.file);
            let runs =
                judge::judge_file(&setups[label.rig.as_str()], &path, &TableOptions::default());
            let mut runs = runs?.into_iter();
            match (runs.next(), runs.next()) {
                (Some(judged), None) => Ok(judged),
                _ => Err(InputError::file(&path, "its clock starts again")),
            }
        })
        .collect::<Result<Vec<JudgedSession>, InputError>>()?;
    bar.finish_and_clear();
    check_rows(&args.dir, labels, &judged)?;
    Ok(judged.iter().map(first_confirmed).collect())
}

fn set_up(args: &ScoreArgs, folder: &Path) -> Result<Setup, InputError> {
    let mut rig = judge::load_rig(Some(&folder.join("rig.json")))?;
    if !args.no_calibration {
        let path = folder.join("calibration.csv");
        let (samples, _) = judge::read_samples(&Recording::of(&path), &TableOptions::default())?;
        let data = calibrate::data_hash(std::slice::from_ref(&path))?;
        let learnt = calibrate::learn(&rig, &samples, &data);
        rig.calibration = Some(Box::new(learnt.map_err(|e| InputError::file(&path, e))?));
    }
    judge::set_up(rig, args.profile)
}

/// Checks that the corpus has the number of rows of its labels, within 1 %.
fn check_rows(dir: &Path, labels: &[Label], judged: &[JudgedSession]) -> Result<(), InputError> {
    let rows: u64 = labels.iter().map(|l| l.rows).sum();
    let samples: u64 = judged.iter().map(|j| j.summary.samples).sum();
    if rows.abs_diff(samples) as f64 > 0.01 * rows as f64 {
        let reason = format!("the labels count {rows} rows, the sessions have {samples} samples");
        return Err(InputError::file(dir, reason));
    }
    Ok(())
}

fn first_confirmed(judged: &JudgedSession) -> Option<FirstConfirmed> {
    let confirmed = |f: &&_| {
        let fault: &offbd_wire::verdict::FaultView = f;
        fault.status == StatusWord::Confirmed
    };
    let fault = judged.faults.iter().find(confirmed)?;
    let kind = fault.kind.map(|kind| kind.to_string());
    Some(FirstConfirmed { code: fault.code.to_string(), kind, t_s: fault.t_s })
}

fn list(label: &Label, found: Option<&FirstConfirmed>) {
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

fn write_table(out: &mut impl Write, figures: &ScoreReport) -> anyhow::Result<()> {
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
