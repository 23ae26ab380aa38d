//! What can be asked of the store.

use super::question::Question;
use super::{
    ActionRow, AssetRow, CalibrationRow, EventRow, FaultRow, Micros, ReplayRow, SessionRow, Store,
    StoreError, TransitionRow, TrendEntry, codec,
};
use offbd_core::vocabulary::Sample;

/// Which sessions; newest first, `before` excluded.
#[derive(Clone, Debug, Default)]
pub struct SessionFilter {
    pub asset: Option<String>,
    /// `open` or `ended`.
    pub state: Option<String>,
    /// The last one of the page before: its opening and id.
    pub before: Option<(Micros, String)>,
}

/// In which order faults are listed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FaultOrder {
    /// The latest change first.
    #[default]
    Newest,
    Oldest,
    /// By asset, then code.
    Asset,
}

/// Which faults of the fleet.
#[derive(Clone, Debug, Default)]
pub struct FaultFilter {
    /// The words of the statuses wanted; empty: all.
    pub statuses: Vec<&'static str>,
    pub asset: Option<String>,
    pub code: Option<&'static str>,
    pub acknowledged: Option<bool>,
    pub order: FaultOrder,
    /// The last one of the page before: its change, asset and code.
    pub after: Option<(Micros, String, String)>,
}

pub(super) const SESSION: &str =
    "SELECT id, asset, name, state, opened_at, ended_at, setup, baseline,
    n_samples, n_rejected, first_t_s, last_t_s, last_seq, verdict, verdict_hash FROM session
    WHERE ";

/// Not given up, nor its asset.
const KEPT: &str = "expired_at IS NULL
    AND asset NOT IN (SELECT name FROM asset WHERE deleted_at IS NOT NULL) AND ";

