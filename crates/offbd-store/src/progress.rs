//! How far sessions have come, according to their rows.

use std::collections::HashMap;

use sqlx::AnyConnection;

use super::from_row::from_row;
use super::query_builder::QueryBuilder;
use super::{SessionProgress, SessionRow, StoreError};

/// Sessions per query.
pub(super) const SESSIONS_AT_ONCE: usize = 256;

struct StoredProgress {
    id: String,
    progress: SessionProgress,
}

from_row!(StoredProgress { id }[progress]);

/// The progress in the rows of `sessions`, by id.
pub(super) async fn stored_progress(
    db: &mut AnyConnection,
    sessions: &[String],
) -> Result<HashMap<String, SessionProgress>, StoreError> {
    let mut stored = HashMap::new();
    for part in sessions.chunks(SESSIONS_AT_ONCE) {
        let mut query = QueryBuilder::new(
            "SELECT id, n_samples, n_rejected, first_t_s, last_t_s, last_seq FROM session
             WHERE id IN (",
        );
        query.bind_list(part)?.push(")");
        let rows: Vec<StoredProgress> = query.rows().fetch_all(&mut *db).await?;
        stored.extend(rows.into_iter().map(|row| (row.id, row.progress)));
    }
    Ok(stored)
}

impl SessionRow {
    /// Takes over `progress` if it is later than the row's own.
    pub(super) fn advance(&mut self, progress: Option<&SessionProgress>) {
        if let Some(later) = progress.filter(|progress| progress.is_beyond(&self.progress)) {
            self.progress = *later;
        }
    }
}
