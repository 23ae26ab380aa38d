//! What is stored of several assets, read by one query for each table, however many they are.

use std::collections::{BTreeMap, HashMap};

use sqlx::AnyConnection;

use super::from_row::from_row;
use super::query_builder::QueryBuilder;
use super::read::SESSION;
use super::{AssetRow, FaultRow, SessionRow, Snapshot, Store, StoreError};

/// Most assets that are read at once. Chosen: with more, a query takes so long that its fixed
/// cost does not matter.
pub const MAX_ASSETS_AT_ONCE: usize = 64;

/// The ended sessions that are read of each asset, the newest ones. Chosen: a retransmission
/// is rarely older.
pub const MAX_ENDED_SESSIONS: u32 = 4;

/// What is stored of an asset.
#[derive(Debug)]
pub struct AssetRecord {
    pub row: AssetRow,
    /// The learning record (JSON), if it has one.
    pub learning: Option<String>,
    /// Its fault memory.
    pub faults: Vec<FaultRow>,
    /// The open session, and the last snapshot of its engine.
    pub open: Option<(SessionRow, Result<Option<Snapshot>, StoreError>)>,
    /// The last ended sessions, the newest first.
    pub ended: Vec<EndedSessionRow>,
    /// Whether there is any session of the asset, also one that is being deleted.
    pub has_sessions: bool,
}

/// An ended session, as far as a retransmission is compared with it.
#[derive(Clone, Debug, PartialEq)]
pub struct EndedSessionRow {
    pub id: String,
    pub asset: String,
    pub name: String,
    pub first_part: Option<String>,
    pub last_seq: Option<i64>,
    /// The latest time in the last two chunks, s.
    pub newest_t_s: Option<f64>,
}

from_row!(EndedSessionRow { id, asset, name, first_part, last_seq, newest_t_s });

struct RowWithLearning {
    learning: Option<String>,
    /// 1 if there is any session of the asset, else 0.
    has_sessions: i32,
    row: AssetRow,
}

from_row!(RowWithLearning { learning, has_sessions }[row]);

impl Store {
    /// Those of the assets `names` that exist, with the last snapshots by this `version` of
    /// the engine. At most [`MAX_ASSETS_AT_ONCE`].
    ///
    /// # Errors
    /// [`StoreError`] if the database fails.
    pub async fn asset_records(
        &self,
        names: &[String],
        version: &str,
    ) -> Result<HashMap<String, AssetRecord>, StoreError> {
        let mut db = self.pool.acquire().await?;
        let mut records = self.open_records_of(&mut db, names, version).await?;
        for fault in faults(&mut db, names).await? {
            if let Some(record) = records.get_mut(&fault.asset) {
                record.faults.push(fault);
            }
        }
        for session in ended_sessions(&mut db, names).await? {
            if let Some(record) = records.get_mut(&session.asset) {
                record.ended.push(session);
            }
        }
        Ok(records)
    }

    /// As [`Self::asset_records`], without the fault memory and the ended sessions.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails.
    pub async fn open_records(
        &self,
        names: &[String],
        version: &str,
    ) -> Result<HashMap<String, AssetRecord>, StoreError> {
        self.open_records_of(&mut *self.pool.acquire().await?, names, version).await
    }

    /// As [`Self::open_records`], on the connection `db`.
    async fn open_records_of(
        &self,
        db: &mut AnyConnection,
        names: &[String],
        version: &str,
    ) -> Result<HashMap<String, AssetRecord>, StoreError> {
        let mut records = assets(db, names).await?;
        let mut query = QueryBuilder::new(SESSION);
        query.push("state = 'open' AND asset IN (").bind_list(names)?.push(")");
        let open = self.session_rows_of(db, query).await?;
        let mut snapshots = snapshots(db, &open, version).await?;
        for session in open {
            if let Some(record) = records.get_mut(&session.asset) {
                let snapshot = snapshots.remove(&session.id).transpose();
                record.open = Some((session, snapshot));
            }
        }
        Ok(records)
    }
}

