//! The partitions of a writer, and the fence that keeps others from changing them.
//!
//! PostgreSQL decides who owns a partition: its owner holds an advisory lock on the
//! connection with which it writes. The server releases the lock when that connection ends:
//! at once if the process is killed, after [`IDLE_TIMEOUT`] if it is stopped or cut off. So
//! a process whose lock another one has taken has no connection left on which a transaction
//! of it could end. The epoch is the proof beside it: each owner increments it before it
//! reads anything, and every transaction of the former owner finds another epoch.

use std::time::Duration;

use data_encoding::HEXLOWER;
use sqlx::{AnyConnection, AssertSqlSafe, Executor};

use super::owned::{OwnedPartition, read};
use super::{COMMIT_TIMEOUT, Writer};
use crate::execute::execute;
use crate::multi_row::{MultiRowStatement, in_parts};
use crate::partition::PartitionRow;
use crate::writer_lock::{self, Backend, WriterRole};
use crate::{
    Location, NodeIdentity, NodeRow, PartitionId, Partitions, Store, StoreError, TRANSFERS,
    migrations,
};

/// The first key of the advisory locks of partitions; the second is the partition.
const PARTITION_LOCKS: i32 = i32::from_be_bytes(*b"part");

/// The first key of the advisory locks of nodes' names; the second is a hash of the name.
const NAME_LOCKS: i32 = i32::from_be_bytes(*b"name");

/// How long a node waits for its name, which a process that was killed or cut off may still
/// have. Chosen: twice the time after which the server ends the connection of that one.
const NAME_LOCK_TIMEOUT: &str = "4s";

/// After this long without a statement the server ends the connection of a node's writer.
/// Chosen: four times the interval at which a node looks at the partitions.
const IDLE_TIMEOUT: &str = "2s";

/// After this long within a transaction without a statement the server ends the connection.
/// Chosen: much longer than the work between two statements.
const IDLE_IN_TRANSACTION_TIMEOUT: &str = "1s";

/// Longest wait for a look at the partitions; then its connection is dropped. Chosen: longer than
/// the server keeps the locks of a node that it does not hear of.
const LOOK_TIMEOUT: Duration = Duration::from_secs(5);

/// Ends the connections of nodes that have read nothing of an answer for so long. The server has no
/// time limit for these: a node that is paused while it reads more than the buffers hold would
/// keep its partitions. (Over TCP the server gives such a connection up by itself, see
/// `store/writer_lock.rs`; not over a socket of the same machine.) Only those of the same user,
/// which is permitted. Chosen: much longer than the journal of a partition takes, the longest
/// answer.
const END_UNREAD: &str = "SELECT pg_terminate_backend(a.pid) FROM node JOIN pg_stat_activity a
    ON a.pid = node.pid AND CAST(a.backend_start AS TEXT) = node.started
    WHERE a.usename = current_user AND a.wait_event = 'ClientWrite'
    AND a.query_start < clock_timestamp() - INTERVAL '10 s'";

/// Whether the server still has the connection with which a row of `node` writes.
macro_rules! is_alive {
    () => {
        "EXISTS (SELECT 1 FROM pg_stat_activity a
         WHERE a.pid = node.pid AND CAST(a.backend_start AS TEXT) = node.started)"
    };
}

/// How many partitions the database has.
pub(super) async fn count(db: &mut AnyConnection) -> Result<Partitions, StoreError> {
    let n: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM partition").fetch_one(db).await?;
    Ok(Partitions::new(u32::try_from(n).unwrap_or(u32::MAX)))
}

/// All partitions as stored.
/// Takes the locks of those `partitions` whose lock is free; returns which. Not for one whose
/// lock this connection has: the server would count it twice.
async fn try_lock(
    db: &mut AnyConnection,
    partitions: &[PartitionId],
) -> Result<Vec<PartitionId>, StoreError> {
    static LOCK: MultiRowStatement = MultiRowStatement::new(
        "SELECT wanted.column1 FROM (VALUES ",
        2,
        ") AS wanted WHERE pg_try_advisory_lock(CAST(wanted.column2 AS INT),
         CAST(wanted.column1 AS INT))",
    );
    let mut locked = Vec::new();
    for part in in_parts(partitions) {
        let mut query = sqlx::query_scalar(LOCK.sql(part.len()));
        for partition in part {
            query = query.bind(partition.bound()).bind(i64::from(PARTITION_LOCKS));
        }
        let ids: Vec<i64> = query.fetch_all(&mut *db).await?;
        locked.extend(ids.into_iter().filter_map(|id| u32::try_from(id).ok()).map(PartitionId));
    }
    Ok(locked)
}

