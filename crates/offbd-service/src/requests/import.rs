//! Imports a recording as a session. Its samples are processed like live telemetry.

use std::collections::VecDeque;
use std::io::{self, Read, Seek, SeekFrom};

use tokio_util::sync::CancellationToken;

use crate::PendingBatch;
use crate::asset::AssetCommand;
use crate::{Service, ServiceError};
use offbd_core::vocabulary::Sample;
use offbd_wire::inspection::{self, InspectionView};
use offbd_wire::judging::run_name;
use offbd_wire::service::{ImportView, SessionView};
use offbd_wire::session_file::{
    self, JoinedRows, SessionFileError, SessionFormat, SessionRowError, SessionRows,
};
use offbd_wire::table::TableOptions;
use offbd_wire::telemetry::{AckView, Batch, BatchError, RowView, file_row};

/// Batches of an import that wait for their acknowledgement at a time.
const MAX_PENDING: usize = 4;

/// Limit of rejected rows in the result; further ones are only counted.
const MAX_LISTED: usize = 100;

/// Samples in one batch of an import.
const BATCH: usize = 2048;

/// Rejected rows that are kept until the first valid one is found. Chosen: more would take memory, and
/// a file that begins with so many is seldom a recording.
const MAX_EARLY: usize = 10_000;

const STOPPED: ServiceError = ServiceError::Unavailable { what: "the service is shutting down" };

impl Service {
    /// Imports `files` of at most `limit` rows as the session `name` and ends it. Several files are
    /// one recording, in the order of their times, and must not overlap; one file whose clock starts
    /// again becomes several sessions, `name`, `name#2` and so on.
    /// Waits until few enough other files are read, then reads it on a blocking thread. The
    /// asset's open session is ended when the file has been opened; from then until the import
    /// is complete, live telemetry of the asset is refused with [`ServiceError::Busy`]. An import
    /// that fails, or whose caller is dropped, leaves neither a session nor faults, but for faults
    /// of earlier runs of the file, which have ended; one that a
    /// stop interrupts is discarded, at the latest at the next start.
    ///
    /// # Errors
    /// [`ServiceError::SessionExists`]; [`ServiceError::Invalid`] for an invalid name;
    /// [`ServiceError::TooMany`] if there are more rows; [`ServiceError::Batch`] if the file
    /// cannot be read to its end, or has no valid row; [`ServiceError::Unavailable`] if the
    /// service stops; those of the samples' batches.
    pub async fn import<S: Read + Seek + Send + 'static>(
        &self,
        asset: &str,
        name: Option<String>,
        files: Vec<ImportFile<S>>,
        options: TableOptions,
        limit: usize,
    ) -> Result<ImportView, ServiceError> {
        let stop = self.inner.handles.closing.child_token();
        let _stop_if_dropped = stop.clone().drop_guard();
        let permit = self.inner.computing.imports.clone().acquire_owned();
        let permit = stop.run_until_cancelled(permit).await.and_then(Result::ok).ok_or(STOPPED)?;
        let import = Import { service: self.clone(), asset: asset.to_owned(), limit, stop };
        let task = tokio::task::spawn_blocking(move || {
            let imported = import.run(name, files, &options);
            drop(permit);
            imported
        });
        task.await.unwrap_or(Err(ServiceError::Unavailable { what: "the import failed" }))
    }

    /// Returns what a recording holds, and how its columns would be read; nothing is imported.
    ///
    /// # Errors
    /// [`ServiceError::Batch`] if the file cannot be read; [`ServiceError::Unavailable`] if the
    /// service stops.
    pub async fn inspect<S: Read + Seek + Send + 'static>(
        &self,
        source: S,
        options: TableOptions,
    ) -> Result<InspectionView, ServiceError> {
        let stop = self.inner.handles.closing.child_token();
        let _stop_if_dropped = stop.clone().drop_guard();
        let permit = self.inner.computing.imports.clone().acquire_owned();
        let permit = stop.run_until_cancelled(permit).await.and_then(Result::ok).ok_or(STOPPED)?;
        let source = StoppableSource { source, stop };
        let task = tokio::task::spawn_blocking(move || {
            let inspected = inspection::inspect(source, &options);
            drop(permit);
            inspected.map_err(|error| unreadable(&error))
        });
        task.await.unwrap_or(Err(ServiceError::Unavailable { what: "the inspection failed" }))
    }

    async fn discard_import(&self, asset: &str, id: String) -> Result<(), ServiceError> {
        let session = id.clone();
        let discard = |reply| AssetCommand::DiscardImport { session, reply };
        self.inner.shards.call(asset, discard).await?;
        self.inner.deleter.session(&id).await
    }
}

