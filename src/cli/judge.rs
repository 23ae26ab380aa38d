//! Judges one session file. Used by `replay`, `trends` and `score`. The service judges in
//! the same way, sample by sample.

use std::fs::File;
use std::path::Path;

use super::errors::{InputError, read};
use crate::judging::Judging;
use crate::wire::asset;
use crate::wire::session_file::{self, RowPlace, SessionRowError, SessionRows};
use crate::wire::verdict::{FaultView, SummaryView, fault_view};
use offbd_core::diagnosis::{FaultMemory, Profile, ServoEstimate};
use offbd_core::engine::{Admission, Input, Misfit, Rig, Setup};
use offbd_core::vocabulary::{PerAxis, Sample};

/// Number of invalid rows of a file that are reported one by one; further ones are only
/// counted.
pub(super) const MAX_NAMED_ROWS: usize = 5;

/// The result of judging a session.
#[derive(Debug)]
pub(super) struct JudgedSession {
    pub faults: Vec<FaultView>,
    pub summary: SummaryView,
    /// The first [`MAX_NAMED_ROWS`] rejected rows: place and reason.
    pub bad_rows: Vec<String>,
    /// Rows that are not judged: their time was too late, or a step of the clock that no
    /// other row confirmed.
    pub n_set_aside: u64,
    /// The estimate of each servo; `None` if there was too little motion.
    pub estimates: PerAxis<Option<ServoEstimate>>,
    /// Contradictions between the data and the asset file.
    pub misfits: Vec<Misfit>,
}

/// Loads the rig of an asset file; without a path, the chapter's rig.
pub(super) fn load_rig(path: Option<&Path>) -> Result<Rig, InputError> {
    let Some(path) = path else { return Ok(Rig::chapter("chapter")) };
    asset::parse(&read(path)?).map_err(|e| InputError::file(path, e))
}

/// The setup of an engine that judges `rig` by `profile`.
pub(super) fn set_up(rig: Rig, profile: Option<Profile>) -> Result<Setup, InputError> {
    let name = rig.name.clone();
    Setup::new(rig, profile).map_err(|e| InputError::new(name, e))
}

/// The name of a session: that of its file.
pub(super) fn session_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Judges the session file at `path`.
pub(super) fn judge_file(setup: &Setup, path: &Path) -> Result<JudgedSession, InputError> {
    let mut rows = open(path)?;
    let mut session = FileSession::new(setup.clone(), session_name(path));
    while let Some(row) = rows.next() {
        match row {
            Ok(sample) => session.sample(sample, || rows.place()),
            Err(SessionRowError::Rejected(reason)) => session.reject(reason),
            Err(error) => return Err(InputError::file(path, error)),
        }
    }
    session.end().map_err(|reason| InputError::file(path, reason))
}

/// Reads the samples of the session file at `path`, and the errors of its invalid rows.
pub(super) fn read_samples(path: &Path) -> Result<(Vec<Sample>, Vec<String>), InputError> {
    let (mut samples, mut bad_rows) = (Vec::new(), Vec::new());
    for row in open(path)? {
        match row {
            Ok(sample) => samples.push(sample),
            Err(SessionRowError::Rejected(reason)) => bad_rows.push(reason),
            Err(error) => return Err(InputError::file(path, error)),
        }
    }
    Ok((samples, bad_rows))
}

/// Opens the session file at `path`, whatever its format.
pub(super) fn open(path: &Path) -> Result<Box<dyn SessionRows>, InputError> {
    let file = File::open(path).map_err(|e| InputError::file(path, e))?;
    session_file::open(file, None).map_err(|e| InputError::file(path, e))
}

/// The judgement of a session file.
struct FileSession {
    name: String,
    judging: Judging,
    faults: Vec<FaultView>,
    bad_rows: Vec<String>,
    n_rejected: u64,
}

impl FileSession {
    fn new(setup: Setup, name: String) -> Self {
        let judging = Judging::new(setup, FaultMemory::default());
        Self { name, judging, faults: Vec::new(), bad_rows: Vec::new(), n_rejected: 0 }
    }

    fn reject(&mut self, reason: String) {
        self.n_rejected += 1;
        if self.bad_rows.len() < MAX_NAMED_ROWS {
            self.bad_rows.push(reason);
        }
    }

    fn sample(&mut self, sample: Sample, place: impl FnOnce() -> RowPlace) {
        let admission = match self.judging.sample(sample) {
            // Rows as old as this are no retransmissions in a recording.
            Admission::Unknown => self.judging.new_sample(sample),
            admission => admission,
        };
        if let Admission::Rejected(reason) = admission {
            self.reject(format!("{}: {reason}", place()));
        }
        self.note_faults();
    }

    fn note_faults(&mut self) {
        let view = |t| fault_view(&self.name, self.judging.basis(), t);
        self.faults.extend(self.judging.transitions().iter().map(view));
    }

    /// Ends the session. Returns the result, or the reason why nothing could be judged.
    fn end(mut self) -> Result<JudgedSession, String> {
        self.judging.input(Input::End);
        self.note_faults();
        let misfits = self.judging.misfits();
        let counts = self.judging.counts();
        if counts.span_s.is_none() {
            return Err(no_row(&misfits));
        }
        let summary = self.judging.summary(&self.name, self.n_rejected);
        let estimates = self.judging.engine().servo_estimates();
        let Self { faults, bad_rows, .. } = self;
        let n_set_aside = counts.n_set_aside;
        Ok(JudgedSession { faults, summary, bad_rows, n_set_aside, estimates, misfits })
    }
}

/// The message that no row was usable, with the reason if it is known.
fn no_row(misfits: &[Misfit]) -> String {
    let units = |m: &&Misfit| matches!(m, Misfit::Positions { .. } | Misfit::Commands { .. });
    let why = misfits.iter().find(units).map_or_else(String::new, |m| format!(": {m}"));
    format!("no usable row{why}")
}
