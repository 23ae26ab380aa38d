//! Judging and calibrating recordings.

use std::sync::Arc;

use arrow_array::{ArrayRef, BooleanArray};
use data_encoding::HEXLOWER;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use sha2::{Digest, Sha256};

use crate::columns::{ColumnError, Recording};
use crate::table::{Table, numbers};
use crate::{rig, unusable};
use offbd_core::diagnosis::{AxisEvidence, Calibration, CalibrationOrigin, Evidence, Profile};
use offbd_core::engine::{Setup, calibrate_with_prospects};
use offbd_core::vocabulary::{PerAxis, Sample};
use offbd_wire::judging::{JudgedSession, RecordedSession};
use offbd_wire::session_file::RowPlace;
use offbd_wire::verdict::FaultView;
use offbd_wire::{asset, session_csv};

/// Returns the setup of an engine for an asset file and the name of a profile.
fn set_up(asset_file: Option<&str>, profile: Option<&str>) -> PyResult<Setup> {
    let profile = profile.map(str::parse::<Profile>).transpose().map_err(unusable)?;
    Setup::new(rig(asset_file).map_err(unusable)?, profile).map_err(unusable)
}

fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(unusable)
}

/// What is kept of the evidence of each sample, to become a table.
#[derive(Default)]
struct EvidenceRows(Vec<(f64, PerAxis<AxisEvidence>)>);

impl EvidenceRows {
    fn take(&mut self, evidence: &Evidence) {
        if let Some(at) = evidence.at {
            self.0.push((at.seconds(), evidence.axes));
        }
    }

    fn table(&self) -> PyResult<Table> {
        type Quantity = fn(&AxisEvidence) -> Option<f64>;
        const QUANTITIES: [(&str, &str, Quantity); 6] = [
            ("x_measured_m_s2", "y_measured_m_s2", |e| e.measured_m_s2),
            ("x_twin_m_s2", "y_twin_m_s2", |e| e.twin_m_s2),
            ("x_residual_m_s2", "y_residual_m_s2", AxisEvidence::residual_m_s2),
            ("x_limit_m_s2", "y_limit_m_s2", |e| Some(e.limit_m_s2)),
            ("x_nats", "y_nats", |e| Some(e.nats)),
            ("x_path_error_m", "y_path_error_m", |e| e.path_error_m),
        ];
        let mut columns = vec![("t_s", numbers(self.0.iter().map(|(t_s, _)| Some(*t_s))))];
        for (x, y, of) in QUANTITIES {
            columns.push((x, numbers(self.0.iter().map(|(_, axes)| of(&axes.x)))));
            columns.push((y, numbers(self.0.iter().map(|(_, axes)| of(&axes.y)))));
        }
        let enabled = |of: fn(&PerAxis<AxisEvidence>) -> bool| {
            let values = self.0.iter().map(|(_, axes)| Some(of(axes)));
            Arc::new(values.collect::<BooleanArray>()) as ArrayRef
        };
        columns.push(("x_enabled", enabled(|axes| axes.x.enabled)));
        columns.push(("y_enabled", enabled(|axes| axes.y.enabled)));
        Table::new(columns).map_err(unusable)
    }
}

/// The lines of faults, the summary, the rejected rows (row from 1, reason), the number of
/// rows that are kept but not judged, and the evidence.
type Replayed = (String, String, Vec<(u64, String)>, u64, Option<Table>);

/// Judges a recording.
#[pyfunction]
pub(crate) fn replay(
    py: Python<'_>,
    recording: &Bound<'_, PyAny>,
    asset_file: Option<&str>,
    profile: Option<&str>,
    session: String,
    evidence: bool,
) -> PyResult<Replayed> {
    let recording = Recording::of(recording)?;
    let session = RecordedSession::new(set_up(asset_file, profile)?, session);
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
    let mut observe = |evidence: &Evidence| {
        if let Some(rows) = rows.as_deref_mut() {
            rows.take(evidence);
        }
    };
    let mut row = 0;
    recording.for_each(|sample| {
        row += 1;
        session.sample(sample, || RowPlace::Row(row), &mut observe);
    })?;
    session.end(observe).map_err(unusable)
}

/// Judges samples as they come.
#[pyclass(module = "offbd._offbd")]
pub(crate) struct NativeEngine {
    /// `None` after the end of the session.
    session: Option<RecordedSession>,
    n_rows: u64,
}

impl NativeEngine {
    fn session(&mut self) -> PyResult<&mut RecordedSession> {
        self.session.as_mut().ok_or_else(|| PyRuntimeError::new_err("the session has ended"))
    }

    /// Takes the samples of `recording`; returns the lines of the faults that changed.
    fn take(&mut self, recording: Recording) -> PyResult<String> {
        let mut row = self.n_rows;
        let session = self.session()?;
        let n_before = session.faults().len();
        let done: Result<(), ColumnError> = recording.for_each(|sample| {
            row += 1;
            session.sample(sample, || RowPlace::Row(row), |_| {});
        });
        let changed: &[FaultView] = &session.faults()[n_before..];
        let lines = json(&changed)?;
        self.n_rows = row;
        done?;
        Ok(lines)
    }
}

#[pymethods]
impl NativeEngine {
    #[new]
    fn new(asset_file: Option<&str>, profile: Option<&str>, session: String) -> PyResult<Self> {
        let setup = set_up(asset_file, profile)?;
        Ok(Self { session: Some(RecordedSession::new(setup, session)), n_rows: 0 })
    }

    fn add(&mut self, py: Python<'_>, recording: &Bound<'_, PyAny>) -> PyResult<String> {
        let recording = Recording::of(recording)?;
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

    /// Ends the session; returns the lines of all faults and the summary.
    fn end(&mut self) -> PyResult<(String, String)> {
        let session = self.session.take();
        let session = session.ok_or_else(|| PyRuntimeError::new_err("the session has ended"))?;
        let judged = session.end(|_| {}).map_err(unusable)?;
        Ok((json(&judged.faults)?, json(&judged.summary)?))
    }
}

/// Calibrates a rig from healthy recordings; returns its asset file with the calibration.
/// `made_at` is the time of the calibration, RFC 3339.
#[pyfunction]
pub(crate) fn calibrate(
    py: Python<'_>,
    asset_file: &str,
    recordings: Vec<Bound<'_, PyAny>>,
    made_at: String,
) -> PyResult<String> {
    let mut rig = rig(Some(asset_file)).map_err(unusable)?;
    let sessions: PyResult<Vec<Recording>> = recordings.iter().map(Recording::of).collect();
    let sessions = sessions?;
    let calibration = py.detach(|| -> PyResult<Calibration> {
        let sessions = sessions.into_iter().map(Recording::samples);
        let sessions = sessions.collect::<Result<Vec<_>, _>>()?;
        let data_sha256 = data_hash(&sessions).map_err(unusable)?;
        let origin = CalibrationOrigin { data_sha256, made_at };
        let learnt = calibrate_with_prospects(&rig, &sessions).map_err(unusable)?;
        Ok(Calibration { origin, ..learnt })
    })?;
    rig.calibration = Some(Box::new(calibration));
    json(&asset::view(&rig))
}

/// SHA-256 of the session files that `sessions` would be, one after the other. It equals that
/// of `offbd calibrate` for files that offbd has written.
fn data_hash(sessions: &[Vec<Sample>]) -> std::io::Result<String> {
    let mut hash = Sha256::new();
    for session in sessions {
        let mut file = Vec::new();
        session_csv::write(&mut file, session)?;
        hash.update(file);
    }
    Ok(HEXLOWER.encode(&hash.finalize()))
}
