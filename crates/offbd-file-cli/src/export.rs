//! `offbd export`: a recorded session in another format, or the twin of a rig.

mod fmu;
mod trace;

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use crate::judge::{self, TableArgs};
use crate::recordings;
use offbd_core::engine::Setup;
use offbd_core::vocabulary::Sample;
use offbd_terminal::errors::{BadArgument, InputError};
use offbd_terminal::output::{self, NewFile};
use offbd_wire::asset;
use offbd_wire::judging::MAX_NAMED_ROWS;
use offbd_wire::session_file::{SessionFormat, SessionInfo, SessionRowError, SessionWriter};
use offbd_wire::table::TableOptions;

/// Samples that are written at a time.
const BATCH: usize = 8192;

/// Writes a recorded session in another format.
///
/// Reads CSV, and in builds with these formats Parquet, Arrow, MCAP and Excel. What
/// a file is, its first bytes say. Of a session in the service, GET
/// /api/v1/sessions/ID/telemetry is the same in each format.
///
/// `offbd export fmu` writes the digital twin of a rig instead.
#[derive(Clone, Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = "Examples:\n  \
    offbd export monday.csv -o monday.parquet\n  \
    offbd export monday.csv --asset calibrated.json -o monday.mcap\n  \
    offbd export monday.parquet --format arrow -o - | other-program\n  \
    offbd export monday.csv --asset calibrated.json --trace monday-trace.parquet\n  \
    offbd export fmu --asset calibrated.json -o ball_on_plate.fmu\n\n\
    With an asset file the session is judged: asset file, calibration and verdict\n\
    hash are in the metadata of the new file (Parquet, Arrow, MCAP). An MCAP file\n\
    then also shows the rig, the twin and the faults in Foxglove.\n\n\
    Invalid rows are reported on stderr, and left out. Exit status: 0 written, 3 the\n\
    session is unusable; then there is no new file.")]
pub struct ExportArgs {
    #[command(subcommand)]
    other: Option<OtherExport>,
    #[command(flatten)]
    session: Option<SessionExport>,
    #[command(flatten)]
    table: TableArgs,
}

/// What is exported besides sessions.
#[derive(Clone, Debug, Subcommand)]
enum OtherExport {
    Fmu(fmu::FmuArgs),
}

#[derive(Clone, Debug, Args)]
struct SessionExport {
    /// The recorded session
    #[arg(value_name = "SESSION.csv")]
    session: PathBuf,
    /// The file to write, replaced once it is complete; - is stdout
    #[arg(short, long, value_name = "FILE", required_unless_present = "trace")]
    output: Option<PathBuf>,
    /// The format [default: by the suffix of FILE]
    #[arg(long, value_parser = parse_format, value_name = "FORMAT")]
    format: Option<SessionFormat>,
    /// The rig's asset file, with which the session is judged
    #[arg(long, value_name = "ASSET.json")]
    asset: Option<PathBuf>,
    /// Also write what the session is judged by, .parquet or .arrow: one row for each judged
    /// moment, as the service's GET /api/v1/sessions/ID/trace
    #[arg(long, value_name = "FILE", requires = "asset")]
    trace: Option<PathBuf>,
}

/// The formats that are written.
const FORMATS: [SessionFormat; 5] = SessionFormat::WRITTEN;

fn parse_format(word: &str) -> Result<SessionFormat, String> {
    let found = FORMATS.into_iter().find(|format| format.suffix() == word);
    found.ok_or_else(|| format!("expected {}", FORMATS.map(SessionFormat::suffix).join(", ")))
}

pub fn run(args: &ExportArgs) -> anyhow::Result<()> {
    match (&args.other, &args.session) {
        (Some(OtherExport::Fmu(args)), _) => fmu::run(args),
        (None, Some(session)) => export_session(session, &args.table.options()),
        (None, None) => Err(BadArgument("name a session".to_owned()).into()),
    }
}

fn export_session(args: &SessionExport, table: &TableOptions) -> anyhow::Result<()> {
    let output = args.output.as_deref();
    let format = output.map(|output| format(args, output)).transpose()?;
    args.trace.as_deref().map(trace::format).transpose()?;
    if !args.session.is_file() {
        let reason = "is not a regular file, which can be read twice";
        return Err(InputError::file(&args.session, reason).into());
    }
    let setup = args.asset.as_deref().map(set_up).transpose()?;
    let columns = setup.as_ref().and_then(|setup| setup.rig.columns.as_deref());
    let table = &table.clone().of_rig(columns);
    let info = info(args, table, setup.as_ref())?;
    let info = SessionInfo { first_t_s: first_t_s((&args.session, table))?, ..info };
    if let (Some(output), Some(format)) = (output, format) {
        write_session((&args.session, table), format, &info, output)?;
    }
    if let (Some(file), Some(setup)) = (&args.trace, &setup) {
        trace::write(setup, (&args.session, table), &info, file)?;
    }
    Ok(())
}

