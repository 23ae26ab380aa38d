//! Queries of retention and deletion: which ended sessions are old, which assets store
//! too much, and what is left of hidden assets and sessions. A session in which a fault
//! changed its status is *around a fault*, all others are *plain*.

use super::query_builder::QueryBuilder;
use super::{Micros, PartitionId, Store, StoreError};

/// The condition that a row of `session` is around a fault.
const AROUND_FAULT: &str =
    "EXISTS (SELECT 1 FROM transition WHERE transition.session = session.id)";

const CANDIDATE: &str =
    "SELECT id, n_bytes FROM session WHERE state = 'ended' AND expired_at IS NULL AND ";

const SIZE: &str = "SELECT id, asset,
    (SELECT COUNT(*) FROM chunk WHERE chunk.session = session.id),
    (SELECT COUNT(*) FROM transition WHERE transition.session = session.id)
    FROM session WHERE ";

/// How many rows of chunks and transitions a session has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SessionSize {
    pub id: String,
    pub asset: String,
    pub n_chunks: u64,
    pub n_transitions: u64,
}

impl Store {
    /// Ids and assets of sessions that ended before `moment`, the oldest first: those around
    /// a fault, or the plain ones. As in all queries here, only assets of the partitions
    /// `owned` count, or all.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails; so do all queries here.
    pub async fn sessions_ended_before(
        &self,
        moment: Micros,
        around_fault: bool,
        owned: Option<&[PartitionId]>,
        limit: u32,
    ) -> Result<Vec<(String, String)>, StoreError> {
        let mut query = QueryBuilder::new(
            "SELECT id, asset FROM session WHERE state = 'ended' AND expired_at IS NULL AND ",
        );
        query.push(if around_fault { "" } else { "NOT " }).push(AROUND_FAULT);
        query.push(" AND ended_at < ").bind(moment)?;
        query.push_owned(owned)?;
        query.push(" ORDER BY ended_at LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// The assets whose ended sessions have more than `bytes` bytes, with these bytes.
    pub async fn assets_above(
        &self,
        bytes: i64,
        owned: Option<&[PartitionId]>,
    ) -> Result<Vec<(String, i64)>, StoreError> {
        let mut query = QueryBuilder::new(
            "SELECT asset, CAST(SUM(n_bytes) AS BIGINT) FROM session
             WHERE state = 'ended' AND expired_at IS NULL",
        );
        query.push_owned(owned)?;
        query.push(" GROUP BY asset HAVING SUM(n_bytes) > ").bind(bytes)?;
        query.push(" ORDER BY asset");
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// Ids and bytes of the plain ended sessions of `asset`, the oldest first.
    pub async fn plain_sessions(
        &self,
        asset: &str,
        limit: u32,
    ) -> Result<Vec<(String, i64)>, StoreError> {
        let mut query = QueryBuilder::new(CANDIDATE);
        query.push("NOT ").push(AROUND_FAULT).push(" AND asset = ").bind(asset)?;
        query.push(" ORDER BY ended_at LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// Hidden sessions that are not deleted yet.
    pub async fn hidden_sessions(
        &self,
        owned: Option<&[PartitionId]>,
    ) -> Result<Vec<SessionSize>, StoreError> {
        let mut query = QueryBuilder::new(SIZE);
        query.push("expired_at IS NOT NULL").push_owned(owned)?;
        query.push(" ORDER BY expired_at");
        self.sizes(query).await
    }

    /// Ids and assets of the sessions of imports that are not complete.
    pub async fn importing_sessions(
        &self,
        owned: Option<&[PartitionId]>,
    ) -> Result<Vec<(String, String)>, StoreError> {
        let mut query = QueryBuilder::new(
            "SELECT id, asset FROM session WHERE state = 'open' AND importing = 1",
        );
        query.push_owned(owned)?.push(" ORDER BY id");
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// Hidden assets that are not deleted yet.
    pub async fn hidden_assets(
        &self,
        owned: Option<&[PartitionId]>,
    ) -> Result<Vec<String>, StoreError> {
        let mut query = QueryBuilder::new(
            "SELECT asset FROM (SELECT name AS asset FROM asset WHERE deleted_at IS NOT NULL)
             AS hidden WHERE 1 = 1",
        );
        query.push_owned(owned)?.push(" ORDER BY asset");
        let rows: Vec<(String,)> = query.rows().fetch_all(&self.pool).await?;
        Ok(rows.into_iter().map(|(name,)| name).collect())
    }

    /// Returns whether the asset `name` is hidden and not deleted yet.
    pub async fn is_being_deleted(&self, name: &str) -> Result<bool, StoreError> {
        let found: Option<String> =
            sqlx::query_scalar("SELECT name FROM asset WHERE deleted_at IS NOT NULL AND name = $1")
                .bind(name)
                .fetch_optional(&self.pool)
                .await?;
        Ok(found.is_some())
    }

    /// Some sessions of `asset`, hidden or not, at most `limit`.
    pub async fn session_sizes(
        &self,
        asset: &str,
        limit: u32,
    ) -> Result<Vec<SessionSize>, StoreError> {
        let mut query = QueryBuilder::new(SIZE);
        query.push("asset = ").bind(asset)?.push(" LIMIT ").bind(i64::from(limit))?;
        self.sizes(query).await
    }

    /// The size of the session `id`, hidden or not.
    pub async fn session_size(&self, id: &str) -> Result<Option<SessionSize>, StoreError> {
        let mut query = QueryBuilder::new(SIZE);
        query.push("id = ").bind(id)?;
        Ok(self.sizes(query).await?.pop())
    }

    async fn sizes(&self, query: QueryBuilder) -> Result<Vec<SessionSize>, StoreError> {
        let rows: Vec<(String, String, i64, i64)> = query.rows().fetch_all(&self.pool).await?;
        let size = |(id, asset, n_chunks, n_transitions): (String, String, i64, i64)| SessionSize {
            id,
            asset,
            n_chunks: n_chunks.unsigned_abs(),
            n_transitions: n_transitions.unsigned_abs(),
        };
        Ok(rows.into_iter().map(size).collect())
    }
}
