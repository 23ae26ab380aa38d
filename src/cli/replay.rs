//! `offbd replay`: judges recordings.

mod against;
mod verdict;

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use super::judge::{self, Judged};
use super::output::{self, Format, words};
use super::table;
use super::unusable::Unusable;
use offbd_core::diagnosis::Profile;
use offbd_core::engine::Setup;

/// Judges recorded sessions: which faults, when, on what evidence.
///
/// The same recording gives the same lines and the same verdict hash, whatever
/// the number of threads or the load of the machine.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "A session is CSV with the header t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m: seconds, \
    radians, metres. An empty position means that no ball was seen.\n\n\
    Examples:\n  \
    offbd replay --asset learnt.json monday.csv tuesday.csv\n  \
    offbd replay --format json sick.csv | jq 'select(.status == \"confirmed\")'\n  \
    offbd replay --profile textbook sick.csv\n  \
    offbd replay --asset learnt.json --against relearnt.json monday.csv\n\n\
    A bad row is rejected by line number on stderr and counted. Exit status: 0 all\n\
    judged (faults or not), 3 a file could not be used; the others are judged."
)]
pub(super) struct ReplayArgs {
    /// The rig's asset file, better a calibrated one [default: the chapter's rig]
    #[arg(long, value_name = "ASSET.json")]
    asset: Option<PathBuf>,
    /// Recorded sessions
    #[arg(required = true, value_name = "SESSION.csv")]
    sessions: Vec<PathBuf>,
    /// A table for people, or one JSON object per line
    #[arg(long, value_enum, default_value = "table")]
    format: Format,
    /// Judge by this profile instead of the asset's
    #[arg(long, value_parser = words::<Profile>(Profile::ALL.map(Profile::as_str)))]
    profile: Option<Profile>,
    /// Judge by this asset file too, and show where the two verdicts differ
    #[arg(long, value_name = "ASSET.json")]
    against: Option<PathBuf>,
    /// Judge by this profile too (of `--against`, or else of the same asset
    /// file), and show where the two verdicts differ
    #[arg(long, value_name = "PROFILE", value_parser = words::<Profile>(Profile::ALL.map(Profile::as_str)))]
    against_profile: Option<Profile>,
    /// Files judged at a time [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
}

pub(super) fn run(args: &ReplayArgs) -> anyhow::Result<()> {
    let setup = judge::set_up(judge::load_rig(args.asset.as_deref())?, args.profile)?;
    let against = against_setup(args)?;
    let bar = progress(args.sessions.len());
    let judge_all = || -> Vec<Result<Verdicts, Unusable>> {
        let judge = |path: &PathBuf| {
            let judged = judge::judge_file(&setup, path)?;
            let against = against.as_ref().map(|s| judge::judge_file(s, path)).transpose()?;
            bar.inc(1);
            Ok(Verdicts { judged, against })
        };
        args.sessions.par_iter().map(judge).collect()
    };
    let results = in_threads(args.jobs, judge_all)?;
    bar.finish_and_clear();
    for (path, result) in args.sessions.iter().zip(&results) {
        report_rows(path, result);
    }
    let verdicts: Vec<&Verdicts> = results.iter().flatten().collect();
    match args.format {
        Format::Json => write_json(&verdicts)?,
        Format::Table => write_table(&verdicts)?,
    }
    outcome(results)
}

/// A session's verdict, and the other one where that is wanted.
struct Verdicts {
    judged: Judged,
    against: Option<Judged>,
}

/// What the other verdict is reached by, if one is wanted.
fn against_setup(args: &ReplayArgs) -> Result<Option<Setup>, Unusable> {
    if args.against.is_none() && args.against_profile.is_none() {
        return Ok(None);
    }
    let asset = args.against.as_ref().or(args.asset.as_ref());
    let rig = judge::load_rig(asset.map(PathBuf::as_path))?;
    judge::set_up(rig, args.against_profile).map(Some)
}

