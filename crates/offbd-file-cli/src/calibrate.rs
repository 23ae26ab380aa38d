//! `offbd calibrate`: calibrates a rig from healthy sessions.

use data_encoding::HEXLOWER;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::judge::{TableArgs, load_rig, read_samples};
use crate::recordings::{JoinArgs, Recording};
use offbd_core::diagnosis::{
    AxisCalibration, Calibration, CalibrationOrigin, LeftOut, MonitorCertificate, Prospects,
    ServoProspects, SessionEstimate,
};
use offbd_core::engine::{Rig, calibrate_with_prospects};
use offbd_core::vocabulary::{Axis, FaultCode, PerAxis, Sample};
use offbd_terminal::errors::{BadArgument, InputError, read};
use offbd_terminal::output::{self, OutputFormat};
use offbd_terminal::table;
use offbd_wire::asset;
use offbd_wire::table::TableOptions;

/// Calibrates a rig from recordings in which it was healthy.
///
/// Estimates gain, delay, level, noise and stiction of each axis, and writes the
/// asset file with a `calibration` section: the estimates, the hash of the data,
/// and the date. If the data are not sufficient, the error says what is missing.
#[derive(Clone, Debug, Args)]
#[command(
    override_usage = "offbd calibrate --asset ASSET.json HEALTHY.csv... -o OUT.json",
    after_help = "One or two minutes with the ball rolling around the middle of the plate are enough, \
    with steps or circles of a few degrees. The ball may be pushed by hand now and then. \
    A moment in which the readings jump is left out and named; the first second counts \
    for nothing.\n\n\
    Examples:\n  \
    offbd calibrate --asset rig.json healthy.csv -o calibrated.json\n  \
    offbd calibrate --asset rig.json monday.csv tuesday.csv -o - | jq .calibration\n\n\
    Exit status: 0 calibrated, 3 the data are not sufficient or a file is unusable."
)]
pub struct CalibrateArgs {
    /// The rig's asset file
    #[arg(long, value_name = "ASSET.json")]
    asset: PathBuf,
    /// Healthy sessions; of a folder all files
    #[arg(required = true, value_name = "HEALTHY.csv")]
    sessions: Vec<PathBuf>,
    #[command(flatten)]
    join: JoinArgs,
    /// The calibrated asset file to write; - is stdout
    #[arg(short, long, value_name = "OUT.json")]
    output: PathBuf,
    /// The calibration: as tables on stderr, or as one JSON object on stdout
    #[arg(long, value_enum, default_value_t = OutputFormat::Table)]
    format: OutputFormat,
    #[command(flatten)]
    table: TableArgs,
}

pub fn run(args: &CalibrateArgs) -> anyhow::Result<()> {
    if args.format == OutputFormat::Json && args.output == Path::new("-") {
        let reason = "`--format json` prints to stdout, and so does `-o -`: give a file, or leave \
                      out `--format`, because the asset file has the calibration";
        return Err(BadArgument(reason.to_owned()).into());
    }
    let mut rig = load_rig(Some(&args.asset))?;
    let options = args.table.options().of_rig(rig.columns.as_deref());
    let recordings = args.join.recordings(&args.sessions)?;
    let sessions = load(&recordings, &options)?;
    let files: Vec<_> = recordings.into_iter().flat_map(|recording| recording.files).collect();
    let calibration = learn(&rig, &sessions, &data_hash(&files)?)
        .map_err(|e| InputError::new("cannot calibrate", e))?;
    if args.format == OutputFormat::Table {
        report(&rig, &calibration);
    }
    rig.calibration = Some(Box::new(calibration));
    write_asset(&rig, &args.output)?;
    match args.format {
        OutputFormat::Table => Ok(()),
        OutputFormat::Json => output::print_json(&learnt(&rig)),
    }
}

/// What was learnt of a rig, for programs.
#[derive(Serialize)]
struct LearntRig {
    asset: String,
    calibration: Option<asset::CalibrationView>,
}

