//! Snapshots of the engines of sessions. The store adds a checksum; it does not interpret
//! the state.

use sqlx::AnyConnection;

use super::execute::execute;
use super::{Store, StoreError};

/// The state of the engine of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    pub session: String,
    /// The number of samples after which the engine had this state.
    pub n_samples: i64,
    /// Whether it is kept when the next one is stored.
    pub kept: bool,
    /// The version of the engine.
    pub version: String,
    pub state: Vec<u8>,
}

impl Snapshot {
    fn checksum(&self) -> [u8; 4] {
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(self.session.as_bytes());
        hasher.update(&self.n_samples.to_le_bytes());
        hasher.update(self.version.as_bytes());
        hasher.update(&self.state);
        hasher.finalize().to_le_bytes()
    }

    /// Returns the snapshot that is stored with these columns, after checking its checksum.
    pub(super) fn opened(
        session: String,
        n_samples: i64,
        kept: i64,
        version: &str,
        data: &[u8],
    ) -> Result<Self, StoreError> {
        let (kept, version) = (kept != 0, version.to_owned());
        Self { session, n_samples, kept, version, state: Vec::new() }.open(data)
    }

    /// Returns the snapshot with the state in `data`, after checking its checksum.
    pub(super) fn open(mut self, data: &[u8]) -> Result<Self, StoreError> {
        let (checksum, state) = data.split_first_chunk().unwrap_or((&[0; 4], &[]));
        self.state = state.to_owned();
        if self.checksum() == *checksum {
            return Ok(self);
        }
        let Self { session, n_samples, .. } = self;
        Err(StoreError::Snapshot { session, n_samples })
    }
}

/// Stores `snapshot`, and removes the earlier ones of its session that are not kept.
pub(super) async fn put(db: &mut AnyConnection, snapshot: &Snapshot) -> Result<(), StoreError> {
    remove(db, &snapshot.session).await?;
    execute!(
        db, "INSERT INTO snapshot (session, n_samples, kept, version, data)
         VALUES ($1, $2, $3, $4, $5)
         ON CONFLICT (session, n_samples) DO UPDATE SET kept = excluded.kept,
         version = excluded.version, data = excluded.data";
        &snapshot.session, snapshot.n_samples, i64::from(snapshot.kept), &snapshot.version,
        [&snapshot.checksum()[..], &snapshot.state].concat()
    )
}

/// Removes the snapshots of `session` that are not kept.
pub(super) async fn remove(db: &mut AnyConnection, session: &str) -> Result<(), StoreError> {
    let remove = sqlx::query("DELETE FROM snapshot WHERE session = $1 AND kept = 0");
    remove.bind(session).execute(db).await?;
    Ok(())
}

/// Removes all snapshots of `session`.
pub(super) async fn remove_all(db: &mut AnyConnection, session: &str) -> Result<(), StoreError> {
    let remove = sqlx::query("DELETE FROM snapshot WHERE session = $1");
    remove.bind(session).execute(db).await?;
    Ok(())
}

impl Store {
    /// Returns the last snapshot of `session` by this `version` of the engine that is not
    /// after the sample `at_most`.
    ///
    /// # Errors
    /// [`StoreError::Snapshot`] if it is damaged; [`StoreError::Database`].
    pub async fn snapshot(
        &self,
        session: &str,
        version: &str,
        at_most: i64,
    ) -> Result<Option<Snapshot>, StoreError> {
        let row: Option<(i64, i64, Vec<u8>)> = sqlx::query_as(
            "SELECT n_samples, kept, data FROM snapshot
             WHERE session = $1 AND version = $2 AND n_samples <= $3
             ORDER BY n_samples DESC LIMIT 1",
        )
        .bind(session)
        .bind(version)
        .bind(at_most)
        .fetch_optional(&self.pool)
        .await?;
        let open = |(n_samples, kept, data): (i64, i64, Vec<u8>)| {
            Snapshot::opened(session.to_owned(), n_samples, kept, version, &data)
        };
        row.map(open).transpose()
    }
}
