//! The one writer: groups of changes, one transaction each, durable on return.

mod deletion;
mod fold;
mod subject;

use std::collections::HashSet;
use std::time::Duration;

use sqlx::{AnyConnection, Connection};

use self::fold::Moves;
use super::checkpoint::{self, Checkpoints};
use super::journal::{Changes, Journal};
use super::rows_at_once::{RowsAtOnce, in_parts};
use super::tail::{Run, Tails};
use super::{
    AccessWrite, ActionRow, AssetRow, CalibrationRow, FaultRow, MIGRATIONS, Micros, Place,
    Progress, ReplayRow, SessionRow, StoreError, TransitionRow, TrendRow,
};
use offbd_core::vocabulary::Sample;

/// How long a commit may take before its connection is given up. A disk that
/// is slower than this cannot carry the service.
const COMMIT_WAIT: Duration = Duration::from_secs(30);

/// One change.
#[derive(Clone, Debug)]
pub enum Write {
    /// A new asset; a conflict if its name is taken.
    CreateAsset(AssetRow),
    /// The document of an asset that is there.
    UpdateAsset(AssetRow),
    /// An asset is given up: nobody sees it or its sessions any more.
    GiveUpAsset {
        name: String,
        at: Micros,
    },
    /// An asset that is given up goes, with what is left of it.
    DeleteAsset {
        name: String,
    },
    OpenSession(SessionRow),
    /// Samples at the end of a session's recording, possibly none, and how far
    /// it has come with them.
    Append {
        session: String,
        first_index: i64,
        samples: Vec<Sample>,
        progress: Progress,
    },
    EndSession {
        session: String,
        ended_at: Micros,
        verdict: String,
        hash: String,
    },
    /// A session goes, with what is left of it.
    DeleteSession {
        session: String,
    },
    /// An ended session is given up: nobody sees it any more.
    ExpireSession {
        session: String,
        at: Micros,
    },
    /// The first chunks of a session that is given up, at most `limit`.
    DropChunks {
        session: String,
        limit: u32,
    },
    /// The first transitions of a session that is given up, at most `limit`.
    DropTransitions {
        session: String,
        limit: u32,
    },
    Act(ActionRow),
    Transition(TransitionRow),
    Fault(FaultRow),
    Trend(TrendRow),
    PutReplay(ReplayRow),
    PutCalibration(CalibrationRow),
    ActivateCalibration {
        asset: String,
        id: String,
    },
    /// What an asset's learning by itself has come to.
    PutLearning {
        asset: String,
        document: String,
    },
    Access(AccessWrite),
}

/// The one that changes things; a guest beside it may write what no event and
/// no engine follows from. Every transaction counts itself in the
/// database, so that after a loss of the connection the writer knows whether
/// the last one came through, and notices if somebody else has written.
#[derive(Debug)]
pub struct Writer {
    place: Place,
    /// None after a failure, until [`Writer::reconnect`].
    connection: Option<AnyConnection>,
    /// The last id given to an event.
    last_id: i64,
    /// Transactions that the database has seen.
    n_commits: i64,
    /// Whether it writes beside the one that counts.
    guest: bool,
    pub(super) checkpoints: Option<Checkpoints>,
    /// Of the transaction that may have come through and is not counted yet.
    in_doubt: Option<Changes>,
    tails: Tails,
    journal: Journal,
    /// Sessions that the database did not let be folded. They take no more until
    /// it does.
    refused: HashSet<String>,
    /// The journal's bytes at the last [`Writer::fold`].
    n_bytes_before: usize,
}

impl Writer {
    pub(super) async fn open(place: &Place, guest: bool) -> Result<Self, StoreError> {
        let mut connection = place.writer(!guest).await?;
        MIGRATIONS.run_direct(None, &mut connection, false).await?;
        let last_id = counter(&mut connection, "event").await?;
        let n_commits = counter(&mut connection, "commit").await?;
        let journal = Journal::load(&mut connection).await?;
        let n_bytes_before = journal.n_bytes();
        Ok(Self {
            place: place.clone(),
            connection: Some(connection),
            last_id,
            n_commits,
            guest,
            checkpoints: if guest { None } else { Checkpoints::beside(place) },
            in_doubt: None,
            tails: Tails::default(),
            journal,
            refused: HashSet::new(),
            n_bytes_before,
        })
    }

