//! The writer: the one connection that changes the database.
//!
//! It applies a group of changes in one transaction, which is durable when
//! [`Writer::commit`] returns. If a connection is lost during a commit, it is not known
//! whether the database has committed the transaction. Therefore every transaction of the
//! main writer increments a counter in the database; after reconnecting, the writer
//! compares the counter with its own and knows the outcome, so that nothing is stored
//! twice or lost. Any other value means that another process has written, or that the
//! database was replaced; then the writer refuses all changes until a restart.

mod deletion;
mod fold;
mod ownership;
mod subject;
#[cfg(feature = "commit-faults")]
mod test_faults;

#[cfg(feature = "commit-faults")]
pub use test_faults::{CommitFault, CommitPoint, FaultPlan};

use std::collections::{BTreeSet, HashSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use sqlx::{AnyConnection, Connection};

use self::fold::Relocation;
use self::ownership::OwnedPartitions;
pub use self::ownership::{NodeIdentity, NodeRow};
use super::checkpoint::{self, Checkpointer};
use super::journal::{Journal, JournalChanges};
use super::multi_row::{MultiRowStatement, in_parts};
use super::tail::{Run, Tails};
use super::writer_lock::Backend;
use super::{
    AccessWrite, ActionRow, AlarmWrite, AssetRow, CalibrationRow, CommunicationChange, EVENTS,
    FaultRow, Location, MIGRATIONS, Micros, NotificationWrite, PartitionId, Partitions,
    RemarkWrite, ReplayRow, SessionProgress, SessionRow, Snapshot, StoreError, TransitionRow,
    TrendRow, alarm, snapshot, tag,
};
use offbd_core::vocabulary::Sample;

/// Longest duration of a commit; then its connection is dropped. A disk that is slower
/// cannot support the service.
const COMMIT_TIMEOUT: Duration = Duration::from_secs(30);

/// A change of the database.
#[derive(Clone, Debug)]
pub enum Write {
    /// Creates an asset. It is a conflict if its name is taken.
    CreateAsset(AssetRow),
    /// Replaces the document of an existing asset.
    UpdateAsset(AssetRow),
    /// Hides an asset and its sessions from all readers, and ends its open session. The
    /// first step of its deletion.
    HideAsset {
        name: String,
        at: Micros,
    },
    /// Deletes a hidden asset, with what is left of its sessions.
    DeleteAsset {
        name: String,
    },
    OpenSession(SessionRow),
    /// Appends samples, possibly none, to the recording of a session, and sets the
    /// session's progress.
    Append {
        session: String,
        first_index: i64,
        samples: Vec<Sample>,
        progress: SessionProgress,
    },
    /// Stores a snapshot of the engine of an open session.
    PutSnapshot(Snapshot),
    /// Removes all snapshots of a session.
    RemoveSnapshots {
        session: String,
    },
    EndSession {
        session: String,
        ended_at: Micros,
        verdict: String,
        hash: String,
        /// Whether the verdict has a confirmed fault.
        found_fault: bool,
    },
    /// Deletes a session, with what is left of its chunks and transitions.
    DeleteSession {
        session: String,
    },
    /// Ends an open session without a verdict and hides it from all readers. The first
    /// step of its deletion.
    DiscardSession {
        session: String,
        at: Micros,
    },
    /// Hides an ended session from all readers. The first step of its deletion.
    HideSession {
        session: String,
        at: Micros,
    },
    /// Deletes the first chunks of a hidden session, at most `limit`.
    DropChunks {
        session: String,
        limit: u32,
    },
    /// Deletes the first transitions of a hidden session, at most `limit`.
    DropTransitions {
        session: String,
        limit: u32,
    },
    Action(ActionRow),
    Transition(TransitionRow),
    Fault(FaultRow),
    Trend(TrendRow),
    PutReplay(ReplayRow),
    PutCalibration(CalibrationRow),
    /// Makes a calibration the active one of its asset; an empty `id` is none of them.
    ActivateCalibration {
        asset: String,
        id: String,
        by: Option<String>,
        at: Micros,
    },
    /// Stores the learning record of an asset (its automatic calibration).
    PutLearning {
        asset: String,
        document: String,
    },
    /// Stores the last event that was published on a bus.
    Published {
        bus: &'static str,
        event: i64,
    },
    /// Replaces the tags of an asset.
    PutTags {
        asset: String,
        tags: Vec<String>,
    },
    Access(AccessWrite),
    Alarm(AlarmWrite),
    Notification(NotificationWrite),
    Remark(RemarkWrite),
    /// Data of a rig stay away or come back; an event.
    Communication(CommunicationChange),
}

impl Write {
    /// Whether it gets the number of an event.
    const fn is_event(&self) -> bool {
        matches!(self, Self::Transition(_) | Self::Action(_) | Self::Communication(_))
    }
}

/// Changes that belong together, and the partition of their asset; `None` for changes that
/// concern no engine, such as tokens.
#[derive(Debug)]
pub struct ChangeSet<'a> {
    pub partition: Option<PartitionId>,
    pub writes: &'a mut Vec<Write>,
}