fn learnt(rig: &Rig) -> LearntRig {
    LearntRig { asset: rig.name.clone(), calibration: asset::view(rig).calibration }
}

/// Loads the samples of healthy sessions, each run as one. Invalid rows are left out and reported
/// on stderr.
pub fn load(
    recordings: &[Recording],
    options: &TableOptions,
) -> Result<Vec<Vec<Sample>>, InputError> {
    let mut sessions = Vec::with_capacity(recordings.len());
    for recording in recordings {
        let (runs, bad_rows) = read_samples(recording, options)?;
        if let Some(first) = bad_rows.first() {
            let (n, name) = (bad_rows.len(), recording.words());
            output::remark(format_args!("{name}: {n} rows rejected, the first: {first}"));
        }
        sessions.extend(runs);
    }
    Ok(sessions)
}

/// Calibrates `rig`, with the present time as the date of the calibration.
#[expect(
    clippy::disallowed_methods,
    reason = "the date of the calibration; no verdict depends on it"
)]
pub fn learn(
    rig: &Rig,
    sessions: &[Vec<Sample>],
    data_sha256: &str,
) -> Result<Calibration, offbd_core::engine::CannotCalibrate> {
    let now = jiff::Timestamp::now();
    let made_at = now.round(jiff::Unit::Second).unwrap_or(now).to_string();
    let origin = CalibrationOrigin { data_sha256: data_sha256.to_owned(), made_at };
    Ok(Calibration { origin, ..calibrate_with_prospects(rig, sessions)? })
}

/// SHA-256 over the contents of the files, one after the other.
pub fn data_hash(paths: &[PathBuf]) -> Result<String, InputError> {
    let mut hash = Sha256::new();
    for path in paths {
        hash.update(read(path)?);
    }
    Ok(HEXLOWER.encode(&hash.finalize()))
}

/// Writes the asset file of `rig` to `path`.
pub fn write_asset(rig: &Rig, path: &Path) -> anyhow::Result<()> {
    let mut out = output::create(path)?;
    serde_json::to_writer_pretty(&mut out, &asset::view(rig))?;
    writeln!(out)?;
    Ok(out.flush()?)
}

/// Prints the calibration on stderr.
pub fn report(rig: &Rig, calibration: &Calibration) {
    output::remark(format_args!(
        "{}: calibrated from {} samples, {:.0} s",
        rig.name, calibration.n_samples, calibration.duration_s
    ));
    let heading = ["", "x", "y", "meaning"];
    let mut learnt = table::table(&heading, &[1, 2]);
    for (name, number, meaning) in axis_table() {
        let of = |axis: Axis| calibration.axes[axis].as_ref().map_or("-".to_owned(), number);
        learnt.add_row([name.to_owned(), of(Axis::X), of(Axis::Y), meaning.to_owned()]);
    }
    for line in table::lines(&learnt) {
        output::remark(format_args!("{line}"));
    }
    if calibration.sessions.len() > 1 {
        report_sessions(&calibration.sessions);
    }
    report_left_out(&calibration.left_out);
    calibration.certificate.iter().for_each(|certificate| report_certificate(certificate));
    calibration.prospects.iter().for_each(report_prospects);
}

/// Prints the moments that were not learnt from on stderr.
fn report_left_out(moments: &[LeftOut]) {
    if moments.is_empty() {
        return;
    }
    output::remark(format_args!(
        "\nleft out, since it contradicts the rest; in operation it counts as a fault of the sensor"
    ));
    for LeftOut { session, from_s, to_s, reason } in moments {
        output::remark(format_args!("session {session}, {from_s:.2}–{to_s:.2} s: {reason}"));
    }
}

