//! Reading the recording of a session, or a stretch of it.

use std::collections::BTreeMap;

use super::codec::ChunkKey;
use super::{SessionRow, Store, StoreError, decode_chunk};
use offbd_core::vocabulary::{Sample, TimeRange};

/// Reads the samples that a session has when the reader is made, in order of arrival. The
/// end is known from the number of samples: a missing part is an error and not the end.
#[derive(Debug)]
pub struct RecordingReader {
    store: Store,
    session: String,
    next: i64,
    end: i64,
    range: TimeRange,
    /// Chunks that are read already, by their first indexes.
    ahead: BTreeMap<i64, Vec<u8>>,
}

impl Store {
    /// Returns a reader of the recording of `session` from the sample `first` on.
    #[must_use]
    pub fn recording(&self, session: &SessionRow, first: i64) -> RecordingReader {
        let (next, end) = (first.max(0), session.progress.n_samples);
        let (store, session, range) = (self.clone(), session.id.clone(), TimeRange::ALL);
        RecordingReader { store, session, next, end, range, ahead: BTreeMap::new() }
    }

    /// Returns a reader of the samples of `session` whose times are in `range`.
    ///
    /// # Errors
    /// [`StoreError::Database`].
    pub async fn stretch(
        &self,
        session: &SessionRow,
        range: TimeRange,
    ) -> Result<RecordingReader, StoreError> {
        let (next, end) = self.indexes(session, range).await?;
        let (store, session) = (self.clone(), session.id.clone());
        Ok(RecordingReader { store, session, next, end, range, ahead: BTreeMap::new() })
    }

    /// Returns indexes of `session` between which all samples with times in `range` are: the
    /// first of them at most, and one after the last at least.
    ///
    /// # Errors
    /// [`StoreError::Database`].
    pub async fn indexes(
        &self,
        session: &SessionRow,
        range: TimeRange,
    ) -> Result<(i64, i64), StoreError> {
        let n_samples = session.progress.n_samples;
        if range == TimeRange::ALL {
            return Ok((0, n_samples));
        }
        // Samples after the last chunk are in the journal.
        let (first, end, n_folded): (Option<i64>, Option<i64>, i64) = sqlx::query_as(
            "SELECT MIN(CASE WHEN max_t_s >= $2 THEN first_index END),
                 MAX(CASE WHEN min_t_s <= $3 THEN first_index + n END),
                 COALESCE(MAX(first_index + n), 0)
             FROM chunk WHERE session = $1",
        )
        .bind(&session.id)
        .bind(range.from_s)
        .bind(range.to_s)
        .fetch_one(&self.pool)
        .await?;
        let end = if n_folded < n_samples { n_samples } else { end.unwrap_or(0) };
        Ok((first.unwrap_or(n_folded).min(end), end))
    }
}

impl Store {
    /// Why the sample `found` of `session`, of `expected` ones, is not there.
    async fn missing(
        &self,
        session: &str,
        found: i64,
        expected: i64,
    ) -> Result<StoreError, StoreError> {
        let (row, session) = (self.session(session).await?, session.to_owned());
        Ok(match row {
            None => StoreError::Deleted { session },
            Some(_) => StoreError::Incomplete { session, found, expected },
        })
    }
}

impl RecordingReader {
    /// Returns the reader with `chunks` of its session that are read already, by their first
    /// indexes. What is not among them is looked for in the journal and in the tables.
    pub(super) fn with_chunks(self, chunks: BTreeMap<i64, Vec<u8>>) -> Self {
        Self { ahead: chunks, ..self }
    }

    /// Takes samples from the next one on, if they are read already.
    fn take_ahead(&mut self) -> Result<Option<Vec<Sample>>, StoreError> {
        let Some((&first_index, _)) = self.ahead.range(..=self.next).next_back() else {
            return Ok(None);
        };
        let data = self.ahead.remove(&first_index).unwrap_or_default();
        let mut samples = decode_chunk(&data, ChunkKey { session: &self.session, first_index })?;
        let at = usize::try_from(self.next - first_index).unwrap_or(usize::MAX);
        Ok((at < samples.len()).then(|| samples.split_off(at)))
    }

    /// Reads the next samples, as many as are stored together; returns `None` at the end.
    ///
    /// # Errors
    /// [`StoreError::Deleted`] if the session is deleted meanwhile;
    /// [`StoreError::Incomplete`] and [`StoreError::Chunk`] if the recording is damaged;
    /// [`StoreError::Database`].
    pub async fn next(&mut self) -> Result<Option<Vec<Sample>>, StoreError> {
        while self.next < self.end {
            let Some(mut samples) = self.stored().await? else {
                return Err(self.store.missing(&self.session, self.next, self.end).await?);
            };
            samples.truncate(usize::try_from(self.end - self.next).unwrap_or(usize::MAX));
            self.next += i64::try_from(samples.len()).unwrap_or(i64::MAX);
            samples.retain(|sample| self.range.contains(sample.t_s));
            if !samples.is_empty() {
                return Ok(Some(samples));
            }
        }
        Ok(None)
    }

    /// Reads samples from the next one on.
    async fn stored(&mut self) -> Result<Option<Vec<Sample>>, StoreError> {
        match self.take_ahead()? {
            Some(samples) => Ok(Some(samples)),
            None => self.store.samples_from(&self.session, self.next).await,
        }
    }
}
