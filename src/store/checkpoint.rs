//! The write-ahead log of a database file goes into the file beside the writer.
//!
//! SQLite lets the commit that finds the log full copy it into the file, and
//! everybody waits for that commit: 0.1 s for 64 MiB on a fast disk, and on a slow
//! one longer than a commit may take. So another connection copies what it can
//! while commits go on. Under load that is never all of it, for more is committed
//! meanwhile; but what is left for the commit that finds the log full is little.

use sqlx::{AnyConnection, Connection};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use super::{Place, StoreError};

/// Pages in the log with which it is full: 64 MiB of them. SQLite's own are 4 MiB;
/// the pages of the journal, used again and again, get into the file seldom so.
pub(super) const FULL_PAGES: i64 = 16_384;

/// Pages from which on it is copied until it is full.
const MANY_PAGES: i64 = FULL_PAGES / 4 * 3;

/// Copies of a shorter log, of which each has less to do than the one before.
const COPIES: u32 = 8;

/// Bytes committed until it is copied again.
const EVERY_BYTES: usize = 16 << 20;

/// Bytes that a commit takes of the log beside its samples, and each of those in the
/// journal and later in a chunk: four pages, and some 45 and 20 bytes.
const COMMIT_BYTES: usize = 4 << 12;
const SAMPLE_BYTES: usize = 65;

/// What runs beside a writer to a file; it ends with it.
#[derive(Debug)]
pub(super) struct Checkpoints {
    due: mpsc::Sender<()>,
    task: JoinHandle<()>,
    n_bytes: usize,
}

impl Checkpoints {
    /// For a file; a server sees to it itself.
    pub(super) fn beside(place: &Place) -> Option<Self> {
        place.file()?;
        let (due, wake) = mpsc::channel(1);
        let task = tokio::spawn(run(place.clone(), wake));
        Some(Self { due, task, n_bytes: 0 })
    }

    /// Notes that a commit of so many samples is in the log.
    pub(super) fn note(&mut self, n_samples: usize) {
        self.n_bytes += COMMIT_BYTES + n_samples * SAMPLE_BYTES;
        if self.n_bytes >= EVERY_BYTES {
            self.n_bytes = 0;
            // Full when a copy is due already.
            let _ = self.due.try_send(());
        }
    }

    /// Waits for what is under way.
    pub(super) async fn close(self) {
        drop(self.due);
        if self.task.await.is_err() {
            tracing::error!("copying the write-ahead log ended by panic");
        }
    }
}

async fn run(place: Place, mut due: mpsc::Receiver<()>) {
    let mut connection = None;
    while due.recv().await.is_some() {
        if let Err(error) = copy(&place, &mut connection).await {
            // The commit that finds it full does it.
            tracing::warn!(%error, "the write-ahead log is not copied into the file");
            connection = None;
        }
    }
    if let Some(connection) = connection {
        drop(connection.close().await);
    }
}

/// Copies what is in the log, and what is committed meanwhile, until nothing is
/// left: the next commit then begins the log anew. Under load that never comes
/// about, so while the log is short a few copies will do, and a long one is copied
/// until it is full.
async fn copy(place: &Place, connection: &mut Option<AnyConnection>) -> Result<(), StoreError> {
    let connection = match connection {
        Some(connection) => connection,
        none => none.insert(place.writer(false).await?),
    };
    let mut before = 0;
    for n_copies in 1.. {
        // How much is in the log is as of the copy's beginning.
        let (_, pages, copied): (i64, i64, i64) =
            sqlx::query_as("PRAGMA wal_checkpoint(PASSIVE)").fetch_one(&mut *connection).await?;
        let enough = pages < MANY_PAGES && n_copies >= COPIES;
        // All is copied, or a reader still needs what would be written over.
        let stands = copied <= before;
        if stands || enough {
            break;
        }
        before = copied;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{AssetRow, Store, Write};

    /// Assets in the file at `place` as it is without its log.
    async fn without_log(place: &Place) -> i64 {
        let file = place.file().unwrap();
        let copy = file.with_extension("copy");
        std::fs::copy(file, &copy).unwrap();
        let mut connection = Place::File(copy).writer(false).await.unwrap();
        let count = sqlx::query_scalar("SELECT count(*) FROM asset");
        count.fetch_one(&mut connection).await.unwrap()
    }

    #[tokio::test]
    async fn what_was_committed_is_in_the_file_while_the_writer_lives() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::File(folder.path().join("offbd.db"));
        let (_store, mut writer) = Store::open(&place).await.unwrap();
        let mut checkpoints = Checkpoints::beside(&place).unwrap();
        checkpoints.note(EVERY_BYTES / SAMPLE_BYTES);
        checkpoints.close().await;
        assert_eq!(without_log(&place).await, 0);
        let row = AssetRow {
            name: "rig".to_owned(),
            document: "{}".to_owned(),
            revision: 1,
            created_at: 0,
            updated_at: 0,
        };
        writer.commit(&mut [&mut vec![Write::CreateAsset(row)]]).await.unwrap();
        let mut checkpoints = Checkpoints::beside(&place).unwrap();
        checkpoints.note(1);
        assert_eq!(without_log(&place).await, 0, "it is not due yet");
        checkpoints.note(EVERY_BYTES / SAMPLE_BYTES);
        checkpoints.close().await;
        assert_eq!(without_log(&place).await, 1);
        writer.close().await.unwrap();
    }
}