    /// Bytes in the journal.
    #[must_use]
    pub fn journal_bytes(&self) -> usize {
        self.journal.n_bytes()
    }

    pub(super) fn journal(&self) -> Journal {
        self.journal.clone()
    }

    /// Applies the sets, in order, in one transaction that is durable on
    /// return; gives ids to their actions and transitions.
    ///
    /// # Errors
    /// [`StoreError`]. If [`StoreError::is_outage`], the transaction may have
    /// come through all the same: [`Writer::reconnect`] knows. Otherwise
    /// nothing of any set has been applied.
    pub async fn commit(&mut self, sets: &mut [&mut Vec<Write>]) -> Result<(), StoreError> {
        self.transact(sets, None).await
    }

    async fn transact(
        &mut self,
        sets: &mut [&mut Vec<Write>],
        moves: Option<&Moves>,
    ) -> Result<(), StoreError> {
        if self.connection.is_none() && self.reconnect().await? {
            // Whoever asked for that one has not waited for its outcome.
            tracing::warn!("a commit came through that was given up");
        }
        let last_id = self.last_id;
        let late = |_| Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()).into());
        let attempt = tokio::time::timeout(COMMIT_WAIT, self.attempt(sets, moves));
        let result = attempt.await.unwrap_or_else(late);
        match &result {
            Ok(()) => {
                self.came_through();
                if let Some(checkpoints) = &mut self.checkpoints {
                    checkpoints.note(n_samples(sets));
                }
            }
            Err(_) => {
                // A connection that failed may be in any state: a new one is not.
                self.connection = None;
                self.last_id = last_id;
                self.tails.forget();
            }
        }
        result
    }

    /// Copies the rest of the log into the file, if it is little, so that the next
    /// commit begins the log anew.
    pub async fn copy_log(&mut self) {
        if !self.checkpoints.as_ref().is_some_and(Checkpoints::is_little_left) {
            return;
        }
        let Some(connection) = &mut self.connection else { return };
        let late = |_| Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()));
        let copied = tokio::time::timeout(COMMIT_WAIT, checkpoint::copy(connection)).await;
        if let Err(error) = copied.unwrap_or_else(late) {
            tracing::warn!(%error, "the write-ahead log is not copied into the file");
            self.connection = None;
        }
    }

    /// Connects anew; returns whether the last commit, which failed, has come
    /// through after all. Nothing is in doubt afterwards.
    ///
    /// # Errors
    /// [`StoreError`] if the database is still away, takes no change, or is not as it was
    /// left.
    pub async fn reconnect(&mut self) -> Result<bool, StoreError> {
        self.connection = None;
        let late = |_| Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()).into());
        let attempt = tokio::time::timeout(COMMIT_WAIT, self.connect_again());
        attempt.await.unwrap_or_else(late)
    }

    async fn connect_again(&mut self) -> Result<bool, StoreError> {
        let mut connection = self.place.writer(!self.guest).await?;
        // It must take a change that is durable. Touching the other row waits for what the
        // lost connection may still do.
        sqlx::query(
            "UPDATE counter SET value = CASE name WHEN 'probe' THEN value + 1 ELSE value END
             WHERE name IN ('commit', 'probe')",
        )
        .execute(&mut connection)
        .await?;
        let found = counter(&mut connection, "commit").await?;
        let came_through = self.in_doubt.is_some() && found == self.n_commits + 1;
        if found != self.n_commits && !came_through {
            return Err(StoreError::Overtaken { expected: self.n_commits, found });
        }
        self.last_id = counter(&mut connection, "event").await?;
        if came_through {
            self.came_through();
        }
        self.in_doubt = None;
        self.connection = Some(connection);
        Ok(came_through)
    }

    /// Takes note of the last transaction.
    fn came_through(&mut self) {
        self.n_commits += i64::from(!self.guest);
        if let Some(changes) = self.in_doubt.take() {
            self.refused.retain(|session| !changes.gone.contains(session));
            self.journal.apply(changes);
        }
    }

    /// Folds what is in the journal and closes the connection.
    ///
    /// # Errors
    /// [`StoreError`] if that fails; all commits stay durable.
    pub async fn close(mut self) -> Result<(), StoreError> {
        let folded = if self.guest { Ok(()) } else { self.fold_all().await };
        if let Some(checkpoints) = self.checkpoints {
            checkpoints.close().await;
        }
        if let Some(connection) = self.connection {
            connection.close().await?;
        }
        folded
    }

    async fn attempt(
        &mut self,
        sets: &mut [&mut Vec<Write>],
        moves: Option<&Moves>,
    ) -> Result<(), StoreError> {
        let Some(connection) = &mut self.connection else {
            return Err(sqlx::Error::PoolClosed.into());
        };
        let mut transaction = connection.begin_with(self.place.begin()).await?;
        let mut group = Group {
            number: self.n_commits + 1,
            last_id: &mut self.last_id,
            tails: &mut self.tails,
            journal: &self.journal,
            refused: &self.refused,
            changes: Changes::default(),
            pending: Vec::new(),
        };
        for write in sets.iter_mut().flat_map(|set| set.iter_mut()) {
            group.apply(&mut transaction, write).await?;
        }
        if let Some(moves) = moves {
            group.relocate(&mut transaction, moves).await?;
        }
        group.flush(&mut transaction).await?;
        let changes = group.changes;
        if !self.guest {
            count(&mut transaction, self.n_commits, self.last_id).await?;
            self.in_doubt = Some(changes);
        }
        Ok(transaction.commit().await?)
    }
}