impl<'a> ChangeSet<'a> {
    /// Changes in a database that has one partition.
    pub const fn unpartitioned(writes: &'a mut Vec<Write>) -> Self {
        Self { partition: Some(PartitionId(0)), writes }
    }
}

/// What a writer may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WriterRole {
    /// Everything, for all partitions. At most one writer of a database has this role, and
    /// there is no node beside it.
    Main,
    /// Everything, for the partitions that it takes: a node of a cluster (PostgreSQL).
    Node,
    /// Changes that neither cause an event nor concern an engine, such as tokens. It may
    /// run beside other writers, and does not count its transactions.
    Auxiliary,
}

/// The connection that changes the database.
#[derive(Debug)]
pub struct Writer {
    location: Location,
    /// `None` after a failure, until [`Writer::reconnect`].
    connection: Option<AnyConnection>,
    n_disconnections: Arc<AtomicU64>,
    /// The SQLite file that the writer has opened.
    file_identity: Option<(u64, u64)>,
    /// The last connection as PostgreSQL knows it.
    backend: Option<Backend>,
    /// How many partitions the database has.
    partitions: Partitions,
    /// The partitions that this writer may change.
    owned: OwnedPartitions,
    /// The node that writes; `None` without a cluster.
    node: Option<NodeIdentity>,
    role: WriterRole,
    pub(super) checkpointer: Option<Checkpointer>,
    /// The transaction whose outcome is not known yet.
    in_doubt: Option<InDoubt>,
    /// Expected and found number of commits, once they were not the same: a partition that
    /// another process goes on with may have as many later.
    unexpected: Option<(i64, i64)>,
    tails: Tails,
    journal: Journal,
    /// Sessions that could not be folded because the database refused their chunks. Until
    /// it accepts them, it accepts no further samples of these sessions either.
    refused: HashSet<String>,
    /// The journal's bytes after the last [`Writer::fold`].
    n_bytes_before: usize,
    /// The faults of a simulation.
    #[cfg(feature = "commit-faults")]
    pub faults: FaultPlan,
}

/// A transaction whose outcome is not known yet.
#[derive(Debug)]
struct InDoubt {
    /// The partitions that count it.
    partitions: BTreeSet<PartitionId>,
    journal: JournalChanges,
}

impl Writer {
    /// Opens the database and takes all its partitions.
    pub(super) async fn open(location: &Location) -> Result<Self, StoreError> {
        location.check_log().await?;
        let (connection, backend) = location.writer(WriterRole::Main, None).await?;
        let mut this = Self::connected(location, WriterRole::Main, connection, backend).await?;
        let all: Vec<_> = this.partitions.all().collect();
        this.take(&all).await?;
        this.checkpointer = Checkpointer::start(location);
        Ok(this)
    }

