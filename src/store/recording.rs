//! Reading the recording of a session from its start to its end.

use super::{SessionRow, Store, StoreError};
use offbd_core::vocabulary::Sample;

/// Reads the samples that a session has when the reader is made, in order of arrival. The
/// end is known from the number of samples: a missing part is an error and not the end.
#[derive(Debug)]
pub struct RecordingReader {
    store: Store,
    session: String,
    next: i64,
    end: i64,
}

impl Store {
    /// Returns a reader of the recording of `session` from the sample `first` on.
    #[must_use]
    pub fn recording(&self, session: &SessionRow, first: i64) -> RecordingReader {
        let (next, end) = (first.max(0), session.progress.n_samples);
        RecordingReader { store: self.clone(), session: session.id.clone(), next, end }
    }
}

impl RecordingReader {
    /// Reads the next samples, as many as are stored together; returns `None` at the end.
    ///
    /// # Errors
    /// [`StoreError::Deleted`] if the session is deleted meanwhile;
    /// [`StoreError::Incomplete`] and [`StoreError::Chunk`] if the recording is damaged;
    /// [`StoreError::Database`].
    pub async fn next(&mut self) -> Result<Option<Vec<Sample>>, StoreError> {
        if self.next >= self.end {
            return Ok(None);
        }
        let samples = self.store.samples_from(&self.session, self.next).await;
        let Some(mut samples) = samples? else { return Err(self.missing().await?) };
        samples.truncate(usize::try_from(self.end - self.next).unwrap_or(usize::MAX));
        self.next += i64::try_from(samples.len()).unwrap_or(i64::MAX);
        Ok(Some(samples))
    }

    /// Why the next sample is not there.
    async fn missing(&self) -> Result<StoreError, StoreError> {
        let session = self.session.clone();
        Ok(match self.store.session(&session).await? {
            None => StoreError::Deleted { session },
            Some(_) => StoreError::Incomplete { session, found: self.next, expected: self.end },
        })
    }
}
