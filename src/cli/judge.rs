//! Judging one session file: rows in, verdict out. Shared by `replay` and
//! `score`; the service judges the same way, sample by sample.

use std::fs::File;
use std::path::Path;

use super::unusable::{Unusable, read};
use crate::judging::Judging;
use crate::wire::asset;
use crate::wire::session_csv::{Reader, RowError};
use crate::wire::verdict::{FaultView, SummaryView, fault_view};
use offbd_core::diagnosis::{FaultMemory, Profile, ServoEstimate};
use offbd_core::engine::{Admission, Input, Misfit, Rig, Setup};
use offbd_core::vocabulary::{PerAxis, Sample};

/// Most bad rows of a file that are named one by one; more are counted: what is
/// wrong with a file shows in a few.
pub(super) const MAX_NAMED_ROWS: usize = 5;

/// What a session came to.
#[derive(Debug)]
pub(super) struct Judged {
    pub faults: Vec<FaultView>,
    pub summary: SummaryView,
    /// The first [`MAX_NAMED_ROWS`] rejected rows.
    pub bad_rows: Vec<RowError>,
    /// Rows that came too late, or too far ahead, to be judged.
    pub n_set_aside: u64,
    /// How each servo has answered; none where too little motion was seen.
    pub estimates: PerAxis<Option<ServoEstimate>>,
    /// In what the data and the asset file do not fit.
    pub misfits: Vec<Misfit>,
}

/// The rig of an asset file; without one the chapter's.
pub(super) fn load_rig(path: Option<&Path>) -> Result<Rig, Unusable> {
    let Some(path) = path else { return Ok(Rig::chapter("chapter")) };
    asset::parse(&read(path)?).map_err(|e| Unusable::file(path, e))
}

/// What an engine needs to judge `rig` by `profile`.
pub(super) fn set_up(rig: Rig, profile: Option<Profile>) -> Result<Setup, Unusable> {
    let name = rig.name.clone();
    Setup::new(rig, profile).map_err(|e| Unusable::new(name, e))
}

/// The session's name: the file's.
pub(super) fn session_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Judges the session file at `path`.
pub(super) fn judge_file(setup: &Setup, path: &Path) -> Result<Judged, Unusable> {
    let mut rows = open(path)?;
    let mut session = FileSession::new(setup.clone(), session_name(path));
    while let Some(row) = rows.next() {
        match row {
            Ok(sample) => session.sample(sample, rows.line()),
            Err(error) => session.reject(error),
        }
    }
    session.end().map_err(|reason| Unusable::file(path, reason))
}

/// The samples of the session file at `path`, bad rows left out and counted.
pub(super) fn read_samples(path: &Path) -> Result<(Vec<Sample>, Vec<RowError>), Unusable> {
    let (mut samples, mut bad_rows) = (Vec::new(), Vec::new());
    for row in open(path)? {
        match row {
            Ok(sample) => samples.push(sample),
            Err(error) => bad_rows.push(error),
        }
    }
    Ok((samples, bad_rows))
}

fn open(path: &Path) -> Result<Reader<File>, Unusable> {
    let file = File::open(path).map_err(|e| Unusable::file(path, e))?;
    Reader::new(file).map_err(|e| Unusable::file(path, e))
}

/// One session of a file.
struct FileSession {
    name: String,
    judging: Judging,
    faults: Vec<FaultView>,
    bad_rows: Vec<RowError>,
    n_rejected: u64,
}

impl FileSession {
    fn new(setup: Setup, name: String) -> Self {
        let judging = Judging::new(setup, FaultMemory::default());
        Self { name, judging, faults: Vec::new(), bad_rows: Vec::new(), n_rejected: 0 }
    }

    fn reject(&mut self, error: RowError) {
        self.n_rejected += 1;
        if self.bad_rows.len() < MAX_NAMED_ROWS {
            self.bad_rows.push(error);
        }
    }

    fn sample(&mut self, sample: Sample, line: u64) {
        if let Admission::Rejected(reason) = self.judging.sample(sample) {
            self.reject(RowError { line, reason: reason.to_string() });
        }
        self.note_faults();
    }

    fn note_faults(&mut self) {
        let view = |t| fault_view(&self.name, self.judging.basis(), t);
        self.faults.extend(self.judging.transitions().map(view));
    }

    /// The verdict, or why there was nothing to judge.
    fn end(mut self) -> Result<Judged, String> {
        self.judging.input(Input::End);
        self.note_faults();
        let misfits = self.judging.misfits();
        let counts = *self.judging.counts();
        if counts.span_s.is_none() {
            return Err(no_row(&misfits));
        }
        let summary = self.judging.summary(&self.name, self.n_rejected);
        let estimates = self.judging.engine().servo_estimates();
        let Self { faults, bad_rows, .. } = self;
        let n_set_aside = counts.n_set_aside;
        Ok(Judged { faults, summary, bad_rows, n_set_aside, estimates, misfits })
    }
}

/// That no row could be used, and why if that shows.
fn no_row(misfits: &[Misfit]) -> String {
    let units = |m: &&Misfit| matches!(m, Misfit::Positions { .. } | Misfit::Commands { .. });
    let why = misfits.iter().find(units).map_or_else(String::new, |m| format!(": {m}"));
    format!("no usable row{why}")
}
