//! Queries for the list of the fleet, for a range of asset names. They are repeated
//! often, so their cost must not grow with the number of stored sessions.

use super::query_builder::QueryBuilder;
use super::read::SESSION;
use super::{FaultRow, Micros, SessionRow, Store, StoreError, WarningRow};

const LAST_SESSIONS: &str = "SELECT last.asset, COALESCE(last.ended_at, last.opened_at)
    FROM asset CROSS JOIN session last
    WHERE asset.name >= $1 AND asset.name <= $2 AND last.id = (
        SELECT id FROM session WHERE session.asset = asset.name
        ORDER BY opened_at DESC, id DESC LIMIT 1)";

const WARNINGS: &str = "SELECT last.asset, last.calibration_id, last.warnings
    FROM asset CROSS JOIN (SELECT 'x' AS name UNION ALL SELECT 'y') axis CROSS JOIN trend last
    WHERE asset.name >= $1 AND asset.name <= $2
    AND last.axis = axis.name AND last.warnings IS NOT NULL AND last.session = (
        SELECT session FROM trend WHERE trend.asset = asset.name AND trend.axis = axis.name
        ORDER BY ended_at DESC, session DESC LIMIT 1)
    ORDER BY last.asset, last.axis";

impl Store {
    /// The open sessions of the assets from `first` to `last`.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails; so do all queries here.
    pub async fn open_sessions_of(
        &self,
        first: &str,
        last: &str,
    ) -> Result<Vec<SessionRow>, StoreError> {
        let mut query = QueryBuilder::new(SESSION);
        query.push("state = 'open' AND asset >= ").bind(first)?;
        query.push(" AND asset <= ").bind(last)?;
        self.session_rows(query).await
    }

    /// For each asset from `first` to `last`, the time at which its latest session ended
    /// or, if it is open, was opened.
    pub async fn last_sessions_of(
        &self,
        first: &str,
        last: &str,
    ) -> Result<Vec<(String, Micros)>, StoreError> {
        let rows = sqlx::query_as(LAST_SESSIONS).bind(first).bind(last);
        Ok(rows.fetch_all(&self.pool).await?)
    }

