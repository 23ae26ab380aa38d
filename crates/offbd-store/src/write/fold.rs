//! Folding: moving samples from the journal to the chunks of their session.
//!
//! The writer folds between two commits once the journal exceeds its limit, starting with
//! the session that has been in it longest. Sessions that end, and long runs, are folded
//! by their own commit.

use std::collections::HashSet;

use super::Writer;
use super::group::{Destination, Relocation};
use crate::StoreError;

/// Smallest number of transactions in which a full journal is folded, so that each is
/// short.
const MIN_FOLDS: usize = 64;

/// Bytes folded in one transaction when the writer is closed, and no commit waits.
const CLOSING_FOLD_BYTES: usize = 1 << 20;

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
