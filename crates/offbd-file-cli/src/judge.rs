//! Judges one session file. Used by `replay`, `trends` and `score`. The service judges in
//! the same way, sample by sample.

use std::fs::File;
use std::path::Path;

use offbd_terminal::errors::{InputError, read};
pub use offbd_wire::judging::JudgedSession;

use offbd_core::diagnosis::Profile;
use offbd_core::engine::{Rig, Setup};
use offbd_core::vocabulary::Sample;
use offbd_wire::asset;
use offbd_wire::judging::RecordedSession;
use offbd_wire::session_file::{self, SessionRowError, SessionRows};

/// Loads the rig of an asset file; without a path, the default rig.
pub fn load_rig(path: Option<&Path>) -> Result<Rig, InputError> {
    let Some(path) = path else { return Ok(Rig::chapter("chapter")) };
    asset::parse(&read(path)?).map_err(|e| InputError::file(path, e))
}

/// The setup of an engine that judges `rig` by `profile`.
pub fn set_up(rig: Rig, profile: Option<Profile>) -> Result<Setup, InputError> {
    let name = rig.name.clone();
    Setup::new(rig, profile).map_err(|e| InputError::new(name, e))
}

/// The name of a session: that of its file.
pub fn session_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Judges the session file at `path`.
pub fn judge_file(setup: &Setup, path: &Path) -> Result<JudgedSession, InputError> {
    let mut rows = open(path)?;
    let mut session = RecordedSession::new(setup.clone(), session_name(path));
    while let Some(row) = rows.next() {
        match row {
            Ok(sample) => session.sample(sample, || rows.place(), |_| {}),
            Err(SessionRowError::Rejected(row)) => session.reject(row),
            Err(error) => return Err(InputError::file(path, error)),
        }
    }
    session.end(|_| {}).map_err(|reason| InputError::file(path, reason))
}

/// Reads the samples of the session file at `path`, and the errors of its invalid rows.
pub fn read_samples(path: &Path) -> Result<(Vec<Sample>, Vec<String>), InputError> {
    let (mut samples, mut bad_rows) = (Vec::new(), Vec::new());
    for row in open(path)? {
        match row {
            Ok(sample) => samples.push(sample),
            Err(SessionRowError::Rejected(row)) => bad_rows.push(row.to_string()),
            Err(error) => return Err(InputError::file(path, error)),
        }
    }
    Ok((samples, bad_rows))
}

/// Opens the session file at `path`, whatever its format.
pub fn open(path: &Path) -> Result<Box<dyn SessionRows>, InputError> {
    let file = File::open(path).map_err(|e| InputError::file(path, e))?;
    session_file::open(file, None).map_err(|e| InputError::file(path, e))
}