/// Prints the estimates of each session on stderr.
fn report_sessions(sessions: &[PerAxis<Option<SessionEstimate>>]) {
    output::remark(format_args!("\nby session"));
    let heading = ["session", "level x", "gain x", "level y", "gain y"];
    let mut lines = table::table(&heading, &[0, 1, 2, 3, 4]);
    for (i, session) in sessions.iter().enumerate() {
        let level = |axis: Axis| session[axis].map(|s| angle(s.level_rad, s.level_error_rad));
        let gain = |axis: Axis| {
            session[axis]
                .and_then(|s| s.gain)
                .map(|(gain, error)| format!("{gain:.2} ± {error:.2}"))
        };
        let cells = Axis::ALL.into_iter().flat_map(|axis| [level(axis), gain(axis)]);
        let row = std::iter::once(Some((i + 1).to_string())).chain(cells);
        lines.add_row(row.map(|cell| cell.unwrap_or_else(|| "-".to_owned())));
    }
    for line in table::lines(&lines) {
        output::remark(format_args!("{line}"));
    }
    for axis in Axis::ALL {
        if let Some(warning) = disagreement(sessions, axis) {
            output::remark(format_args!("{}", table::wrapped("warning: ", &warning)));
        }
    }
}

fn angle(rad: f64, error_rad: f64) -> String {
    format!("{:.2}° ± {:.2}°", rad.to_degrees(), error_rad.to_degrees())
}

/// A warning if the estimates of `axis` differ more between the sessions than for most
/// rigs.
fn disagreement(sessions: &[PerAxis<Option<SessionEstimate>>], axis: Axis) -> Option<String> {
    let seen = || sessions.iter().filter_map(|s| s[axis]);
    let levels = range(seen().map(|s| s.level_rad))?;
    let gains = range(seen().filter_map(|s| s.gain).map(|(gain, _)| gain.ln()));
    let far = levels > WIDE_LEVELS_RAD;
    let off = gains.is_some_and(|g| g > WIDE_GAINS.ln());
    (far || off).then(|| {
        format!(
            "along {axis} the sessions disagree: levels differ by {levels:.1}° and gains by a \
             factor of {gains:.2}; small faults of the servo of {command} cannot be told from that. \
             Check that plate, horn and linkage are tight and that all sessions were healthy.",
            axis = axis.as_str(),
            levels = levels.to_degrees(),
            gains = gains.unwrap_or(0.0).exp(),
            command = axis.command(),
        )
    })
}

/// Difference of the largest and the smallest of `values`; `None` if there are none.
fn range(values: impl Iterator<Item = f64> + Clone) -> Option<f64> {
    let least = values.clone().reduce(f64::min)?;
    values.reduce(f64::max).map(|most| most - least)
}

/// Prints the false alarms to expect of each monitor on stderr.
fn report_certificate(certificate: &[MonitorCertificate]) {
    output::remark(format_args!("\non the healthy rig, by tests on held-out recordings"));
    let heading = ["monitor", "judged", "closest to the limit", "false alarms to expect"];
    let mut lines = table::table(&heading, &[1, 2, 3]);
    for (code, monitor) in FaultCode::ALL.iter().zip(certificate) {
        lines.add_row([
            code.to_string(),
            format!("{:.0} s", monitor.judged_s),
            format!("{:.0} %", 100.0 * monitor.nearest),
            monitor.most_alarms_per_hour.map_or("unknown".to_owned(), alarm_rate),
        ]);
    }
    for line in table::lines(&lines) {
        output::remark(format_args!("{line}"));
    }
    output::remark(table::wrapped("", POPULATION));
}

/// Where the rates of alarms come from: the source of the constants of the certificate.
const POPULATION: &str = "Nine of ten rigs have fewer. The rates come from simulated rigs with the \
    properties of real ones, watched for 94 to 234 h; tests of minutes on this rig change them little.";

/// A limit of a rate of alarms, with a suitable unit.
fn alarm_rate(per_hour: f64) -> String {
    let per_day = 24.0 * per_hour;
    let days = (1.0 / per_day).floor();
    match per_day {
        d if d >= 24.0 => format!("fewer than {per_hour:.1} an hour"),
        d if days <= 1.0 => format!("fewer than {d:.1} a day"),
        _ => format!("fewer than one in {days:.0} days"),
    }
}