/// A file that is imported.
pub struct ImportFile<S> {
    /// Its name, in errors of several files.
    pub name: String,
    pub source: S,
    /// Its format; its first bytes say it if `None`.
    pub format: Option<SessionFormat>,
}

/// An import on its blocking thread.
struct Import {
    service: Service,
    asset: String,
    limit: usize,
    /// Cancelled if the caller is dropped or the service stops.
    stop: CancellationToken,
}

impl Import {
    fn run(
        self,
        name: Option<String>,
        files: Vec<ImportFile<impl Read + Seek + Send + 'static>>,
        options: &TableOptions,
    ) -> Result<ImportView, ServiceError> {
        let is_joined = files.len() > 1;
        let open = |ImportFile { name: file, source, format }| {
            let source = StoppableSource { source, stop: self.stop.clone() };
            match session_file::open(source, format, options) {
                Ok(rows) => Ok((file, rows)),
                Err(error) if is_joined => {
                    Err(SessionFileError::Part { file, reason: error.to_string() })
                }
                Err(error) => Err(error),
            }
        };
        let opened = files.into_iter().map(open).collect::<Result<Vec<_>, _>>();
        let mut opened = opened.map_err(|error| self.unreadable(&error))?;
        let rows = match opened.pop() {
            Some((_, rows)) if !is_joined => rows,
            last => {
                opened.extend(last);
                Box::new(JoinedRows::new(opened))
            }
        };
        let runtime = self.service.inner.handles.runtime.clone();
        runtime.block_on(self.import(name, RunRows::new(rows)))
    }

    /// Imports each run as a session.
    async fn import(
        &self,
        name: Option<String>,
        mut rows: RunRows,
    ) -> Result<ImportView, ServiceError> {
        let Self { service, asset, stop, .. } = self;
        // A file without a sample does not end the open session.
        rows.find_sample().map_err(|error| match error {
            NoSample::Unreadable(error) => self.unreadable(&error),
            NoSample::Rejected(reason) => no_usable_row(reason.as_deref()),
        })?;
        let first = service.open_for(asset, name, true).await?;
        let name = first.name.clone();
        let mut sessions = vec![first];
        let mut counts = ImportCounts::default();
        let imported = async {
            loop {
                let n_run = sessions.len();
                let session = &mut sessions[n_run - 1];
                self.samples(&mut counts, &session.name, n_run, &mut rows).await?;
                *session = service.end_session(&session.id).await?;
                if rows.run() <= n_run {
                    return Ok(());
                }
                let name = run_name(&name, n_run + 1);
                sessions.push(service.open_for(asset, Some(name), true).await?);
            }
        };
        let imported = match stop.run_until_cancelled(imported).await {
            Some(Ok(())) if !stop.is_cancelled() && counts.accepted == 0 => {
                Err(no_usable_row(counts.rejections.first().map(|row| row.reason.as_str())))
            }
            Some(imported) if !stop.is_cancelled() => imported,
            _ => Err(STOPPED),
        };
        if let Err(error) = imported {
            for session in sessions {
                service.discard_import(asset, session.id).await?;
            }
            return Err(error);
        }
        Ok(counts.view(sessions))
    }

    /// Submits the samples of a run.
    async fn samples(
        &self,
        counts: &mut ImportCounts,
        session: &str,
        n_run: usize,
        rows: &mut RunRows,
    ) -> Result<(), ServiceError> {
        let Self { service, asset, limit, .. } = self;
        loop {
            let batch = std::iter::from_fn(|| rows.next_of(n_run)).take(BATCH);
            let batch =
                batch.map(|row| self.batch_row(row)).collect::<Result<Vec<_>, ServiceError>>()?;
            if batch.is_empty() {
                break;
            }
            let first = counts.n_rows;
            counts.n_rows += batch.len();
            if counts.n_rows > *limit {
                let what = "rows in an imported file";
                return Err(ServiceError::TooMany { what, limit: *limit });
            }
            let batch =
                Batch { session: Some(session.to_owned()), rows: batch, ..Batch::default() };
            if counts.pending.len() >= MAX_PENDING {
                counts.settle().await?;
            }
            counts.pending.push_back((first, service.submit_when_ready(asset, batch, true).await?));
        }
        while !counts.pending.is_empty() {
            counts.settle().await?;
        }
        Ok(())
    }

    /// Returns a row of a file as one of a batch; an error if the file cannot be read any further.
    fn batch_row(
        &self,
        row: Result<Sample, SessionRowError>,
    ) -> Result<Result<Sample, String>, ServiceError> {
        match row {
            Err(SessionRowError::Unreadable(error)) => Err(self.unreadable(&error)),
            Err(SessionRowError::Rejected(row)) => Ok(file_row(Err(row.to_string()))),
            Ok(sample) => Ok(file_row(Ok(sample))),
        }
    }

