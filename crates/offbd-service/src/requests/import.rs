//! Imports a recording as a session. Its samples are processed like live telemetry.

use std::collections::VecDeque;
use std::io::{self, Read, Seek, SeekFrom};

use tokio_util::sync::CancellationToken;

use crate::PendingBatch;
use crate::asset::AssetCommand;
use crate::{Service, ServiceError};
use offbd_core::vocabulary::Sample;
use offbd_wire::service::{ImportView, SessionView};
use offbd_wire::session_file::{
    self, SessionFileError, SessionFormat, SessionRowError, SessionRows,
};
use offbd_wire::telemetry::{AckView, Batch, BatchError, RowView, file_row};

/// Batches of an import that wait for their acknowledgement at a time.
const MAX_PENDING: usize = 4;

/// Limit of rejected rows in the result; further ones are only counted.
const MAX_LISTED: usize = 100;

/// Samples in one batch of an import.
const BATCH: usize = 2048;

const STOPPED: ServiceError = ServiceError::Unavailable { what: "the service is shutting down" };

impl Service {
    /// Imports the session file `source` of at most `limit` rows as the session `name` and ends
    /// it. Waits until few enough other files are read, then reads it on a blocking thread. The
    /// asset's open session is ended when the file has been opened; from then until the import
    /// is complete, live telemetry of the asset is refused with [`ServiceError::Busy`]. An import
    /// that fails, or whose caller is dropped, leaves neither a session nor faults; one that a
    /// stop interrupts is discarded, at the latest at the next start.
    ///
    /// # Errors
    /// [`ServiceError::SessionExists`]; [`ServiceError::Invalid`] for an invalid name;
    /// [`ServiceError::TooMany`] if there are more rows; [`ServiceError::Batch`] if the file
    /// cannot be read to its end; [`ServiceError::Unavailable`] if the service stops; those of
    /// the samples' batches.
    pub async fn import<S: Read + Seek + Send + 'static>(
        &self,
        asset: &str,
        name: Option<String>,
        source: S,
        format: Option<SessionFormat>,
        limit: usize,
    ) -> Result<ImportView, ServiceError> {
        let stop = self.inner.handles.closing.child_token();
        let _stop_if_dropped = stop.clone().drop_guard();
        let permit = self.inner.computing.imports.clone().acquire_owned();
        let permit = stop.run_until_cancelled(permit).await.and_then(Result::ok).ok_or(STOPPED)?;
        let import = Import { service: self.clone(), asset: asset.to_owned(), limit, stop };
        let task = tokio::task::spawn_blocking(move || {
            let imported = import.run(name, source, format);
            drop(permit);
            imported
        });
        task.await.unwrap_or(Err(ServiceError::Unavailable { what: "the import failed" }))
    }

    async fn discard_import(&self, asset: &str, id: String) -> Result<(), ServiceError> {
        let session = id.clone();
        let discard = |reply| AssetCommand::DiscardImport { session, reply };
        self.inner.shards.call(asset, discard).await?;
        self.inner.deleter.session(&id).await
    }
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
        source: impl Read + Seek + Send + 'static,
        format: Option<SessionFormat>,
    ) -> Result<ImportView, ServiceError> {
        let source = StoppableSource { source, stop: self.stop.clone() };
        let rows = session_file::open(source, format).map_err(|error| self.unreadable(&error))?;
        let runtime = self.service.inner.handles.runtime.clone();
        runtime.block_on(self.import(name, rows))
    }

    async fn import(
        &self,
        name: Option<String>,
        rows: Box<dyn SessionRows>,
    ) -> Result<ImportView, ServiceError> {
        let Self { service, asset, stop, .. } = self;
        let session = service.open_for(asset, name, true).await?;
        let id = session.id.clone();
        let imported = match stop.run_until_cancelled(self.samples(session, rows)).await {
            // The rows of a CSV file end also where it cannot be read on.
            Some(imported) if !stop.is_cancelled() => imported,
            _ => Err(STOPPED),
        };
        match imported {
            Ok(imported) => Ok(ImportView { session: service.end_session(&id).await?, ..imported }),
            Err(error) => {
                service.discard_import(asset, id).await?;
                Err(error)
            }
        }
    }

    /// Submits the samples of all rows.
    async fn samples(
        &self,
        session: SessionView,
        rows: Box<dyn SessionRows>,
    ) -> Result<ImportView, ServiceError> {
        let Self { service, asset, limit, .. } = self;
        let limit = *limit;
        let name = session.name.clone();
        let mut counts = ImportCounts { view: empty(session), pending: VecDeque::new() };
        let mut rows = rows.peekable();
        let mut first = 0;
        while rows.peek().is_some() {
            let rows = rows.by_ref().take(BATCH).map(|row| self.batch_row(row));
            let rows = rows.collect::<Result<Vec<_>, _>>()?;
            let n = rows.len();
            if first + n > limit {
                return Err(ServiceError::TooMany { what: "rows in an imported file", limit });
            }
            let batch = Batch { session: Some(name.clone()), id: None, rows };
            if counts.pending.len() >= MAX_PENDING {
                counts.settle().await?;
            }
            counts.pending.push_back((first, service.submit_when_ready(asset, batch, true).await?));
            first += n;
        }
        while !counts.pending.is_empty() {
            counts.settle().await?;
        }
        Ok(counts.view)
    }

    /// Returns a row of a file as one of a batch; an error if the file cannot be read on.
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
        BatchError::Malformed { pointer: String::new(), reason: error.to_string() }.into()
    }
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

const fn empty(session: SessionView) -> ImportView {
    ImportView { session, accepted: 0, duplicate: 0, late: 0, rejected: 0, rejections: Vec::new() }
}

/// The counts of an import, and its batches without an acknowledgement.
struct ImportCounts {
    view: ImportView,
    pending: VecDeque<(usize, PendingBatch)>,
}

impl ImportCounts {
    async fn settle(&mut self) -> Result<(), ServiceError> {
        if let Some((first, pending)) = self.pending.pop_front() {
            self.add(first, pending.acknowledged().await?);
        }
        Ok(())
    }

    fn add(&mut self, first: usize, ack: AckView) {
        let view = &mut self.view;
        view.accepted += ack.accepted as u64;
        view.duplicate += ack.duplicate as u64;
        view.late += ack.late.len() as u64;
        view.rejected += ack.rejected.len() as u64;
        let room = MAX_LISTED.saturating_sub(view.rejections.len());
        let rows = ack.rejected.into_iter().take(room);
        let offset = |row: RowView| RowView { index: first + row.index, ..row };
        view.rejections.extend(rows.map(offset));
    }
}