fn n_samples(sets: &[&mut Vec<Write>]) -> usize {
    let of =
        |write: &Write| if let Write::Append { samples, .. } = write { samples.len() } else { 0 };
    sets.iter().flat_map(|set| set.iter()).map(of).sum()
}

async fn counter(db: &mut AnyConnection, name: &str) -> Result<i64, StoreError> {
    let question = sqlx::query_scalar("SELECT value FROM counter WHERE name = $1").bind(name);
    Ok(question.fetch_one(db).await?)
}

/// Counts this transaction, and the events up to `last_id`.
async fn count(db: &mut AnyConnection, n_commits: i64, last_id: i64) -> Result<(), StoreError> {
    let counted = sqlx::query(
        "UPDATE counter SET value = CASE name WHEN 'commit' THEN $1 ELSE $2 END
         WHERE name IN ('commit', 'event')
         AND EXISTS (SELECT 1 FROM counter WHERE name = 'commit' AND value = $3)",
    )
    .bind(n_commits + 1)
    .bind(last_id)
    .bind(n_commits)
    .execute(&mut *db)
    .await?;
    if counted.rows_affected() == 2 {
        return Ok(());
    }
    let found = counter(db, "commit").await?;
    Err(StoreError::Overtaken { expected: n_commits, found })
}

/// The transaction at hand.
struct Group<'a> {
    /// Counts the transactions; the row of the journal.
    number: i64,
    last_id: &'a mut i64,
    tails: &'a mut Tails,
    journal: &'a Journal,
    refused: &'a HashSet<String>,
    changes: Changes,
    /// Samples that wait for the end of the group, so that consecutive batches
    /// of a session become one run.
    pending: Vec<Run>,
}

impl Group<'_> {
    const fn next_id(&mut self) -> i64 {
        *self.last_id += 1;
        *self.last_id
    }

    async fn apply(&mut self, db: &mut AnyConnection, write: &mut Write) -> Result<(), StoreError> {
        match write {
            Write::Append { session, first_index, samples, progress } => {
                self.defer(session, *first_index, samples, *progress);
                Ok(())
            }
            Write::Transition(row) => {
                row.id = self.next_id();
                insert_transition(db, row).await
            }
            Write::Act(row) => {
                row.id = self.next_id();
                insert_action(db, row).await
            }
            Write::Fault(row) => put_fault(db, row).await,
            Write::Trend(row) => insert_trend(db, row).await,
            Write::PutReplay(row) => put_replay(db, row).await,
            Write::PutCalibration(row) => put_calibration(db, row).await,
            Write::ActivateCalibration { asset, id } => activate(db, asset, id).await,
            Write::PutLearning { asset, document } => put_learning(db, asset, document).await,
            Write::Access(write) => write.apply(db).await,
            Write::CreateAsset(row) => create_asset(db, row).await,
            Write::UpdateAsset(row) => update_asset(db, row).await,
            Write::OpenSession(row) => open_session(db, row).await,
            Write::EndSession { session, ended_at, verdict, hash } => {
                self.finish(db, session).await?;
                end_session(db, session, *ended_at, verdict, hash).await
            }
            Write::DeleteSession { session } => self.delete_session(db, session).await,
            Write::ExpireSession { session, at } => deletion::expire(db, session, *at).await,
            Write::DropChunks { session, limit } => {
                deletion::drop_chunks(db, session, *limit).await
            }
            Write::DropTransitions { session, limit } => {
                deletion::drop_transitions(db, session, *limit).await
            }
            Write::GiveUpAsset { name, at } => self.give_up_asset(db, name, *at).await,
            Write::DeleteAsset { name } => deletion::delete_asset(db, name).await,
        }
    }

    fn defer(&mut self, session: &str, first_index: i64, samples: &[Sample], progress: Progress) {
        let known = self.pending.iter_mut().find(|p| p.session == session);
        if let Some(pending) = known {
            pending.samples.extend_from_slice(samples);
            pending.progress = progress;
            return;
        }
        let (session, samples) = (session.to_owned(), samples.to_vec());
        self.pending.push(Run { session, first_index, samples, progress });
    }
}