/// Prints on stderr which faults would be found, and after what time.
fn report_prospects(prospects: &Prospects) {
    output::remark(format_args!("\na fault during this recording would have been confirmed after"));
    let heading = ["", "x", "y", "meaning"];
    let mut servos = table::table(&heading, &[1, 2]);
    let numbers: [ServoTableRow; 5] = [
        ("dead", |s| seconds(s.dead_s), "no response"),
        ("half", |s| seconds(s.half_gain_s), "half response"),
        ("off by 1°", |s| seconds(s.offset_1deg_s), "its horn has slipped"),
        ("least loss", |s| percent(s.least_gain_loss), "of the response that is found in 10 s"),
        ("least slip", |s| degrees(s.least_offset_rad), "of the horn that is found in 10 s"),
    ];
    for (name, number, meaning) in numbers {
        let of = |axis: Axis| prospects.servos[axis].as_ref().map_or("-".to_owned(), number);
        servos.add_row([name.to_owned(), of(Axis::X), of(Axis::Y), meaning.to_owned()]);
    }
    for line in table::lines(&servos) {
        output::remark(format_args!("{line}"));
    }
    let Prospects { n_trials, stuck_s, frozen_s, unseen_s, .. } = prospects;
    output::remark(format_args!(
        "a stuck ball {}, frozen readings {}, no ball seen {}; medians of {n_trials} trials",
        seconds(*stuck_s),
        seconds(*frozen_s),
        seconds(*unseen_s)
    ));
}

fn seconds(delay_s: Option<f64>) -> String {
    delay_s.map_or("> 10 s".to_owned(), |s| format!("{s:.1} s"))
}

fn percent(share: Option<f64>) -> String {
    share.map_or("-".to_owned(), |s| format!("{:.0} %", s * 100.0))
}

fn degrees(angle_rad: Option<f64>) -> String {
    angle_rad.map_or("-".to_owned(), |a| format!("{:.1}°", a.to_degrees()))
}

/// Difference of levels between sessions that causes a warning, rad: twice the spread of
/// the worst real rig within a day.
const WIDE_LEVELS_RAD: f64 = 2.0 * AxisCalibration::POPULATION_LEVEL_SPREAD_RAD;
/// Ratio of gains between sessions that causes a warning: twice the population's spread
/// to either side.
const WIDE_GAINS: f64 = 1.3;

/// Name, number and meaning of a line of the table of axes.
type AxisTableRow = (&'static str, fn(&AxisCalibration) -> String, &'static str);
/// Name, number and meaning of a line of the table of prospects.
type ServoTableRow = (&'static str, fn(&ServoProspects) -> String, &'static str);

/// The breakaway angle, which is unknown if the ball never rested.
fn breakaway(axis: &AxisCalibration) -> String {
    match axis.rest_s > 0.0 {
        true => format!("{:.2}°", axis.breakaway_rad.to_degrees()),
        false => "unknown".to_owned(),
    }
}

fn axis_table() -> [AxisTableRow; 10] {
    [
        ("gain", |a| format!("{:.3}", a.gain), "measured over modelled acceleration"),
        ("dead time", |a| format!("{:.0} ms", a.dead_time_s * 1e3), "command to first movement"),
        ("lag", |a| format!("{:.0} ms", a.lag_s * 1e3), "time constant of the servo"),
        ("level", |a| format!("{:.2}°", a.level_rad.to_degrees()), "plate angle at command 0"),
        (
            "level, ±",
            |a| format!("{:.2}°", a.level_spread_rad.to_degrees()),
            "from session to session, rms",
        ),
        (
            "resistance",
            |a| format!("{:.3} m/s²", a.resistance_m_s2),
            "a rolling ball slows down by",
        ),
        ("noise", |a| format!("{:.2} mm", a.noise_m * 1e3), "readings about the motion, rms"),
        ("breakaway", breakaway, "a ball at rest starts"),
        ("repeats", |a| format!("{:.2} s", a.longest_repeat_s), "longest healthy repeat"),
        ("residual", |a| format!("{:.3} m/s²", a.residual_m_s2), "measured - twin, rms"),
    ]
}
