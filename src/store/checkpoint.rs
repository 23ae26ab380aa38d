//! The write-ahead log of a database file goes into the file beside the writer.
//!
//! SQLite lets the commit that finds the log full copy it into the file, and
//! everybody waits for that commit: 0.1 s for 64 MiB on a fast disk, and on a slow
//! one longer than a commit may take. So another connection copies what it can
//! while commits go on, until little is left. That little the writer copies itself,
//! between two commits: for only where none comes between does the next one begin
//! the log anew.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use sqlx::{AnyConnection, Connection};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use super::{Place, StoreError};

/// Pages in the log with which it is full, 64 MiB of them, and a commit copies it
/// after all: when a reader has held on to it. SQLite's own are 4 MiB.
pub(super) const FULL_PAGES: i64 = 16_384;

/// Bytes committed until the log is copied. A page written again and again, as those
/// of the journal are, goes into the file once each time.
const EVERY_BYTES: usize = 16 << 20;

/// Pages that the writer may copy itself: 4 MiB, some 15 ms at most on two busy cores.
const LITTLE_PAGES: i64 = 1024;

/// Copies after which as little is left as ever will be: each has less to do than
/// the one before, down to what comes meanwhile.
const COPIES: u32 = 4;

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
    /// The rest is the writer's.
    is_little_left: Arc<AtomicBool>,
}

impl Checkpoints {
    /// For a file; a server sees to it itself.
    pub(super) fn beside(place: &Place) -> Option<Self> {
        place.file()?;
        let (due, wake) = mpsc::channel(1);
        let is_little_left = Arc::new(AtomicBool::new(false));
        let task = tokio::spawn(run(place.clone(), wake, is_little_left.clone()));
        Some(Self { due, task, n_bytes: 0, is_little_left })
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

    /// Whether the writer should [`copy`] now; true once.
    pub(super) fn is_little_left(&self) -> bool {
        self.is_little_left.swap(false, Ordering::Relaxed)
    }

    /// Waits for what is under way.
    pub(super) async fn close(self) {
        drop(self.due);
        if self.task.await.is_err() {
            tracing::error!("copying the write-ahead log ended by panic");
        }
    }
}

async fn run(place: Place, mut due: mpsc::Receiver<()>, is_little_left: Arc<AtomicBool>) {
    let mut connection = None;
    while due.recv().await.is_some() {
        match copy_most(&place, &mut connection).await {
            Ok(most) => is_little_left.store(most, Ordering::Relaxed),
            Err(error) => {
                // The commit that finds it full does it.
                tracing::warn!(%error, "the write-ahead log is not copied into the file");
                connection = None;
            }
        }
    }
    if let Some(connection) = connection {
        drop(connection.close().await);
    }
}

/// Copies what is in the log, and what is committed meanwhile, until little is left;
/// false if a reader still needs what would be written over.
async fn copy_most(
    place: &Place,
    connection: &mut Option<AnyConnection>,
) -> Result<bool, StoreError> {
    let connection = match connection {
        Some(connection) => connection,
        none => none.insert(place.writer(false).await?),
    };
    let mut before = 0;
    for _ in 0..COPIES {
        let Copied { pages, copied } = copy(connection).await?;
        if copied < pages {
            return Ok(false);
        }
        if pages - before <= LITTLE_PAGES {
            break;
        }
        before = copied;
    }
    Ok(true)
}

/// Pages in the log as of a copy's beginning, and those of them that are copied now.
#[derive(Debug)]
pub(super) struct Copied {
    pages: i64,
    copied: i64,
}

/// Copies what is in the log and what no reader holds on to.
pub(super) async fn copy(connection: &mut AnyConnection) -> Result<Copied, sqlx::Error> {
    let copy = sqlx::query_as("PRAGMA wal_checkpoint(PASSIVE)");
    let (_busy, pages, copied): (i64, i64, i64) = copy.fetch_one(connection).await?;
    Ok(Copied { pages, copied })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{AssetRow, Store, Write, Writer};

    /// Assets in the file at `place` as it is without its log.
    async fn without_log(place: &Place) -> i64 {
        let file = place.file().unwrap();
        let copy = file.with_extension("copy");
        std::fs::copy(file, &copy).unwrap();
        let mut connection = Place::File(copy).writer(false).await.unwrap();
        let count = sqlx::query_scalar("SELECT count(*) FROM asset");
        count.fetch_one(&mut connection).await.unwrap()
    }

    /// How often the log at `place` has begun anew (bytes 12 to 16 of its header,
    /// <https://www.sqlite.org/fileformat2.html#the_write_ahead_log>).
    fn n_begun_anew(place: &Place) -> u32 {
        let log = std::fs::read(place.file().unwrap().with_extension("db-wal")).unwrap();
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
        writer.commit(&mut [&mut vec![asset(name)]]).await.unwrap();
    }

    #[tokio::test]
    async fn the_log_begins_anew_once_the_writer_has_copied_the_rest() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::File(folder.path().join("offbd.db"));
        let (_store, mut writer) = Store::open(&place).await.unwrap();
        let before = n_begun_anew(&place);
        commit(&mut writer, "a").await;
        writer.copy_log().await;
        commit(&mut writer, "b").await;
        assert_eq!(n_begun_anew(&place), before, "it is not due yet");
        let checkpoints = writer.checkpoints.as_ref().unwrap();
        checkpoints.is_little_left.store(true, Ordering::Relaxed);
        writer.copy_log().await;
        commit(&mut writer, "c").await;
        assert_eq!(n_begun_anew(&place), before + 1);
        assert_eq!(without_log(&place).await, 2, "c is in the log alone");
        writer.close().await.unwrap();
    }

    #[tokio::test]
    async fn commits_wake_the_copying() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::File(folder.path().join("offbd.db"));
        let (_store, mut writer) = Store::open(&place).await.unwrap();
        for n in 0..EVERY_BYTES / COMMIT_BYTES {
            commit(&mut writer, &n.to_string()).await;
        }
        let checkpoints = writer.checkpoints.take().unwrap();
        let is_little_left = checkpoints.is_little_left.clone();
        checkpoints.close().await;
        assert!(without_log(&place).await > 0);
        assert!(is_little_left.load(Ordering::Relaxed), "the rest is the writer's");
        writer.close().await.unwrap();
    }
}