/// Absent values go as others that cannot be: their type is then the same in
/// every execution of a statement, as PostgreSQL wants it.
async fn put_progress(db: &mut AnyConnection, runs: &[Run]) -> Result<(), StoreError> {
    static PUT: RowsAtOnce = RowsAtOnce::new(
        "UPDATE session SET n_samples = run.column2, n_rejected = run.column3,
         first_t_s = CASE WHEN run.column2 = 0 THEN NULL ELSE run.column4 END,
         last_t_s = CASE WHEN run.column2 = 0 THEN NULL ELSE run.column5 END,
         last_seq = NULLIF(run.column6, -1) FROM (VALUES ",
        6,
        ") AS run WHERE id = run.column1",
    );
    for part in in_parts(runs) {
        let mut query = sqlx::query(PUT.sql(part.len()));
        for Run { session, progress, .. } in part {
            query = query
                .bind(session)
                .bind(progress.n_samples)
                .bind(progress.n_rejected)
                .bind(progress.first_t_s.unwrap_or_default())
                .bind(progress.last_t_s.unwrap_or_default())
                .bind(progress.last_seq.unwrap_or(-1));
        }
        query.execute(&mut *db).await?;
    }
    Ok(())
}

async fn create_asset(db: &mut AnyConnection, row: &AssetRow) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO asset (name, document, revision, created_at, updated_at)
         VALUES ($1, $2, $3, $4, $5)",
    )
    .bind(&row.name)
    .bind(&row.document)
    .bind(row.revision)
    .bind(row.created_at)
    .bind(row.updated_at)
    .execute(db)
    .await?;
    Ok(())
}

async fn update_asset(db: &mut AnyConnection, row: &AssetRow) -> Result<(), StoreError> {
    sqlx::query("UPDATE asset SET document = $2, revision = $3, updated_at = $4 WHERE name = $1")
        .bind(&row.name)
        .bind(&row.document)
        .bind(row.revision)
        .bind(row.updated_at)
        .execute(db)
        .await?;
    Ok(())
}

async fn open_session(db: &mut AnyConnection, row: &SessionRow) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO session (id, asset, name, state, opened_at, setup, baseline, n_samples,
         n_rejected) VALUES ($1, $2, $3, 'open', $4, $5, $6, 0, 0)",
    )
    .bind(&row.id)
    .bind(&row.asset)
    .bind(&row.name)
    .bind(row.opened_at)
    .bind(&row.setup)
    .bind(&row.baseline)
    .execute(db)
    .await?;
    Ok(())
}

async fn end_session(
    db: &mut AnyConnection,
    session: &str,
    ended_at: Micros,
    verdict: &str,
    hash: &str,
) -> Result<(), StoreError> {
    sqlx::query(
        "UPDATE session SET state = 'ended', ended_at = $2, verdict = $3, verdict_hash = $4,
         n_bytes = (SELECT CAST(COALESCE(SUM(LENGTH(data)), 0) AS BIGINT) FROM chunk
                    WHERE chunk.session = session.id)
         WHERE id = $1",
    )
    .bind(session)
    .bind(ended_at)
    .bind(verdict)
    .bind(hash)
    .execute(db)
    .await?;
    Ok(())
}

