//! Recordings that come from Python: tables, and the session files that the program `offbd` reads.

use std::fs::File;
use std::io;
use std::path::PathBuf;

use arrow_array::ffi_stream::RecordBatchStreamReader;
use arrow_schema::ArrowError;
use pyo3::exceptions::{PyTypeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyMapping, PyString};
use sha2::{Digest, Sha256};

use crate::columns::{ColumnError, SampleColumns, record_batch, stream};
use crate::table::Table;
use crate::{rig, unusable};
use offbd_core::vocabulary::Sample;
use offbd_wire::session_csv;
use offbd_wire::session_file::{
    self, RejectedRow, RowPlace, SessionFileError, SessionRowError, SessionRows,
};
use offbd_wire::table::{RATES_HZ, TableOptions};

/// A recording: a file, or a table in batches.
pub(crate) enum Recording {
    File(Box<SessionFile>),
    Stream(RecordBatchStreamReader),
    Whole(Box<SampleColumns>),
}

/// A session file, and how it is read.
pub(crate) struct SessionFile {
    path: PathBuf,
    options: TableOptions,
}

/// Why a recording cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RecordingError {
    #[error(transparent)]
    Columns(#[from] ColumnError),
    #[error("{}: {error}", path.display())]
    Unreadable { path: PathBuf, error: io::Error },
    #[error("{}: {error}", path.display())]
    NotSession { path: PathBuf, error: SessionFileError },
    #[error(
        "{}: the clock starts again at {place}, so the file has several runs; \
         `offbd.read` returns a table for each", path.display()
    )]
    SeveralRuns { path: PathBuf, place: RowPlace },
}

impl From<ArrowError> for RecordingError {
    fn from(error: ArrowError) -> Self {
        Self::Columns(error.into())
    }
}

impl From<RecordingError> for PyErr {
    fn from(error: RecordingError) -> Self {
        match &error {
            // Python has an exception for each kind.
            RecordingError::Unreadable { error: cause, .. } => {
                io::Error::new(cause.kind(), error.to_string()).into()
            }
            _ => PyValueError::new_err(error.to_string()),
        }
    }
}

/// Returns the options for session files: the mapping `columns`, and the rows a second of a text
/// without a time.
pub(crate) fn options(columns: Option<&str>, rate_hz: Option<f64>) -> PyResult<TableOptions> {
    let columns = columns.map(str::parse).transpose().map_err(unusable)?.unwrap_or_default();
    if rate_hz.is_some_and(|rate| !RATES_HZ.contains(&rate)) {
        let (least, most) = (RATES_HZ.start(), RATES_HZ.end());
        return Err(unusable(format!("rate_hz: expected a number from {least} to {most}")));
    }
    Ok(TableOptions { columns, rate_hz, ..TableOptions::default() })
}

impl Recording {
    /// Takes a recording from Python. `options` say how a file is read.
    pub(crate) fn of(source: &Bound<'_, PyAny>, options: &TableOptions) -> PyResult<Self> {
        if source.is_instance_of::<PyString>() || source.hasattr("__fspath__")? {
            let file = SessionFile { path: source.extract()?, options: options.clone() };
            return Ok(Self::File(Box::new(file)));
        }
        if source.hasattr("__arrow_c_stream__")? {
            return Ok(Self::Stream(stream(source)?));
        }
        if source.hasattr("__arrow_c_array__")? {
            return Ok(Self::Whole(Box::new(SampleColumns::of_batch(&record_batch(source)?)?)));
        }
        if let Ok(columns) = source.cast::<PyMapping>() {
            return Ok(Self::Whole(Box::new(SampleColumns::of_mapping(columns)?)));
        }
        Err(PyTypeError::new_err(format!(
            "a recording is the path of a session file, a table with `__arrow_c_stream__` or \
             `__arrow_c_array__`, or a mapping from names to columns, not {}",
            source.get_type().name()?
        )))
    }

    /// Calls `take` with each row of a single session, in order: a sample or a rejected row, and
    /// its place, counted from the `n_before` rows before.
    ///
    /// # Errors
    /// [`RecordingError`]; what came before it has been taken.
    pub(crate) fn for_each(
        self,
        n_before: u64,
        mut take: impl FnMut(RowPlace, Result<Sample, RejectedRow>),
    ) -> Result<(), RecordingError> {
        let mut n_rows = n_before;
        let mut sample = |sample| {
            n_rows += 1;
            take(RowPlace::Row(n_rows), Ok(sample));
        };
        match self {
            Self::Whole(columns) => columns.for_each(&mut sample),
            Self::Stream(batches) => {
                for batch in batches {
                    SampleColumns::of_batch(&batch?)?.for_each(&mut sample);
                }
            }
            Self::File(file) => {
                return file.for_each(|n_run, place, row| match n_run {
                    1 => {
                        take(place, row);
                        Ok(())
                    }
                    _ => Err(RecordingError::SeveralRuns { path: file.path.clone(), place }),
                });
            }
        }
        Ok(())
    }

