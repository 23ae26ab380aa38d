//! The partitions that a writer owns, and the fence around its transactions.

use std::collections::{BTreeMap, BTreeSet};

use sqlx::AnyConnection;

use crate::multi_row::{MultiRowStatement, in_parts};
use crate::partition::PartitionRow;
use crate::{NodeIdentity, PartitionId, StoreError};

/// What a writer knows of a partition that it owns.
#[derive(Clone, Copy, Debug)]
pub(super) struct OwnedPartition {
    pub epoch: i64,
    /// Transactions that the database has committed and counted.
    pub n_commits: i64,
}

impl OwnedPartition {
    pub(super) const fn unexpected(self, found: &PartitionRow) -> StoreError {
        StoreError::UnexpectedCommits { expected: self.n_commits, found: found.n_commits }
    }

    /// Checks that the database has what this writer, the node `me`, has seen committed.
    /// Another owner increments the epoch and goes on with the count, so lower numbers, or this
    /// epoch with another owner, are those of an older copy.
    pub(super) fn check_age(
        self,
        found: &PartitionRow,
        me: Option<&NodeIdentity>,
    ) -> Result<(), StoreError> {
        let is_other = || found.owner.as_ref() != me.map(|node| &node.id);
        let is_older = found.epoch < self.epoch
            || found.n_commits < self.n_commits
            || found.epoch == self.epoch && is_other();
        if is_older { Err(self.unexpected(found)) } else { Ok(()) }
    }
}

/// The partitions that a writer may change.
#[derive(Debug, Default)]
pub(super) struct OwnedPartitions {
    pub by_id: BTreeMap<PartitionId, OwnedPartition>,
    /// Those that were lost and not asked for yet.
    pub lost: Vec<PartitionId>,
}

impl OwnedPartitions {
    pub(super) fn contains(&self, partition: PartitionId) -> bool {
        self.by_id.contains_key(&partition)
    }

    pub(super) fn first(&self) -> Option<PartitionId> {
        self.by_id.keys().next().copied()
    }

    pub(super) fn n_commits(&self, partition: PartitionId) -> i64 {
        self.by_id.get(&partition).map_or(0, |owned| owned.n_commits)
    }

    /// Counts a committed transaction in each of `partitions`.
    pub(super) fn count_commit(&mut self, partitions: &BTreeSet<PartitionId>) {
        for partition in partitions {
            if let Some(owned) = self.by_id.get_mut(partition) {
                owned.n_commits += 1;
            }
        }
    }

    /// Checks that the database is not an older copy of the one that the node `me` has seen.
    ///
    /// # Errors
    /// [`StoreError::UnexpectedCommits`] if it is.
    pub(super) fn check_age(
        &self,
        rows: &BTreeMap<PartitionId, PartitionRow>,
        me: Option<&NodeIdentity>,
    ) -> Result<(), StoreError> {
        let missing = PartitionRow::default();
        let found = |partition| rows.get(partition).unwrap_or(&missing);
        self.by_id.iter().try_for_each(|(partition, mine)| mine.check_age(found(partition), me))
    }

    /// Counts the transaction `db` in each of `partitions`, for the node `me` or a writer that
    /// works alone. The last statement before its commit.
    ///
    /// # Errors
    /// [`StoreError::Overtaken`] if another node has taken a partition, which does not happen to
    /// a writer that works alone;
    /// [`StoreError::UnexpectedCommits`] if there are other transactions than this writer's, or
    /// fewer.
    pub(super) async fn fence(
        &self,
        db: &mut AnyConnection,
        partitions: &BTreeSet<PartitionId>,
        me: Option<&NodeIdentity>,
    ) -> Result<(), StoreError> {
        static COUNT: MultiRowStatement = MultiRowStatement::new(
            "UPDATE partition SET n_commits = n_commits + 1 FROM (VALUES ",
            3,
            ") AS mine WHERE id = mine.column1 AND epoch = mine.column2
             AND n_commits = mine.column3",
        );
        let counted: Vec<_> =
            partitions.iter().filter_map(|p| self.by_id.get(p).map(|owned| (*p, *owned))).collect();
        let mut n_counted = 0;
        for part in in_parts(&counted) {
            let mut query = sqlx::query(COUNT.sql(part.len()));
            for (partition, OwnedPartition { epoch, n_commits }) in part {
                query = query.bind(partition.bound()).bind(epoch).bind(n_commits);
            }
            n_counted += query.execute(&mut *db).await?.rows_affected();
        }
        if n_counted == partitions.len() as u64 {
            return Ok(());
        }
        let rows = read(db).await?;
        let (mut overtaken, mut unexpected) = (Vec::new(), None);
        for (partition, mine) in counted {
            let found = rows.get(&partition).cloned().unwrap_or_default();
            mine.check_age(&found, me)?;
            if found.epoch != mine.epoch && me.is_some() {
                overtaken.push(partition);
            } else if found.epoch != mine.epoch || found.n_commits - mine.n_commits > 1 {
                return Err(mine.unexpected(&found));
            } else {
                // Either this transaction has just counted itself here, or there was another one.
                unexpected = Some(mine.unexpected(&found));
            }
        }
        match unexpected {
            Some(unexpected) if overtaken.is_empty() => Err(unexpected),
            _ => Err(StoreError::Overtaken { partitions: overtaken }),
        }
    }
}

pub(super) async fn read(
    db: &mut AnyConnection,
) -> Result<BTreeMap<PartitionId, PartitionRow>, StoreError> {
    let rows: Vec<PartitionRow> =
        sqlx::query_as("SELECT * FROM partition ORDER BY id").fetch_all(db).await?;
    Ok(rows.into_iter().map(|row| (row.partition(), row)).collect())
}