/// Increments the epochs of `partitions`, in one transaction. Not by an implicit commit, whose
/// error is not reported once there is a row.
async fn begin_epochs(
    db: &mut AnyConnection,
    partitions: &[PartitionId],
    me: Option<&NodeIdentity>,
) -> Result<Vec<(PartitionId, OwnedPartition)>, StoreError> {
    static TAKE: MultiRowStatement = MultiRowStatement::new(
        "UPDATE partition SET epoch = epoch + 1, owner = NULLIF(taken.column2, '') FROM (VALUES ",
        2,
        ") AS taken WHERE id = taken.column1 RETURNING id, epoch, n_commits, owner",
    );
    let owner = me.map_or("", |node| &node.id);
    let mut taken = Vec::new();
    let mut transaction = sqlx::Connection::begin(db).await?;
    for part in in_parts(partitions) {
        let mut query = sqlx::query_as(TAKE.sql(part.len()));
        for partition in part {
            query = query.bind(partition.bound()).bind(owner);
        }
        let rows: Vec<PartitionRow> = query.fetch_all(&mut *transaction).await?;
        taken.extend(rows.into_iter().map(|row| {
            let PartitionRow { epoch, n_commits, .. } = row;
            (row.partition(), OwnedPartition { epoch, n_commits })
        }));
    }
    transaction.commit().await?;
    Ok(taken)
}

/// Stores that partitions have no owner any more, each unless its epoch is another one.
async fn end_epochs(
    db: &mut AnyConnection,
    epochs: &[(PartitionId, i64)],
) -> Result<(), StoreError> {
    static GIVE_UP: MultiRowStatement = MultiRowStatement::new(
        "UPDATE partition SET owner = NULL FROM (VALUES ",
        2,
        ") AS mine WHERE id = mine.column1 AND epoch = mine.column2",
    );
    let mut transaction = sqlx::Connection::begin(db).await?;
    for part in in_parts(epochs) {
        let mut query = sqlx::query(GIVE_UP.sql(part.len()));
        for (partition, epoch) in part {
            query = query.bind(partition.bound()).bind(epoch);
        }
        query.execute(&mut *transaction).await?;
    }
    Ok(transaction.commit().await?)
}

/// Gives up partitions, each unless its epoch is another one.
async fn release_on(
    db: &mut AnyConnection,
    epochs: &[(PartitionId, i64)],
) -> Result<(), StoreError> {
    end_epochs(db, epochs).await?;
    let released: Vec<_> = epochs.iter().map(|(partition, _)| *partition).collect();
    unlock(db, &released).await?;
    notify(db, TRANSFERS).await
}

