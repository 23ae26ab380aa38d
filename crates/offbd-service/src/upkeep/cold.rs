//! Cold data: moves the samples of old ended sessions from the database to files, and removes
//! the files of deleted sessions.
//!
//! A session moves in five steps: a plan with the file's path is stored; the file is written
//! and is on the disk; it is read back and compared with the recording; one transaction makes
//! it the recording; the chunks are deleted in pieces, each in its own transaction, so that
//! other changes are committed in between. Wherever this is interrupted, the recording is
//! whole, the plan names what is left, and the next round deletes the other chunks. One task
//! does all of it, so that nothing is removed that is being written. The work of another
//! process that does not know yet that it has lost the partition is in files of other names.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::Notify;

use crate::cold_files::{self, ColdFileError};
use crate::writing::Handles;
use crate::{ServiceError, views};
use offbd_core::vocabulary::Sample;
use offbd_store::{ColdDirectory, ColdFileRow, ColdWrite, Micros, SessionRow, Write};

/// Sessions that are read from the database at a time.
const SESSIONS_AT_ONCE: u32 = 64;

/// Chunks deleted in one transaction, as in other deletions.
const CHUNKS_AT_ONCE: u32 = 16;

/// Pause after a session, in which other changes are committed. Chosen.
const PAUSE_AFTER_SESSION: Duration = Duration::from_millis(50);

/// The background task of cold data.
pub(super) struct ColdMover {
    pub(super) handles: Handles,
    /// Age at which a session moves; `None` for never.
    pub(super) after: Option<Duration>,
    /// Interval between two rounds.
    pub(super) every: Duration,
    /// Notified when a session has been deleted, whose file is to be removed.
    pub(super) deleted: Arc<Notify>,
}

impl ColdMover {
    /// Goes through the sessions periodically until the service shuts down; does nothing
    /// without a directory.
    pub(super) async fn run(self) {
        let Some(directory) = self.handles.store.cold().cloned() else { return };
        let closing = self.handles.closing.clone();
        let forever = async {
            loop {
                if let Err(error) = self.round(&directory).await {
                    tracing::warn!(%error, "cold data cannot be looked after; tried again later");
                }
                // A deletion is a reason to begin earlier.
                let _ = tokio::time::timeout(self.every, self.deleted.notified()).await;
            }
        };
        closing.run_until_cancelled(forever).await;
    }

    async fn round(&self, directory: &ColdDirectory) -> Result<(), ServiceError> {
        self.remove_leftovers(directory).await?;
        self.finish_moves(directory).await?;
        let age = self.after.map(|after| i64::try_from(after.as_micros()).unwrap_or(i64::MAX));
        match age.and_then(|age| self.handles.clock.now().checked_sub(age)) {
            Some(moment) => self.move_sessions(directory, moment).await,
            None => Ok(()),
        }
    }

    /// Removes the files of sessions that are deleted.
    async fn remove_leftovers(&self, directory: &ColdDirectory) -> Result<(), ServiceError> {
        for row in self.handles.store.cold_leftovers().await? {
            if !self.handles.ownership.owns(&row.asset) {
                continue;
            }
            let (session, asset, path) = (row.session.clone(), row.asset.clone(), row.path.clone());
            let directory = directory.clone();
            let removed = blocking(move || {
                remove_earlier(&directory, &row)?;
                Ok(directory.remove(&row.path)?)
            });
            if let Err(error) = removed.await {
                count_failure();
                tracing::warn!(session, path, %error, "a file of cold data cannot be removed");
                continue;
            }
            let forget = Write::Cold(ColdWrite::Forget { session });
            self.handles.write(&asset, vec![forget]).await?;
        }
        Ok(())
    }

    /// Deletes the chunks of sessions that have moved, if something has interrupted that and
    /// the file is still the one that was recorded.
    async fn finish_moves(&self, directory: &ColdDirectory) -> Result<(), ServiceError> {
        for row in self.handles.store.cold_files_with_chunks().await? {
            if !self.handles.ownership.owns(&row.asset) {
                continue;
            }
            let (session, asset) = (row.session.clone(), row.asset.clone());
            let directory = directory.clone();
            let checked =
                blocking(move || directory.compare(&row).map_err(ColdFileError::Recorded));
            if let Err(error) = checked.await {
                count_failure();
                tracing::warn!(session, %error, "the chunks of a moved session are kept");
                continue;
            }
            self.drop_chunks(&asset, &session).await;
        }
        Ok(())
    }

    /// Deletes the chunks of a session that has moved. If that fails, the next round goes on.
    async fn drop_chunks(&self, asset: &str, session: &str) {
        if let Err(error) = self.try_drop_chunks(asset, session).await {
            count_failure();
            tracing::warn!(session, %error, "the chunks of a moved session are deleted later");
        }
    }

