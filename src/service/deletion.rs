//! Deleting what may be large: an asset with its sessions, a session with its
//! recording.
//!
//! The first change, made where the engine runs, is small and hides all of it. What
//! is stored then goes in pieces, each a transaction of its own, so that others commit
//! in between. A stop or a crash leaves it hidden, and the next sweep of retention,
//! the first of which begins with the service, goes on.

use std::sync::Arc;

use tokio::sync::Mutex;

use super::handles::Handles;
use super::{Service, ServiceError};
use crate::store::{Bulk, Write};

/// Chunks deleted in one transaction, some 50 kB each: on a disk with 100 µs a read
/// 20 ms.
const CHUNKS_AT_ONCE: u32 = 16;

/// Transitions deleted in one transaction, some 1 kB each.
const TRANSITIONS_AT_ONCE: u32 = 500;

/// Sessions of an asset that are looked at, and at most deleted, at once.
const SESSIONS_AT_ONCE: u32 = 64;

/// Deletes what has been given up. Cheap to clone; all clones take turns.
#[derive(Clone)]
pub(super) struct Deleter {
    handles: Handles,
    /// Whoever has it commits a piece: two deletions take no longer transactions than
    /// one.
    turn: Arc<Mutex<()>>,
}

impl Deleter {
    pub(super) fn new(handles: Handles) -> Self {
        Self { handles, turn: Arc::default() }
    }

    /// Deletes all that has been given up. What the store does not take is logged, and
    /// stays for the next time.
    ///
    /// # Errors
    /// [`ServiceError::Store`] if the store cannot be read.
    pub(super) async fn all(&self) -> Result<(), ServiceError> {
        for asset in self.handles.store.deleted_assets().await? {
            if let Err(error) = self.asset(&asset).await {
                tracing::warn!(asset, %error, "a deletion has to wait");
            }
        }
        for session in self.handles.store.expired_sessions().await? {
            let id = session.id.clone();
            if let Err(error) = self.delete(vec![session]).await {
                tracing::warn!(session = id, %error, "a deletion has to wait");
            }
        }
        Ok(())
    }

    /// Deletes the asset `name`, which has been given up.
    ///
    /// # Errors
    /// [`ServiceError`] if the store cannot be read or does not take a piece.
    pub(super) async fn asset(&self, name: &str) -> Result<(), ServiceError> {
        loop {
            let sessions = self.handles.store.sessions_in_bulk(name, SESSIONS_AT_ONCE).await?;
            if sessions.is_empty() {
                break;
            }
            self.delete(sessions).await?;
        }
        self.piece(vec![Write::DeleteAsset { name: name.to_owned() }]).await
    }

    /// Deletes the session `id`, which has been given up.
    ///
    /// # Errors
    /// As for [`Deleter::asset`].
    pub(super) async fn session(&self, id: &str) -> Result<(), ServiceError> {
        self.delete(self.handles.store.session_in_bulk(id).await?.into_iter().collect()).await
    }

    async fn delete(&self, sessions: Vec<Bulk>) -> Result<(), ServiceError> {
        for piece in pieces(sessions) {
            self.piece(piece).await?;
        }
        Ok(())
    }

    async fn piece(&self, writes: Vec<Write>) -> Result<(), ServiceError> {
        let _turn = self.turn.lock().await;
        self.handles.write_all(writes).await
    }
}

