//! `offbd replay`: judges recorded sessions.

mod against;
mod verdict;

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::judge::{self, JudgedSession, TableArgs};
use crate::recordings::{JoinArgs, Recording};
use offbd_core::diagnosis::Profile;
use offbd_core::engine::Setup;
use offbd_terminal::errors::{FaultFound, InputError};
use offbd_terminal::output::{self, OutputFormat, value_parser};
use offbd_terminal::table;

/// Judges recorded sessions: which faults occurred, when, and on what evidence.
///
/// The same recording gives the same lines and the same verdict hash, whatever
/// the number of threads or the load of the machine.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "A session is CSV with the header t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m: seconds, \
    radians, metres. An empty position means that no ball was seen. For other names \
    and units give --columns; `offbd inspect FILE` proposes it. In a build with the \
    feature `parquet`, Parquet and Arrow files with these columns are read too; with `mcap`, \
    MCAP files with messages of these keys; with `xlsx`, Excel workbooks. JSON lists \
    are read as texts are.\n\n\
    Examples:\n  \
    offbd replay --asset calibrated.json monday.csv tuesday.csv\n  \
    offbd replay --asset calibrated.json --join data-*.csv\n  \
    offbd replay --format json sick.csv | jq 'select(.status == \"confirmed\")'\n  \
    offbd replay --profile textbook sick.csv\n  \
    offbd replay --asset calibrated.json --against recalibrated.json monday.csv\n\n\
    Invalid rows are reported on stderr with their line number, and counted.\n\n\
    Exit status: 0 all files judged (faults or not), 3 a file is unusable; the\n\
    others are judged; 4 a fault was confirmed, with --fail-on-fault."
)]
pub struct ReplayArgs {
    /// The rig's asset file, preferably calibrated [default: the default rig (plate
    /// 0.38 × 0.24 m, steel ball)]
    #[arg(long, value_name = "ASSET.json")]
    asset: Option<PathBuf>,
    /// Recorded sessions; of a folder all files
    #[arg(required = true, value_name = "SESSION.csv")]
    sessions: Vec<PathBuf>,
    #[command(flatten)]
    join: JoinArgs,
    /// A table for people, or one JSON object per line
    #[arg(long, value_enum, default_value = "table")]
    format: OutputFormat,
    /// Judge by this profile instead of the asset's
    #[arg(long, value_parser = value_parser::<Profile>(Profile::ALL.map(Profile::as_str)))]
    profile: Option<Profile>,
    /// Judge with this asset file too, and show where the two verdicts differ
    #[arg(long, value_name = "ASSET.json")]
    against: Option<PathBuf>,
    /// Judge by this profile too (with the asset file of `--against` or else
    /// `--asset`), and show where the two verdicts differ
    #[arg(long, value_name = "PROFILE", value_parser = value_parser::<Profile>(Profile::ALL.map(Profile::as_str)))]
    against_profile: Option<Profile>,
    /// End with exit status 4 if a fault was confirmed in any session
    #[arg(long)]
    fail_on_fault: bool,
    /// Files judged at a time [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    #[command(flatten)]
    table: TableArgs,
}

pub fn run(args: &ReplayArgs) -> anyhow::Result<()> {
    let setup = judge::set_up(judge::load_rig(args.asset.as_deref())?, args.profile)?;
    let against = against_setup(args)?;
    let recordings = args.join.recordings(&args.sessions)?;
    let bar = progress(recordings.len());
    let options = args.table.options();
    let judge_all = || -> Vec<Result<Vec<ComparedSession>, InputError>> {
        let judge = |recording: &Recording| {
            let judged = judge::judge_recording(&setup, recording, &options)?;
            let against = against.as_ref();
            let against = against.map(|s| judge::judge_recording(s, recording, &options));
            let mut against = against.transpose()?.into_iter().flatten();
            bar.inc(1);
            let compared = |judged| ComparedSession { judged, against: against.next() };
            Ok(judged.into_iter().map(compared).collect())
        };
        recordings.par_iter().map(judge).collect()
    };
    let results = in_threads(args.jobs, judge_all)?;
    bar.finish_and_clear();
    for (recording, result) in recordings.iter().zip(&results) {
        report_rows(&recording.words(), result.as_deref().unwrap_or_default());
    }
    let verdicts: Vec<&ComparedSession> = results.iter().flatten().flatten().collect();
    match args.format {
        OutputFormat::Json => write_json(&verdicts)?,
        OutputFormat::Table => write_table(&verdicts, setup.settings.profile)?,
    }
    let (n, n_faulty) = (verdicts.len(), verdicts.iter().filter(|v| v.has_fault()).count());
    outcome(results)?;
    if args.fail_on_fault && n_faulty > 0 {
        return Err(FaultFound { n_faulty, n }.into());
    }
    Ok(())
}