    /// Returns the samples of each run, and the rejected rows. A table is one run.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub(crate) fn runs(self) -> Result<Runs, RecordingError> {
        let mut runs = Runs { path: None, samples: vec![Vec::new()], rejected: Vec::new() };
        match self {
            Self::File(file) => {
                file.for_each(|n_run, _, row| {
                    runs.samples.resize_with(n_run, Vec::new);
                    runs.push(row);
                    Ok(())
                })?;
                runs.path = Some(file.path);
            }
            table => table.for_each(0, |_, row| runs.push(row))?,
        }
        Ok(runs)
    }

    /// The name of the session: that of the file, or else `session`.
    pub(crate) fn name(&self) -> String {
        let Self::File(file) = self else { return "session".to_owned() };
        let path = &file.path;
        path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
    }
}

impl SessionFile {
    /// Calls `take` with each row: the number of its run from 1, its place, and a sample or a
    /// rejected row.
    fn for_each(
        &self,
        mut take: impl FnMut(usize, RowPlace, Result<Sample, RejectedRow>) -> Result<(), RecordingError>,
    ) -> Result<(), RecordingError> {
        let mut rows = self.open()?;
        while let Some(row) = rows.next() {
            let row = match row {
                Ok(sample) => Ok(sample),
                Err(SessionRowError::Rejected(row)) => Err(row),
                Err(SessionRowError::Unreadable(error)) => return Err(self.error(error)),
            };
            take(rows.n_runs(), rows.place(), row)?;
        }
        Ok(())
    }

    fn open(&self) -> Result<Box<dyn SessionRows>, RecordingError> {
        let file = File::open(&self.path).map_err(|error| self.error(error.into()))?;
        session_file::open(file, None, &self.options).map_err(|error| self.error(error))
    }

    fn error(&self, error: SessionFileError) -> RecordingError {
        let path = self.path.clone();
        match error {
            SessionFileError::Io(error) => RecordingError::Unreadable { path, error },
            error => RecordingError::NotSession { path, error },
        }
    }
}

/// The runs of a recording: in a text, a clock that starts again begins another one.
pub(crate) struct Runs {
    /// The file; `None` for a table.
    path: Option<PathBuf>,
    /// The samples of each run; there is at least one.
    pub(crate) samples: Vec<Vec<Sample>>,
    rejected: Vec<RejectedRow>,
}

impl Runs {
    fn push(&mut self, row: Result<Sample, RejectedRow>) {
        match row {
            Ok(sample) => self.samples.last_mut().into_iter().for_each(|run| run.push(sample)),
            Err(row) => self.rejected.push(row),
        }
    }

    /// Adds the bytes of the file to `hash`; of a table those of the CSV file that it would be.
    pub(crate) fn add_to_hash(&self, hash: &mut Sha256) -> Result<(), RecordingError> {
        let bytes = match &self.path {
            Some(path) => std::fs::read(path),
            None => self.csv(),
        };
        let path = self.path.clone().unwrap_or_default();
        hash.update(bytes.map_err(|error| RecordingError::Unreadable { path, error })?);
        Ok(())
    }

    fn csv(&self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.samples.iter().try_for_each(|run| session_csv::write(&mut bytes, run))?;
        Ok(bytes)
    }

    /// Warns in Python if rows of the file were rejected.
    pub(crate) fn warn(&self, py: Python<'_>) -> PyResult<()> {
        let (Some(path), Some(first)) = (&self.path, self.rejected.first()) else { return Ok(()) };
        let (n, path) = (self.rejected.len(), path.display());
        let text = format!("{path}: {n} rows rejected, the first: {first}");
        let text = std::ffi::CString::new(text).map_err(unusable)?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 2)
    }
}

/// Reads a session file; returns the table of each run. `asset_file` may say which columns are
/// which quantities.
#[pyfunction]
pub(crate) fn read(
    py: Python<'_>,
    path: PathBuf,
    asset_file: Option<&str>,
    columns: Option<&str>,
    rate_hz: Option<f64>,
) -> PyResult<Vec<Table>> {
    let rig = rig(asset_file).map_err(unusable)?;
    let options = options(columns, rate_hz)?.of_rig(rig.columns.as_deref());
    let runs = py.detach(|| Recording::File(Box::new(SessionFile { path, options })).runs())?;
    runs.warn(py)?;
    let with_seq = |run: &[Sample]| run.iter().any(|sample| sample.seq.is_some());
    let tables = runs.samples.iter().map(|run| Table::of_samples(run, with_seq(run)));
    tables.collect::<Result<_, _>>().map_err(unusable)
}