fn write_session(
    source: (&Path, &TableOptions),
    format: SessionFormat,
    info: &SessionInfo,
    output: &Path,
) -> anyhow::Result<()> {
    // Only CSV has the column `seq` where it is needed.
    let with_seq = format == SessionFormat::Csv && has_seq(source)?;
    let begun = SessionWriter::new(format, info, with_seq)?;
    if output == Path::new("-") {
        let mut out = output::stdout();
        write(source, begun, &mut out)?;
        return Ok(out.flush()?);
    }
    let mut file = NewFile::create(output)?;
    write(source, begun, &mut file)?;
    file.keep()
}

fn format(args: &SessionExport, output: &Path) -> Result<SessionFormat, BadArgument> {
    let suffix = output.extension().and_then(|suffix| suffix.to_str());
    let by_suffix = || suffix.and_then(|suffix| parse_format(suffix).ok());
    let format = args.format.or_else(by_suffix).ok_or_else(|| {
        let formats = FORMATS.map(SessionFormat::suffix).join(", ");
        BadArgument(format!("the suffix of FILE is not a format; add --format, one of {formats}"))
    })?;
    format.check().map_err(|e| BadArgument(e.to_string()))?;
    Ok(format)
}

fn set_up(asset: &Path) -> Result<Setup, InputError> {
    judge::set_up(judge::load_rig(Some(asset))?, None)
}

/// Judges the session if there is a setup.
fn info(
    args: &SessionExport,
    table: &TableOptions,
    setup: Option<&Setup>,
) -> anyhow::Result<SessionInfo> {
    let session = recordings::session_name(&args.session);
    let Some(setup) = setup else {
        return Ok(SessionInfo { session, ..SessionInfo::default() });
    };
    let runs = judge::judge_file(setup, &args.session, table)?;
    let [judged] = &runs[..] else {
        let reason = "its clock starts again: write each run into a separate file";
        return Err(InputError::file(&args.session, reason).into());
    };
    Ok(SessionInfo {
        session,
        asset_file: Some(serde_json::to_string(&asset::view(&setup.rig))?),
        calibration_id: setup.rig.calibration.as_deref().map(asset::calibration_id),
        verdict_hash: Some(judged.summary.verdict_hash.clone()),
        ..SessionInfo::default()
    })
}

/// The time of the first valid row, s.
fn first_t_s((path, table): (&Path, &TableOptions)) -> Result<Option<f64>, InputError> {
    let mut samples = recordings::open(path, table)?.filter_map(Result::ok);
    Ok(samples.next().map(|sample| sample.t_s))
}

fn has_seq((path, table): (&Path, &TableOptions)) -> Result<bool, InputError> {
    let mut rows = recordings::open(path, table)?;
    Ok(rows.any(|row| row.is_ok_and(|sample| sample.seq.is_some())))
}

/// Writes the valid rows of the session, and reports the others.
fn write(
    (path, table): (&Path, &TableOptions),
    (mut writer, start): (SessionWriter, Vec<u8>),
    out: &mut impl Write,
) -> anyhow::Result<()> {
    out.write_all(&start)?;
    let (mut samples, mut n_rejected) = (Vec::<Sample>::with_capacity(BATCH), 0_usize);
    for row in recordings::open(path, table)? {
        match row {
            Ok(sample) => samples.push(sample),
            Err(SessionRowError::Rejected(reason)) => {
                n_rejected += 1;
                if n_rejected <= MAX_NAMED_ROWS {
                    anstream::eprintln!("{}: {reason}; row left out", path.display());
                }
            }
            Err(error) => return Err(InputError::file(path, error).into()),
        }
        if samples.len() == BATCH {
            out.write_all(&writer.rows(&samples)?)?;
            samples.clear();
        }
    }
    if n_rejected > MAX_NAMED_ROWS {
        anstream::eprintln!(
            "{}: {} more rows are left out",
            path.display(),
            n_rejected - MAX_NAMED_ROWS
        );
    }
    if !samples.is_empty() {
        out.write_all(&writer.rows(&samples)?)?;
    }
    Ok(out.write_all(&writer.end()?)?)
}