/// A judged session and, for a comparison, the same session judged with other settings.
struct ComparedSession {
    judged: JudgedSession,
    against: Option<JudgedSession>,
}

impl ComparedSession {
    /// Whether a fault was confirmed.
    fn has_fault(&self) -> bool {
        !self.judged.summary.faults.is_empty()
    }
}

/// The settings of the second judgement for a comparison; `None` without one.
fn against_setup(args: &ReplayArgs) -> Result<Option<Setup>, InputError> {
    if args.against.is_none() && args.against_profile.is_none() {
        return Ok(None);
    }
    let asset = args.against.as_ref().or(args.asset.as_ref());
    let rig = judge::load_rig(asset.map(PathBuf::as_path))?;
    judge::set_up(rig, args.against_profile).map(Some)
}

/// A progress bar on stderr for `n` items, hidden if `n` is less than 2 or stderr is not a
/// terminal.
pub fn progress(n: usize) -> ProgressBar {
    if n < 2 || output::is_quiet() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:40} {pos} of {len}, {eta} left");
    ProgressBar::new(n as u64).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// Runs `work` on `jobs` threads; by default one per core.
pub fn in_threads<T: Send>(
    jobs: Option<u16>,
    work: impl FnOnce() -> T + Send,
) -> anyhow::Result<T> {
    let n = jobs.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build()?;
    Ok(pool.install(work))
}

/// Reports rejected rows and rows that were not judged, on stderr.
fn report_rows(name: &str, sessions: &[ComparedSession]) {
    if sessions.len() > 1 {
        output::remark(format_args!(
            "{name}: the clock starts again; its {} runs are judged as sessions",
            sessions.len()
        ));
    }
    for ComparedSession { judged, .. } in sessions {
        report_rows_of_run(name, judged);
    }
}

fn report_rows_of_run(name: &str, judged: &JudgedSession) {
    for row in &judged.bad_rows {
        output::remark(format_args!("{name}: {row}; row rejected"));
    }
    let n_more = judged.summary.rejected - judged.bad_rows.len() as u64;
    if n_more > 0 {
        output::remark(format_args!("{name}: {n_more} more rows rejected"));
    }
    if judged.n_set_aside > 0 {
        output::remark(format_args!(
            "{name}: {} rows kept but not judged: too late, or too far ahead in time",
            judged.n_set_aside
        ));
    }
}

fn write_json(verdicts: &[&ComparedSession]) -> anyhow::Result<()> {
    let mut out = output::stdout();
    for ComparedSession { judged: session, against } in verdicts {
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

fn write_table(verdicts: &[&ComparedSession], profile: Profile) -> anyhow::Result<()> {
    let mut out = output::stdout();
    if verdicts.is_empty() {
        return Ok(());
    }
    let heading = ["session", "samples", "rejected", "seconds", "verdict"];
    let mut summaries = table::table_of_files(&heading, &[1, 2, 3]);
    for ComparedSession { judged: session, .. } in verdicts {
        let s = &session.summary;
        summaries.add_row([
            s.session.clone(),
            s.samples.to_string(),
            s.rejected.to_string(),
            format!("{:.1}", s.duration_s),
            verdict::coloured(session, profile),
        ]);
    }
    for line in table::lines(&summaries) {
        writeln!(out, "{line}")?;
    }
    writeln!(out)?;
    for line in table::lines(&verdict::judged(verdicts.iter().map(|v| &v.judged))) {
        writeln!(out, "{line}")?;
    }
    for ComparedSession { judged, .. } in verdicts {
        write_warnings(&mut out, judged, verdicts.len() > 1)?;
    }
    for ComparedSession { judged, .. } in verdicts {
        write_sentences(&mut out, judged, verdicts.len() > 1)?;
    }
    for ComparedSession { judged, against } in verdicts {
        if let Some(against) = against {
            against::write_table(&mut out, judged, against)?;
        }
    }
    Ok(out.flush()?)
}

/// Writes a sentence for each contradiction between the data and the asset file.
fn write_warnings(
    out: &mut impl Write,
    session: &JudgedSession,
    several: bool,
) -> anyhow::Result<()> {
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

/// Writes a sentence for each change of a fault's status, below the session's name if
/// there are several sessions.
fn write_sentences(
    out: &mut impl Write,
    session: &JudgedSession,
    several: bool,
) -> anyhow::Result<()> {
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

/// Returns an error if a file could not be judged, and prints all errors but the last.
fn outcome<T>(results: Vec<Result<T, InputError>>) -> anyhow::Result<()> {
    let mut unusable: Vec<InputError> = results.into_iter().filter_map(Result::err).collect();
    let Some(last) = unusable.pop() else { return Ok(()) };
    for error in unusable {
        anstream::eprintln!("offbd: {error}");
    }
    Err(last.into())
}
