//! Cold data: ended sessions whose samples are in a file outside the database.
//!
//! A row of `cold_file` says which file, with its checksum; `cold_chunk` keeps the places and
//! times of the chunks that were deleted. They are deleted in pieces, from the first one on,
//! once the file is the recording; until then a reader may find a sample in either. The row is
//! made before the file (a *plan*) and
//! removed after it, so that whatever a crash leaves is named in the database. Each attempt
//! to write a file has a path of its own, so that a process that no longer owns the
//! partition never touches a file that counts.
//!
//! The store does not know the format of the files: it is given a function that reads them.

mod files;
mod rows;

pub use files::{ColdDirectory, ReadSamples, SampleStream};
pub(super) use rows::release;
pub use rows::{ColdFileRow, ColdWrite};

use sqlx::AnyConnection;

use super::codec::Packing;
use super::{Store, StoreError, tail};
use offbd_core::vocabulary::Sample;

/// Samples that are read from a file at a time.
const SAMPLES_AT_ONCE: usize = 8192;

/// Reads the file of a session, from some sample on. Blocking work is done on the threads
/// for it.
pub(super) struct ColdReader {
    row: ColdFileRow,
    /// `None` after an error.
    stream: Option<SampleStream>,
}

impl std::fmt::Debug for ColdReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("ColdReader").field(&self.row).finish()
    }
}

impl ColdReader {
    /// Opens the file of `row` after comparing its size and its checksum.
    ///
    /// # Errors
    /// [`StoreError::Cold`] if it is missing or damaged.
    pub(super) async fn open(
        directory: Option<&ColdDirectory>,
        row: ColdFileRow,
        first: i64,
    ) -> Result<Self, StoreError> {
        let Some(directory) = directory.cloned() else {
            return Err(row.unreadable("is not at hand: `cold.directory` is not configured"));
        };
        let skipped = usize::try_from(first).unwrap_or(usize::MAX);
        let opened = blocking(move || {
            let stream = directory.open(&row).and_then(|mut stream| {
                take(&mut stream, skipped)?;
                Ok(stream)
            });
            stream.map(|stream| (row.clone(), stream)).map_err(|reason| row.unreadable(reason))
        });
        let (row, stream) = opened.await?;
        Ok(Self { row, stream: Some(stream) })
    }

    /// Returns the next samples, at most `limit`; none at the end of the file.
    pub(super) async fn next(&mut self, limit: usize) -> Result<Vec<Sample>, StoreError> {
        let Some(mut stream) = self.stream.take() else { return Ok(Vec::new()) };
        let (stream, samples) = blocking(move || {
            let samples = stream.by_ref().take(limit).collect::<Result<Vec<_>, _>>();
            (stream, samples)
        })
        .await;
        let samples = samples.map_err(|reason| self.row.unreadable(reason))?;
        self.stream = Some(stream);
        Ok(samples)
    }

    /// Returns the next samples, as many as are read at a time.
    pub(super) async fn next_part(&mut self) -> Result<Vec<Sample>, StoreError> {
        self.next(SAMPLES_AT_ONCE).await
    }
}

/// Passes over `n` samples.
fn take(stream: &mut SampleStream, n: usize) -> Result<(), String> {
    stream.by_ref().take(n).try_for_each(|sample| sample.map(drop))
}

async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    match tokio::task::spawn_blocking(work).await {
        Ok(done) => done,
        Err(error) => std::panic::resume_unwind(error.into_panic()),
    }
}

impl Store {
    /// The store with the directory of its cold data.
    #[must_use]
    pub fn with_cold(mut self, directory: Option<ColdDirectory>) -> Self {
        self.cold = directory;
        self
    }

    /// The directory of cold data, if one is configured.
    #[must_use]
    pub const fn cold(&self) -> Option<&ColdDirectory> {
        self.cold.as_ref()
    }

    /// Opens the file of `session` at the sample `first`; `None` if its samples have not left
    /// the database.
    pub(super) async fn cold_reader(
        &self,
        session: &str,
        first: i64,
    ) -> Result<Option<ColdReader>, StoreError> {
        let Some(row) = self.cold_file(session).await?.filter(ColdFileRow::is_moved) else {
            return Ok(None);
        };
        match ColdReader::open(self.cold.as_ref(), row, first).await {
            Ok(reader) => Ok(Some(reader)),
            // The session may have been deleted meanwhile, and its file with it.
            Err(_) if self.session(session).await?.is_none() => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The samples that are wanted in the cold data of `session`.
    pub(super) async fn cold_samples(
        &self,
        session: &str,
        is_wanted: impl Fn(&Sample) -> bool,
    ) -> Result<Vec<Sample>, StoreError> {
        let mut found = Vec::new();
        let Some(mut reader) = self.cold_reader(session, 0).await? else { return Ok(found) };
        loop {
            let samples = reader.next_part().await?;
            if samples.is_empty() {
                return Ok(found);
            }
            found.extend(samples.into_iter().filter(&is_wanted));
        }
    }
}

/// Reads the whole file of `row`. Returns the number of its samples.
pub(super) async fn verify(
    directory: Option<&ColdDirectory>,
    row: ColdFileRow,
) -> Result<i64, StoreError> {
    let mut reader = ColdReader::open(directory, row, 0).await?;
    let mut n_samples = 0;
    loop {
        let n = reader.next_part().await?.len();
        if n == 0 {
            return Ok(n_samples);
        }
        n_samples += i64::try_from(n).unwrap_or(i64::MAX);
    }
}

/// Brings all cold data back into the chunks of the database `db`, a copy: then it is whole
/// without the directory. Nothing in the directory changes.
pub(super) async fn bring_back(
    db: &mut AnyConnection,
    directory: Option<&ColdDirectory>,
) -> Result<(), StoreError> {
    for row in rows::moved(db).await? {
        let session = row.session.clone();
        let mut reader = ColdReader::open(directory, row, 0).await?;
        for (first_index, n) in rows::chunks(db, &session).await? {
            let samples = reader.next(usize::try_from(n).unwrap_or_default()).await?;
            tail::insert_run(db, &session, first_index, &samples, Packing::Compact).await?;
        }
    }
    rows::forget_all(db).await
}