/// A progress bar on stderr, hidden where that is no terminal or there is one
/// piece of work only.
pub(super) fn progress(n: usize) -> ProgressBar {
    if n < 2 {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:40} {pos} of {len}, {eta} left");
    ProgressBar::new(n as u64).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// Runs `work` on `jobs` threads, or on as many as there are cores.
pub(super) fn in_threads<T: Send>(
    jobs: Option<u16>,
    work: impl FnOnce() -> T + Send,
) -> anyhow::Result<T> {
    let n = jobs.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build()?;
    Ok(pool.install(work))
}

/// Says on stderr what was not taken.
fn report_rows(path: &Path, result: &Result<Verdicts, Unusable>) {
    let name = path.display();
    let Ok(Verdicts { judged, .. }) = result else { return };
    for row in &judged.bad_rows {
        anstream::eprintln!("{name}: {row}; row rejected");
    }
    let n_more = judged.summary.rejected - judged.bad_rows.len() as u64;
    if n_more > 0 {
        anstream::eprintln!("{name}: {n_more} more rows rejected");
    }
    if judged.n_set_aside > 0 {
        anstream::eprintln!(
            "{name}: {} rows kept but not judged: too late, or too far ahead in time",
            judged.n_set_aside
        );
    }
}

fn write_json(verdicts: &[&Verdicts]) -> anyhow::Result<()> {
    let mut out = output::stdout();
    for Verdicts { judged: session, against } in verdicts {
        for fault in &session.faults {
            serde_json::to_writer(&mut out, fault)?;
            writeln!(out)?;
        }
        serde_json::to_writer(&mut out, &session.summary)?;
        writeln!(out)?;
        if let Some(against) = against {
            against::write_json(&mut out, session, against)?;
        }
    }
    Ok(out.flush()?)
}

fn write_table(verdicts: &[&Verdicts]) -> anyhow::Result<()> {
    let mut out = output::stdout();
    if verdicts.is_empty() {
        return Ok(());
    }
    let heading = ["session", "samples", "rejected", "seconds", "verdict"];
    let mut summaries = table::of_names(&heading, &[1, 2, 3]);
    for Verdicts { judged: session, .. } in verdicts {
        let s = &session.summary;
        summaries.add_row([
            s.session.clone(),
            s.samples.to_string(),
            s.rejected.to_string(),
            format!("{:.1}", s.duration_s),
            verdict::words(session),
        ]);
    }
    for line in table::lines(&summaries) {
        writeln!(out, "{line}")?;
    }
    writeln!(out)?;
    for line in table::lines(&verdict::judged(verdicts.iter().map(|v| &v.judged))) {
        writeln!(out, "{line}")?;
    }
    for Verdicts { judged, .. } in verdicts {
        write_warnings(&mut out, judged, verdicts.len() > 1)?;
    }
    for Verdicts { judged, .. } in verdicts {
        write_sentences(&mut out, judged, verdicts.len() > 1)?;
    }
    for Verdicts { judged, against } in verdicts {
        if let Some(against) = against {
            against::write_table(&mut out, judged, against)?;
        }
    }
    Ok(out.flush()?)
}

/// A sentence for everything that does not fit.
fn write_warnings(out: &mut impl Write, session: &Judged, several: bool) -> anyhow::Result<()> {
    if session.misfits.is_empty() {
        return Ok(());
    }
    let name = if several { session.summary.session.as_str() } else { "the data" };
    writeln!(out, "\n{name} and the asset file do not fit:")?;
    for misfit in &session.misfits {
        writeln!(out, "{}", table::wrapped("  ", &misfit.to_string()))?;
    }
    Ok(())
}

/// A sentence for every change of a fault's status, under the session's name
/// where there are several.
fn write_sentences(out: &mut impl Write, session: &Judged, several: bool) -> anyhow::Result<()> {
    if session.faults.is_empty() {
        return Ok(());
    }
    let name = if several { session.summary.session.as_str() } else { "" };
    writeln!(out, "\n{name}{}", if several { ":" } else { "what was seen:" })?;
    for fault in &session.faults {
        let at = format!("  {:>8.2} s  ", fault.t_s);
        writeln!(out, "{}", table::wrapped(&at, &fault.summary))?;
    }
    Ok(())
}

/// All were judged, or else the files that were not.
fn outcome<T>(results: Vec<Result<T, Unusable>>) -> anyhow::Result<()> {
    let mut unusable: Vec<Unusable> = results.into_iter().filter_map(Result::err).collect();
    let Some(last) = unusable.pop() else { return Ok(()) };
    for error in unusable {
        anstream::eprintln!("offbd: {error}");
    }
    Err(last.into())
}
