//! Out of the journal: into the chunks of a session, or to the journal's end.

use std::collections::HashSet;

use sqlx::AnyConnection;

use super::{Group, Writer, put_progress};
use crate::store::StoreError;
use crate::store::journal::Journal;
use crate::store::tail::Run;

/// Transactions at least in which a full journal is folded, so that nobody waits
/// long for one.
const FOLDS: usize = 64;

/// Bytes folded in one transaction while nobody waits.
const FOLD_BYTES: usize = 1 << 20;

/// Where sessions go that are in the journal.
#[derive(Clone, Copy, Debug)]
enum Way {
    /// Into their chunks.
    Fold,
    /// To the journal's end.
    Carry,
}

/// What a transaction does beside its sets.
#[derive(Debug)]
pub(super) struct Moves {
    sessions: Vec<String>,
    way: Way,
}

impl Writer {
    /// Folds what has been in the journal longest, if the journal has more than
    /// `above` bytes: a little at a time, for whoever comes meanwhile waits. From half
    /// as much again on it is four times what has come since the last call, so that
    /// the journal stays below 15/8 of `above` and 5/4 of what one group brings.
    ///
    /// A session whose chunks the database refuses stays in the journal. It takes
    /// no more samples until the database takes those.
    ///
    /// # Errors
    /// As for [`Writer::commit`].
    pub async fn fold(&mut self, above: usize) -> Result<(), StoreError> {
        let n_bytes = self.journal.n_bytes();
        let grown = n_bytes.saturating_sub(self.n_bytes_before);
        if n_bytes > above {
            let pressed = if n_bytes > above + above / 2 { 4 * grown } else { 1 };
            let sessions = self.journal.oldest(pressed.max(above / FOLDS), &HashSet::new());
            self.fold_these(sessions).await?;
        }
        self.n_bytes_before = self.journal.n_bytes();
        Ok(())
    }

    pub(super) async fn fold_all(&mut self) -> Result<(), StoreError> {
        while self.journal.n_bytes() > 0 {
            let sessions = self.journal.oldest(FOLD_BYTES, &self.refused);
            let is_last = sessions.is_empty();
            self.fold_these(sessions).await?;
            if is_last {
                break;
            }
        }
        Ok(())
    }

    async fn fold_these(&mut self, sessions: Vec<String>) -> Result<(), StoreError> {
        let moves = Moves { sessions, way: Way::Fold };
        match self.transact(&mut [], Some(&moves)).await {
            Err(error) if !error.is_outage() => self.fold_each(moves.sessions).await,
            result => result,
        }
    }

    /// Folds each of `sessions` on its own, those that can be.
    async fn fold_each(&mut self, sessions: Vec<String>) -> Result<(), StoreError> {
        for session in sessions {
            let mut moves = Moves { sessions: vec![session.clone()], way: Way::Fold };
            let Err(error) = self.transact(&mut [], Some(&moves)).await else { continue };
            if error.is_outage() {
                return Err(error);
            }
            tracing::error!(session, %error, "a recording cannot be stored; it takes no more");
            moves.way = Way::Carry;
            self.transact(&mut [], Some(&moves)).await?;
            self.refused.insert(session);
        }
        Ok(())
    }
}

impl Group<'_> {
    /// The samples of `session` that wait, behind those in the journal.
    fn take(&mut self, session: &str) -> Result<Option<Run>, StoreError> {
        let held = self.journal.run(session)?;
        let at = self.pending.iter().position(|run| run.session == session);
        let new = at.map(|at| self.pending.swap_remove(at));
        Ok(match (held, new) {
            (Some(held), Some(new)) => Some(held.followed_by(new)),
            (held, new) => held.or(new),
        })
    }

    /// `session` is deleted: nothing of it is left to be folded.
    pub(super) fn forget(&mut self, session: &str) {
        self.pending.retain(|run| run.session != session);
        self.tails.remove(session);
        self.changes.gone.insert(session.to_owned());
    }

    /// Folds all of `session`, which ends.
    pub(super) async fn finish(
        &mut self,
        db: &mut AnyConnection,
        session: &str,
    ) -> Result<(), StoreError> {
        let run = self.take(session)?;
        put_progress(db, run.as_slice()).await?;
        let run = run.unwrap_or_else(|| Run::nothing(session));
        self.tails.finish(db, &run).await?;
        self.changes.gone.insert(run.session);
        Ok(())
    }

    /// Folds what must be, appends the rest to the journal.
    pub(super) async fn flush(&mut self, db: &mut AnyConnection) -> Result<(), StoreError> {
        let at_once = |run: &Run| self.refused.contains(&run.session) || self.journal.is_large(run);
        let folded: Vec<_> =
            self.pending.iter().filter(|run| at_once(run)).map(|run| run.session.clone()).collect();
        self.fold(db, &folded).await?;
        self.append(db).await
    }

    async fn append(&mut self, db: &mut AnyConnection) -> Result<(), StoreError> {
        let runs = std::mem::take(&mut self.pending);
        Journal::append(db, self.number, runs, &mut self.changes).await
    }

    async fn fold(
        &mut self,
        db: &mut AnyConnection,
        sessions: &[String],
    ) -> Result<(), StoreError> {
        let mut runs = Vec::with_capacity(sessions.len());
        for session in sessions {
            runs.extend(self.take(session)?);
        }
        put_progress(db, &runs).await?;
        self.tails.append(db, &runs).await?;
        self.changes.gone.extend(runs.into_iter().map(|run| run.session));
        Ok(())
    }

    /// Moves all that the journal has of some sessions; nothing else waits.
    pub(super) async fn relocate(
        &mut self,
        db: &mut AnyConnection,
        moves: &Moves,
    ) -> Result<(), StoreError> {
        match moves.way {
            Way::Fold => self.fold(db, &moves.sessions).await?,
            Way::Carry => {
                for session in &moves.sessions {
                    let run = self.take(session)?;
                    self.pending.extend(run);
                    self.changes.gone.insert(session.clone());
                }
                self.append(db).await?;
            }
        }
        self.journal.trim(db, self.number, &mut self.changes).await
    }
}