    fn unreadable(&self, error: &SessionFileError) -> ServiceError {
        if self.stop.is_cancelled() {
            return STOPPED;
        }
        unreadable(error)
    }
}

/// The error of a file of which no row is a sample, with the reason of the first.
fn no_usable_row(reason: Option<&str>) -> ServiceError {
    let why = reason.map_or_else(String::new, |reason| format!(": {reason}"));
    BatchError::Malformed { pointer: String::new(), reason: format!("no usable row{why}") }.into()
}

fn unreadable(error: &SessionFileError) -> ServiceError {
    BatchError::Malformed { pointer: String::new(), reason: error.to_string() }.into()
}

/// A source that cannot be read any more once the import is to stop, so that a file that expands
/// a lot is not read to its end for nobody.
struct StoppableSource<S> {
    source: S,
    stop: CancellationToken,
}

impl<S: Read> Read for StoppableSource<S> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.stop.is_cancelled() {
            return Err(io::Error::other("the import has been stopped"));
        }
        self.source.read(buffer)
    }
}

impl<S: Seek> Seek for StoppableSource<S> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.source.seek(to)
    }
}

/// The rows of a file, one run after the other.
struct RunRows {
    rows: Box<dyn SessionRows>,
    /// The rows up to the first valid one.
    early: VecDeque<Result<Sample, SessionRowError>>,
    /// The first row of the next run.
    next: Option<Result<Sample, SessionRowError>>,
}

/// Why a file has no sample.
enum NoSample {
    /// The reason of its first rejected row, if it has one.
    Rejected(Option<String>),
    Unreadable(SessionFileError),
}

impl RunRows {
    fn new(rows: Box<dyn SessionRows>) -> Self {
        Self { rows, early: VecDeque::new(), next: None }
    }

    /// Reads up to the first valid row. After [`MAX_EARLY`] rows there may be one.
    fn find_sample(&mut self) -> Result<(), NoSample> {
        while self.early.len() < MAX_EARLY {
            match self.rows.next() {
                Some(Err(SessionRowError::Unreadable(error))) => {
                    return Err(NoSample::Unreadable(error));
                }
                Some(Err(row)) => self.early.push_back(Err(row)),
                Some(Ok(sample)) => {
                    self.early.push_back(Ok(sample));
                    return Ok(());
                }
                None => {
                    let first = self.early.pop_front();
                    let reason = first.and_then(Result::err).map(|error| error.to_string());
                    return Err(NoSample::Rejected(reason));
                }
            }
        }
        Ok(())
    }

    /// The number of the run that the rows have come to, from 1.
    fn run(&self) -> usize {
        self.rows.n_runs()
    }

    /// Returns the next row if it belongs to the run `n_run`.
    fn next_of(&mut self, n_run: usize) -> Option<Result<Sample, SessionRowError>> {
        if self.next.is_none() {
            self.next = self.early.pop_front().or_else(|| self.rows.next());
        }
        self.next.take_if(|_| self.rows.n_runs() == n_run)
    }
}

/// The counts of an import, and its batches without an acknowledgement.
#[derive(Default)]
struct ImportCounts {
    n_rows: usize,
    accepted: u64,
    duplicate: u64,
    late: u64,
    rejected: u64,
    rejections: Vec<RowView>,
    pending: VecDeque<(usize, PendingBatch)>,
}

impl ImportCounts {
    /// Returns the result; `sessions` has at least one.
    fn view(self, mut sessions: Vec<SessionView>) -> ImportView {
        let Self { accepted, duplicate, late, rejected, rejections, .. } = self;
        let session = sessions.remove(0);
        let more_sessions = sessions;
        ImportView { session, more_sessions, accepted, duplicate, late, rejected, rejections }
    }

    async fn settle(&mut self) -> Result<(), ServiceError> {
        if let Some((first, pending)) = self.pending.pop_front() {
            self.add(first, pending.acknowledged().await?);
        }
        Ok(())
    }

    fn add(&mut self, first: usize, ack: AckView) {
        self.accepted += ack.accepted as u64;
        self.duplicate += ack.duplicate as u64;
        self.late += ack.late.len() as u64;
        self.rejected += ack.rejected.len() as u64;
        let room = MAX_LISTED.saturating_sub(self.rejections.len());
        let rows = ack.rejected.into_iter().take(room);
        let offset = |row: RowView| RowView { index: first + row.index, ..row };
        self.rejections.extend(rows.map(offset));
    }
}