    pub(super) async fn open_auxiliary(location: &Location) -> Result<Self, StoreError> {
        location.check_log().await?;
        let (connection, _) = location.writer(WriterRole::Auxiliary, None).await?;
        Self::connected(location, WriterRole::Auxiliary, connection, None).await
    }

    /// Brings the schema to this version, and returns a writer that owns no partition yet.
    async fn connected(
        location: &Location,
        role: WriterRole,
        mut connection: AnyConnection,
        backend: Option<Backend>,
    ) -> Result<Self, StoreError> {
        MIGRATIONS.run_direct(None, &mut connection, false).await?;
        let partitions = ownership::count(&mut connection).await?;
        Ok(Self {
            location: location.clone(),
            file_identity: location.file_identity(),
            connection: Some(connection),
            n_disconnections: Arc::default(),
            backend,
            partitions,
            owned: OwnedPartitions::default(),
            node: None,
            role,
            checkpointer: None,
            in_doubt: None,
            unexpected: None,
            tails: Tails::default(),
            journal: Journal::default(),
            refused: HashSet::new(),
            n_bytes_before: 0,
            #[cfg(feature = "commit-faults")]
            faults: FaultPlan::default(),
        })
    }

    /// How many partitions the database has.
    #[must_use]
    pub const fn partitions(&self) -> Partitions {
        self.partitions
    }

    /// Bytes of all rows of the journal.
    #[must_use]
    pub fn journal_bytes(&self) -> usize {
        self.journal.n_bytes()
    }

    pub(super) fn journal(&self) -> Journal {
        self.journal.clone()
    }

    /// Applies `sets` in order, in one transaction that is durable on return, and assigns
    /// ids to their actions and transitions: consecutive ones, in the order of the commits of
    /// all writers of the database.
    ///
    /// # Errors
    /// [`StoreError`]. If [`StoreError::is_outage`], the transaction may nevertheless be
    /// committed; [`Writer::reconnect`] returns whether it is. Otherwise nothing has been
    /// applied; after [`StoreError::Overtaken`] the partitions that it names are no longer
    /// owned, see [`Writer::lost`].
    pub async fn commit(&mut self, sets: &mut [ChangeSet<'_>]) -> Result<(), StoreError> {
        self.transact(sets, None).await
    }

    async fn transact(
        &mut self,
        sets: &mut [ChangeSet<'_>],
        relocation: Option<&Relocation>,
    ) -> Result<(), StoreError> {
        self.check_file()?;
        if self.connection.is_none() && self.reconnect().await? {
            // The caller of that commit did not call `reconnect`.
            tracing::warn!("a commit whose outcome was unknown has succeeded");
        }
        let late = |_| Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()).into());
        let attempt = tokio::time::timeout(COMMIT_TIMEOUT, self.attempt(sets, relocation));
        let result = attempt.await.unwrap_or_else(late);
        match &result {
            Ok(()) => {
                self.note_committed();
                self.tails.note_committed();
                if let Some(checkpointer) = &mut self.checkpointer {
                    checkpointer.count_commit(n_samples(sets));
                }
            }
            Err(error) => {
                self.tails.forget_uncommitted();
                self.note_unexpected(error);
                match error {
                    // The transaction was rolled back, and the connection holds locks.
                    StoreError::Overtaken { partitions } => self.lose(partitions),
                    // After another failure the connection may be in any state.
                    _ => self.disconnect(),
                }
            }
        }
        result
    }