impl Store {
    /// # Errors
    /// [`StoreError`], as for every question here, if the database fails.
    pub async fn asset(&self, name: &str) -> Result<Option<AssetRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM asset WHERE name = $1 AND deleted_at IS NULL")
            .bind(name)
            .fetch_optional(&self.pool)
            .await?)
    }

    /// What the learning of asset `name` by itself has come to, if anything.
    pub async fn learning(&self, name: &str) -> Result<Option<String>, StoreError> {
        let question = "SELECT learning FROM asset WHERE name = $1 AND learning IS NOT NULL";
        Ok(sqlx::query_scalar(question).bind(name).fetch_optional(&self.pool).await?)
    }

    /// Assets in the order of their names, from the one after `after`.
    pub async fn assets(&self, after: &str, limit: u32) -> Result<Vec<AssetRow>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT * FROM asset WHERE name > $1 AND deleted_at IS NULL ORDER BY name LIMIT $2",
        )
        .bind(after)
        .bind(i64::from(limit))
        .fetch_all(&self.pool)
        .await?)
    }

    pub async fn n_assets(&self) -> Result<i64, StoreError> {
        // Two counts that indexes answer, so that no document is read.
        let count = sqlx::query_scalar(
            "SELECT (SELECT COUNT(*) FROM asset) -
             (SELECT COUNT(*) FROM asset WHERE deleted_at IS NOT NULL)",
        );
        Ok(count.fetch_one(&self.pool).await?)
    }

    /// The names of the assets that have an open session.
    pub async fn assets_in_session(&self) -> Result<Vec<String>, StoreError> {
        Ok(sqlx::query_scalar("SELECT asset FROM session WHERE state = 'open' ORDER BY asset")
            .fetch_all(&self.pool)
            .await?)
    }

    pub async fn session(&self, id: &str) -> Result<Option<SessionRow>, StoreError> {
        let progress = self.journal.progress(id);
        let mut query = Question::new(SESSION);
        query.push(KEPT).push("id = ").bind(id)?;
        let row: Option<SessionRow> = query.rows().fetch_optional(&self.pool).await?;
        Ok(row.map(|row| row.with(progress.as_ref())))
    }

    pub async fn open_session(&self, asset: &str) -> Result<Option<SessionRow>, StoreError> {
        let mut query = Question::new(SESSION);
        query.push("state = 'open' AND asset = ").bind(asset)?;
        self.session_row(query).await
    }

    /// Also one that is given up: its name is taken until it is gone.
    pub async fn session_named(
        &self,
        asset: &str,
        name: &str,
    ) -> Result<Option<SessionRow>, StoreError> {
        let mut query = Question::new(SESSION);
        query.push("asset = ").bind(asset)?.push(" AND name = ").bind(name)?;
        self.session_row(query).await
    }

    pub async fn sessions(
        &self,
        filter: &SessionFilter,
        limit: u32,
    ) -> Result<Vec<SessionRow>, StoreError> {
        let mut query = Question::new(SESSION);
        query.push(KEPT).push("1 = 1");
        if let Some(asset) = &filter.asset {
            query.push(" AND asset = ").bind(asset)?;
        }
        match filter.state.as_deref() {
            // Few, and with an index of just those, which is for this text. Of the many others
            // a page is best taken in its order, so their word is no text of the question.
            Some("open") => drop(query.push(" AND state = 'open'")),
            Some(state) => drop(query.push(" AND state = ").bind(state)?),
            None => {}
        }
        if let Some((opened_at, id)) = &filter.before {
            query.push(" AND (opened_at, id) < (").bind(opened_at)?;
            query.push(", ").bind(id)?.push(")");
        }
        query.push(" ORDER BY opened_at DESC, id DESC LIMIT ").bind(i64::from(limit))?;
        self.session_rows(query).await
    }

    /// The answer to `query`, which asks for one session. An open one is looked up
    /// again by its id: only by that does the journal know it.
    async fn session_row(&self, query: Question) -> Result<Option<SessionRow>, StoreError> {
        let row: Option<SessionRow> = query.rows().fetch_optional(&self.pool).await?;
        match row {
            Some(row) if row.is_open() => self.session(&row.id).await,
            row => Ok(row),
        }
    }

    /// The answer to `query`, which asks for sessions.
    pub(super) async fn session_rows(
        &self,
        query: Question,
    ) -> Result<Vec<SessionRow>, StoreError> {
        let known = self.journal.all_progress();
        let rows: Vec<SessionRow> = query.rows().fetch_all(&self.pool).await?;
        let noted = rows.into_iter().map(|row| {
            let progress = known.get(&row.id);
            row.with(progress)
        });
        Ok(noted.collect())
    }

    /// Samples of the recording of `session` from the one at `index` on, as many
    /// as are together; none at its end.
    pub async fn samples_from(
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
        let mut samples = decode(session, first_index, &data)?;
        Ok(Some(samples.split_off(usize::try_from(index - first_index).unwrap_or_default())))
    }

    /// The chunks of `session` that may hold a sample with a `t_s` from `first`
    /// to `last`, the latest first, at most `limit` and what the journal has.
    pub async fn chunks_between(
        &self,
        session: &str,
        (first, last): (f64, f64),
        limit: u32,
    ) -> Result<Vec<Vec<Sample>>, StoreError> {
        let mut chunks = Vec::from_iter(self.journal.run(session)?.map(|run| run.samples));
        let rows: Vec<(i64, Vec<u8>)> = sqlx::query_as(
            "SELECT first_index, data FROM chunk
             WHERE session = $1 AND min_t_s <= $3 AND max_t_s >= $2
             ORDER BY first_index DESC LIMIT $4",
        )
        .bind(session)
        .bind(first)
        .bind(last)
        .bind(i64::from(limit))
        .fetch_all(&self.pool)
        .await?;
        for (first_index, data) in rows {
            chunks.push(decode(session, first_index, &data)?);
        }
        Ok(chunks)
    }

    /// What people did in `session`, in order.
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

    /// Transitions of `code` in `session` before `before` (an ordinal), latest first.
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

    pub async fn n_transitions(&self, session: &str) -> Result<i64, StoreError> {
        Ok(sqlx::query_scalar("SELECT COUNT(*) FROM transition WHERE session = $1")
            .bind(session)
            .fetch_one(&self.pool)
            .await?)
    }

    /// Events of `asset`, or of all, with an id above `after`.
    pub async fn events(
        &self,
        asset: Option<&str>,
        after: i64,
        limit: u32,
    ) -> Result<Vec<EventRow>, StoreError> {
        let mut query = Question::new("");
        for select in [
            "SELECT id, asset, session, document FROM transition WHERE id > ",
            " UNION ALL SELECT id, asset, session, event FROM action
             WHERE event IS NOT NULL AND id > ",
        ] {
            query.push(select).bind(after)?;
            if let Some(asset) = asset {
                query.push(" AND asset = ").bind(asset)?;
            }
        }
        query.push(" ORDER BY id LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// What the sessions of `asset` estimated, with their names, newest first:
    /// at most `limit` rows, of which a session has one for each axis.
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

    /// Changes of a code of `asset` with an id below `before`, newest first.
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

    /// What people did about a code of `asset`, with an id below `before`,
    /// newest first.
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

    pub async fn faults(
        &self,
        filter: &FaultFilter,
        limit: u32,
    ) -> Result<Vec<FaultRow>, StoreError> {
        let mut query = Question::new("SELECT * FROM fault WHERE 1 = 1");
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
        page(&mut query, filter)?;
        query.push(" LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    pub async fn fault(&self, asset: &str, code: &str) -> Result<Option<FaultRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM fault WHERE asset = $1 AND code = $2")
            .bind(asset)
            .bind(code)
            .fetch_optional(&self.pool)
            .await?)
    }

    pub async fn replay(&self, id: &str) -> Result<Option<ReplayRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM replay WHERE id = $1")
            .bind(id)
            .fetch_optional(&self.pool)
            .await?)
    }

    /// Jobs that a former process left unfinished.
    pub async fn unfinished_replays(&self) -> Result<Vec<ReplayRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM replay WHERE state IN ('queued', 'running')")
            .fetch_all(&self.pool)
            .await?)
    }

    pub async fn calibration(&self, id: &str) -> Result<Option<CalibrationRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM calibration WHERE id = $1")
            .bind(id)
            .fetch_optional(&self.pool)
            .await?)
    }

    /// The calibrations of `asset`, newest first, `before` excluded.
    pub async fn calibrations(
        &self,
        asset: &str,
        before: Option<(Micros, &str)>,
        limit: u32,
    ) -> Result<Vec<CalibrationRow>, StoreError> {
        let mut query = Question::new("SELECT * FROM calibration WHERE asset = ");
        query.bind(asset)?;
        if let Some((made_at, id)) = before {
            query.push(" AND (made_at, id) < (").bind(made_at)?;
            query.push(", ").bind(id)?.push(")");
        }
        query.push(" ORDER BY made_at DESC, id DESC LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// Jobs that a former process left unfinished.
    pub async fn unfinished_calibrations(&self) -> Result<Vec<CalibrationRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM calibration WHERE state IN ('queued', 'running')")
            .fetch_all(&self.pool)
            .await?)
    }
}

/// The page's beginning and order.
fn page(query: &mut Question, filter: &FaultFilter) -> Result<(), StoreError> {
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

fn decode(session: &str, first_index: i64, data: &[u8]) -> Result<Vec<Sample>, StoreError> {
    let session = || session.to_owned();
    codec::decode(data).map_err(|source| StoreError::Chunk {
        session: session(),
        first_index,
        source,
    })
}
