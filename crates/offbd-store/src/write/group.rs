//! A group of changes while its transaction is open.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use sqlx::AnyConnection;

use super::owned::OwnedPartitions;
use crate::journal::{Journal, JournalChanges};
use crate::multi_row::{MultiRowStatement, in_parts};
use crate::tail::{Run, Tails};
use crate::{PartitionId, SessionProgress, StoreError};
use offbd_core::vocabulary::Sample;

/// The ids of the events of a transaction. They are taken from the database all at once and
/// as late as possible, because other writers of the database wait for the next ones until
/// this transaction has ended. So ids have the order of the commits, and
/// no gaps but where an event turns out to be none.
#[derive(Debug)]
pub(super) struct EventIds {
    n_events: usize,
    next: Option<i64>,
}

impl EventIds {
    pub(super) const fn new(n_events: usize) -> Self {
        Self { n_events, next: None }
    }

    pub(super) async fn next(&mut self, db: &mut AnyConnection) -> Result<i64, StoreError> {
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
pub(super) struct GroupCommit<'a> {
    pub(super) owned: &'a OwnedPartitions,
    pub(super) events: EventIds,
    pub(super) tails: &'a mut Tails,
    pub(super) journal: &'a Journal,
    pub(super) refused: &'a HashSet<String>,
    pub(super) changes: JournalChanges,
    /// New samples, one run per session, by its id. They are written at the end of the group, so
    /// that consecutive batches of a session become one run.
    pub(super) pending: BTreeMap<String, Run>,
}

impl GroupCommit<'_> {
    /// The id of the journal row of this transaction for `partition`.
    fn journal_row(&self, partition: PartitionId) -> i64 {
        partition.journal_row(self.owned.n_commits(partition) + 1)
    }

    /// Adds samples to the run of their session.
    pub(super) fn defer(
        &mut self,
        partition: PartitionId,
        session: &str,
        first_index: i64,
        samples: &[Sample],
        progress: SessionProgress,
    ) {
        if let Some(pending) = self.pending.get_mut(session) {
            pending.samples.extend_from_slice(samples);
            pending.progress = progress;
            return;
        }
        let (session, samples) = (session.to_owned(), samples.to_vec());
        let run = Run { partition, session: session.clone(), first_index, samples, progress };
        self.pending.insert(session, run);
    }
}

/// Where a [`Relocation`] moves samples.
#[derive(Clone, Copy, Debug)]
pub(super) enum Destination {
    /// To the chunks of their session.
    Chunks,
    /// To a new row at the end of the journal, so that its older rows can be removed.
    JournalEnd,
}

/// Moves all samples of `sessions` that are in the journal.
#[derive(Debug)]
pub(super) struct Relocation {
    pub(super) sessions: Vec<String>,
    pub(super) to: Destination,
}

impl Relocation {
    /// The partitions whose rows of the journal it changes: those of its sessions, and those
    /// whose rows are not needed any more.
    pub(super) fn partitions(&self, journal: &Journal) -> BTreeSet<PartitionId> {
        let of_sessions = self.sessions.iter().filter_map(|id| journal.partition_of(id));
        of_sessions.chain(journal.idle_partitions()).collect()
    }
}

impl GroupCommit<'_> {
    /// Takes the samples of `session` in the journal and in this group, as one run.
    fn take_run(&mut self, session: &str) -> Result<Option<Run>, StoreError> {
        let in_journal = self.journal.run(session)?;
        let new = self.pending.remove(session);
        Ok(match (in_journal, new) {
            (Some(in_journal), Some(new)) => Some(in_journal.followed_by(new)),
            (in_journal, new) => in_journal.or(new),
        })
    }

    /// Drops the samples of `session`, which is deleted.
    pub(super) fn discard(&mut self, session: &str) {
        self.pending.remove(session);
        self.tails.remove(session);
        self.changes.removed_sessions.insert(session.to_owned());
    }

    /// Folds `session`, which ends, and merges its tail.
    pub(super) async fn fold_ended(
        &mut self,
        db: &mut AnyConnection,
        partition: PartitionId,
        session: &str,
    ) -> Result<(), StoreError> {
        let run = self.take_run(session)?;
        put_progress(db, run.as_slice()).await?;
        let run = run.unwrap_or_else(|| Run::empty(partition, session));
        self.tails.finish(db, &run).await?;
        self.changes.removed_sessions.insert(run.session);
        Ok(())
    }

    /// Writes the group's samples: folds long runs and sessions that were refused before,
    /// and appends all others to the journal.
    pub(super) async fn flush(&mut self, db: &mut AnyConnection) -> Result<(), StoreError> {
        let at_once = |run: &Run| self.refused.contains(&run.session) || self.journal.is_large(run);
        let folded = self.pending.values().filter(|run| at_once(run));
        let folded: Vec<_> = folded.map(|run| run.session.clone()).collect();
        self.fold(db, &folded).await?;
        self.append(db).await
    }

    async fn append(&mut self, db: &mut AnyConnection) -> Result<(), StoreError> {
        let runs = std::mem::take(&mut self.pending).into_values().collect();
        let mut changes = std::mem::take(&mut self.changes);
        let appended = Journal::append(db, runs, |p| self.journal_row(p), &mut changes).await;
        self.changes = changes;
        appended
    }

    async fn fold(
        &mut self,
        db: &mut AnyConnection,
        sessions: &[String],
    ) -> Result<(), StoreError> {
        let mut runs = Vec::with_capacity(sessions.len());
        for session in sessions {
            runs.extend(self.take_run(session)?);
        }
        put_progress(db, &runs).await?;
        self.tails.append(db, &runs).await?;
        self.changes.removed_sessions.extend(runs.into_iter().map(|run| run.session));
        Ok(())
    }

    /// Carries out `relocation`, and removes rows of the journal that are no longer
    /// needed. The group has no other changes.
    pub(super) async fn relocate(
        &mut self,
        db: &mut AnyConnection,
        relocation: &Relocation,
    ) -> Result<(), StoreError> {
        let partitions = relocation.partitions(self.journal);
        match relocation.to {
            Destination::Chunks => self.fold(db, &relocation.sessions).await?,
            Destination::JournalEnd => {
                for session in &relocation.sessions {
                    let run = self.take_run(session)?;
                    self.pending.extend(run.map(|run| (run.session.clone(), run)));
                    self.changes.removed_sessions.insert(session.clone());
                }
                self.append(db).await?;
            }
        }
        for partition in partitions {
            let next = self.journal_row(partition);
            self.journal.trim(db, partition, next, &mut self.changes).await?;
        }
        Ok(())
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