    /// The active faults of the assets from `first` to `last`.
    pub async fn active_faults_of(
        &self,
        first: &str,
        last: &str,
    ) -> Result<Vec<FaultRow>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT * FROM fault WHERE asset >= $1 AND asset <= $2
             AND status IN ('pending', 'confirmed') ORDER BY asset, status, code",
        )
        .bind(first)
        .bind(last)
        .fetch_all(&self.pool)
        .await?)
    }

    /// The assets from `first` to `last` whose data stay away, each with the time at which the
    /// last data arrived.
    pub async fn lost_communications_of(
        &self,
        first: &str,
        last: &str,
    ) -> Result<Vec<(String, Micros)>, StoreError> {
        let rows = sqlx::query_as(
            "SELECT asset, since FROM communication
             WHERE asset >= $1 AND asset <= $2 AND lost = 1",
        );
        Ok(rows.bind(first).bind(last).fetch_all(&self.pool).await?)
    }

    /// The learning records of the assets from `first` to `last`, with the asset's name,
    /// for those that have one.
    pub async fn learning_of(
        &self,
        first: &str,
        last: &str,
    ) -> Result<Vec<(String, String)>, StoreError> {
        let rows = sqlx::query_as(
            "SELECT name, learning FROM asset
             WHERE name >= $1 AND name <= $2 AND learning IS NOT NULL",
        );
        Ok(rows.bind(first).bind(last).fetch_all(&self.pool).await?)
    }

    /// The drift warnings of the assets from `first` to `last`, each axis by the last
    /// session that estimated it.
    pub async fn warnings_of(
        &self,
        first: &str,
        last: &str,
    ) -> Result<Vec<WarningRow>, StoreError> {
        let rows = sqlx::query_as(WARNINGS).bind(first).bind(last);
        Ok(rows.fetch_all(&self.pool).await?)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};

    use sqlx::sqlite::SqliteConnection;
    use sqlx::{Connection, Executor};

    use super::*;
    use crate::Location;
    use crate::file::file_url;

    /// Two assets with `$1` sessions each, which have warnings for both axes.
    const HISTORY: &str = "
        INSERT INTO asset (name, document, revision, created_at, updated_at)
            VALUES ('a', '{}', 1, 0, 0), ('b', '{}', 1, 0, 0);
        INSERT INTO session (id, asset, name, state, opened_at, ended_at, setup, baseline,
            n_samples, n_rejected)
        WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < $1)
        SELECT asset.name || i, asset.name, i, 'ended', 10 * i, 10 * i + 5, '{}', '{}', 0, 0
            FROM n, asset;
        INSERT INTO trend SELECT id, axis.name, asset, ended_at, 0, NULL, 1, 1, 1, 1, 1, 1, 1,
            axis.name
            FROM session, (SELECT 'x' AS name UNION ALL SELECT 'y') axis";

    /// A database with `n` sessions per asset, and a connection to it.
    async fn with_history(folder: &tempfile::TempDir, n: u32) -> (Store, SqliteConnection) {
        let location = Location::File(folder.path().join(format!("{n}.db")));
        let (store, writer) = Store::open(&location).await.unwrap();
        writer.close().await.unwrap();
        let url = file_url(location.file().unwrap(), "rw").unwrap();
        let mut db = SqliteConnection::connect(&url).await.unwrap();
        db.execute(sqlx::AssertSqlSafe(HISTORY.replace("$1", &n.to_string()))).await.unwrap();
        (store, db)
    }

    /// Instructions of SQLite's virtual machine that `query` executes.
    async fn cost(db: &mut SqliteConnection, query: &'static str) -> u64 {
        let count = Arc::new(AtomicU64::new(0));
        let counted = count.clone();
        db.lock_handle().await.unwrap().set_progress_handler(1, move || {
            counted.fetch_add(1, Ordering::Relaxed);
            true
        });
        let rows = sqlx::query(query).bind("a").bind("b").fetch_all(&mut *db).await.unwrap();
        assert!(!rows.is_empty());
        db.lock_handle().await.unwrap().remove_progress_handler();
        count.load(Ordering::Relaxed)
    }

    #[tokio::test]
    async fn a_long_history_costs_no_more_than_a_short_one() {
        let folder = tempfile::tempdir().unwrap();
        let (_, mut short) = with_history(&folder, 2).await;
        let (_, mut long) = with_history(&folder, 200).await;
        for query in [LAST_SESSIONS, WARNINGS] {
            let (short, long) = (cost(&mut short, query).await, cost(&mut long, query).await);
            assert_eq!(short, long, "{query}");
        }
    }

    #[tokio::test]
    async fn the_last_of_each_asset_counts() {
        let folder = tempfile::tempdir().unwrap();
        let (store, mut db) = with_history(&folder, 3).await;
        let last = store.last_sessions_of("a", "b").await.unwrap();
        assert_eq!(last, [("a".to_owned(), 35), ("b".to_owned(), 35)]);
        assert_eq!(store.last_sessions_of("b", "z").await.unwrap().len(), 1);
        let warnings = async || store.warnings_of("a", "b").await.unwrap();
        let of =
            |rows: Vec<WarningRow>| Vec::from_iter(rows.into_iter().map(|r| r.asset + &r.warnings));
        assert_eq!(of(warnings().await), ["ax", "ay", "bx", "by"]);
        // A later session without a warning ends it; one without an estimate of the axis
        // does not.
        let over = "UPDATE trend SET warnings = NULL WHERE session = 'a3' AND axis = 'x';
                    DELETE FROM trend WHERE session = 'b3' AND axis = 'y'";
        db.execute(over).await.unwrap();
        assert_eq!(of(warnings().await), ["ay", "bx", "by"]);
    }
}