    async fn try_drop_chunks(&self, asset: &str, session: &str) -> Result<(), ServiceError> {
        while self.handles.store.has_chunks_of_file(session).await? {
            let session = session.to_owned();
            let drop = ColdWrite::DropChunks { session, limit: CHUNKS_AT_ONCE };
            self.handles.write(asset, vec![Write::Cold(drop)]).await?;
        }
        Ok(())
    }

    /// Moves all sessions that ended before `moment`. One that cannot be moved is reported,
    /// and the others go on.
    async fn move_sessions(
        &self,
        directory: &ColdDirectory,
        moment: Micros,
    ) -> Result<(), ServiceError> {
        let mut last = String::new();
        loop {
            let owned = self.handles.ownership.filter();
            let store = &self.handles.store;
            let found = store.sessions_to_move(moment, &last, owned.as_deref(), SESSIONS_AT_ONCE);
            let found = found.await?;
            let Some(session) = found.last() else { return Ok(()) };
            last.clone_from(&session.id);
            for session in found {
                let id = session.id.clone();
                if let Err(error) = self.move_session(directory, session).await {
                    count_failure();
                    tracing::warn!(session = id, %error, "a session stays in the database");
                }
                tokio::time::sleep(PAUSE_AFTER_SESSION).await;
            }
        }
    }

    async fn move_session(
        &self,
        directory: &ColdDirectory,
        session: SessionRow,
    ) -> Result<(), ColdFileError> {
        let (handles, asset) = (&self.handles, session.asset.clone());
        let Some(plan) = self.plan(&session).await? else { return Ok(()) };
        let (reading, directory, path) = (handles.clone(), directory.clone(), plan.path.clone());
        let earlier = plan.clone();
        let written = blocking(move || {
            remove_earlier(&directory, &earlier)?;
            let info = views::session_info(&session)?;
            cold_files::write(&directory, &path, &info, recording(&reading, &session))?;
            cold_files::verify(&directory, &path, recording(&reading, &session))
        });
        let (bytes, checksum) = written.await?;
        let moved_at = Some(handles.clock.now());
        let moved = ColdFileRow { bytes, checksum, moved_at, ..plan };
        let id = moved.session.clone();
        tracing::info!(session = id, path = moved.path, bytes, "a session moves");
        handles.write(&asset, vec![Write::Cold(ColdWrite::Move(moved))]).await?;
        metrics::counter!("offbd_cold_files_total").increment(1);
        metrics::counter!("offbd_cold_bytes_total").increment(bytes.unsigned_abs());
        self.drop_chunks(&asset, &id).await;
        Ok(())
    }

    /// Stores the plan of the next attempt to move `session`. Returns `None` if it has moved
    /// meanwhile.
    async fn plan(&self, session: &SessionRow) -> Result<Option<ColdFileRow>, ServiceError> {
        let Handles { store, ownership, .. } = &self.handles;
        let day = day(session.ended_at.unwrap_or_default())?;
        let folder = format!("{day}/partition-{:02}", ownership.partition_of(&session.asset));
        let earlier = store.cold_file(&session.id).await?;
        let plan = ColdFileRow::plan(session, &folder, earlier.as_ref());
        let write = Write::Cold(ColdWrite::Plan(plan.clone()));
        self.handles.write(&session.asset, vec![write]).await?;
        Ok(store.cold_file(&session.id).await?.filter(|stored| *stored == plan))
    }
}

/// Returns the samples of `session`, part by part. Blocks on the store.
fn recording(
    handles: &Handles,
    session: &SessionRow,
) -> impl FnMut() -> Result<Option<Vec<Sample>>, ServiceError> {
    let mut reader = handles.store.recording(session, 0);
    move || {
        if handles.closing.is_cancelled() {
            return Err(ServiceError::Unavailable { what: "the service is shutting down" });
        }
        handles.wait(async { reader.next().await.map_err(ServiceError::from) })
    }
}

/// Removes what earlier attempts to write the file of `row` have left.
fn remove_earlier(directory: &ColdDirectory, row: &ColdFileRow) -> Result<(), ColdFileError> {
    Ok(row.earlier_paths().try_for_each(|path| directory.remove(&path))?)
}

/// The day of a time in UTC, YYYY-MM-DD.
fn day(time: Micros) -> Result<String, ServiceError> {
    let time = jiff::Timestamp::from_microsecond(time).map_err(ServiceError::corrupt)?;
    Ok(time.strftime("%Y-%m-%d").to_string())
}

/// Runs `work` on a thread that may block.
async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, ColdFileError> + Send + 'static,
) -> Result<T, ColdFileError> {
    let failed = |_| ServiceError::Unavailable { what: "a thread of cold data panicked" };
    tokio::task::spawn_blocking(work).await.map_err(failed)?
}

fn count_failure() {
    metrics::counter!("offbd_cold_failures_total").increment(1);
}
