//! Deletion of large data: an asset with its sessions, a session with its recording.
//!
//! First a small change, made by the shard, hides the data. Then they are deleted in
//! parts, each in its own transaction, so that other changes are committed in between. After
//! a stop or a crash the data remain hidden, and the next sweep of retention, the first of
//! which runs at the start of the service, continues the deletion.

use std::sync::Arc;

use tokio::sync::Mutex;

use crate::ServiceError;
use crate::writing::Handles;
use offbd_store::{SessionSize, Write};

/// Chunks deleted in one transaction, some 50 kB each: 20 ms on a disk with 100 µs per
/// read.
const CHUNKS_AT_ONCE: u32 = 16;

/// Transitions deleted in one transaction, some 1 kB each.
const TRANSITIONS_AT_ONCE: u32 = 500;

/// Sessions of an asset that are read per query and deleted at most in one transaction.
const SESSIONS_AT_ONCE: u32 = 64;

/// Deletes hidden data. Cheap to clone; all clones share one lock.
#[derive(Clone)]
pub(crate) struct Deleter {
    handles: Handles,
    /// Held while a part is deleted, so that two parts never share a group commit.
    lock: Arc<Mutex<()>>,
}

impl Deleter {
    pub(crate) fn new(handles: Handles) -> Self {
        Self { handles, lock: Arc::default() }
    }

    /// Deletes all hidden data. A deletion that the store does not accept is logged and
    /// left for the next sweep.
    ///
    /// # Errors
    /// [`ServiceError::Store`] if the store cannot be read.
    pub(crate) async fn all(&self) -> Result<(), ServiceError> {
        let owned = self.handles.ownership.filter();
        for asset in self.handles.store.hidden_assets(owned.as_deref()).await? {
            if let Err(error) = self.asset(&asset).await {
                tracing::warn!(asset, %error, "the deletion failed and is retried later");
            }
        }
        for session in self.handles.store.hidden_sessions(owned.as_deref()).await? {
            let (id, asset) = (session.id.clone(), session.asset.clone());
            if let Err(error) = self.delete(&asset, vec![session]).await {
                tracing::warn!(session = id, %error, "the deletion failed and is retried later");
            }
        }
        Ok(())
    }

    /// Deletes the hidden asset `name`.
    ///
    /// # Errors
    /// [`ServiceError`] if the store cannot be read or does not accept a part.
    pub(crate) async fn asset(&self, name: &str) -> Result<(), ServiceError> {
        loop {
            let sessions = self.handles.store.session_sizes(name, SESSIONS_AT_ONCE).await?;
            if sessions.is_empty() {
                break;
            }
            self.delete(name, sessions).await?;
        }
        self.commit_part(name, vec![Write::DeleteAsset { name: name.to_owned() }]).await
    }

    /// Deletes the hidden session `id`.
    ///
    /// # Errors
    /// As for [`Deleter::asset`].
    pub(crate) async fn session(&self, id: &str) -> Result<(), ServiceError> {
        match self.handles.store.session_size(id).await? {
            Some(session) => self.delete(&session.asset.clone(), vec![session]).await,
            None => Ok(()),
        }
    }

    /// Runs `deletion` to completion even if the caller is dropped. A deletion that a
    /// shutdown interrupts continues with the next start.
    pub(crate) async fn run_to_completion(
        &self,
        deletion: impl Future<Output = Result<(), ServiceError>> + Send + 'static,
    ) -> Result<(), ServiceError> {
        let closing = self.handles.closing.clone();
        let task = tokio::spawn(async move {
            tokio::select! {
                () = closing.cancelled() => {
                    Err(ServiceError::Unavailable { what: "the service is shutting down" })
                }
                done = deletion => done,
            }
        });
        task.await.unwrap_or(Err(ServiceError::Unavailable { what: "the deletion failed" }))
    }

    /// Deletes hidden `sessions` of `asset`.
    async fn delete(&self, asset: &str, sessions: Vec<SessionSize>) -> Result<(), ServiceError> {
        for part in parts(sessions) {
            self.commit_part(asset, part).await?;
        }
        Ok(())
    }

    async fn commit_part(&self, asset: &str, writes: Vec<Write>) -> Result<(), ServiceError> {
        let _guard = self.lock.lock().await;
        self.handles.write(asset, writes).await
    }
}

/// Returns the transactions that delete `sessions`: several for a large session, one for
/// several small ones.
fn parts(sessions: Vec<SessionSize>) -> Vec<Vec<Write>> {
    let mut parts = Vec::new();
    let (mut together, mut n_chunks) = (Vec::new(), 0);
    for SessionSize { id: session, n_chunks: chunks, n_transitions, .. } in sessions {
        let n_parts = |n: u64, limit: u32| n.saturating_sub(1) / u64::from(limit);
        let n_chunk_parts = n_parts(chunks, CHUNKS_AT_ONCE);
        for _ in 0..n_chunk_parts {
            let session = session.clone();
            parts.push(vec![Write::DropChunks { session, limit: CHUNKS_AT_ONCE }]);
        }
        for _ in 0..n_parts(n_transitions, TRANSITIONS_AT_ONCE) {
            let session = session.clone();
            parts.push(vec![Write::DropTransitions { session, limit: TRANSITIONS_AT_ONCE }]);
        }
        // The rest is deleted together with the session.
        let rest = chunks - n_chunk_parts * u64::from(CHUNKS_AT_ONCE);
        if n_chunks + rest > u64::from(CHUNKS_AT_ONCE) {
            parts.push(std::mem::take(&mut together));
            n_chunks = 0;
        }
        n_chunks += rest;
        together.push(Write::DeleteSession { session });
    }
    if !together.is_empty() {
        parts.push(together);
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the chunks, transitions and sessions that each part deletes. The input has
    /// the chunks and transitions of each session.
    fn shapes(sessions: &[(u64, u64)]) -> Vec<(u64, u64, usize)> {
        let bulk = |(i, &(n_chunks, n_transitions)): (usize, &(u64, u64))| SessionSize {
            id: i.to_string(),
            asset: "a".to_owned(),
            n_chunks,
            n_transitions,
        };
        let all: Vec<_> = sessions.iter().enumerate().map(bulk).collect();
        let mut left = all.clone();
        let mut shapes = Vec::new();
        for part in parts(all) {
            let (mut chunks, mut transitions, mut n_sessions) = (0, 0, 0);
            for write in part {
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
                        n_sessions += 1;
                    }
                    other => panic!("{other:?}"),
                }
            }
            shapes.push((chunks, transitions, n_sessions));
        }
        assert!(left.iter().all(|bulk| bulk.n_chunks + bulk.n_transitions == 0));
        shapes
    }

    #[test]
    fn a_large_session_is_deleted_in_parts() {
        assert_eq!(shapes(&[(40, 3)]), [(16, 0, 0), (16, 0, 0), (8, 3, 1)]);
        assert_eq!(shapes(&[(16, 1200)]), [(0, 500, 0), (0, 500, 0), (16, 200, 1)]);
    }

    #[test]
    fn small_sessions_are_deleted_together() {
        assert_eq!(shapes(&[]), []);
        assert_eq!(shapes(&[(1, 0), (0, 9), (15, 0), (1, 1)]), [(16, 9, 3), (1, 1, 1)]);
        assert_eq!(shapes(&[(16, 0), (0, 0), (17, 0)]), [(16, 0, 0), (16, 0, 2), (1, 0, 1)]);
    }
}
