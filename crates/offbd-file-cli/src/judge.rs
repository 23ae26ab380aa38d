//! Judges one session file. Used by `replay`, `trends` and `score`. The service judges in
//! the same way, sample by sample.

use std::path::Path;

use crate::recordings::Recording;
use clap::Args;
use offbd_terminal::errors::{InputError, read};
pub use offbd_wire::judging::JudgedSession;

use offbd_core::diagnosis::Profile;
use offbd_core::engine::{Rig, Setup};
use offbd_core::vocabulary::Sample;
use offbd_wire::asset;
use offbd_wire::judging::{RecordedSession, run_name};
use offbd_wire::session_file::SessionRowError;
use offbd_wire::table::{ColumnMapping, RATES_HZ, TableOptions};

/// How the tables of recordings in text are read.
#[derive(Clone, Debug, Default, Args)]
pub struct TableArgs {
    /// Which columns of a text or a sheet are which quantities, with units, such as
    /// "t_s=time/ms, x_m=ball_x/mm"; by default `columns` of the asset file;
    /// `offbd inspect FILE` proposes a mapping
    #[arg(long, value_name = "MAPPING")]
    columns: Option<ColumnMapping>,
    /// Rows a second of a text without a time
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
}

fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| RATES_HZ.contains(rate));
    rate.ok_or_else(|| format!("expected a number from {} to {}", RATES_HZ.start(), RATES_HZ.end()))
}

impl TableArgs {
    /// The options of the reader.
    #[must_use]
    pub fn options(&self) -> TableOptions {
        let columns = self.columns.clone().unwrap_or_default();
        TableOptions { columns, rate_hz: self.rate, ..TableOptions::default() }
    }
}

/// Loads the rig of an asset file; without a path, the default rig.
pub fn load_rig(path: Option<&Path>) -> Result<Rig, InputError> {
    let Some(path) = path else { return Ok(Rig::chapter("chapter")) };
    asset::parse_new(&read(path)?).map_err(|e| InputError::file(path, e))
}

/// The setup of an engine that judges `rig` by `profile`.
pub fn set_up(rig: Rig, profile: Option<Profile>) -> Result<Setup, InputError> {
    let name = rig.name.clone();
    Setup::new(rig, profile).map_err(|e| InputError::new(name, e))
}

/// Judges each run of the session file at `path` as a session; there is at least one.
pub fn judge_file(
    setup: &Setup,
    path: &Path,
    options: &TableOptions,
) -> Result<Vec<JudgedSession>, InputError> {
    judge_recording(setup, &Recording::of(path), options)
}

/// Judges each run of `recording` as a session; there is at least one.
pub fn judge_recording(
    setup: &Setup,
    recording: &Recording,
    options: &TableOptions,
) -> Result<Vec<JudgedSession>, InputError> {
    let options = options.clone().of_rig(setup.rig.columns.as_deref());
    let mut rows = recording.open(&options)?;
    let begin = |n_run| RecordedSession::new(setup.clone(), run_name(&recording.name, n_run));
    let end = |session: RecordedSession| {
        session.end(|_| {}).map_err(|reason| InputError::new(&recording.name, reason))
    };
    let (mut ended, mut session) = (Vec::new(), begin(1));
    while let Some(row) = rows.next() {
        if rows.n_runs() > ended.len() + 1 {
            let next = begin(rows.n_runs());
            ended.push(end(std::mem::replace(&mut session, next))?);
        }
        match row {
            Ok(sample) => session.sample(sample, || rows.place(), |_| {}),
            Err(SessionRowError::Rejected(row)) => session.reject(row),
            Err(error) => return Err(recording.error(error)),
        }
    }
    ended.push(end(session)?);
    Ok(ended)
}

/// Reads the samples of each run of `recording`, and the errors of its invalid rows.
pub fn read_samples(
    recording: &Recording,
    options: &TableOptions,
) -> Result<(Vec<Vec<Sample>>, Vec<String>), InputError> {
    let (mut runs, mut bad_rows) = (vec![Vec::new()], Vec::new());
    let mut rows = recording.open(options)?;
    while let Some(row) = rows.next() {
        runs.resize_with(rows.n_runs(), Vec::new);
        match row {
            Ok(sample) => runs.last_mut().into_iter().for_each(|run| run.push(sample)),
            Err(SessionRowError::Rejected(row)) => bad_rows.push(row.to_string()),
            Err(error) => return Err(recording.error(error)),
        }
    }
    Ok((runs, bad_rows))
}
