//! What retention asks: which ended sessions are old, which assets keep too
//! much, what is left of what was given up. A session in which a code changed
//! its status is *around a fault*, all others are *plain*.

use super::question::Question;
use super::{Micros, Store, StoreError};

/// Whether a session is around a fault, as a condition on `session`.
const AROUND_FAULT: &str =
    "EXISTS (SELECT 1 FROM transition WHERE transition.session = session.id)";

const CANDIDATE: &str =
    "SELECT id, n_bytes FROM session WHERE state = 'ended' AND expired_at IS NULL AND ";

const BULK: &str = "SELECT id,
    (SELECT COUNT(*) FROM chunk WHERE chunk.session = session.id),
    (SELECT COUNT(*) FROM transition WHERE transition.session = session.id)
    FROM session WHERE ";

/// How much there is of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bulk {
    pub id: String,
    pub n_chunks: u64,
    pub n_transitions: u64,
}

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
        let mut question = Question::new(CANDIDATE);
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
        let mut question = Question::new(CANDIDATE);
        question.push("NOT ").push(AROUND_FAULT).push(" AND asset = ").bind(asset)?;
        question.push(" ORDER BY ended_at LIMIT ").bind(i64::from(limit))?;
        Ok(question.rows().fetch_all(&self.pool).await?)
    }

    /// Sessions that are given up and still here.
    pub async fn expired_sessions(&self) -> Result<Vec<Bulk>, StoreError> {
        let mut question = Question::new(BULK);
        question.push("expired_at IS NOT NULL ORDER BY expired_at");
        self.bulks(question).await
    }

    /// Assets that are given up and still here.
    pub async fn deleted_assets(&self) -> Result<Vec<String>, StoreError> {
        Ok(sqlx::query_scalar("SELECT name FROM asset WHERE deleted_at IS NOT NULL ORDER BY name")
            .fetch_all(&self.pool)
            .await?)
    }

    /// Whether an asset `name` is given up and still here.
    pub async fn is_being_deleted(&self, name: &str) -> Result<bool, StoreError> {
        let found: Option<String> =
            sqlx::query_scalar("SELECT name FROM asset WHERE deleted_at IS NOT NULL AND name = $1")
                .bind(name)
                .fetch_optional(&self.pool)
                .await?;
        Ok(found.is_some())
    }

    /// Some of the sessions of `asset`, seen or not.
    pub async fn sessions_in_bulk(&self, asset: &str, limit: u32) -> Result<Vec<Bulk>, StoreError> {
        let mut question = Question::new(BULK);
        question.push("asset = ").bind(asset)?.push(" LIMIT ").bind(i64::from(limit))?;
        self.bulks(question).await
    }

    /// The session `id`, seen or not.
    pub async fn session_in_bulk(&self, id: &str) -> Result<Option<Bulk>, StoreError> {
        let mut question = Question::new(BULK);
        question.push("id = ").bind(id)?;
        Ok(self.bulks(question).await?.pop())
    }

    async fn bulks(&self, question: Question) -> Result<Vec<Bulk>, StoreError> {
        let rows: Vec<(String, i64, i64)> = question.rows().fetch_all(&self.pool).await?;
        let bulk = |(id, n_chunks, n_transitions): (String, i64, i64)| Bulk {
            id,
            n_chunks: n_chunks.unsigned_abs(),
            n_transitions: n_transitions.unsigned_abs(),
        };
        Ok(rows.into_iter().map(bulk).collect())
    }
}
