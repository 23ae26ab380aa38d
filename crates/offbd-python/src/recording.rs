//! Recordings that come from Python: tables, and the session files that the program `offbd` reads.
//!
//! A table with the columns of a session is read column by column. Any other one, whose columns
//! have other names or units, or that lacks an axis or the time, is read as the Arrow stream that
//! it would be in a file.

use std::fmt;
use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use arrow_array::ffi_stream::RecordBatchStreamReader;
use arrow_array::{RecordBatch, RecordBatchReader};
use arrow_ipc::writer::StreamWriter;
use arrow_schema::{ArrowError, Schema};
use pyo3::exceptions::{PyTypeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyMapping, PyString};
use sha2::{Digest, Sha256};

use crate::columns::{ColumnError, SampleColumns, batch_of_mapping, record_batch, stream};
use crate::table::Table;
use crate::{rig, unusable};
use offbd_core::vocabulary::Sample;
use offbd_wire::session_csv::{self, COLUMNS};
use offbd_wire::session_file::{
    self, RejectedRow, RowPlace, SessionFileError, SessionFormat, SessionRowError, SessionRows,
};
use offbd_wire::table::{RATES_HZ, TableOptions};

/// A recording: a file or what is read as one, or a table in batches.
pub(crate) enum Recording {
    File(Box<SessionFile>),
    Stream(RecordBatchStreamReader),
    Whole(Box<SampleColumns>),
}

/// A session file, and how it is read.
pub(crate) struct SessionFile {
    source: Source,
    options: TableOptions,
}

/// Where the bytes of a session file are.
#[derive(Clone, Debug)]
pub(crate) enum Source {
    Path(PathBuf),
    /// A table, as an Arrow stream.
    Table(Arc<[u8]>),
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Path(path) => path.display().fmt(f),
            Self::Table(_) => f.write_str("the recording"),
        }
    }
}

/// Rows of a record batch in the Arrow stream of a table: a reader takes a batch at a time into memory.
const BATCH_ROWS: usize = 1 << 16;

/// Why a recording cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RecordingError {
    #[error(transparent)]
    Columns(#[from] ColumnError),
    #[error("{file}: {error}")]
    Unreadable { file: Source, error: io::Error },
    #[error("{file}: {error}")]
    NotSession { file: Source, error: SessionFileError },
    #[error(
        "{file}: the clock starts again at {place}, so there are several runs; \
         `offbd.read` returns a table for each"
    )]
    SeveralRuns { file: Source, place: RowPlace },
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
    /// Takes a recording from Python. `options` say how a file, and a table with other columns than
    /// those of a session, is read.
    pub(crate) fn of(source: &Bound<'_, PyAny>, options: &TableOptions) -> PyResult<Self> {
        if source.is_instance_of::<PyString>() || source.hasattr("__fspath__")? {
            return Ok(Self::file(Source::Path(source.extract()?), options));
        }
        if source.hasattr("__arrow_c_stream__")? {
            let batches = stream(source)?;
            if is_session(&batches.schema(), options) {
                return Ok(Self::Stream(batches));
            }
            return Self::table(&batches.schema(), batches, options);
        }
        let batch = if source.hasattr("__arrow_c_array__")? {
            record_batch(source)?
        } else if let Ok(columns) = source.cast::<PyMapping>() {
            batch_of_mapping(columns)?
        } else {
            return Err(PyTypeError::new_err(format!(
                "a recording is the path of a session file, a table with `__arrow_c_stream__` or \
                 `__arrow_c_array__`, or a mapping from names to columns, not {}",
                source.get_type().name()?
            )));
        };
        if is_session(batch.schema_ref(), options) {
            return Ok(Self::Whole(Box::new(SampleColumns::of_batch(&batch)?)));
        }
        Self::table(&batch.schema(), [Ok(batch)], options)
    }

    fn file(source: Source, options: &TableOptions) -> Self {
        Self::File(Box::new(SessionFile { source, options: options.clone() }))
    }

    /// Takes a table whose columns are found by `options`.
    fn table(
        schema: &Schema,
        batches: impl IntoIterator<Item = Result<RecordBatch, ArrowError>>,
        options: &TableOptions,
    ) -> PyResult<Self> {
        let written = || -> Result<Vec<u8>, ArrowError> {
            let mut writer = StreamWriter::try_new(Vec::new(), schema)?;
            for batch in batches {
                let batch = batch?;
                for start in (0..batch.num_rows()).step_by(BATCH_ROWS) {
                    let n = BATCH_ROWS.min(batch.num_rows() - start);
                    writer.write(&batch.slice(start, n))?;
                }
            }
            writer.into_inner()
        };
        let bytes = written().map_err(ColumnError::from)?;
        Ok(Self::file(Source::Table(bytes.into()), options))
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
                    _ => Err(RecordingError::SeveralRuns { file: file.source.clone(), place }),
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
        let mut runs = Runs { file: None, samples: vec![Vec::new()], rejected: Vec::new() };
        match self {
            Self::File(file) => {
                file.for_each(|n_run, _, row| {
                    runs.samples.resize_with(n_run, Vec::new);
                    runs.push(row);
                    Ok(())
                })?;
                runs.file = Some(file.source);
            }
            table => table.for_each(0, |_, row| runs.push(row))?,
        }
        Ok(runs)
    }

    /// The name of the session: that of the file, or else `session`.
    pub(crate) fn name(&self) -> String {
        let Self::File(file) = self else { return "session".to_owned() };
        let Source::Path(path) = &file.source else { return "session".to_owned() };
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
        let opened = match &self.source {
            Source::Path(path) => {
                let file = File::open(path).map_err(|error| self.error(error.into()))?;
                session_file::open(file, None, &self.options)
            }
            Source::Table(bytes) => {
                let stream = io::Cursor::new(Arc::clone(bytes));
                session_file::open(stream, Some(SessionFormat::Arrow), &self.options)
            }
        };
        opened.map_err(|error| self.error(error))
    }

    fn error(&self, error: SessionFileError) -> RecordingError {
        let file = self.source.clone();
        match error {
            SessionFileError::Io(error) => RecordingError::Unreadable { file, error },
            error => RecordingError::NotSession { file, error },
        }
    }
}

