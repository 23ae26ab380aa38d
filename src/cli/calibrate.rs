//! `offbd calibrate`: learns a rig from healthy sessions.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use sha2::{Digest, Sha256};

use super::judge::{load_rig, read_samples};
use super::unusable::{Unusable, read};
use super::{output, table};
use crate::diagnosis::{AxisCalibration, Calibration, Prospects, ServoProspects};
use crate::engine::{Rig, calibrate_and_foresee};
use crate::vocabulary::{Axis, Sample};
use crate::wire::{asset, session_csv, verdict};

/// Learns a rig from recordings in which it was healthy.
///
/// Learns gain, delay, level, noise and stiction of each axis, and writes the
/// asset file back with a `calibration` section: what was learnt, from which
/// data, when. Refuses when the data cannot support it, and says what is missing.
#[derive(Clone, Debug, Args)]
#[command(
    override_usage = "offbd calibrate --asset ASSET.json HEALTHY.csv... -o OUT.json",
    after_help = "A minute or two with the ball rolling about the middle of the plate is enough; \
    steps or circles of a few degrees. Hands may push the ball now and then.\n\n\
    Examples:\n  \
    offbd calibrate --asset rig.json healthy.csv -o learnt.json\n  \
    offbd calibrate --asset rig.json monday.csv tuesday.csv -o - | jq .calibration\n\n\
    Exit status: 0 learnt, 3 the data cannot support it or a file is unusable."
)]
pub(super) struct CalibrateArgs {
    /// The rig's asset file
    #[arg(long, value_name = "ASSET.json")]
    asset: PathBuf,
    /// Healthy sessions
    #[arg(required = true, value_name = "HEALTHY.csv")]
    sessions: Vec<PathBuf>,
    /// Where the calibrated asset file goes; - is stdout
    #[arg(short, long, value_name = "OUT.json")]
    output: PathBuf,
}

pub(super) fn run(args: &CalibrateArgs) -> anyhow::Result<()> {
    let mut rig = load_rig(Some(&args.asset))?;
    let sessions = load(&args.sessions)?;
    let calibration = learn(&rig, &sessions, &data_hash(&args.sessions)?)
        .map_err(|e| Unusable::new("cannot calibrate", e))?;
    report(&rig, &calibration);
    rig.calibration = Some(calibration);
    write_asset(&rig, &args.output)
}

/// The samples of healthy sessions; bad rows are named on stderr and left out.
pub(super) fn load(paths: &[PathBuf]) -> Result<Vec<Vec<Sample>>, Unusable> {
    let mut sessions = Vec::with_capacity(paths.len());
    for path in paths {
        let (samples, bad_rows) = read_samples(path)?;
        if let Some(first) = bad_rows.first() {
            let n = bad_rows.len();
            anstream::eprintln!("{}: {n} rows rejected, the first: {first}", path.display());
        }
        sessions.push(samples);
    }
    Ok(sessions)
}

/// Learns `rig` as of now.
#[expect(
    clippy::disallowed_methods,
    reason = "the file says when it was learnt; no verdict depends on it"
)]
pub(super) fn learn(
    rig: &Rig,
    sessions: &[Vec<Sample>],
    data_sha256: &str,
) -> Result<Calibration, crate::engine::CannotCalibrate> {
    let now = jiff::Timestamp::now();
    let made_at = now.round(jiff::Unit::Second).unwrap_or(now).to_string();
    calibrate_and_foresee(rig, sessions, data_sha256, &made_at)
}

/// SHA-256 over the files' bytes, one after the other.
pub(super) fn data_hash(paths: &[PathBuf]) -> Result<String, Unusable> {
    let mut hash = Sha256::new();
    for path in paths {
        hash.update(read(path)?);
    }
    Ok(verdict::hex(&hash.finalize()))
}

