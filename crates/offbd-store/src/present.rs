//! The faults on record and the lost communications of the fleet, and the event that told last
//! of each.

use super::from_row::from_row;
use super::rows::EventRow;
use super::{Store, StoreError};

/// A fault on record, or lost communication.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PresentFaultRow {
    pub asset: String,
    /// A fault code, or `communication_lost`.
    pub code: String,
    pub status: String,
}

from_row!(PresentFaultRow { asset, code, status });

impl Store {
    /// What is on record of assets that are not deleted, in the order of assets and codes, after
    /// an asset and a code, at most `limit`.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails; so do all queries here.
    pub async fn present_faults(
        &self,
        (asset, code): (&str, &str),
        limit: u32,
    ) -> Result<Vec<PresentFaultRow>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT asset, code, status FROM (
                 SELECT asset, code, status FROM fault WHERE status <> 'cleared'
                 UNION ALL SELECT asset, 'communication_lost', 'confirmed' FROM communication
                 WHERE lost = 1
             ) AS present
             WHERE asset NOT IN (SELECT name FROM asset WHERE deleted_at IS NOT NULL)
             AND (asset, code) > ($1, $2) ORDER BY asset, code LIMIT $3",
        )
        .bind(asset)
        .bind(code)
        .bind(i64::from(limit))
        .fetch_all(&self.pool)
        .await?)
    }

    /// The last event about `code` of `asset`; `None` if it was deleted with its session.
    pub async fn last_event_of(
        &self,
        asset: &str,
        code: &str,
    ) -> Result<Option<EventRow>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT id, 'fault' AS kind, asset, session, document FROM transition
             WHERE asset = $1 AND code = $2
             UNION ALL SELECT id, 'fault', asset, session, event FROM action
             WHERE event IS NOT NULL AND asset = $1 AND code = $2
             UNION ALL SELECT id, 'communication', asset, session, document
             FROM communication_change WHERE asset = $1 AND $2 = 'communication_lost'
             ORDER BY id DESC LIMIT 1",
        )
        .bind(asset)
        .bind(code)
        .fetch_optional(&self.pool)
        .await?)
    }
}