/// Whether a table is a session as it is: it has all columns, and nothing says that they are others.
fn is_session(schema: &Schema, options: &TableOptions) -> bool {
    let has_all = COLUMNS.iter().all(|name| schema.column_with_name(name).is_some());
    has_all && options.columns.is_empty() && options.of_rig.is_empty()
}

/// The runs of a recording: in a text, a clock that starts again begins another one.
pub(crate) struct Runs {
    /// The file, or what was read as one; `None` for another table.
    file: Option<Source>,
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
        let bytes = match &self.file {
            Some(file @ Source::Path(path)) => std::fs::read(path)
                .map_err(|error| RecordingError::Unreadable { file: file.clone(), error })?,
            Some(Source::Table(_)) | None => self.csv(),
        };
        hash.update(bytes);
        Ok(())
    }

    fn csv(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for run in &self.samples {
            // Memory can always be written to.
            let _ = session_csv::write(&mut bytes, run);
        }
        bytes
    }

    /// Warns in Python if rows of the file were rejected.
    pub(crate) fn warn(&self, py: Python<'_>) -> PyResult<()> {
        let (Some(file), Some(first)) = (&self.file, self.rejected.first()) else { return Ok(()) };
        let n = self.rejected.len();
        let text = format!("{file}: {n} rows rejected, the first: {first}");
        let text = std::ffi::CString::new(text).map_err(unusable)?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 2)
    }
}

/// Reads a session file or a table; returns the table of each run. `asset_file` may say which columns
/// are which quantities.
#[pyfunction]
pub(crate) fn read(
    py: Python<'_>,
    recording: &Bound<'_, PyAny>,
    asset_file: Option<&str>,
    columns: Option<&str>,
    rate_hz: Option<f64>,
) -> PyResult<Vec<Table>> {
    let rig = rig(asset_file).map_err(unusable)?;
    let options = options(columns, rate_hz)?.of_rig(rig.columns.as_deref());
    let recording = Recording::of(recording, &options)?;
    let runs = py.detach(|| recording.runs())?;
    runs.warn(py)?;
    let with_seq = |run: &[Sample]| run.iter().any(|sample| sample.seq.is_some());
    let tables = runs.samples.iter().map(|run| Table::of_samples(run, with_seq(run)));
    tables.collect::<Result<_, _>>().map_err(unusable)
}
