//! Judging and calibrating recordings.

use std::sync::Arc;

use arrow_array::BooleanArray;
use data_encoding::HEXLOWER;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::recording::{Recording, RecordingError, Runs, options};
use crate::table::{Table, numbers};
use crate::{rig, unusable};
use offbd_core::diagnosis::{AxisEvidence, Calibration, CalibrationOrigin, Evidence, Profile};
use offbd_core::engine::{JUDGEMENT, Rig, SNAPSHOT_FORMAT, Setup, State, calibrate_with_prospects};
use offbd_core::vocabulary::{Axis, PerAxis, Sample};
use offbd_wire::asset;
use offbd_wire::judging::{JudgedSession, RecordedSession};
use offbd_wire::session_file::{RejectedRow, RowPlace};
use offbd_wire::table::TableOptions;
use offbd_wire::verdict::FaultView;

/// Returns the setup of an engine for an asset file and the name of a profile.
fn set_up(asset_file: Option<&str>, profile: Option<&str>) -> PyResult<Setup> {
    let profile = profile.map(str::parse::<Profile>).transpose().map_err(unusable)?;
    Setup::new(rig(asset_file).map_err(unusable)?, profile).map_err(unusable)
}

fn json(value: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(unusable)
}

/// What is kept of the evidence of each sample, to become a table.
#[derive(Default)]
struct EvidenceRows(Vec<EvidenceRow>);

struct EvidenceRow {
    t_s: f64,
    axes: PerAxis<AxisEvidence>,
    /// `None` if a later sample was judged at once.
    twin_position_m: Option<PerAxis<f64>>,
}

impl EvidenceRows {
    fn take(&mut self, evidence: &Evidence) {
        if let Some(at) = evidence.at {
            let (t_s, axes) = (at.seconds(), evidence.axes);
            self.0.push(EvidenceRow { t_s, axes, twin_position_m: None });
        }
    }

    /// Notes the position of the twin at the last judged sample.
    fn note_twin(&mut self, state: &State) {
        let at_s = state.at.map(|at| at.seconds());
        if let Some(row) = self.0.last_mut().filter(|row| Some(row.t_s) == at_s) {
            row.twin_position_m = Some(state.twin_position_m);
        }
    }

    fn table(&self) -> PyResult<Table> {
        type Quantity = fn(&AxisEvidence) -> Option<f64>;
        const QUANTITIES: [(&str, &str, Quantity); 7] = [
            ("x_position_m", "y_position_m", |e| e.position_m),
            ("x_measured_m_s2", "y_measured_m_s2", |e| e.measured_m_s2),
            ("x_twin_m_s2", "y_twin_m_s2", |e| e.twin_m_s2),
            ("x_residual_m_s2", "y_residual_m_s2", AxisEvidence::residual_m_s2),
            ("x_limit_m_s2", "y_limit_m_s2", |e| Some(e.limit_m_s2)),
            ("x_nats", "y_nats", |e| Some(e.nats)),
            ("x_path_nats", "y_path_nats", |e| e.path_nats),
        ];
        let rows = || self.0.iter();
        let mut columns = vec![("t_s", numbers(rows().map(|row| Some(row.t_s))))];
        for (x, y, of) in QUANTITIES {
            columns.push((x, numbers(rows().map(|row| of(&row.axes.x)))));
            columns.push((y, numbers(rows().map(|row| of(&row.axes.y)))));
        }
        let names = ["x_twin_position_m", "y_twin_position_m"];
        for (name, axis) in names.into_iter().zip(Axis::ALL) {
            let at = |row: &EvidenceRow| row.twin_position_m.map(|position| position[axis]);
            columns.push((name, numbers(rows().map(at))));
        }
        for (name, axis) in ["x_enabled", "y_enabled"].into_iter().zip(Axis::ALL) {
            let enabled: BooleanArray = rows().map(|row| Some(row.axes[axis].enabled)).collect();
            columns.push((name, Arc::new(enabled)));
        }
        Table::new(columns).map_err(unusable)
    }
}

