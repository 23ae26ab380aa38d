//! Judging one session file: rows in, verdict out. Shared by `replay` and
//! `score`; the service judges the same way, sample by sample.

use std::fs::File;
use std::path::Path;

use super::unusable::{Unusable, read};
use crate::wire::asset;
use crate::wire::basis::Basis;
use crate::wire::session_csv::{Reader, RowError};
use crate::wire::verdict::{FaultView, SummaryView, Verdict, fault_view};
use offbd_core::diagnosis::{FaultMemory, Profile, ServoEstimate, Transition};
use offbd_core::engine::{Admission, Engine, Input, Misfit, Output, Plausibility, Rig, Setup};
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
    let mut bench = Bench::new(setup.clone(), session_name(path));
    while let Some(row) = rows.next() {
        match row {
            Ok(sample) => bench.sample(sample, rows.line()),
            Err(error) => bench.reject(error),
        }
    }
    bench.end().map_err(|reason| Unusable::file(path, reason))
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

/// An engine with what comes out of it for one session.
struct Bench {
    session: String,
    basis: Basis,
    plausibility: Plausibility,
    engine: Engine,
    outputs: Vec<Output>,
    verdict: Verdict,
    faults: Vec<FaultView>,
    bad_rows: Vec<RowError>,
    n_samples: u64,
    n_rejected: u64,
    n_set_aside: u64,
    span_s: Option<(f64, f64)>,
}

impl Bench {
    fn new(setup: Setup, session: String) -> Self {
        Self {
            session,
            basis: Basis::of(&setup),
            plausibility: Plausibility::new(&setup.rig),
            engine: Engine::new(setup, FaultMemory::default()),
            outputs: Vec::new(),
            verdict: Verdict::default(),
            faults: Vec::new(),
            bad_rows: Vec::new(),
            n_samples: 0,
            n_rejected: 0,
            n_set_aside: 0,
            span_s: None,
        }
    }

    fn reject(&mut self, error: RowError) {
        self.n_rejected += 1;
        if self.bad_rows.len() < MAX_NAMED_ROWS {
            self.bad_rows.push(error);
        }
    }

    fn sample(&mut self, sample: Sample, line: u64) {
        self.plausibility.take(&sample);
        self.engine.handle(Input::Sample(sample), &mut self.outputs);
        let mut outputs = std::mem::take(&mut self.outputs);
        for output in outputs.drain(..) {
            self.verdict.take(&output);
            match output {
                Output::Admitted(admission) => self.admitted(admission, sample.t_s, line),
                Output::Transition(transition) => self.transition(&transition),
            }
        }
        self.outputs = outputs;
    }

    fn admitted(&mut self, admission: Admission, t_s: f64, line: u64) {
        match admission {
            Admission::Accepted => {
                let (first, last) = self.span_s.unwrap_or((t_s, t_s));
                self.span_s = Some((first.min(t_s), last.max(t_s)));
                self.n_samples += 1;
            }
            Admission::SetAside(_) => {
                self.n_samples += 1;
                self.n_set_aside += 1;
            }
            Admission::Duplicate => {}
            Admission::Rejected(reason) => {
                self.reject(RowError { line, reason: reason.to_string() });
            }
        }
    }

    fn transition(&mut self, transition: &Transition) {
        self.faults.push(fault_view(&self.session, &self.basis, transition));
    }

    /// The verdict, or why there was nothing to judge.
    fn end(mut self) -> Result<Judged, String> {
        self.engine.handle(Input::End, &mut self.outputs);
        for output in std::mem::take(&mut self.outputs) {
            self.verdict.take(&output);
            if let Output::Transition(transition) = output {
                self.transition(&transition);
            }
        }
        let misfits = self.plausibility.misfits();
        let (first, last) = self.span_s.ok_or_else(|| no_row(&misfits))?;
        let summary =
            self.verdict.summary(&self.session, self.n_samples, self.n_rejected, last - first);
        let summary = summary
            .with_monitors(self.verdict.monitors(&self.engine.state()))
            .with_misfits(&misfits);
        let estimates = self.engine.servo_estimates();
        let Self { faults, bad_rows, n_set_aside, .. } = self;
        Ok(Judged { faults, summary, bad_rows, n_set_aside, estimates, misfits })
    }
}

/// That no row could be used, and why if that shows.
fn no_row(misfits: &[Misfit]) -> String {
    let units = |m: &&Misfit| matches!(m, Misfit::Positions { .. } | Misfit::Commands { .. });
    let why = misfits.iter().find(units).map_or_else(String::new, |m| format!(": {m}"));
    format!("no usable row{why}")
}