async fn unlock(db: &mut AnyConnection, partitions: &[PartitionId]) -> Result<(), StoreError> {
    static UNLOCK: MultiRowStatement = MultiRowStatement::new(
        "SELECT pg_advisory_unlock(CAST(held.column2 AS INT), CAST(held.column1 AS INT))
         FROM (VALUES ",
        2,
        ") AS held",
    );
    for part in in_parts(partitions) {
        let mut query = sqlx::query(UNLOCK.sql(part.len()));
        for partition in part {
            query = query.bind(partition.bound()).bind(i64::from(PARTITION_LOCKS));
        }
        query.execute(&mut *db).await?;
    }
    Ok(())
}

/// Takes the lock of a node's name.
///
/// # Errors
/// [`StoreError::NameInUse`] if a process has it that is alive; [`StoreError`].
async fn lock_name(db: &mut AnyConnection, name: &str) -> Result<(), StoreError> {
    db.execute(AssertSqlSafe(format!("SET lock_timeout = '{NAME_LOCK_TIMEOUT}'"))).await?;
    let lock = sqlx::query("SELECT pg_advisory_lock($1, hashtext($2))").bind(NAME_LOCKS).bind(name);
    match lock.execute(&mut *db).await {
        Err(error) if writer_lock::is_timeout(&error) => {
            return Err(StoreError::NameInUse { name: name.to_owned() });
        }
        locked => locked?,
    };
    db.execute("SET lock_timeout = DEFAULT").await?;
    Ok(())
}

/// A new secret of a cluster: 256 random bits.
fn secret() -> Result<String, StoreError> {
    let mut bytes = [0; 32];
    getrandom::fill(&mut bytes).map_err(|error| sqlx::Error::Io(std::io::Error::other(error)))?;
    Ok(HEXLOWER.encode(&bytes))
}

/// Tells the other nodes that something has changed, once the transaction is committed.
pub(super) async fn notify(
    db: &mut AnyConnection,
    channel: &'static str,
) -> Result<(), StoreError> {
    db.execute(AssertSqlSafe(format!("SELECT pg_notify('{channel}', '')"))).await?;
    Ok(())
}

/// Waits for statements at most this long: their answer may be lost on the way, and nobody tells.
async fn within<T>(
    longest: Duration,
    statements: impl Future<Output = Result<T, StoreError>>,
) -> Result<T, StoreError> {
    let late = |_| Err(StoreError::too_slow());
    tokio::time::timeout(longest, statements).await.unwrap_or_else(late)
}

impl Writer {
    /// Opens the database as a node of a cluster, which owns no partition yet. The first node
    /// brings the schema to this version and divides the assets into `partitions`.
    pub(crate) async fn open_node(
        location: &Location,
        node: NodeIdentity,
        partitions: Partitions,
    ) -> Result<Self, StoreError> {
        match Self::prepare(location, partitions).await {
            // Another node is there already.
            Ok(()) | Err(StoreError::InUse) => {}
            Err(error) => return Err(error),
        }
        let (mut connection, backend) = location.writer(WriterRole::Node, None).await?;
        let (found, expected) = (migrations::schema(&mut connection).await?, migrations::latest());
        if found != expected {
            return Err(StoreError::Schema { found, expected });
        }
        let found = count(&mut connection).await?;
        if found != partitions {
            let (found, expected) = (found.count(), partitions.count());
            return Err(StoreError::PartitionCount { found, expected });
        }
        let mut this = Self::connected(location, WriterRole::Node, connection, backend).await?;
        this.node = Some(node);
        let Some(mut connection) = this.connection.take() else { return Ok(this) };
        this.register(&mut connection).await?;
        this.connection = Some(connection);
        Ok(this)
    }

    /// Brings the schema to this version and divides the assets into partitions, unless
    /// another process uses the database.
    async fn prepare(location: &Location, partitions: Partitions) -> Result<(), StoreError> {
        let (connection, backend) = location.writer_if_free().await?;
        let mut this = Self::connected(location, WriterRole::Main, connection, backend).await?;
        if this.partitions == Partitions::ONE && partitions != Partitions::ONE {
            this.take(&[PartitionId(0)]).await?;
            this.fold_all().await?;
            this.divide(partitions).await?;
        }
        if let Some(connection) = &mut this.connection {
            sqlx::query(
                "INSERT INTO cluster (secret) SELECT $1 WHERE NOT EXISTS (SELECT 1 FROM cluster)",
            )
            .bind(secret()?)
            .execute(connection)
            .await?;
        }
        this.close().await
    }

    /// Divides the assets of the only partition, whose journal is empty.
    async fn divide(&mut self, partitions: Partitions) -> Result<(), StoreError> {
        static PUT: MultiRowStatement = MultiRowStatement::new(
            "UPDATE asset SET partition = moved.column2 FROM (VALUES ",
            2,
            ") AS moved WHERE name = moved.column1",
        );
        let Some(connection) = &mut self.connection else {
            return Err(sqlx::Error::PoolClosed.into());
        };
        let mut transaction = sqlx::Connection::begin(connection).await?;
        for partition in partitions.all().skip(1) {
            sqlx::query("INSERT INTO partition (id, epoch, n_commits) VALUES ($1, 0, 0)")
                .bind(partition.bound())
                .execute(&mut *transaction)
                .await?;
        }
        let names: Vec<String> =
            sqlx::query_scalar("SELECT name FROM asset").fetch_all(&mut *transaction).await?;
        for part in in_parts(&names) {
            let mut query = sqlx::query(PUT.sql(part.len()));
            for name in part {
                query = query.bind(name).bind(partitions.of(name).bound());
            }
            query.execute(&mut *transaction).await?;
        }
        transaction.commit().await?;
        self.partitions = partitions;
        Ok(())
    }

    /// Takes the name of this node, stores which connection it writes with, and forgets nodes
    /// that are gone.
    async fn register(&mut self, db: &mut AnyConnection) -> Result<(), StoreError> {
        let (Some(node), Some(backend)) = (&self.node, &self.backend) else { return Ok(()) };
        let settings = format!(
            "SET idle_session_timeout = '{IDLE_TIMEOUT}';
             SET idle_in_transaction_session_timeout = '{IDLE_IN_TRANSACTION_TIMEOUT}'"
        );
        db.execute(AssertSqlSafe(settings)).await?;
        lock_name(db, &node.name).await?;
        execute!(
            &mut *db, "INSERT INTO node (id, name, address, version, leaving, pid, started)
             VALUES ($1, $2, $3, $4, 0, $5, $6)
             ON CONFLICT (id) DO UPDATE SET pid = excluded.pid, started = excluded.started";
            &node.id, &node.name, &node.address, &node.version, i64::from(backend.pid),
            &backend.started
        )?;
        // With the process: a node that registers again meanwhile has another one, which this
        // statement does not know to be alive.
        let forget = concat!(
            "DELETE FROM node WHERE id NOT IN
             (SELECT owner FROM partition WHERE owner IS NOT NULL)
             AND (id, pid, started) IN (SELECT id, pid, started FROM node WHERE NOT ",
            is_alive!(),
            ")"
        );
        sqlx::query(forget).execute(db).await?;
        Ok(())
    }

    /// Whether this is the writer of a node of a cluster.
    #[must_use]
    pub fn is_node(&self) -> bool {
        self.role == WriterRole::Node
    }

    /// The partitions that were lost since the last call: others have taken them.
    pub fn lost(&mut self) -> Vec<PartitionId> {
        std::mem::take(&mut self.owned.lost)
    }

    /// The partitions that this writer owns, each with its epoch.
    #[must_use]
    pub fn owned(&self) -> Vec<(PartitionId, i64)> {
        self.owned.by_id.iter().map(|(partition, owned)| (*partition, owned.epoch)).collect()
    }

    pub(super) fn lose(&mut self, partitions: &[PartitionId]) {
        for partition in partitions {
            if self.owned.by_id.remove(partition).is_some() {
                self.owned.lost.push(*partition);
            }
            self.journal.forget(*partition);
        }
        self.tails.forget(partitions);
    }

    /// Takes those of `partitions` that have no owner, or that this writer owns already, and
    /// reads their journal. Returns which.
    ///
    /// # Errors
    /// [`StoreError`]; then none is taken.
    pub async fn take(
        &mut self,
        partitions: &[PartitionId],
    ) -> Result<Vec<PartitionId>, StoreError> {
        let Some(mut connection) = self.connection.take() else {
            return Err(sqlx::Error::PoolClosed.into());
        };
        let taken = within(COMMIT_TIMEOUT, self.take_on(&mut connection, partitions)).await;
        let is_usable = match &taken {
            Ok(_) => true,
            Err(error) if error.leaves_connection() && self.role == WriterRole::Node => {
                let is_foreign = |partition: &PartitionId| !self.owned.contains(*partition);
                let foreign: Vec<_> = partitions.iter().copied().filter(is_foreign).collect();
                // Only warns of locks that it has not got.
                within(COMMIT_TIMEOUT, unlock(&mut connection, &foreign)).await.is_ok()
            }
            Err(_) => false,
        };
        if is_usable {
            self.connection = Some(connection);
        }
        taken
    }

    async fn take_on(
        &mut self,
        db: &mut AnyConnection,
        partitions: &[PartitionId],
    ) -> Result<Vec<PartitionId>, StoreError> {
        let (mut ids, mut free): (Vec<_>, Vec<_>) =
            partitions.iter().partition(|partition| self.owned.contains(**partition));
        if self.role == WriterRole::Node {
            free = try_lock(db, &free).await?;
        }
        ids.extend(free);
        let taken = begin_epochs(db, &ids, self.node.as_ref()).await?;
        let before = self.journal.n_bytes();
        self.journal.load(db, &ids).await?;
        // What is taken has not grown: it is folded by and by, as one fold of it would take long.
        self.n_bytes_before += self.journal.n_bytes().saturating_sub(before);
        self.owned.by_id.extend(taken);
        if self.role == WriterRole::Node && !ids.is_empty() {
            notify(db, TRANSFERS).await?;
        }
        Ok(ids)
    }

    /// Gives partitions up, of which nothing is to be written any more.
    ///
    /// # Errors
    /// [`StoreError`]; then the server releases them when it ends the connection.
    pub async fn release(&mut self, partitions: &[PartitionId]) -> Result<(), StoreError> {
        let Some(mut connection) = self.connection.take() else {
            return Err(sqlx::Error::PoolClosed.into());
        };
        let released = partitions.iter().filter_map(|partition| {
            let owned = self.owned.by_id.remove(partition)?;
            self.journal.forget(*partition);
            Some((*partition, owned.epoch))
        });
        let released: Vec<_> = released.collect();
        self.tails.forget(partitions);
        within(COMMIT_TIMEOUT, release_on(&mut connection, &released)).await?;
        self.connection = Some(connection);
        Ok(())
    }

    /// Says that this node hands its partitions over, so that it gets none any more.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn leave(&mut self) -> Result<(), StoreError> {
        let (Some(node), Some(connection)) = (&self.node, &mut self.connection) else {
            return Ok(());
        };
        let leave = async {
            sqlx::query("UPDATE node SET leaving = 1 WHERE id = $1")
                .bind(&node.id)
                .execute(&mut *connection)
                .await?;
            notify(connection, TRANSFERS).await
        };
        within(COMMIT_TIMEOUT, leave).await
    }

    /// Reads which nodes are alive and who owns which partition. Also keeps the connection
    /// from being idle.
    ///
    /// # Errors
    /// [`StoreError`]; [`StoreError::Forgotten`] if this node is not one of them.
    pub async fn observe(&mut self) -> Result<(Vec<NodeRow>, Vec<PartitionRow>), StoreError> {
        let Some(connection) = &mut self.connection else {
            return Err(sqlx::Error::PoolClosed.into());
        };
        let nodes = sqlx::query_as(concat!(
            "SELECT id, name, address, version, leaving,
             CAST(EXTRACT(EPOCH FROM clock_timestamp()) * 1000000 AS BIGINT) AS read_at
             FROM node WHERE ",
            is_alive!(),
            " ORDER BY id"
        ));
        let partitions = sqlx::query_as("SELECT * FROM partition ORDER BY id");
        let look = async {
            let ended = sqlx::query(END_UNREAD).fetch_all(&mut *connection).await?;
            if !ended.is_empty() {
                tracing::warn!(n = ended.len(), "ended the connections of nodes that read nothing");
            }
            let nodes = nodes.fetch_all(&mut *connection).await?;
            Ok((nodes, partitions.fetch_all(&mut *connection).await?))
        };
        let (nodes, partitions): (Vec<NodeRow>, _) = within(LOOK_TIMEOUT, look).await?;
        let is_me = |node: &NodeRow| self.node.as_ref().is_none_or(|me| me.id == node.id);
        if !nodes.iter().any(is_me) {
            return Err(StoreError::Forgotten);
        }
        Ok((nodes, partitions))
    }

    /// After connecting again: which partitions are still owned. Returns whether the
    /// transaction in doubt was committed.
    ///
    /// # Errors
    /// [`StoreError::UnexpectedCommits`] if the database lacks commits, or has others than this
    /// writer's where no other may write; [`StoreError`].
    pub(super) async fn own_again(&mut self, db: &mut AnyConnection) -> Result<bool, StoreError> {
        if self.role == WriterRole::Auxiliary {
            return Ok(false);
        }
        // Before the other nodes see this one.
        self.owned.check_age(&read(db).await?, self.node.as_ref())?;
        self.register(db).await?;
        let mut locked: Vec<_> = self.owned.by_id.keys().copied().collect();
        if self.role == WriterRole::Node {
            locked = try_lock(db, &locked).await?;
        }
        let rows = read(db).await?;
        let (mut lost, mut was_committed) = (Vec::new(), false);
        for (&partition, mine) in &self.owned.by_id {
            let found = rows.get(&partition).cloned().unwrap_or_default();
            let is_mine = found.epoch == mine.epoch && locked.contains(&partition);
            if !is_mine && self.role == WriterRole::Node {
                lost.push(partition);
                continue;
            }
            let is_in_doubt =
                self.in_doubt.as_ref().is_some_and(|doubt| doubt.partitions.contains(&partition));
            match found.n_commits - mine.n_commits {
                0 if is_mine => {}
                1 if is_mine && is_in_doubt => was_committed = true,
                _ => return Err(mine.unexpected(&found)),
            }
        }
        locked.retain(|partition| lost.contains(partition));
        unlock(db, &locked).await?;
        self.lose(&lost);
        Ok(was_committed)
    }
}

impl Store {
    /// By which the nodes of the cluster know each other.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails.
    pub async fn cluster_secret(&self) -> Result<String, StoreError> {
        Ok(sqlx::query_scalar("SELECT secret FROM cluster").fetch_one(&self.pool).await?)
    }
}

impl Location {
    /// Opens a connection as the only writer of a PostgreSQL database, if there is no other.
    async fn writer_if_free(&self) -> Result<(AnyConnection, Option<Backend>), StoreError> {
        self.check_free().await?;
        self.writer(WriterRole::Main, None).await
    }

    async fn check_free(&self) -> Result<(), StoreError> {
        let mut connection = self.writer(WriterRole::Auxiliary, None).await?.0;
        let is_free = writer_lock::is_free(&mut connection).await?;
        sqlx::Connection::close(connection).await?;
        if is_free { Ok(()) } else { Err(StoreError::InUse) }
    }
}
