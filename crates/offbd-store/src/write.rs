//! The writer: the one connection that changes the database.
//!
//! It applies a group of changes in one transaction, which is durable when
//! [`Writer::commit`] returns. If a connection is lost during a commit, it is not known
//! whether the database has committed the transaction. Therefore every transaction of the
//! main writer increments a counter in the database; after reconnecting, the writer
//! compares the counter with its own and knows the outcome, so that nothing is stored
//! twice or lost. Any other value means that another process has written, or that the
//! database was replaced; then the writer refuses all changes until a restart.

mod change;
mod deletion;
mod fold;
mod group;
mod owned;
mod ownership;
mod statements;
#[cfg(feature = "commit-faults")]
mod test_faults;

#[cfg(feature = "commit-faults")]
pub use test_faults::{CommitFault, CommitPoint, FaultPlan};

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use sqlx::{AnyConnection, Connection};

pub use self::change::{ChangeSet, Write};
use self::group::{EventIds, GroupCommit, Relocation};
use self::owned::OwnedPartitions;
use super::checkpoint::{self, Checkpointer};
use super::journal::{Journal, JournalChanges};
use super::tail::Tails;
use super::writer_lock::{Backend, WriterRole};
use super::{Location, NodeIdentity, PartitionId, Partitions, StoreError, migrations};

/// Longest duration of a commit; then its connection is dropped. A disk that is slower
/// cannot support the service.
const COMMIT_TIMEOUT: Duration = Duration::from_secs(30);

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
        migrations::migrate(&mut connection).await?;
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
    /// ids to their actions and transitions: increasing ones, in the order of the commits of
    /// all writers of the database.
    ///
    /// # Errors
    /// [`StoreError`]. If [`StoreError::is_outage`], the transaction may nevertheless be
    /// committed, unless [`Writer::is_connected`]; [`Writer::reconnect`] returns whether it is.
    /// Otherwise nothing has been applied; after [`StoreError::Overtaken`] the partitions that it
    /// names are no longer owned, see [`Writer::lost`].
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
                self.note_replaced(error);
                match error {
                    // The transaction was rolled back, and the connection holds locks.
                    StoreError::Overtaken { partitions } => self.lose(partitions),
                    error if error.leaves_connection() => self.roll_back().await,
                    // After another failure the connection may be in any state.
                    _ => self.disconnect(),
                }
            }
        }
        result
    }

    /// Ends the transaction that the server has refused. The connection remains, and with it what
    /// this writer owns.
    async fn roll_back(&mut self) {
        self.in_doubt = None;
        let Some(connection) = &mut self.connection else { return };
        // Sends the rollback that waits for the next statement.
        let late = |_| Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()));
        let rolled_back = tokio::time::timeout(COMMIT_TIMEOUT, connection.ping()).await;
        if rolled_back.unwrap_or_else(late).is_err() {
            self.disconnect();
        }
    }

    /// Whether there is a connection, which may have failed meanwhile.
    #[must_use]
    pub const fn is_connected(&self) -> bool {
        self.connection.is_some()
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
        connected.inspect_err(|error| self.note_replaced(error))
    }

    async fn connect_again(&mut self) -> Result<bool, StoreError> {
        self.check_file()?;
        let lost = self.backend.as_ref();
        // Has its own time limits.
        let (connection, backend) = self.location.writer(self.role, lost).await?;
        self.backend = backend.or(self.backend.take());
        let late = |_| Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()).into());
        let attempt = tokio::time::timeout(COMMIT_TIMEOUT, self.resume(connection));
        attempt.await.unwrap_or_else(late)
    }

    fn note_replaced(&mut self, error: &StoreError) {
        if let StoreError::UnexpectedCommits { expected, found } = error {
            self.unexpected = Some((*expected, *found));
        }
        if error.is_replaced() && self.role == WriterRole::Node {
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
            pending: BTreeMap::new(),
        };
        for ChangeSet { partition, writes } in sets {
            let partition = partition.unwrap_or_default();
            for write in writes.iter_mut() {
                write.apply(&mut group, &mut transaction, partition).await?;
            }
        }
        if let Some(relocation) = relocation {
            group.relocate(&mut transaction, relocation).await?;
        }
        group.flush(&mut transaction).await?;
        let journal = group.changes;
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
