//! Tables of mutes, lost communication and the owner's notes.

use sqlx::AnyConnection;

use super::from_row::from_row;
use super::query_builder::QueryBuilder;
use super::{Micros, PartitionId, Store, StoreError};

/// A monitor that a person has muted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MuteRow {
    pub asset: String,
    pub code: String,
    pub actor: String,
    pub reason: String,
    pub at: Micros,
    pub until: Micros,
}

from_row!(MuteRow { asset, code, actor, reason, at, until });

/// Whether data of an asset arrive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommunicationRow {
    pub asset: String,
    /// 1 while no data arrive, else 0.
    pub lost: i64,
    /// Time at which the last data before the loss arrived.
    pub since: Micros,
    pub changed_at: Micros,
    pub occurrences: i64,
    /// Id of the session that was open.
    pub session: Option<String>,
    pub acknowledged_by: Option<String>,
    pub acknowledged_at: Option<Micros>,
}

from_row!(CommunicationRow {
    asset,
    lost,
    since,
    changed_at,
    occurrences,
    session,
    acknowledged_by,
    acknowledged_at
});

/// A change of whether data of an asset arrive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommunicationChange {
    /// Assigned by the writer; 0 if the asset has been deleted.
    pub id: i64,
    pub asset: String,
    pub session: Option<String>,
    pub is_lost: bool,
    pub since: Micros,
    pub at: Micros,
    /// The event (JSON).
    pub document: String,
}

/// An open session with samples, whose rig should send data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenLink {
    pub asset: String,
    pub session: String,
    pub session_name: String,
}

/// The owner's note on a fault code.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoteRow {
    pub code: String,
    pub text: String,
    pub actor: String,
    pub at: Micros,
}

from_row!(NoteRow { code, text, actor, at });

/// A change of mutes, notes or acknowledgements of lost communication.
#[derive(Clone, Debug)]
pub enum AlarmWrite {
    Mute(MuteRow),
    Unmute { asset: String, code: String },
    Note(NoteRow),
    RemoveNote { code: String },
    AcknowledgeCommunication { asset: String, actor: String, at: Micros },
}

impl AlarmWrite {
    pub(super) async fn apply(&self, db: &mut AnyConnection) -> Result<(), StoreError> {
        match self {
            Self::Mute(row) => mute(db, row).await,
            Self::Unmute { asset, code } => {
                let sql = "DELETE FROM mute WHERE asset = $1 AND code = $2";
                sqlx::query(sql).bind(asset).bind(code).execute(db).await?;
                Ok(())
            }
            Self::Note(row) => note(db, row).await,
            Self::RemoveNote { code } => {
                sqlx::query("DELETE FROM note WHERE code = $1").bind(code).execute(db).await?;
                Ok(())
            }
            Self::AcknowledgeCommunication { asset, actor, at } => {
                sqlx::query(
                    "UPDATE communication SET acknowledged_by = $2, acknowledged_at = $3
                     WHERE asset = $1 AND acknowledged_at IS NULL",
                )
                .bind(asset)
                .bind(actor)
                .bind(at)
                .execute(db)
                .await?;
                Ok(())
            }
        }
    }
}

async fn mute(db: &mut AnyConnection, row: &MuteRow) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO mute (asset, code, actor, reason, at, until) VALUES ($1, $2, $3, $4, $5, $6)
         ON CONFLICT (asset, code) DO UPDATE SET actor = excluded.actor,
         reason = excluded.reason, at = excluded.at, until = excluded.until",
    )
    .bind(&row.asset)
    .bind(&row.code)
    .bind(&row.actor)
    .bind(&row.reason)
    .bind(row.at)
    .bind(row.until)
    .execute(db)
    .await?;
    Ok(())
}

async fn note(db: &mut AnyConnection, row: &NoteRow) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO note (code, text, actor, at) VALUES ($1, $2, $3, $4)
         ON CONFLICT (code) DO UPDATE SET text = excluded.text, actor = excluded.actor,
         at = excluded.at",
    )
    .bind(&row.code)
    .bind(&row.text)
    .bind(&row.actor)
    .bind(row.at)
    .execute(db)
    .await?;
    Ok(())
}

/// Stores a change of an asset that is not deleted; returns whether there is one.
pub(super) async fn change_communication(
    db: &mut AnyConnection,
    row: &CommunicationChange,
) -> Result<bool, StoreError> {
    let known = sqlx::query_scalar("SELECT name FROM asset WHERE name = $1 AND deleted_at IS NULL");
    let known: Option<String> = known.bind(&row.asset).fetch_optional(&mut *db).await?;
    if known.is_none() {
        return Ok(false);
    }
    sqlx::query(
        "INSERT INTO communication_change (id, asset, session, at, document)
         VALUES ($1, $2, $3, $4, $5)",
    )
    .bind(row.id)
    .bind(&row.asset)
    .bind(&row.session)
    .bind(row.at)
    .bind(&row.document)
    .execute(&mut *db)
    .await?;
    if row.is_lost { lose(db, row).await } else { regain(db, row).await }?;
    Ok(true)
}