async fn insert_action(db: &mut AnyConnection, row: &ActionRow) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO action (id, asset, session, after_index, kind, code, actor, at, event)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
    )
    .bind(row.id)
    .bind(&row.asset)
    .bind(&row.session)
    .bind(row.after_index)
    .bind(&row.kind)
    .bind(&row.code)
    .bind(&row.actor)
    .bind(row.at)
    .bind(&row.event)
    .execute(db)
    .await?;
    Ok(())
}

async fn insert_transition(db: &mut AnyConnection, row: &TransitionRow) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO transition (id, asset, session, ordinal, t_s, code, status, at, document)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
    )
    .bind(row.id)
    .bind(&row.asset)
    .bind(&row.session)
    .bind(row.ordinal)
    .bind(row.t_s)
    .bind(&row.code)
    .bind(&row.status)
    .bind(row.at)
    .bind(&row.document)
    .execute(db)
    .await?;
    Ok(())
}

async fn put_fault(db: &mut AnyConnection, row: &FaultRow) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO fault (asset, code, status, acknowledged, changed_at, record, provenance)
         VALUES ($1, $2, $3, $4, $5, $6, $7)
         ON CONFLICT (asset, code) DO UPDATE SET status = excluded.status,
         acknowledged = excluded.acknowledged, changed_at = excluded.changed_at,
         record = excluded.record, provenance = excluded.provenance",
    )
    .bind(&row.asset)
    .bind(&row.code)
    .bind(&row.status)
    .bind(row.acknowledged)
    .bind(row.changed_at)
    .bind(&row.record)
    .bind(&row.provenance)
    .execute(db)
    .await?;
    Ok(())
}

async fn insert_trend(db: &mut AnyConnection, row: &TrendRow) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO trend (session, axis, asset, ended_at, n_samples, calibration_id, gain,
         gain_error, offset_m_s2, offset_error_m_s2, delay_s, delay_error_s, motion_s, warnings)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14)",
    )
    .bind(&row.session)
    .bind(&row.axis)
    .bind(&row.asset)
    .bind(row.ended_at)
    .bind(row.n_samples)
    .bind(&row.calibration_id)
    .bind(row.gain)
    .bind(row.gain_error)
    .bind(row.offset_m_s2)
    .bind(row.offset_error_m_s2)
    .bind(row.delay_s)
    .bind(row.delay_error_s)
    .bind(row.motion_s)
    .bind(&row.warnings)
    .execute(db)
    .await?;
    Ok(())
}

async fn put_replay(db: &mut AnyConnection, row: &ReplayRow) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO replay (id, session, state, settings, created_at, finished_at, result, error)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8)
         ON CONFLICT (id) DO UPDATE SET state = excluded.state,
         finished_at = excluded.finished_at, result = excluded.result, error = excluded.error",
    )
    .bind(&row.id)
    .bind(&row.session)
    .bind(&row.state)
    .bind(&row.settings)
    .bind(row.created_at)
    .bind(row.finished_at)
    .bind(&row.result)
    .bind(&row.error)
    .execute(db)
    .await?;
    Ok(())
}

async fn put_calibration(db: &mut AnyConnection, row: &CalibrationRow) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO calibration (id, asset, state, sessions, made_at, active, document, error)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8)
         ON CONFLICT (id) DO UPDATE SET state = excluded.state, document = excluded.document,
         error = excluded.error",
    )
    .bind(&row.id)
    .bind(&row.asset)
    .bind(&row.state)
    .bind(&row.sessions)
    .bind(row.made_at)
    .bind(row.active)
    .bind(&row.document)
    .bind(&row.error)
    .execute(db)
    .await?;
    Ok(())
}

async fn activate(db: &mut AnyConnection, asset: &str, id: &str) -> Result<(), StoreError> {
    sqlx::query(
        "UPDATE calibration SET active = CASE WHEN id = $2 THEN 1 ELSE 0 END WHERE asset = $1",
    )
    .bind(asset)
    .bind(id)
    .execute(db)
    .await?;
    Ok(())
}

async fn put_learning(
    db: &mut AnyConnection,
    asset: &str,
    document: &str,
) -> Result<(), StoreError> {
    sqlx::query("UPDATE asset SET learning = $2 WHERE name = $1")
        .bind(asset)
        .bind(document)
        .execute(db)
        .await?;
    Ok(())
}