/// The lines of faults, the summary, the rejected rows (row from 1, reason), the number of
/// rows that are kept but not judged, and the evidence.
type Replayed = (String, String, Vec<(u64, String)>, u64, Option<Table>);

/// Judges a recording. `session` is its name; without it, that of the file.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
pub(crate) fn replay(
    py: Python<'_>,
    recording: &Bound<'_, PyAny>,
    asset_file: Option<&str>,
    profile: Option<&str>,
    session: Option<String>,
    evidence: bool,
    columns: Option<&str>,
    rate_hz: Option<f64>,
) -> PyResult<Replayed> {
    let setup = set_up(asset_file, profile)?;
    let options = options(columns, rate_hz)?.of_rig(setup.rig.columns.as_deref());
    let recording = Recording::of(recording, &options)?;
    let session = RecordedSession::new(setup, session.unwrap_or_else(|| recording.name()));
    let mut rows = evidence.then(EvidenceRows::default);
    let judged = py.detach(|| judge(session, recording, rows.as_mut()))?;
    let number = |place| match place {
        RowPlace::Line(n) | RowPlace::Row(n) => n,
    };
    let rejected = judged.bad_rows.into_iter();
    let bad_rows = rejected.map(|row| (number(row.place), row.reason)).collect();
    let table = rows.map(|rows| rows.table()).transpose()?;
    Ok((json(&judged.faults)?, json(&judged.summary)?, bad_rows, judged.n_set_aside, table))
}

fn judge(
    mut session: RecordedSession,
    recording: Recording,
    mut rows: Option<&mut EvidenceRows>,
) -> PyResult<JudgedSession> {
    let observe = |rows: &mut Option<&mut EvidenceRows>, evidence: &Evidence| {
        if let Some(rows) = rows {
            rows.take(evidence);
        }
    };
    recording.for_each(0, |place, row| {
        take(&mut session, place, row, |evidence| observe(&mut rows, evidence));
        if let Some(rows) = &mut rows {
            rows.note_twin(&session.state());
        }
    })?;
    session.end(|evidence| observe(&mut rows, evidence)).map_err(unusable)
}

/// Gives a row to `session`.
fn take(
    session: &mut RecordedSession,
    place: RowPlace,
    row: Result<Sample, RejectedRow>,
    observe: impl FnMut(&Evidence),
) {
    match row {
        Ok(sample) => session.sample(sample, || place, observe),
        Err(row) => session.reject(row),
    }
}

/// The version of the state of an engine; others cannot be read, or would be continued
/// differently.
fn state_version() -> String {
    format!("{JUDGEMENT}.{SNAPSHOT_FORMAT}, offbd {}", env!("CARGO_PKG_VERSION"))
}

/// Judges samples as they come.
#[derive(Serialize, Deserialize)]
#[pyclass(module = "offbd._offbd")]
pub(crate) struct NativeEngine {
    /// `None` after the end of the session.
    session: Option<RecordedSession>,
    /// The columns of the rig's files.
    columns: Option<String>,
    n_rows: u64,
}

impl NativeEngine {
    fn session(&mut self) -> PyResult<&mut RecordedSession> {
        self.session.as_mut().ok_or_else(|| PyRuntimeError::new_err("the session has ended"))
    }

    /// Takes the samples of `recording`; returns the lines of the faults that changed.
    fn take(&mut self, recording: Recording) -> PyResult<String> {
        let mut n_rows = self.n_rows;
        let session = self.session()?;
        let n_before = session.faults().len();
        let done: Result<(), RecordingError> = recording.for_each(n_rows, |place, row| {
            n_rows += 1;
            take(session, place, row, |_| {});
        });
        let changed: &[FaultView] = &session.faults()[n_before..];
        let lines = json(&changed)?;
        self.n_rows = n_rows;
        done?;
        Ok(lines)
    }
}

#[pymethods]
impl NativeEngine {
    #[new]
    fn new(asset_file: Option<&str>, profile: Option<&str>, session: String) -> PyResult<Self> {
        let setup = set_up(asset_file, profile)?;
        let columns = setup.rig.columns.as_deref().map(str::to_owned);
        Ok(Self { session: Some(RecordedSession::new(setup, session)), columns, n_rows: 0 })
    }

