//! Queries of the store.

use super::codec::ChunkKey;
use super::progress::stored_progress;
use super::query_builder::QueryBuilder;
use super::rows::published_counter;
use super::{
    ActionRow, AssetRow, CalibrationRow, EventRow, FaultRow, Micros, PartitionId, ReplayRow,
    SessionRow, Store, StoreError, TransitionRow, TrendEntry, TrendRow, decode_chunk,
};
use offbd_core::vocabulary::Sample;
use sqlx::AnyConnection;

/// A filter for a list of sessions, by their time of opening.
#[derive(Clone, Debug, Default)]
pub struct SessionFilter {
    pub asset: Option<String>,
    /// `open` or `ended`.
    pub state: Option<String>,
    /// How the name begins.
    pub name: Option<String>,
    /// Opened at this time or later.
    pub opened_from: Option<Micros>,
    /// Opened before this time.
    pub opened_to: Option<Micros>,
    /// Ended, with or without a confirmed fault.
    pub found_fault: Option<bool>,
    /// A tag of the asset.
    pub tag: Option<String>,
    /// Oldest first instead of newest first.
    pub is_ascending: bool,
    /// Opening time and id of the last session of the previous page.
    pub after: Option<(Micros, String)>,
}

/// A filter for a list of assets, by name.
#[derive(Clone, Debug, Default)]
pub struct AssetFilter {
    /// Only names after this one.
    pub after: String,
    /// How the name begins.
    pub name: Option<String>,
    /// Whether a fault is pending or confirmed.
    pub has_fault: Option<bool>,
    /// Whether a session is open.
    pub has_session: Option<bool>,
    /// A tag of the asset.
    pub tag: Option<String>,
}

/// The order of a list of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FaultOrder {
    /// The latest change first.
    #[default]
    Newest,
    Oldest,
    /// By asset, then code.
    Asset,
}

/// A filter for a list of faults.
#[derive(Clone, Debug, Default)]
pub struct FaultFilter {
    /// The wanted statuses; all if empty.
    pub statuses: Vec<&'static str>,
    pub asset: Option<String>,
    pub code: Option<&'static str>,
    pub acknowledged: Option<bool>,
    /// A tag of the asset.
    pub tag: Option<String>,
    pub order: FaultOrder,
    /// Time of the last change, asset and code of the last fault of the previous page.
    pub after: Option<(Micros, String, String)>,
}

pub(super) const SESSION: &str = "SELECT * FROM session WHERE ";

/// The condition that neither the session nor its asset is hidden.
pub(super) const VISIBLE: &str = "expired_at IS NULL
    AND asset NOT IN (SELECT name FROM asset WHERE deleted_at IS NOT NULL) AND ";

/// Most ranges of time in one query. Chosen: beyond it, chunks between two ranges are read
/// as well.
const MAX_TIME_RANGES: usize = 32;

/// Gap that separates two ranges of time in a query, s. Chosen.
const LONG_GAP_S: f64 = 10.0;