async fn assets(
    db: &mut AnyConnection,
    names: &[String],
) -> Result<HashMap<String, AssetRecord>, StoreError> {
    let mut query = QueryBuilder::new(
        "SELECT asset.*, CASE WHEN EXISTS (SELECT 1 FROM session WHERE session.asset = asset.name)
             THEN 1 ELSE 0 END AS has_sessions
         FROM asset WHERE deleted_at IS NULL AND asset.name IN (",
    );
    query.bind_list(names)?.push(")");
    let rows: Vec<RowWithLearning> = query.rows().fetch_all(db).await?;
    let record = |RowWithLearning { row, learning, has_sessions }| {
        let (name, has_sessions) = (row.name.clone(), has_sessions != 0);
        let (faults, open, ended) = (Vec::new(), None, Vec::new());
        (name, AssetRecord { row, learning, faults, open, ended, has_sessions })
    };
    Ok(rows.into_iter().map(record).collect())
}

async fn faults(db: &mut AnyConnection, names: &[String]) -> Result<Vec<FaultRow>, StoreError> {
    let mut query = QueryBuilder::new("SELECT * FROM fault WHERE asset IN (");
    query.bind_list(names)?.push(") ORDER BY changed_at DESC, asset DESC, code DESC");
    Ok(query.rows().fetch_all(db).await?)
}

/// The last ended sessions of each of the assets `names`, the newest first.
async fn ended_sessions(
    db: &mut AnyConnection,
    names: &[String],
) -> Result<Vec<EndedSessionRow>, StoreError> {
    let ids = ids_of_ended(db, names).await?;
    if ids.is_empty() {
        return Ok(Vec::new());
    }
    let mut query = QueryBuilder::new(
        "SELECT id, asset, name, first_part, last_seq,
             (SELECT MAX(max_t_s) FROM (
                 SELECT max_t_s FROM chunk WHERE chunk.session = session.id
                 ORDER BY first_index DESC LIMIT 2) AS newest) AS newest_t_s
         FROM session WHERE id IN (",
    );
    query.bind_list(&ids)?.push(") ORDER BY opened_at DESC, id DESC");
    Ok(query.rows().fetch_all(db).await?)
}

async fn ids_of_ended(db: &mut AnyConnection, names: &[String]) -> Result<Vec<String>, StoreError> {
    let mut query = QueryBuilder::new("SELECT asset.name");
    // A parameter, so that the database reads the sessions in the order of opening.
    let state = "ended".to_owned();
    for place in 0..MAX_ENDED_SESSIONS {
        query.push(", (SELECT id FROM session WHERE session.asset = asset.name AND state = ");
        query
            .bind(state.clone())?
            .push(" AND expired_at IS NULL ORDER BY opened_at DESC, id DESC LIMIT 1 OFFSET ");
        query.bind(i64::from(place))?.push(")");
    }
    query.push(" FROM asset WHERE asset.name IN (").bind_list(names)?.push(")");
    type Ids = (String, Option<String>, Option<String>, Option<String>, Option<String>);
    let rows: Vec<Ids> = query.rows().fetch_all(db).await?;
    Ok(rows.into_iter().flat_map(|(_, a, b, c, d)| [a, b, c, d]).flatten().collect())
}

/// The last snapshot of each of the `sessions` that is not after its last sample, or why it
/// cannot be used.
async fn snapshots(
    db: &mut AnyConnection,
    sessions: &[SessionRow],
    version: &str,
) -> Result<BTreeMap<String, Result<Snapshot, StoreError>>, StoreError> {
    if sessions.is_empty() {
        return Ok(BTreeMap::new());
    }
    let wanted = |session: &SessionRow| (session.id.clone(), session.progress.n_samples);
    let wanted: Vec<_> = sessions.iter().map(wanted).collect();
    let mut query = QueryBuilder::new("WITH wanted (session, at_most) AS (VALUES ");
    query.bind_rows(&wanted)?.push(
        ") SELECT snapshot.session, snapshot.n_samples, kept, data FROM
             (SELECT wanted.session, (SELECT MAX(n_samples) FROM snapshot AS earlier
                 WHERE earlier.session = wanted.session AND n_samples <= at_most AND version = ",
    );
    query.bind(version.to_owned())?.push(
        ") AS n_samples FROM wanted) AS found
         JOIN snapshot ON snapshot.session = found.session
             AND snapshot.n_samples = found.n_samples",
    );
    let rows: Vec<(String, i64, i64, Vec<u8>)> = query.rows().fetch_all(db).await?;
    let open = |(session, n_samples, kept, data): (String, i64, i64, Vec<u8>)| {
        (session.clone(), Snapshot::opened(session, n_samples, kept, version, &data))
    };
    Ok(rows.into_iter().map(open).collect())
}