/// The transactions that delete `sessions`: the parts of a large one, several small
/// ones together.
fn pieces(sessions: Vec<Bulk>) -> Vec<Vec<Write>> {
    let mut pieces = Vec::new();
    let (mut together, mut n_chunks) = (Vec::new(), 0);
    for Bulk { id: session, n_chunks: chunks, n_transitions } in sessions {
        let n_parts = |n: u64, limit: u32| n.saturating_sub(1) / u64::from(limit);
        let n_drops = n_parts(chunks, CHUNKS_AT_ONCE);
        for _ in 0..n_drops {
            let session = session.clone();
            pieces.push(vec![Write::DropChunks { session, limit: CHUNKS_AT_ONCE }]);
        }
        for _ in 0..n_parts(n_transitions, TRANSITIONS_AT_ONCE) {
            let session = session.clone();
            pieces.push(vec![Write::DropTransitions { session, limit: TRANSITIONS_AT_ONCE }]);
        }
        // What is left goes with the session.
        let rest = chunks - n_drops * u64::from(CHUNKS_AT_ONCE);
        if n_chunks + rest > u64::from(CHUNKS_AT_ONCE) {
            pieces.push(std::mem::take(&mut together));
            n_chunks = 0;
        }
        n_chunks += rest;
        together.push(Write::DeleteSession { session });
    }
    if !together.is_empty() {
        pieces.push(together);
    }
    pieces
}

impl Service {
    /// Does `deletion` to its end, also if the caller goes away. What a stop interrupts
    /// goes on with the next start.
    pub(super) async fn to_the_end(
        &self,
        deletion: impl Future<Output = Result<(), ServiceError>> + Send + 'static,
    ) -> Result<(), ServiceError> {
        let closing = self.inner.handles.closing.clone();
        let task = tokio::spawn(async move {
            tokio::select! {
                () = closing.cancelled() => {
                    Err(ServiceError::Unavailable { what: "the service is closing" })
                }
                done = deletion => done,
            }
        });
        task.await.unwrap_or(Err(ServiceError::Unavailable { what: "the deletion has failed" }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How many chunks, transitions and sessions each piece deletes of sessions with so
    /// many chunks and transitions.
    fn shapes(sessions: &[(u64, u64)]) -> Vec<(u64, u64, usize)> {
        let bulk = |(i, &(n_chunks, n_transitions)): (usize, &(u64, u64))| Bulk {
            id: i.to_string(),
            n_chunks,
            n_transitions,
        };
        let all: Vec<_> = sessions.iter().enumerate().map(bulk).collect();
        let mut left = all.clone();
        let mut shapes = Vec::new();
        for piece in pieces(all) {
            let (mut chunks, mut transitions, mut gone) = (0, 0, 0);
            for write in piece {
                let mut take = |session: &str, limit: (u64, u64)| {
                    let bulk = &mut left[session.parse::<usize>().unwrap()];
                    let n = (bulk.n_chunks.min(limit.0), bulk.n_transitions.min(limit.1));
                    bulk.n_chunks -= n.0;
                    bulk.n_transitions -= n.1;
                    chunks += n.0;
                    transitions += n.1;
                };
                match write {
                    Write::DropChunks { session, limit } => take(&session, (limit.into(), 0)),
                    Write::DropTransitions { session, limit } => take(&session, (0, limit.into())),
                    Write::DeleteSession { session } => {
                        take(&session, (u64::MAX, u64::MAX));
                        gone += 1;
                    }
                    other => panic!("{other:?}"),
                }
            }
            shapes.push((chunks, transitions, gone));
        }
        assert!(left.iter().all(|bulk| bulk.n_chunks + bulk.n_transitions == 0));
        shapes
    }

    #[test]
    fn a_large_session_goes_in_parts() {
        assert_eq!(shapes(&[(40, 3)]), [(16, 0, 0), (16, 0, 0), (8, 3, 1)]);
        assert_eq!(shapes(&[(16, 1200)]), [(0, 500, 0), (0, 500, 0), (16, 200, 1)]);
    }

    #[test]
    fn small_sessions_go_together() {
        assert_eq!(shapes(&[]), []);
        assert_eq!(shapes(&[(1, 0), (0, 9), (15, 0), (1, 1)]), [(16, 9, 3), (1, 1, 1)]);
        assert_eq!(shapes(&[(16, 0), (0, 0), (17, 0)]), [(16, 0, 0), (16, 0, 2), (1, 0, 1)]);
    }
}