impl Store {
    /// The asset `name`.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails; so do all queries here.
    pub async fn asset(&self, name: &str) -> Result<Option<AssetRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM asset WHERE name = $1 AND deleted_at IS NULL")
            .bind(name)
            .fetch_optional(&self.pool)
            .await?)
    }

    /// When the asset `name` was registered.
    pub async fn asset_created_at(&self, name: &str) -> Result<Option<Micros>, StoreError> {
        let query = "SELECT created_at FROM asset WHERE name = $1 AND deleted_at IS NULL";
        Ok(sqlx::query_scalar(query).bind(name).fetch_optional(&self.pool).await?)
    }

    /// The learning record of the asset `name`, if it has one.
    pub async fn learning(&self, name: &str) -> Result<Option<String>, StoreError> {
        let query = "SELECT learning FROM asset WHERE name = $1 AND learning IS NOT NULL";
        Ok(sqlx::query_scalar(query).bind(name).fetch_optional(&self.pool).await?)
    }

    /// Assets that match `filter`, sorted by name.
    pub async fn assets(
        &self,
        filter: &AssetFilter,
        limit: u32,
    ) -> Result<Vec<AssetRow>, StoreError> {
        let mut query = QueryBuilder::new("SELECT * FROM asset WHERE deleted_at IS NULL");
        query.push(" AND name > ").bind(filter.after.clone())?;
        push_name(&mut query, filter.name.as_deref())?;
        query.push_tagged("name", filter.tag.as_deref())?;
        for (wanted, related) in [
            (
                filter.has_fault,
                "EXISTS (SELECT 1 FROM fault WHERE fault.asset = asset.name
                     AND status IN ('pending', 'confirmed'))",
            ),
            (
                filter.has_session,
                "EXISTS (SELECT 1 FROM session WHERE session.asset = asset.name AND state = 'open')",
            ),
        ] {
            match wanted {
                Some(true) => drop(query.push(" AND ").push(related)),
                Some(false) => drop(query.push(" AND NOT ").push(related)),
                None => {}
            }
        }
        query.push(" ORDER BY name LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// The number of assets.
    pub async fn n_assets(&self) -> Result<i64, StoreError> {
        // Indexes answer both counts, so that no document is read.
        let count = sqlx::query_scalar(
            "SELECT (SELECT COUNT(*) FROM asset) -
             (SELECT COUNT(*) FROM asset WHERE deleted_at IS NOT NULL)",
        );
        Ok(count.fetch_one(&self.pool).await?)
    }

    /// The id of the session that follows the session `id` in the order of ids.
    pub async fn session_after(&self, id: &str) -> Result<Option<String>, StoreError> {
        let next = "SELECT id FROM session WHERE id > $1 ORDER BY id LIMIT 1";
        Ok(sqlx::query_scalar(next).bind(id).fetch_optional(&self.pool).await?)
    }

    /// The names of the assets whose open session has at least `n_samples` samples after the
    /// last snapshot by this `version` of the engine; of the partitions `owned`, or of all.
    pub async fn assets_behind(
        &self,
        version: &str,
        n_samples: i64,
        owned: Option<&[PartitionId]>,
    ) -> Result<Vec<String>, StoreError> {
        let mut query =
            QueryBuilder::new("SELECT asset FROM session WHERE state = 'open' AND n_samples >= ");
        query.bind(n_samples)?.push(
            " + COALESCE((SELECT MAX(snapshot.n_samples) FROM snapshot
              WHERE snapshot.session = session.id AND version = ",
        );
        query.bind(version.to_owned())?.push("), 0)").push_owned(owned)?;
        query.push(" ORDER BY asset");
        let rows: Vec<(String,)> = query.rows().fetch_all(&self.pool).await?;
        Ok(rows.into_iter().map(|(asset,)| asset).collect())
    }

    /// The session `id`.
    pub async fn session(&self, id: &str) -> Result<Option<SessionRow>, StoreError> {
        let progress = self.journal.progress(id);
        let mut query = QueryBuilder::new(SESSION);
        query.push(VISIBLE).push("id = ").bind(id)?;
        let row: Option<SessionRow> = query.rows().fetch_optional(&self.pool).await?;
        Ok(row.map(|mut row| {
            row.advance(progress.as_ref());
            row
        }))
    }

    /// The asset of the session `id`.
    pub async fn asset_of_session(&self, id: &str) -> Result<Option<String>, StoreError> {
        let mut query = QueryBuilder::new("SELECT asset FROM session WHERE ");
        query.push(VISIBLE).push("id = ").bind(id)?;
        let row: Option<(String,)> = query.rows().fetch_optional(&self.pool).await?;
        Ok(row.map(|(asset,)| asset))
    }

    /// The open session of `asset`.
    pub async fn open_session(&self, asset: &str) -> Result<Option<SessionRow>, StoreError> {
        let mut query = QueryBuilder::new(SESSION);
        query.push("state = 'open' AND asset = ").bind(asset)?;
        self.session_row(query).await
    }

    /// The session of `asset` with this name, also if it is hidden: its name is taken
    /// until it is deleted.
    pub async fn session_named(
        &self,
        asset: &str,
        name: &str,
    ) -> Result<Option<SessionRow>, StoreError> {
        let mut query = QueryBuilder::new(SESSION);
        query.push("asset = ").bind(asset)?.push(" AND name = ").bind(name)?;
        self.session_row(query).await
    }

    /// A later part of the session that a device calls `name`. The first part of it, which has
    /// that name, may have been deleted.
    pub async fn later_part_of(
        &self,
        asset: &str,
        name: &str,
    ) -> Result<Option<SessionRow>, StoreError> {
        let mut query = QueryBuilder::new(SESSION);
        query.push("asset = ").bind(asset)?.push(" AND first_part IS NOT NULL AND name = ");
        query.bind(name)?.push(" || ' (' || CAST(part AS TEXT) || ')' ORDER BY part LIMIT 1");
        self.session_row(query).await
    }

    /// The last parts of the session whose first part is `first`, the newest first.
    pub async fn parts(&self, first: &str, limit: u32) -> Result<Vec<SessionRow>, StoreError> {
        let mut query = QueryBuilder::new(SESSION);
        query.push("id = ").bind(first.to_owned())?;
        query.push(" OR first_part = ").bind(first.to_owned())?;
        query.push(" ORDER BY part DESC LIMIT ").bind(i64::from(limit))?;
        self.session_rows(query).await
    }

    /// The latest time in the last two chunks of `session`, s.
    pub async fn newest_t_s(&self, session: &str) -> Result<Option<f64>, StoreError> {
        let newest = "SELECT MAX(max_t_s) FROM (
             SELECT max_t_s FROM chunk WHERE session = $1
             ORDER BY first_index DESC LIMIT 2) AS newest";
        Ok(sqlx::query_scalar(newest).bind(session).fetch_one(&self.pool).await?)
    }

    /// Sessions that match `filter`, in its order.
    pub async fn sessions(
        &self,
        filter: &SessionFilter,
        limit: u32,
    ) -> Result<Vec<SessionRow>, StoreError> {
        let mut query = QueryBuilder::new(SESSION);
        query.push(VISIBLE).push("1 = 1");
        if let Some(asset) = &filter.asset {
            query.push(" AND asset = ").bind(asset)?;
        }
        match filter.state.as_deref() {
            // Open sessions are few and have a partial index, which is used only if the
            // SQL has this literal. Ended ones are many: bound as a parameter, their
            // state does not keep the database from reading a page in the order of
            // opening.
            Some("open") => drop(query.push(" AND state = 'open'")),
            Some(state) => drop(query.push(" AND state = ").bind(state)?),
            None => {}
        }
        push_name(&mut query, filter.name.as_deref())?;
        query.push_tagged("asset", filter.tag.as_deref())?;
        if let Some(from) = filter.opened_from {
            query.push(" AND opened_at >= ").bind(from)?;
        }
        if let Some(to) = filter.opened_to {
            query.push(" AND opened_at < ").bind(to)?;
        }
        // A literal, because there is a partial index of the few with a fault.
        match filter.found_fault {
            Some(true) => drop(query.push(" AND found_fault = 1")),
            Some(false) => drop(query.push(" AND found_fault = 0")),
            None => {}
        }
        if let Some((opened_at, id)) = &filter.after {
            let beyond = if filter.is_ascending { ") > (" } else { ") < (" };
            query.push(" AND (opened_at, id").push(beyond).bind(opened_at)?;
            query.push(", ").bind(id)?.push(")");
        }
        query.push(match filter.is_ascending {
            true => " ORDER BY opened_at, id LIMIT ",
            false => " ORDER BY opened_at DESC, id DESC LIMIT ",
        });
        query.bind(i64::from(limit))?;
        self.session_rows(query).await
    }

    /// The result of `query` for one session.
    async fn session_row(&self, query: QueryBuilder) -> Result<Option<SessionRow>, StoreError> {
        Ok(self.session_rows(query).await?.into_iter().next())
    }

    /// The result of `query` for sessions. The progress of the open ones is queried again by
    /// their ids, because the journal is indexed by id and must be read before the tables.
    pub(super) async fn session_rows(
        &self,
        query: QueryBuilder,
    ) -> Result<Vec<SessionRow>, StoreError> {
        self.session_rows_of(&mut *self.pool.acquire().await?, query).await
    }

    /// As [`session_rows`](Self::session_rows), on the connection `db`.
    pub(super) async fn session_rows_of(
        &self,
        db: &mut AnyConnection,
        query: QueryBuilder,
    ) -> Result<Vec<SessionRow>, StoreError> {
        let mut rows: Vec<SessionRow> = query.rows().fetch_all(&mut *db).await?;
        let is_open = |row: &&SessionRow| row.is_open();
        let open: Vec<_> = rows.iter().filter(is_open).map(|row| row.id.clone()).collect();
        let in_journal = self.journal.progress_of(&open);
        if open.is_empty() {
            return Ok(rows);
        }
        let stored = stored_progress(db, &open).await?;
        for row in &mut rows {
            row.advance(stored.get(&row.id));
            row.advance(in_journal.get(&row.id));
        }
        Ok(rows)
    }

    /// Samples of `session` from `index` on, as many as are stored together (in one chunk
    /// or in the journal); `None` if the sample at `index` is not there.
    pub(super) async fn samples_from(
        &self,
        session: &str,
        index: i64,
    ) -> Result<Option<Vec<Sample>>, StoreError> {
        if let Some(samples) = self.journal.samples_from(session, index)? {
            return Ok(Some(samples));
        }
        let row: Option<(i64, i64, Vec<u8>)> = sqlx::query_as(
            "SELECT first_index, n, data FROM chunk WHERE session = $1 AND first_index <= $2
             ORDER BY first_index DESC LIMIT 1",
        )
        .bind(session)
        .bind(index)
        .fetch_optional(&self.pool)
        .await?;
        let row = row.filter(|(first_index, n, _)| index < first_index + n);
        let Some((first_index, _, data)) = row else { return Ok(None) };
        let mut samples = decode_chunk(&data, ChunkKey { session, first_index })?;
        let at = usize::try_from(index - first_index).unwrap_or_default();
        Ok((at < samples.len()).then(|| samples.split_off(at)))
    }

    /// The recorded samples of `session` with one of the `times`, which ascend. Returns
    /// `None` if more than `limit` chunks would have to be searched.
    pub async fn samples_at(
        &self,
        session: &str,
        times: &[f64],
        limit: u32,
    ) -> Result<Option<Vec<Sample>>, StoreError> {
        let is_asked = |sample: &Sample| {
            let after = times.partition_point(|&t_s| t_s <= sample.t_s);
            after > 0 && times[after - 1] == sample.t_s
        };
        // The journal first: what is folded meanwhile is in the chunks then.
        let journal = self.journal.run(session)?.map(|run| run.samples).unwrap_or_default();
        let mut found: Vec<Sample> = journal.into_iter().filter(is_asked).collect();
        let mut query = QueryBuilder::new("SELECT first_index, data FROM chunk WHERE session = ");
        query.bind(session.to_owned())?;
        push_times(&mut query, times)?;
        query.push(" ORDER BY first_index DESC LIMIT ").bind(i64::from(limit) + 1)?;
        let rows: Vec<(i64, Vec<u8>)> = query.rows().fetch_all(&self.pool).await?;
        if rows.len() > limit as usize {
            return Ok(None);
        }
        for (first_index, data) in rows {
            let samples = decode_chunk(&data, ChunkKey { session, first_index })?;
            found.extend(samples.into_iter().filter(is_asked));
        }
        Ok(Some(found))
    }

    /// The actions of people in `session`, in order.
    pub async fn actions(&self, session: &str) -> Result<Vec<ActionRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM action WHERE session = $1 ORDER BY after_index, id")
            .bind(session)
            .fetch_all(&self.pool)
            .await?)
    }

    /// The transitions of `session`, in order, from ordinal `from`.
    pub async fn transitions(
        &self,
        session: &str,
        from: i64,
        limit: u32,
    ) -> Result<Vec<TransitionRow>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT * FROM transition WHERE session = $1 AND ordinal >= $2
             ORDER BY ordinal LIMIT $3",
        )
        .bind(session)
        .bind(from)
        .bind(i64::from(limit))
        .fetch_all(&self.pool)
        .await?)
    }

    /// Transitions of `code` in `session` with an ordinal below `before`, latest first.
    pub async fn transitions_of(
        &self,
        session: &str,
        code: &str,
        before: i64,
        limit: u32,
    ) -> Result<Vec<TransitionRow>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT * FROM transition WHERE session = $1 AND code = $2 AND ordinal < $3
             ORDER BY ordinal DESC LIMIT $4",
        )
        .bind(session)
        .bind(code)
        .bind(before)
        .bind(i64::from(limit))
        .fetch_all(&self.pool)
        .await?)
    }

    /// The number of transitions of `session`.
    pub async fn n_transitions(&self, session: &str) -> Result<i64, StoreError> {
        Ok(sqlx::query_scalar("SELECT COUNT(*) FROM transition WHERE session = $1")
            .bind(session)
            .fetch_one(&self.pool)
            .await?)
    }

    /// Events with an id above `after`, of `asset` or, if `None`, of all assets.
    pub async fn events(
        &self,
        asset: Option<&str>,
        after: i64,
        limit: u32,
    ) -> Result<Vec<EventRow>, StoreError> {
        let mut query = QueryBuilder::new("");
        for select in [
            "SELECT id, 'fault' AS kind, asset, session, document FROM transition WHERE id > ",
            " UNION ALL SELECT id, 'fault', asset, session, event FROM action
             WHERE event IS NOT NULL AND id > ",
            " UNION ALL SELECT id, 'communication', asset, session, document
             FROM communication_change WHERE id > ",
        ] {
            query.push(select).bind(after)?;
            if let Some(asset) = asset {
                query.push(" AND asset = ").bind(asset)?;
            }
        }
        query.push(" ORDER BY id LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// The servo estimates of the sessions of `asset`, newest first, at most `limit`. A
    /// session has one for each axis.
    pub async fn trend(&self, asset: &str, limit: u32) -> Result<Vec<TrendEntry>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT trend.*, session.name AS session_name FROM trend
             JOIN session ON session.id = trend.session WHERE trend.asset = $1
             ORDER BY trend.ended_at DESC, trend.session DESC, trend.axis LIMIT $2",
        )
        .bind(asset)
        .bind(i64::from(limit))
        .fetch_all(&self.pool)
        .await?)
    }

    /// The servo estimates of the sessions of `asset` that were opened from `from` to before
    /// `to`, at most `limit`.
    pub async fn trend_between(
        &self,
        asset: &str,
        from: Micros,
        to: Micros,
        limit: u32,
    ) -> Result<Vec<TrendRow>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT trend.* FROM trend JOIN session ON session.id = trend.session
             WHERE trend.asset = $1 AND session.opened_at >= $2 AND session.opened_at < $3
             LIMIT $4",
        )
        .bind(asset)
        .bind(from)
        .bind(to)
        .bind(i64::from(limit))
        .fetch_all(&self.pool)
        .await?)
    }

    /// The transitions of `asset` or, if `None`, of all assets from a time to before another,
    /// the latest first, at most `limit`.
    pub async fn transitions_between(
        &self,
        asset: Option<&str>,
        (from, to): (Micros, Micros),
        limit: u32,
    ) -> Result<Vec<TransitionRow>, StoreError> {
        let mut query = QueryBuilder::new("SELECT * FROM transition WHERE at >= ");
        query.bind(from)?.push(" AND at < ").bind(to)?;
        if let Some(asset) = asset {
            query.push(" AND asset = ").bind(asset.to_owned())?;
        }
        query.push(" ORDER BY at DESC, id DESC LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// Transitions of `code` of `asset` with an id below `before`, newest first.
    pub async fn transitions_before(
        &self,
        asset: &str,
        code: &str,
        before: i64,
        limit: u32,
    ) -> Result<Vec<TransitionRow>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT * FROM transition WHERE asset = $1 AND code = $2 AND id < $3
             ORDER BY id DESC LIMIT $4",
        )
        .bind(asset)
        .bind(code)
        .bind(before)
        .bind(i64::from(limit))
        .fetch_all(&self.pool)
        .await?)
    }

    /// Actions of people on `code` of `asset` with an id below `before`, newest first.
    pub async fn actions_before(
        &self,
        asset: &str,
        code: &str,
        before: i64,
        limit: u32,
    ) -> Result<Vec<ActionRow>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT * FROM action WHERE asset = $1 AND code = $2 AND id < $3
             ORDER BY id DESC LIMIT $4",
        )
        .bind(asset)
        .bind(code)
        .bind(before)
        .bind(i64::from(limit))
        .fetch_all(&self.pool)
        .await?)
    }

    /// The id of the latest event.
    pub async fn last_event(&self) -> Result<i64, StoreError> {
        Ok(sqlx::query_scalar("SELECT value FROM counter WHERE name = 'event'")
            .fetch_one(&self.pool)
            .await?)
    }

    /// The id of the last event that was published on a bus; `None` before the first one.
    pub async fn published(&self, bus: &str) -> Result<Option<i64>, StoreError> {
        let query = sqlx::query_scalar("SELECT value FROM counter WHERE name = $1");
        Ok(query.bind(published_counter(bus)).fetch_optional(&self.pool).await?)
    }

    /// Faults that match `filter`.
    pub async fn faults(
        &self,
        filter: &FaultFilter,
        limit: u32,
    ) -> Result<Vec<FaultRow>, StoreError> {
        let mut query = QueryBuilder::new("SELECT * FROM fault WHERE 1 = 1");
        if !filter.statuses.is_empty() {
            query.push(" AND status IN (");
            for (i, status) in filter.statuses.iter().enumerate() {
                query.push(if i == 0 { "" } else { ", " }).bind(*status)?;
            }
            query.push(")");
        }
        if let Some(asset) = &filter.asset {
            query.push(" AND asset = ").bind(asset)?;
        }
        if let Some(code) = filter.code {
            query.push(" AND code = ").bind(code)?;
        }
        if let Some(acknowledged) = filter.acknowledged {
            query.push(" AND acknowledged = ").bind(i64::from(acknowledged))?;
        }
        query.push_tagged("asset", filter.tag.as_deref())?;
        push_page(&mut query, filter)?;
        query.push(" LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// The fault `code` of `asset`.
    pub async fn fault(&self, asset: &str, code: &str) -> Result<Option<FaultRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM fault WHERE asset = $1 AND code = $2")
            .bind(asset)
            .bind(code)
            .fetch_optional(&self.pool)
            .await?)
    }

    /// The replay `id`.
    pub async fn replay(&self, id: &str) -> Result<Option<ReplayRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM replay WHERE id = $1")
            .bind(id)
            .fetch_optional(&self.pool)
            .await?)
    }

    /// Ids of the replays that an earlier process did not finish; of the partitions `owned`,
    /// or of all.
    pub async fn unfinished_replays(
        &self,
        owned: Option<&[PartitionId]>,
    ) -> Result<Vec<String>, StoreError> {
        let mut query = QueryBuilder::new(
            "SELECT replay.id FROM replay JOIN session ON session.id = replay.session
             WHERE replay.state IN ('queued', 'running')",
        );
        query.push_owned(owned)?.push(" ORDER BY replay.id");
        let rows: Vec<(String,)> = query.rows().fetch_all(&self.pool).await?;
        Ok(rows.into_iter().map(|(id,)| id).collect())
    }

    /// The calibration `id`.
    pub async fn calibration(&self, id: &str) -> Result<Option<CalibrationRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM calibration WHERE id = $1")
            .bind(id)
            .fetch_optional(&self.pool)
            .await?)
    }

    /// The calibrations of `asset`, newest first, from the one after `before` (its time
    /// and id).
    pub async fn calibrations(
        &self,
        asset: &str,
        before: Option<(Micros, &str)>,
        limit: u32,
    ) -> Result<Vec<CalibrationRow>, StoreError> {
        let mut query = QueryBuilder::new("SELECT * FROM calibration WHERE asset = ");
        query.bind(asset)?;
        if let Some((made_at, id)) = before {
            query.push(" AND (made_at, id) < (").bind(made_at)?;
            query.push(", ").bind(id)?.push(")");
        }
        query.push(" ORDER BY made_at DESC, id DESC LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// The calibrations that an earlier process did not finish, each by its id and who made it;
    /// of the partitions `owned`, or of all.
    pub async fn unfinished_calibrations(
        &self,
        owned: Option<&[PartitionId]>,
    ) -> Result<Vec<(String, Option<String>)>, StoreError> {
        let mut query = QueryBuilder::new(
            "SELECT id, made_by FROM calibration WHERE state IN ('queued', 'running')",
        );
        query.push_owned(owned)?.push(" ORDER BY id");
        Ok(query.rows().fetch_all(&self.pool).await?)
    }
}

/// Appends the condition that the name begins with `start`. No pattern, whose wildcards may
/// occur in a name.
fn push_name(query: &mut QueryBuilder, start: Option<&str>) -> Result<(), StoreError> {
    if let Some(start) = start {
        query.push(" AND SUBSTR(name, 1, LENGTH(").bind(start.to_owned())?;
        query.push(")) = ").bind(start.to_owned())?;
    }
    Ok(())
}

/// Appends the condition that a chunk may have samples at one of the `times`, which ascend.
fn push_times(query: &mut QueryBuilder, times: &[f64]) -> Result<(), StoreError> {
    query.push(" AND (");
    for (i, (first, last)) in time_ranges(times).into_iter().enumerate() {
        query.push(if i > 0 { " OR (min_t_s <= " } else { "(min_t_s <= " }).bind(last)?;
        query.push(" AND max_t_s >= ").bind(first)?.push(")");
    }
    query.push(")");
    Ok(())
}

/// Appends the condition for the next page, and the order.
fn push_page(query: &mut QueryBuilder, filter: &FaultFilter) -> Result<(), StoreError> {
    if let Some((changed_at, asset, code)) = &filter.after {
        match filter.order {
            FaultOrder::Newest => query.push(" AND (changed_at, asset, code) < ("),
            FaultOrder::Oldest => query.push(" AND (changed_at, asset, code) > ("),
            FaultOrder::Asset => query.push(" AND (asset, code) > ("),
        };
        if filter.order != FaultOrder::Asset {
            query.bind(*changed_at)?.push(", ");
        }
        query.bind(asset.clone())?.push(", ").bind(code.clone())?.push(")");
    }
    query.push(match filter.order {
        FaultOrder::Newest => " ORDER BY changed_at DESC, asset DESC, code DESC",
        FaultOrder::Oldest => " ORDER BY changed_at, asset, code",
        FaultOrder::Asset => " ORDER BY asset, code",
    });
    Ok(())
}

/// Cuts ascending `times` into at most [`MAX_TIME_RANGES`] ranges without long gaps.
fn time_ranges(times: &[f64]) -> Vec<(f64, f64)> {
    let mut ranges: Vec<(f64, f64)> = Vec::new();
    for &t_s in times {
        let is_full = ranges.len() == MAX_TIME_RANGES;
        match ranges.last_mut() {
            Some((_, last)) if is_full || t_s - *last <= LONG_GAP_S => *last = t_s,
            _ => ranges.push((t_s, t_s)),
        }
    }
    ranges
}
