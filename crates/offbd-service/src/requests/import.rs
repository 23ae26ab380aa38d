//! Imports a recording as a session. Its samples are processed like live telemetry.

use std::collections::VecDeque;

use crate::PendingBatch;
use crate::asset::AssetCommand;
use crate::{Service, ServiceError};
use offbd_core::vocabulary::Sample;
use offbd_wire::service::{ImportView, SessionView};
use offbd_wire::session_file::SessionRowError;
use offbd_wire::telemetry::{AckView, Batch, BatchError, RowView, file_row};

/// Batches of an import that wait for their acknowledgement at a time.
const MAX_PENDING: usize = 4;

/// Limit of rejected rows in the result; further ones are only counted.
const MAX_LISTED: usize = 100;

/// Samples in one batch of an import.
const BATCH: usize = 2048;

impl Service {
    /// Imports `rows`, at most `limit`, as the session `name` and ends it. The asset's open session is
    /// ended first; until the import is complete, live telemetry of the asset is refused
    /// with [`ServiceError::Busy`]. Continues if the caller is dropped. An import that fails
    /// leaves neither a session nor faults; one that a stop interrupts is discarded at the
    /// next start.
    ///
    /// # Errors
    /// [`ServiceError::SessionExists`]; [`ServiceError::Invalid`] for an invalid name;
    /// [`ServiceError::TooMany`] if there are more rows; [`ServiceError::Batch`] if the file
    /// cannot be read to its end; those of the samples' batches.
    pub async fn import(
        &self,
        asset: &str,
        name: Option<String>,
        rows: impl Iterator<Item = Result<Sample, SessionRowError>> + Send + 'static,
        limit: usize,
    ) -> Result<ImportView, ServiceError> {
        let (this, asset) = (self.clone(), asset.to_owned());
        let task = tokio::spawn(async move {
            let session = this.open_for(&asset, name, true).await?;
            let id = session.id.clone();
            match this.run_import(&asset, session, rows, limit).await {
                Ok(imported) => {
                    Ok(ImportView { session: this.end_session(&id).await?, ..imported })
                }
                Err(error) => {
                    this.discard_import(&asset, id).await?;
                    Err(error)
                }
            }
        });
        task.await.unwrap_or(Err(ServiceError::Unavailable { what: "the import failed" }))
    }

    async fn discard_import(&self, asset: &str, id: String) -> Result<(), ServiceError> {
        let session = id.clone();
        let discard = |reply| AssetCommand::DiscardImport { session, reply };
        self.inner.shards.call(asset, discard).await?;
        self.inner.deleter.session(&id).await
    }

    async fn run_import(
        &self,
        asset: &str,
        session: SessionView,
        rows: impl Iterator<Item = Result<Sample, SessionRowError>> + Send,
        limit: usize,
    ) -> Result<ImportView, ServiceError> {
        let name = session.name.clone();
        let mut counts = ImportCounts { view: empty(session), pending: VecDeque::new() };
        let mut rows = rows.peekable();
        let mut first = 0;
        while rows.peek().is_some() {
            let rows = rows.by_ref().take(BATCH).map(batch_row).collect::<Result<Vec<_>, _>>()?;
            let n = rows.len();
            if first + n > limit {
                return Err(ServiceError::TooMany { what: "rows in an imported file", limit });
            }
            let batch = Batch { session: Some(name.clone()), id: None, rows };
            if counts.pending.len() >= MAX_PENDING {
                counts.settle().await?;
            }
            counts.pending.push_back((first, self.submit_when_ready(asset, batch, true).await?));
            first += n;
        }
        while !counts.pending.is_empty() {
            counts.settle().await?;
        }
        Ok(counts.view)
    }
}

/// Returns a row of a file as one of a batch; an error if the file cannot be read on.
fn batch_row(row: Result<Sample, SessionRowError>) -> Result<Result<Sample, String>, ServiceError> {
    match row {
        Err(SessionRowError::Unreadable(error)) => {
            let (pointer, reason) = (String::new(), error.to_string());
            Err(BatchError::Malformed { pointer, reason }.into())
        }
        Err(SessionRowError::Rejected(row)) => Ok(file_row(Err(row.to_string()))),
        Ok(sample) => Ok(file_row(Ok(sample))),
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
