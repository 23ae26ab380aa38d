//! What retention asks: which ended sessions are old, which assets keep too
//! much, what is left of what was given up. A session in which a code changed
//! its status is *around a fault*, all others are *plain*.

use super::{Micros, Store, StoreError};

/// Whether a session is around a fault, as a condition on `session`.
const AROUND_FAULT: &str =
    "EXISTS (SELECT 1 FROM transition WHERE transition.session = session.id)";

const CANDIDATE: &str =
    "SELECT id, n_bytes FROM session WHERE state = 'ended' AND expired_at IS NULL AND ";

impl Store {
    /// The ids of ended sessions from before `moment`, the oldest first, plain
    /// ones or those around a fault.
    ///
    /// # Errors
    /// [`StoreError`], as for every question here, if the database fails.
    pub async fn sessions_ended_before(
        &self,
        moment: Micros,
        around_fault: bool,
        limit: u32,
    ) -> Result<Vec<String>, StoreError> {
        let mut question = super::question::Question::new(CANDIDATE);
        question.push(if around_fault { "" } else { "NOT " }).push(AROUND_FAULT);
        question.push(" AND ended_at < ").bind(moment)?;
        question.push(" ORDER BY ended_at LIMIT ").bind(i64::from(limit))?;
        let rows: Vec<(String, i64)> = question.rows().fetch_all(&self.pool).await?;
        Ok(rows.into_iter().map(|(id, _)| id).collect())
    }

    /// The assets whose ended sessions hold more than `bytes`, and how much.
    pub async fn assets_above(&self, bytes: i64) -> Result<Vec<(String, i64)>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT asset, CAST(SUM(n_bytes) AS BIGINT) FROM session
             WHERE state = 'ended' AND expired_at IS NULL
             GROUP BY asset HAVING SUM(n_bytes) > $1 ORDER BY asset",
        )
        .bind(bytes)
        .fetch_all(&self.pool)
        .await?)
    }

    /// Ids and bytes of plain ended sessions of `asset`, the oldest first.
    pub async fn plain_sessions(
        &self,
        asset: &str,
        limit: u32,
    ) -> Result<Vec<(String, i64)>, StoreError> {
        let mut question = super::question::Question::new(CANDIDATE);
        question.push("NOT ").push(AROUND_FAULT).push(" AND asset = ").bind(asset)?;
        question.push(" ORDER BY ended_at LIMIT ").bind(i64::from(limit))?;
        Ok(question.rows().fetch_all(&self.pool).await?)
    }

    /// Sessions that are given up and still here, with how many chunks.
    pub async fn expired_sessions(&self) -> Result<Vec<(String, i64)>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT id, (SELECT COUNT(*) FROM chunk WHERE chunk.session = session.id)
             FROM session WHERE expired_at IS NOT NULL ORDER BY expired_at",
        )
        .fetch_all(&self.pool)
        .await?)
    }
}