/// SHA-256 of a session that never was a file, as if it were.
pub(super) fn samples_hash(samples: &[Sample]) -> anyhow::Result<String> {
    let mut bytes = Vec::new();
    session_csv::write(&mut bytes, samples)?;
    Ok(verdict::hex(&Sha256::digest(&bytes)))
}

/// Writes the asset file of `rig` to `path`.
pub(super) fn write_asset(rig: &Rig, path: &Path) -> anyhow::Result<()> {
    let mut out = output::create(path)?;
    serde_json::to_writer_pretty(&mut out, &asset::view(rig))?;
    writeln!(out)?;
    Ok(out.flush()?)
}

/// What was learnt, for the person who asked, on stderr.
pub(super) fn report(rig: &Rig, calibration: &Calibration) {
    anstream::eprintln!(
        "{}: learnt from {} samples, {:.0} s",
        rig.name,
        calibration.n_samples,
        calibration.duration_s
    );
    let heading = ["", "x", "y", "meaning"];
    let mut learnt = table::table(&heading, &[1, 2]);
    for (name, number, meaning) in rows() {
        let of = |axis: Axis| calibration.axes[axis].as_ref().map_or("-".to_owned(), number);
        learnt.add_row([name.to_owned(), of(Axis::X), of(Axis::Y), meaning.to_owned()]);
    }
    for line in table::lines(&learnt) {
        anstream::eprintln!("{line}");
    }
    calibration.prospects.iter().for_each(foresee);
}

/// What can be found how soon, on stderr.
fn foresee(prospects: &Prospects) {
    anstream::eprintln!("\na fault during this recording would have been confirmed after");
    let heading = ["", "x", "y", "meaning"];
    let mut servos = table::table(&heading, &[1, 2]);
    let numbers: [ServoRow; 5] = [
        ("dead", |s| seconds(s.dead_s), "the servo answers nothing"),
        ("half", |s| seconds(s.half_gain_s), "it answers half"),
        ("off by 1°", |s| seconds(s.offset_1deg_s), "its horn has slipped"),
        ("least loss", |s| percent(s.least_gain_loss), "of the answer that is found in 10 s"),
        ("least slip", |s| degrees(s.least_offset_rad), "of the horn that is found in 10 s"),
    ];
    for (name, number, meaning) in numbers {
        let of = |axis: Axis| prospects.servos[axis].as_ref().map_or("-".to_owned(), number);
        servos.add_row([name.to_owned(), of(Axis::X), of(Axis::Y), meaning.to_owned()]);
    }
    for line in table::lines(&servos) {
        anstream::eprintln!("{line}");
    }
    let Prospects { n_trials, stuck_s, frozen_s, unseen_s, .. } = prospects;
    anstream::eprintln!(
        "a stuck ball {}, frozen readings {}, no ball seen {}; medians of {n_trials} trials",
        seconds(*stuck_s),
        seconds(*frozen_s),
        seconds(*unseen_s)
    );
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

type Row = (&'static str, fn(&AxisCalibration) -> String, &'static str);
type ServoRow = (&'static str, fn(&ServoProspects) -> String, &'static str);

fn rows() -> [Row; 8] {
    [
        ("gain", |a| format!("{:.3}", a.gain), "measured over modelled acceleration"),
        ("dead time", |a| format!("{:.0} ms", a.dead_time_s * 1e3), "command to first movement"),
        ("lag", |a| format!("{:.0} ms", a.lag_s * 1e3), "time constant of the servo"),
        ("level", |a| format!("{:.2}°", a.level_rad.to_degrees()), "plate angle at command 0"),
        (
            "resistance",
            |a| format!("{:.3} m/s²", a.resistance_m_s2),
            "a rolling ball slows down by",
        ),
        ("noise", |a| format!("{:.2} mm", a.noise_m * 1e3), "readings about the motion, rms"),
        ("breakaway", |a| format!("{:.2}°", a.breakaway_rad.to_degrees()), "a ball at rest starts"),
        ("residual", |a| format!("{:.3} m/s²", a.residual_m_s2), "measured - twin, rms"),
    ]
}
