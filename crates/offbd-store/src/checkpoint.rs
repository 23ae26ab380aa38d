//! Checkpoints of SQLite: copying the write-ahead log (WAL) into the database file.
//!
//! SQLite writes each commit to the end of the log. By itself it copies the log into the
//! file within the commit that makes the log too long, and every client waits for that
//! commit: 0.1 s for 64 MiB on a fast disk, and longer than a commit may take on a slow
//! one. So a second connection copies most of the log while commits go on. The small rest
//! is copied by the writer itself between two commits, because SQLite writes to the
//! beginning of the log again only if the whole log is copied when the next commit
//! starts. Commits are durable before and after a checkpoint: checkpoints only limit the
//! length of the log. If they fail, SQLite's own mechanism still works.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use sqlx::{AnyConnection, Connection};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use super::writer_lock::WriterRole;
use super::{Location, StoreError};

/// Pages in the log (64 MiB) at which a commit of the writer copies it after all, which
/// happens if a reader has prevented checkpoints for long. SQLite's default is 4 MiB.
pub(super) const AUTOCHECKPOINT_PAGES: i64 = 16_384;

/// Committed bytes between two checkpoints. A page that is written repeatedly, like
/// those of the journal, is copied once per checkpoint.
const CHECKPOINT_BYTES: usize = 16 << 20;

/// Pages that the writer may copy itself: 4 MiB, about 15 ms at most on two busy cores.
const SMALL_REST_PAGES: i64 = 1024;

/// Copies per checkpoint. Each has only the pages to copy that were committed during the
/// previous one, so that further copies would not make the rest smaller.
const COPIES: u32 = 4;

/// Pause before the log is copied again because a connection still reads an older state of the
/// database. Chosen.
const COPY_AGAIN_AFTER: Duration = Duration::from_millis(100);

/// How often it is logged that copying the whole log goes on. Chosen.
const STILL_COPYING_EVERY: Duration = Duration::from_secs(10);

/// Estimated bytes of the log per commit (four pages), and per sample: about 45 in the
/// journal and later 20 in a chunk.
const COMMIT_BYTES: usize = 4 << 12;
const SAMPLE_BYTES: usize = 65;

/// The task that copies the log of a database file for a writer.
#[derive(Debug)]
pub(super) struct Checkpointer {
    due: mpsc::Sender<()>,
    task: JoinHandle<()>,
    /// Estimated bytes committed since the last checkpoint was requested.
    n_bytes: usize,
    /// Set by the task when the writer should copy the rest.
    is_rest_small: Arc<AtomicBool>,
}

impl Checkpointer {
    /// Starts the task; returns `None` for PostgreSQL, which makes its checkpoints itself.
    pub(super) fn start(location: &Location) -> Option<Self> {
        location.file()?;
        let (due, wake) = mpsc::channel(1);
        let is_rest_small = Arc::new(AtomicBool::new(false));
        let task = tokio::spawn(run(location.clone(), wake, is_rest_small.clone()));
        Some(Self { due, task, n_bytes: 0, is_rest_small })
    }

    /// Counts a commit of `n_samples` samples, and requests a checkpoint if one is due.
    pub(super) fn count_commit(&mut self, n_samples: usize) {
        self.n_bytes += COMMIT_BYTES + n_samples * SAMPLE_BYTES;
        if self.n_bytes >= CHECKPOINT_BYTES {
            self.n_bytes = 0;
            // Fails if a checkpoint is requested already.
            let _ = self.due.try_send(());
        }
    }

    /// Returns whether the writer should [`copy`] the rest now, and resets the flag.
    pub(super) fn take_is_rest_small(&self) -> bool {
        self.is_rest_small.swap(false, Ordering::Relaxed)
    }

    /// Ends the task, and waits for a checkpoint that is running.
    pub(super) async fn close(self) {
        drop(self.due);
        if self.task.await.is_err() {
            tracing::error!("the task that copies the write-ahead log has panicked");
        }
    }
}

async fn run(location: Location, mut due: mpsc::Receiver<()>, is_rest_small: Arc<AtomicBool>) {
    let mut connection = None;
    while due.recv().await.is_some() {
        match copy_most(&location, &mut connection).await {
            Ok(is_small) => is_rest_small.store(is_small, Ordering::Relaxed),
            Err(error) => {
                // The log then grows until SQLite copies it within a commit.
                tracing::warn!(%error, "cannot copy the write-ahead log into the database file");
                connection = None;
            }
        }
    }
    if let Some(connection) = connection {
        drop(connection.close().await);
    }
}

/// Copies the log until the rest is small. Returns `false` if a reader prevents that,
/// because it still needs an older state of pages in the file.
async fn copy_most(
    location: &Location,
    connection: &mut Option<AnyConnection>,
) -> Result<bool, StoreError> {
    let connection = match connection {
        Some(connection) => connection,
        none => none.insert(location.writer(WriterRole::Auxiliary, None).await?.0),
    };
    let mut before = 0;
    for _ in 0..COPIES {
        let LogPages { pages, copied, .. } = copy(connection).await?;
        if copied < pages {
            return Ok(false);
        }
        if pages - before <= SMALL_REST_PAGES {
            break;
        }
        before = copied;
    }
    Ok(true)
}