async fn lose(db: &mut AnyConnection, row: &CommunicationChange) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO communication (asset, lost, since, changed_at, occurrences, session)
         VALUES ($1, 1, $2, $3, 1, $4)
         ON CONFLICT (asset) DO UPDATE SET lost = 1, since = excluded.since,
         changed_at = excluded.changed_at, occurrences = communication.occurrences + 1,
         session = excluded.session, acknowledged_by = NULL, acknowledged_at = NULL",
    )
    .bind(&row.asset)
    .bind(row.since)
    .bind(row.at)
    .bind(&row.session)
    .execute(db)
    .await?;
    Ok(())
}

async fn regain(db: &mut AnyConnection, row: &CommunicationChange) -> Result<(), StoreError> {
    sqlx::query("UPDATE communication SET lost = 0, changed_at = $2 WHERE asset = $1")
        .bind(&row.asset)
        .bind(row.at)
        .execute(db)
        .await?;
    Ok(())
}

/// The assets of which no data arrive, or whose data have stayed away at some time.
const COMMUNICATION: &str = "SELECT * FROM communication
    WHERE asset NOT IN (SELECT name FROM asset WHERE deleted_at IS NOT NULL)";

impl Store {
    /// All mutes that end after `now`.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails; so do all queries here.
    pub async fn mutes(&self, now: Micros) -> Result<Vec<MuteRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM mute WHERE until > $1 ORDER BY asset, code")
            .bind(now)
            .fetch_all(&self.pool)
            .await?)
    }

    /// The owner's notes.
    pub async fn notes(&self) -> Result<Vec<NoteRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM note ORDER BY code").fetch_all(&self.pool).await?)
    }

    /// The assets of which no data arrive.
    pub async fn lost_communications(
        &self,
        asset: Option<&str>,
    ) -> Result<Vec<CommunicationRow>, StoreError> {
        let mut query = QueryBuilder::new(COMMUNICATION);
        query.push(" AND lost = 1");
        if let Some(asset) = asset {
            query.push(" AND asset = ").bind(asset)?;
        }
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// The assets of which no data arrive, or whose data have stayed away at some time, the latest
    /// change first, from the change and the asset `from` on.
    pub async fn communications(
        &self,
        asset: Option<&str>,
        tag: Option<&str>,
        from: Option<(Micros, String)>,
        limit: u32,
    ) -> Result<Vec<CommunicationRow>, StoreError> {
        let mut query = QueryBuilder::new(COMMUNICATION);
        if let Some(asset) = asset {
            query.push(" AND asset = ").bind(asset)?;
        }
        query.push_tagged("asset", tag)?;
        if let Some((changed_at, asset)) = from {
            query.push(" AND (changed_at, asset) <= (").bind(changed_at)?;
            query.push(", ").bind(asset)?.push(")");
        }
        query.push(" ORDER BY changed_at DESC, asset DESC LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// The open sessions that have samples, except imports; of the partitions `owned`, or of
    /// all.
    pub async fn open_links(
        &self,
        owned: Option<&[PartitionId]>,
    ) -> Result<Vec<OpenLink>, StoreError> {
        let in_journal = self.journal.all_progress();
        let mut query = QueryBuilder::new(
            "SELECT asset, id, name, n_samples FROM session
             WHERE state = 'open' AND importing = 0 AND expired_at IS NULL",
        );
        query.push_owned(owned)?;
        let rows: Vec<(String, String, String, i64)> = query.rows().fetch_all(&self.pool).await?;
        let has_samples = |(_, id, _, n): &(String, String, String, i64)| {
            *n > 0 || in_journal.get(id).is_some_and(|progress| progress.n_samples > 0)
        };
        let link = |(asset, session, session_name, _)| OpenLink { asset, session, session_name };
        Ok(rows.into_iter().filter(has_samples).map(link).collect())
    }

    /// Those of the sessions `ids` that are there and not hidden.
    pub async fn existing_sessions(&self, ids: &[String]) -> Result<Vec<String>, StoreError> {
        self.names("SELECT id FROM session WHERE expired_at IS NULL AND id IN (", ids).await
    }

    /// Those of `assets` that have an open session.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails.
    pub async fn assets_with_session(&self, assets: &[String]) -> Result<Vec<String>, StoreError> {
        self.names("SELECT asset FROM session WHERE state = 'open' AND asset IN (", assets).await
    }

    /// Those of `assets` that exist.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails.
    pub async fn existing_assets(&self, assets: &[String]) -> Result<Vec<String>, StoreError> {
        let select = "SELECT name FROM asset WHERE deleted_at IS NULL AND name IN (";
        self.names(select, assets).await
    }

    /// Returns the names that `select`, which ends in `IN (`, finds with the list `among`.
    async fn names(
        &self,
        select: &'static str,
        among: &[String],
    ) -> Result<Vec<String>, StoreError> {
        if among.is_empty() {
            return Ok(Vec::new());
        }
        let mut query = QueryBuilder::new(select);
        query.bind_list(among)?.push(")");
        let rows: Vec<(String,)> = query.rows().fetch_all(&self.pool).await?;
        Ok(rows.into_iter().map(|(name,)| name).collect())
    }
}