    fn add(&mut self, py: Python<'_>, recording: &Bound<'_, PyAny>) -> PyResult<String> {
        let options = TableOptions::default().of_rig(self.columns.as_deref());
        let recording = Recording::of(recording, &options)?;
        py.detach(|| self.take(recording))
    }

    fn add_sample(
        &mut self,
        t_s: f64,
        commands: (Option<f64>, Option<f64>),
        position: (Option<f64>, Option<f64>),
        seq: Option<u64>,
    ) -> PyResult<String> {
        let ((cmd_qx_rad, cmd_qy_rad), (x_m, y_m)) = (commands, position);
        let sample = Sample { seq, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m };
        let row = self.n_rows + 1;
        let session = self.session()?;
        let n_before = session.faults().len();
        session.sample(sample, || RowPlace::Row(row), |_| {});
        let lines = json(&&session.faults()[n_before..])?;
        self.n_rows = row;
        Ok(lines)
    }

    fn summary(&mut self) -> PyResult<String> {
        json(&self.session()?.summary())
    }

    /// The whole state, to the bit, and its version.
    fn state(&self) -> PyResult<(String, Vec<u8>)> {
        Ok((state_version(), rmp_serde::to_vec(self).map_err(unusable)?))
    }

    /// The engine with a state that [`state`](Self::state) has returned.
    #[staticmethod]
    fn of_state(version: &str, state: &[u8]) -> PyResult<Self> {
        let own = state_version();
        if version != own {
            let reason = format!("the engine was pickled by version {version}; this is {own}");
            return Err(unusable(reason));
        }
        rmp_serde::from_slice(state).map_err(unusable)
    }

    /// Ends the session; returns the lines of all faults and the summary.
    fn end(&mut self) -> PyResult<(String, String)> {
        let session = self.session.take();
        let session = session.ok_or_else(|| PyRuntimeError::new_err("the session has ended"))?;
        let judged = session.end(|_| {}).map_err(unusable)?;
        Ok((json(&judged.faults)?, json(&judged.summary)?))
    }
}

/// Calibrates a rig from healthy recordings; each run in a file counts as a session. Returns the
/// asset file of the rig with the calibration. `made_at` is the time of the calibration, RFC 3339.
#[pyfunction]
pub(crate) fn calibrate(
    py: Python<'_>,
    asset_file: &str,
    recordings: Vec<Bound<'_, PyAny>>,
    made_at: String,
    columns: Option<&str>,
    rate_hz: Option<f64>,
) -> PyResult<String> {
    let mut rig = rig(Some(asset_file)).map_err(unusable)?;
    let options = options(columns, rate_hz)?.of_rig(rig.columns.as_deref());
    let recordings = recordings.iter().map(|source| Recording::of(source, &options));
    let recordings = recordings.collect::<PyResult<Vec<_>>>()?;
    let runs =
        py.detach(|| recordings.into_iter().map(Recording::runs).collect::<Result<Vec<_>, _>>())?;
    runs.iter().try_for_each(|runs| runs.warn(py))?;
    let calibration = py.detach(|| learn(&rig, runs, made_at))?;
    rig.calibration = Some(Box::new(calibration));
    json(&asset::view(&rig))
}

/// Learns a rig. The hash of the data equals that of `offbd calibrate` for the same files, and
/// for tables of files that offbd has written.
fn learn(rig: &Rig, recordings: Vec<Runs>, made_at: String) -> PyResult<Calibration> {
    let mut hash = Sha256::new();
    recordings.iter().try_for_each(|runs| runs.add_to_hash(&mut hash))?;
    let data_sha256 = HEXLOWER.encode(&hash.finalize());
    let origin = CalibrationOrigin { data_sha256, made_at };
    let sessions: Vec<_> = recordings.into_iter().flat_map(|runs| runs.samples).collect();
    let learnt = calibrate_with_prospects(rig, &sessions).map_err(unusable)?;
    Ok(Calibration { origin, ..learnt })
}