/// Pages in the log at the beginning of a copy, and how many of them are in the file
/// after it.
#[derive(Debug)]
pub(super) struct LogPages {
    pages: i64,
    copied: i64,
    /// Whether another connection was copying the log, so that nothing was copied.
    is_busy: bool,
}

/// Copies the log as far as no reader prevents it.
pub(super) async fn copy(connection: &mut AnyConnection) -> Result<LogPages, sqlx::Error> {
    let copy = sqlx::query_as("PRAGMA wal_checkpoint(PASSIVE)");
    let (busy, pages, copied): (i64, i64, i64) = copy.fetch_one(connection).await?;
    Ok(LogPages { pages, copied, is_busy: busy != 0 })
}

/// Copies the whole log. There is no limit of time: SQLite notes what it has copied only at
/// the end, so that on a slow disk an interrupted copy would begin again each time.
pub(super) async fn copy_all(connection: &mut AnyConnection) -> Result<(), sqlx::Error> {
    let mut copied = std::pin::pin!(copy_until_whole(connection));
    loop {
        match tokio::time::timeout(STILL_COPYING_EVERY, &mut copied).await {
            Ok(copied) => return copied,
            Err(_) => tracing::warn!(
                "the write-ahead log is still being copied into the database file; on a slow \
                 disk this takes long"
            ),
        }
    }
}

async fn copy_until_whole(connection: &mut AnyConnection) -> Result<(), sqlx::Error> {
    let mut is_reported = false;
    loop {
        let LogPages { pages, copied, is_busy } = copy(connection).await?;
        if copied == pages && !is_busy {
            return Ok(());
        }
        if !is_reported {
            tracing::warn!(
                pages,
                copied,
                "the write-ahead log waits to be copied into the database file until other \
                 programs have read what they began to read, such as a backup or a check"
            );
            is_reported = true;
        }
        tokio::time::sleep(COPY_AGAIN_AFTER).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ChangeSet;
    use crate::{AssetRow, Store, Write, Writer};

    /// Counts the assets in the database file without its log.
    async fn without_log(location: &Location) -> i64 {
        let file = location.file().unwrap();
        let copy = file.with_extension("copy");
        std::fs::copy(file, &copy).unwrap();
        let mut connection =
            Location::File(copy).writer(WriterRole::Auxiliary, None).await.unwrap().0;
        let count = sqlx::query_scalar("SELECT count(*) FROM asset");
        count.fetch_one(&mut connection).await.unwrap()
    }

    /// How often SQLite has restarted the log from its beginning (the checkpoint sequence
    /// number, bytes 12 to 16 of the header,
    /// <https://www.sqlite.org/fileformat2.html#the_write_ahead_log>).
    fn n_restarts(location: &Location) -> u32 {
        let log = std::fs::read(location.file().unwrap().with_extension("db-wal")).unwrap();
        u32::from_be_bytes(log[12..16].try_into().unwrap())
    }

    fn asset(name: &str) -> Write {
        Write::CreateAsset(AssetRow {
            name: name.to_owned(),
            document: "{}".to_owned(),
            revision: 1,
            created_at: 0,
            updated_at: 0,
        })
    }

    async fn commit(writer: &mut Writer, name: &str) {
        writer.commit(&mut [ChangeSet::unpartitioned(&mut vec![asset(name)])]).await.unwrap();
    }

    #[tokio::test]
    async fn the_log_restarts_once_the_writer_has_copied_the_rest() {
        let folder = tempfile::tempdir().unwrap();
        let location = Location::File(folder.path().join("offbd.db"));
        let (_store, mut writer) = Store::open(&location).await.unwrap();
        let before = n_restarts(&location);
        commit(&mut writer, "a").await;
        writer.copy_log().await;
        commit(&mut writer, "b").await;
        assert_eq!(n_restarts(&location), before, "no checkpoint is due yet");
        let checkpointer = writer.checkpointer.as_ref().unwrap();
        checkpointer.is_rest_small.store(true, Ordering::Relaxed);
        writer.copy_log().await;
        commit(&mut writer, "c").await;
        assert_eq!(n_restarts(&location), before + 1);
        assert_eq!(without_log(&location).await, 2, "c is in the log only");
        writer.close().await.unwrap();
    }

    #[tokio::test]
    async fn commits_trigger_a_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let location = Location::File(folder.path().join("offbd.db"));
        let (_store, mut writer) = Store::open(&location).await.unwrap();
        for n in 0..CHECKPOINT_BYTES / COMMIT_BYTES {
            commit(&mut writer, &n.to_string()).await;
        }
        let checkpointer = writer.checkpointer.take().unwrap();
        let is_rest_small = checkpointer.is_rest_small.clone();
        checkpointer.close().await;
        assert!(without_log(&location).await > 0);
        assert!(is_rest_small.load(Ordering::Relaxed), "the writer copies the rest");
        writer.close().await.unwrap();
    }
}
