//! Folding: moving samples from the journal to the chunks of their session.
//!
//! The writer folds between two commits once the journal exceeds its limit, starting with
//! the session that has been in it longest. Sessions that end, and long runs, are folded
//! by their own commit.

use std::collections::{BTreeSet, HashSet};

use sqlx::AnyConnection;

use super::{GroupCommit, Writer, put_progress};
use crate::journal::Journal;
use crate::tail::Run;
use crate::{PartitionId, StoreError};

/// Smallest number of transactions in which a full journal is folded, so that each is
/// short.
const MIN_FOLDS: usize = 64;

/// Bytes folded in one transaction when the writer is closed, and no commit waits.
const CLOSING_FOLD_BYTES: usize = 1 << 20;

/// Where a [`Relocation`] moves samples.
#[derive(Clone, Copy, Debug)]
enum Destination {
    /// To the chunks of their session.
    Chunks,
    /// To a new row at the end of the journal, so that its older rows can be removed.
    JournalEnd,
}

/// Moves all samples of `sessions` that are in the journal.
#[derive(Debug)]
pub(super) struct Relocation {
    sessions: Vec<String>,
    to: Destination,
}

impl Relocation {
    /// The partitions whose rows of the journal it changes: those of its sessions, and those
    /// whose rows are not needed any more.
    pub(super) fn partitions(&self, journal: &Journal) -> BTreeSet<PartitionId> {
        let of_sessions = self.sessions.iter().filter_map(|id| journal.partition_of(id));
        of_sessions.chain(journal.idle_partitions()).collect()
    }
}

impl Writer {
    /// Folds the oldest sessions of the journal if it has more than `above` bytes. Each
    /// call folds a small part, because commits wait for it. Above 3/2 of `above` this
    /// part is four times what was added since the last call, so that the journal stays
    /// below 15/8 of `above` plus 5/4 of the size of one group.
    ///
    /// A session whose chunks the database refuses stays in the journal, and accepts no
    /// further samples until the database accepts its chunks.
    ///
    /// # Errors
    /// As for [`Writer::commit`].
    pub async fn fold(&mut self, above: usize) -> Result<(), StoreError> {
        let n_bytes = self.journal.n_bytes();
        let grown = n_bytes.saturating_sub(self.n_bytes_before);
        if n_bytes > above {
            let urgent = if n_bytes > above + above / 2 { 4 * grown } else { 1 };
            let sessions = self.journal.oldest(urgent.max(above / MIN_FOLDS), &HashSet::new());
            self.fold_these(sessions).await?;
        }
        self.n_bytes_before = self.journal.n_bytes();
        Ok(())
    }

    pub(super) async fn fold_all(&mut self) -> Result<(), StoreError> {
        while self.journal.n_bytes() > 0 {
            let sessions = self.journal.oldest(CLOSING_FOLD_BYTES, &self.refused);
            let is_last = sessions.is_empty();
            self.fold_these(sessions).await?;
            if is_last {
                break;
            }
        }
        Ok(())
    }

    async fn fold_these(&mut self, sessions: Vec<String>) -> Result<(), StoreError> {
        let relocation = Relocation { sessions, to: Destination::Chunks };
        match self.transact(&mut [], Some(&relocation)).await {
            Err(error) if !error.is_outage() => self.fold_each(relocation.sessions).await,
            result => result,
        }
    }

    /// Folds each of `sessions` in its own transaction. Those that the database refuses
    /// are moved to the end of the journal.
    async fn fold_each(&mut self, sessions: Vec<String>) -> Result<(), StoreError> {
        for session in sessions {
            let mut relocation =
                Relocation { sessions: vec![session.clone()], to: Destination::Chunks };
            let Err(error) = self.transact(&mut [], Some(&relocation)).await else { continue };
            if error.is_outage() {
                return Err(error);
            }
            tracing::error!(
                session,
                %error,
                "cannot fold a session; it accepts no further samples until this succeeds"
            );
            relocation.to = Destination::JournalEnd;
            self.transact(&mut [], Some(&relocation)).await?;
            self.refused.insert(session);
        }
        Ok(())
    }
}

impl GroupCommit<'_> {
    /// Takes the samples of `session` in the journal and in this group, as one run.
    fn take_run(&mut self, session: &str) -> Result<Option<Run>, StoreError> {
        let in_journal = self.journal.run(session)?;
        let at = self.pending.iter().position(|run| run.session == session);
        let new = at.map(|at| self.pending.swap_remove(at));
        Ok(match (in_journal, new) {
            (Some(in_journal), Some(new)) => Some(in_journal.followed_by(new)),
            (in_journal, new) => in_journal.or(new),
        })
    }

    /// Drops the samples of `session`, which is deleted.
    pub(super) fn discard(&mut self, session: &str) {
        self.pending.retain(|run| run.session != session);
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
        let folded: Vec<_> =
            self.pending.iter().filter(|run| at_once(run)).map(|run| run.session.clone()).collect();
        self.fold(db, &folded).await?;
        self.append(db).await
    }

    async fn append(&mut self, db: &mut AnyConnection) -> Result<(), StoreError> {
        let runs = std::mem::take(&mut self.pending);
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
                    self.pending.extend(run);
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