    /// Copies the rest of SQLite's write-ahead log into the database file if the
    /// checkpointer has left a small one, so that the next commit starts the log from its
    /// beginning.
    pub async fn copy_log(&mut self) {
        if !self.checkpointer.as_ref().is_some_and(Checkpointer::take_is_rest_small) {
            return;
        }
        let Some(connection) = &mut self.connection else { return };
        let late = |_| Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()));
        let copied = tokio::time::timeout(COMMIT_TIMEOUT, checkpoint::copy(connection)).await;
        if let Err(error) = copied.unwrap_or_else(late) {
            tracing::warn!(%error, "cannot copy the write-ahead log into the database file");
            self.disconnect();
        }
    }

    /// Connects again. Returns whether the last commit, which returned an error, has been
    /// committed nevertheless. Afterwards no outcome is in doubt.
    ///
    /// # Errors
    /// [`StoreError`] if the database is still unavailable, does not accept changes, or has
    /// ever been found changed by another process.
    pub async fn reconnect(&mut self) -> Result<bool, StoreError> {
        self.disconnect();
        if let Some((expected, found)) = self.unexpected {
            return Err(StoreError::UnexpectedCommits { expected, found });
        }
        let connected = self.connect_again().await;
        connected.inspect_err(|error| self.note_unexpected(error))
    }

    async fn connect_again(&mut self) -> Result<bool, StoreError> {
        self.check_file()?;
        let lost = self.backend.as_ref();
        // Has time limits of its own.
        let (connection, backend) = self.location.writer(self.role, lost).await?;
        self.backend = backend.or(self.backend.take());
        let late = |_| Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()).into());
        let attempt = tokio::time::timeout(COMMIT_TIMEOUT, self.resume(connection));
        attempt.await.unwrap_or_else(late)
    }

    fn note_unexpected(&mut self, error: &StoreError) {
        let StoreError::UnexpectedCommits { expected, found } = error else { return };
        self.unexpected = Some((*expected, *found));
        if self.role == WriterRole::Node {
            let all: Vec<_> = self.owned().into_iter().map(|(partition, _)| partition).collect();
            self.lose(&all);
        }
    }

    /// Drops the connection. From now on other nodes may take what this writer owns.
    pub fn disconnect(&mut self) {
        self.connection = None;
        self.n_disconnections.fetch_add(1, Ordering::SeqCst);
    }

    /// How often the connection was dropped so far; counts on.
    #[must_use]
    pub fn n_disconnections(&self) -> Arc<AtomicU64> {
        self.n_disconnections.clone()
    }

    /// Checks that the SQLite file is still there: what is written to a removed file is lost
    /// when the service stops.
    fn check_file(&self) -> Result<(), StoreError> {
        if self.location.file_identity() == self.file_identity {
            return Ok(());
        }
        let file = self.location.file().unwrap_or(Path::new("")).to_owned();
        Err(StoreError::FileGone { file })
    }

    /// Goes on with a new connection. Returns whether the transaction in doubt is committed.
    async fn resume(&mut self, mut connection: AnyConnection) -> Result<bool, StoreError> {
        self.probe(&mut connection).await?;
        let was_committed = self.own_again(&mut connection).await?;
        if was_committed {
            self.note_committed();
        }
        self.in_doubt = None;
        self.connection = Some(connection);
        Ok(was_committed)
    }

    /// Checks that the database accepts durable changes, and waits until the transaction of
    /// the lost connection has ended.
    async fn probe(&mut self, db: &mut AnyConnection) -> Result<(), StoreError> {
        sqlx::query("UPDATE counter SET value = value + 1 WHERE name = 'probe'")
            .execute(&mut *db)
            .await?;
        for partition in self.in_doubt.iter().flat_map(|doubt| &doubt.partitions) {
            sqlx::query("UPDATE partition SET epoch = epoch WHERE id = $1")
                .bind(partition.bound())
                .execute(&mut *db)
                .await?;
        }
        Ok(())
    }

    /// Counts the last transaction, which is committed, and applies its changes of the
    /// journal.
    fn note_committed(&mut self) {
        if let Some(InDoubt { partitions, journal }) = self.in_doubt.take() {
            self.owned.count_commit(&partitions);
            self.refused.retain(|session| !journal.removed_sessions.contains(session));
            self.journal.apply(journal);
        }
    }

    /// Folds the whole journal and closes the connection.
    ///
    /// # Errors
    /// [`StoreError`] if that fails. All commits are durable in any case.
    pub async fn close(mut self) -> Result<(), StoreError> {
        let folded = match self.role {
            WriterRole::Main => self.fold_all().await,
            WriterRole::Node | WriterRole::Auxiliary => Ok(()),
        };
        if let Some(checkpointer) = self.checkpointer {
            checkpointer.close().await;
        }
        if let Some(connection) = self.connection {
            connection.close().await?;
        }
        folded
    }

    async fn attempt(
        &mut self,
        sets: &mut [ChangeSet<'_>],
        relocation: Option<&Relocation>,
    ) -> Result<(), StoreError> {
        let partitions = self.touched(sets, relocation)?;
        let Some(connection) = &mut self.connection else {
            return Err(sqlx::Error::PoolClosed.into());
        };
        #[cfg(feature = "commit-faults")]
        self.faults.reach(CommitPoint::Begin)?;
        let mut transaction = connection.begin_with(self.location.begin()).await?;
        let writes = || sets.iter().flat_map(|set| set.writes.iter());
        let mut group = GroupCommit {
            owned: &self.owned,
            events: EventIds::new(writes().filter(|write| write.is_event()).count()),
            tails: &mut self.tails,
            journal: &self.journal,
            refused: &self.refused,
            changes: JournalChanges::default(),
            pending: Vec::new(),
        };
        for ChangeSet { partition, writes } in sets {
            let partition = partition.unwrap_or_default();
            for write in writes.iter_mut() {
                group.apply(&mut transaction, partition, write).await?;
            }
        }
        if let Some(relocation) = relocation {
            group.relocate(&mut transaction, relocation).await?;
        }
        group.flush(&mut transaction).await?;
        let (journal, has_events) = (group.changes, group.events.next.is_some());
        if has_events && self.role == WriterRole::Node {
            ownership::notify(&mut transaction, EVENTS).await?;
        }
        if !partitions.is_empty() {
            self.owned.fence(&mut transaction, &partitions, self.node.as_ref()).await?;
            self.in_doubt = Some(InDoubt { partitions, journal });
        }
        #[cfg(feature = "commit-faults")]
        self.faults.reach(CommitPoint::BeforeCommit)?;
        transaction.commit().await?;
        #[cfg(feature = "commit-faults")]
        self.faults.reach(CommitPoint::AfterCommit)?;
        Ok(())
    }

    /// The partitions that a transaction changes; those count it. One that changes none is
    /// counted by some owned partition, so that its outcome can be known too.
    fn touched(
        &self,
        sets: &[ChangeSet<'_>],
        relocation: Option<&Relocation>,
    ) -> Result<BTreeSet<PartitionId>, StoreError> {
        if self.role == WriterRole::Auxiliary {
            return Ok(BTreeSet::new());
        }
        let mut touched: BTreeSet<_> = sets.iter().filter_map(|set| set.partition).collect();
        touched.extend(relocation.into_iter().flat_map(|r| r.partitions(&self.journal)));
        if touched.is_empty() {
            touched.extend(self.owned.first());
        }
        let lost: Vec<_> = touched.iter().copied().filter(|p| !self.owned.contains(*p)).collect();
        if lost.is_empty() { Ok(touched) } else { Err(StoreError::Overtaken { partitions: lost }) }
    }
}

fn n_samples(sets: &[ChangeSet<'_>]) -> usize {
    let of =
        |write: &Write| if let Write::Append { samples, .. } = write { samples.len() } else { 0 };
    sets.iter().flat_map(|set| set.writes.iter()).map(of).sum()
}

/// The ids of the events of a transaction. They are taken from the database all at once and
/// as late as possible, because other writers of the database wait for the next ones until
/// this transaction has ended. So ids have the order of the commits, and
/// no gaps but where an event turns out to be none.
#[derive(Debug)]
struct EventIds {
    n_events: usize,
    next: Option<i64>,
}

impl EventIds {
    const fn new(n_events: usize) -> Self {
        Self { n_events, next: None }
    }

    async fn next(&mut self, db: &mut AnyConnection) -> Result<i64, StoreError> {
        let n_events = self.n_events as i64;
        let next = match self.next {
            Some(next) => next,
            None => {
                let take = "UPDATE counter SET value = value + $1 WHERE name = 'event'
                            RETURNING value";
                let last: i64 = sqlx::query_scalar(take).bind(n_events).fetch_one(db).await?;
                last + 1 - n_events
            }
        };
        self.next = Some(next + 1);
        Ok(next)
    }
}

/// A group of changes while its transaction is open.
struct GroupCommit<'a> {
    owned: &'a OwnedPartitions,
    events: EventIds,
    tails: &'a mut Tails,
    journal: &'a Journal,
    refused: &'a HashSet<String>,
    changes: JournalChanges,
    /// New samples, one run per session. They are written at the end of the group, so that
    /// consecutive batches of a session become one run.
    pending: Vec<Run>,
}

impl GroupCommit<'_> {
    /// The id of the journal row of this transaction for `partition`.
    fn journal_row(&self, partition: PartitionId) -> i64 {
        partition.journal_row(self.owned.n_commits(partition) + 1)
    }

    async fn apply(
        &mut self,
        db: &mut AnyConnection,
        partition: PartitionId,
        write: &mut Write,
    ) -> Result<(), StoreError> {
        match write {
            Write::Append { session, first_index, samples, progress } => {
                self.defer(partition, session, *first_index, samples, *progress);
                Ok(())
            }
            Write::Transition(row) => {
                row.id = self.events.next(db).await?;
                insert_transition(db, row).await
            }
            Write::Action(row) => {
                row.id = self.events.next(db).await?;
                insert_action(db, row).await
            }
            Write::Fault(row) => put_fault(db, row).await,
            Write::Trend(row) => insert_trend(db, row).await,
            Write::PutReplay(row) => put_replay(db, row).await,
            Write::PutCalibration(row) => put_calibration(db, row).await,
            Write::ActivateCalibration { asset, id, by, at } => {
                activate(db, asset, id, (by.as_deref(), *at)).await
            }
            Write::PutLearning { asset, document } => put_learning(db, asset, document).await,
            Write::PutTags { asset, tags } => tag::put(db, asset, tags).await,
            Write::Published { bus, event } => published(db, bus, *event).await,
            Write::Access(write) => write.apply(db).await,
            Write::Alarm(write) => write.apply(db).await,
            Write::Notification(write) => write.apply(db).await,
            Write::Remark(write) => write.apply(db).await,
            Write::Communication(row) => {
                row.id = self.events.next(db).await?;
                if !alarm::change_communication(db, row).await? {
                    row.id = 0;
                }
                Ok(())
            }
            Write::CreateAsset(row) => create_asset(db, partition, row).await,
            Write::UpdateAsset(row) => update_asset(db, row).await,
            Write::OpenSession(row) => open_session(db, row).await,
            Write::PutSnapshot(row) => snapshot::put(db, row).await,
            Write::RemoveSnapshots { session } => snapshot::remove_all(db, session).await,
            Write::EndSession { session, ended_at, verdict, hash, found_fault } => {
                self.fold_ended(db, partition, session).await?;
                snapshot::remove(db, session).await?;
                end_session(db, session, *ended_at, (verdict, hash, *found_fault)).await
            }
            Write::DeleteSession { session } => self.delete_session(db, session).await,
            Write::HideSession { session, at } => deletion::hide_session(db, session, *at).await,
            Write::DiscardSession { session, at } => self.discard_session(db, session, *at).await,
            Write::DropChunks { session, limit } => {
                deletion::drop_chunks(db, session, *limit).await
            }
            Write::DropTransitions { session, limit } => {
                deletion::drop_transitions(db, session, *limit).await
            }
            Write::HideAsset { name, at } => self.hide_asset(db, name, *at).await,
            Write::DeleteAsset { name } => deletion::delete_asset(db, name).await,
        }
    }

    /// Adds samples to the run of their session.
    fn defer(
        &mut self,
        partition: PartitionId,
        session: &str,
        first_index: i64,
        samples: &[Sample],
        progress: SessionProgress,
    ) {
        let known = self.pending.iter_mut().find(|p| p.session == session);
        if let Some(pending) = known {
            pending.samples.extend_from_slice(samples);
            pending.progress = progress;
            return;
        }
        let (session, samples) = (session.to_owned(), samples.to_vec());
        self.pending.push(Run { partition, session, first_index, samples, progress });
    }
}

/// Updates the progress of the sessions of `runs`. Missing values are bound as values
/// that do not occur otherwise, because PostgreSQL requires the same types in every
/// execution of a statement, and NULL has another one.
async fn put_progress(db: &mut AnyConnection, runs: &[Run]) -> Result<(), StoreError> {
    static PUT: MultiRowStatement = MultiRowStatement::new(
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

async fn create_asset(
    db: &mut AnyConnection,
    partition: PartitionId,
    row: &AssetRow,
) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO asset (partition, name, document, revision, created_at, updated_at)
         VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(partition.bound())
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
        "INSERT INTO session (id, asset, name, state, opened_at, setup, baseline, importing,
         part, first_part, n_samples, n_rejected)
         VALUES ($1, $2, $3, 'open', $4, $5, $6, $7, $8, $9, 0, 0)",
    )
    .bind(&row.id)
    .bind(&row.asset)
    .bind(&row.name)
    .bind(row.opened_at)
    .bind(&row.setup)
    .bind(&row.baseline)
    .bind(row.importing)
    .bind(row.part)
    .bind(&row.first_part)
    .execute(db)
    .await?;
    Ok(())
}

async fn end_session(
    db: &mut AnyConnection,
    session: &str,
    ended_at: Micros,
    (verdict, hash, found_fault): (&str, &str, bool),
) -> Result<(), StoreError> {
    sqlx::query(
        "UPDATE session SET state = 'ended', importing = 0, ended_at = $2, verdict = $3,
         verdict_hash = $4, found_fault = $5,
         n_bytes = (SELECT CAST(COALESCE(SUM(LENGTH(data)), 0) AS BIGINT) FROM chunk
                    WHERE chunk.session = session.id)
             + LENGTH(setup) + LENGTH(baseline) + LENGTH($3)
         WHERE id = $1",
    )
    .bind(session)
    .bind(ended_at)
    .bind(verdict)
    .bind(hash)
    .bind(i64::from(found_fault))
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
        "INSERT INTO calibration (id, asset, state, sessions, made_at, active, document, error,
         made_by) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)
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
    .bind(&row.made_by)
    .execute(db)
    .await?;
    Ok(())
}

async fn activate(
    db: &mut AnyConnection,
    asset: &str,
    id: &str,
    (by, at): (Option<&str>, Micros),
) -> Result<(), StoreError> {
    sqlx::query("UPDATE calibration SET active = 0 WHERE asset = $1 AND active = 1")
        .bind(asset)
        .execute(&mut *db)
        .await?;
    sqlx::query(
        "UPDATE calibration SET active = 1, activated_by = $3, activated_at = $4
         WHERE asset = $1 AND id = $2",
    )
    .bind(asset)
    .bind(id)
    .bind(by)
    .bind(at)
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

async fn published(db: &mut AnyConnection, bus: &str, event: i64) -> Result<(), StoreError> {
    let sql = "INSERT INTO counter (name, value) VALUES ($1, $2)
        ON CONFLICT (name) DO UPDATE SET value = excluded.value";
    sqlx::query(sql).bind(published_counter(bus)).bind(event).execute(db).await?;
    Ok(())
}

/// Returns the name of the counter of the last event that was published on a bus.
pub(super) fn published_counter(bus: &str) -> String {
    format!("published_{bus}")
}
