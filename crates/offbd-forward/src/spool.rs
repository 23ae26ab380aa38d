//! The spool: batches that wait, in a file.

use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use serde::Serialize;
use tokio::sync::Notify;
use tokio::task::spawn_blocking;

use super::batch::{NewBatch, SpoolError};
use super::log::{self, BLOCK, Log};
use super::reserve::{RESERVE_BYTES, Reserve};

/// Default of the most bytes of batches that a spool holds; further ones are refused with 429.
/// Chosen: ten hours of one rig at 100 Hz as JSON.
pub const MAX_SPOOL_BYTES: u64 = 512 << 20;

/// A batch that waits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct WaitingBatch {
    pub id: i64,
    pub batch: NewBatch,
}

/// How much waits.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SpoolStatus {
    /// Batches that wait for the service.
    pub waiting_batches: u64,
    /// Bytes of the spool in use, with what is set aside.
    pub used_bytes: u64,
    pub limit_bytes: u64,
    /// Bytes on the disk that are kept for what is set aside; 0 on a full disk, and then no batch
    /// is taken.
    pub reserve_bytes: u64,
    /// What is set aside, at most 100 batches, the oldest first.
    pub refused: Vec<RefusedBatch>,
}

/// A batch that the service has refused for good, the samples of one that it has rejected, or one
/// that is damaged.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RefusedBatch {
    pub id: i64,
    pub asset: String,
    pub bytes: u64,
    pub reason: String,
}

/// Most batches, and most assets, that a status names.
pub(super) const MAX_NAMED: usize = 100;

/// The spool. One process at a time uses its file.
#[derive(Debug)]
pub struct Spool {
    limit_bytes: u64,
    file: Arc<Mutex<SpoolFile>>,
    /// Notified when a batch has been added.
    pub(super) added: Arc<Notify>,
    /// Notified when room has become free.
    pub(super) freed: Notify,
}

#[derive(Debug)]
struct SpoolFile {
    log: Log,
    reserve: Reserve,
}

impl SpoolFile {
    /// Makes a change, if need be with the room of the reserve.
    fn change<T>(
        &mut self,
        change: impl Fn(&mut Log) -> Result<T, SpoolError>,
    ) -> Result<T, SpoolError> {
        let changed = change(&mut self.log);
        if changed.as_ref().is_err_and(SpoolError::is_of_full_disk) && self.reserve.release() {
            tracing::error!("the disk is full; the agent takes nothing until it has room again");
            return change(&mut self.log);
        }
        changed
    }

    /// The batch `id`, which is set aside with `reason`.
    fn refused(&mut self, id: i64, bytes: u64) -> Result<RefusedBatch, SpoolError> {
        let description = self.log.description(id)?;
        let reason = description.refusal.unwrap_or_default();
        Ok(RefusedBatch { id, asset: description.asset, bytes, reason })
    }

    /// What is set aside, up to `limit` batches, the oldest first.
    fn all_refused(&mut self, limit: usize) -> Result<Vec<RefusedBatch>, SpoolError> {
        let refused: Vec<_> = self.log.refused().take(limit).collect();
        refused.into_iter().map(|(id, bytes)| self.refused(id, bytes)).collect()
    }

    /// Fails unless each of the batches is set aside.
    fn expect_refused(&self, ids: &[i64]) -> Result<(), SpoolError> {
        match ids.iter().find(|id| !self.log.is_refused(**id)) {
            Some(id) => Err(SpoolError::NotSetAside(*id)),
            None => Ok(()),
        }
    }
}

impl Spool {
    /// Opens the spool at `path`, or creates it. Batches of up to `limit_bytes` fit. A spool of
    /// an earlier version is read and replaced.
    ///
    /// # Errors
    /// [`SpoolError`] if the file cannot be used, another process uses it, or a later version of
    /// offbd has written it.
    pub async fn open(path: &Path, limit_bytes: u64) -> Result<Self, SpoolError> {
        super::files::prepare(path)?;
        let mut file = log::lock(path)?;
        if super::database::is_database(&mut file)? {
            file = super::database::replaced(path).await?;
        }
        let log = spawn_blocking(move || Log::open(file)).await.map_err(io::Error::other)??;
        let mut reserve = Reserve::of(path);
        if let Err(error) = reserve.keep() {
            tracing::error!(%error, "no room for the reserve; the agent takes nothing");
        }
        let file = Arc::new(Mutex::new(SpoolFile { log, reserve }));
        Ok(Self { limit_bytes, file, added: Arc::default(), freed: Notify::new() })
    }

    /// Does something with the file, on a thread that may wait. Once begun it ends, also if
    /// nobody waits for it any more.
    async fn with<T: Send + 'static>(
        &self,
        act: impl FnOnce(&mut SpoolFile) -> Result<T, SpoolError> + Send + 'static,
    ) -> Result<T, SpoolError> {
        let file = self.file.clone();
        let act = move || act(&mut file.lock().unwrap_or_else(PoisonError::into_inner));
        spawn_blocking(act).await.map_err(io::Error::other)?
    }

    /// Adds a batch; it is durable when this returns.
    ///
    /// # Errors
    /// [`SpoolError`] if there is no room, or the file fails.
    pub async fn put(&self, batch: &NewBatch) -> Result<(), SpoolError> {
        let (batch, limit, added) = (batch.clone(), self.limit_bytes, self.added.clone());
        self.with(move |file| {
            let used = file.log.used_bytes();
            if used + cost(&batch) > limit {
                return Err(SpoolError::Full { used, limit });
            }
            if !file.reserve.is_kept() {
                return Err(SpoolError::DiskFull);
            }
            let put = file.log.put(&batch).map_err(SpoolError::from);
            put.map_err(|e| if e.is_of_full_disk() { SpoolError::DiskFull } else { e })?;
            added.notify_one();
            Ok(())
        })
        .await
    }

    /// Adds a batch beyond the limit, if need be in the room of the reserve: what the agent has
    /// read when it is told to stop.
    pub(super) async fn put_last(&self, batch: &NewBatch) -> Result<(), SpoolError> {
        let batch = batch.clone();
        self.with(move |file| file.change(|log| Ok(log.put(&batch)?))).await
    }

    /// Returns the assets of which batches wait, in the order of their oldest batch.
    pub(super) async fn assets(&self) -> Result<Vec<String>, SpoolError> {
        self.with(|file| Ok(file.log.assets())).await
    }

    /// Returns the oldest batch of `asset` that waits, and sets aside those before it that are
    /// damaged.
    pub(super) async fn oldest(&self, asset: &str) -> Result<Option<WaitingBatch>, SpoolError> {
        let asset = asset.to_owned();
        self.with(move |file| {
            while let Some(id) = file.log.oldest(&asset) {
                let frame = file.log.read(id)?;
                let is_intact = frame.is_intact;
                let batch = frame.into_batch();
                if is_intact {
                    return Ok(Some(WaitingBatch { id, batch }));
                }
                let reason = "the checksum is wrong: the disk has not kept what was written";
                file.change(|log| Ok(log.replace(id, &batch, Some(reason.to_owned()), true)?))?;
                tracing::error!(asset, id, reason, "a batch is damaged and set aside");
            }
            Ok(None)
        })
        .await
    }

    /// Removes a batch that the service has stored.
    pub(super) async fn remove(&self, stored: &WaitingBatch) -> Result<(), SpoolError> {
        let id = stored.id;
        self.with(move |file| {
            file.change(|log| Ok(log.remove(id)?))?;
            // What is not given back now is given back after the next batch.
            let _ = file.log.shrink();
            Ok(())
        })
        .await?;
        self.freed.notify_waiters();
        Ok(())
    }

    /// Sets a batch aside that the service has refused for good: all of it, or those of its
    /// samples that the service does not have.
    pub(super) async fn set_aside(
        &self,
        refused: &WaitingBatch,
        kept: &NewBatch,
        reason: &str,
    ) -> Result<(), SpoolError> {
        let (id, kept, reason) = (refused.id, kept.clone(), reason.to_owned());
        self.with(move |file| {
            file.change(|log| Ok(log.replace(id, &kept, Some(reason.clone()), false)?))
        })
        .await?;
        self.freed.notify_waiters();
        Ok(())
    }

    /// Returns all that is set aside, the oldest first.
    ///
    /// # Errors
    /// [`SpoolError::File`] if the file fails.
    pub async fn refused(&self) -> Result<Vec<RefusedBatch>, SpoolError> {
        self.with(|file| file.all_refused(usize::MAX)).await
    }

    /// Returns the batches that are set aside and can be sent again: those that are not damaged.
    ///
    /// # Errors
    /// [`SpoolError::File`] if the file fails.
    pub async fn sendable(&self) -> Result<Vec<i64>, SpoolError> {
        self.with(|file| {
            let ids: Vec<_> = file.log.refused().map(|(id, _)| id).collect();
            let mut sendable = Vec::new();
            for id in ids {
                if !file.log.description(id)?.is_damaged {
                    sendable.push(id);
                }
            }
            Ok(sendable)
        })
        .await
    }

    /// Lets batches that are set aside wait for the service again.
    ///
    /// # Errors
    /// [`SpoolError`] if one of them is not set aside or is damaged, and nothing is changed then;
    /// or if the file fails.
    pub async fn send_again(&self, ids: &[i64]) -> Result<(), SpoolError> {
        let (ids, added) = (ids.to_vec(), self.added.clone());
        self.with(move |file| {
            file.expect_refused(&ids)?;
            for id in &ids {
                let frame = file.log.read(*id)?;
                if frame.description.is_damaged || !frame.is_intact {
                    return Err(SpoolError::Damaged(*id));
                }
            }
            for id in ids {
                let batch = file.log.read(id)?.into_batch();
                file.change(|log| Ok(log.replace(id, &batch, None, false)?))?;
            }
            file.log.sync()?;
            added.notify_one();
            Ok(())
        })
        .await
    }

    /// Deletes batches that are set aside.
    ///
    /// # Errors
    /// [`SpoolError`] if one of them is not set aside, and nothing is changed then; or if the file
    /// fails.
    pub async fn delete(&self, ids: &[i64]) -> Result<(), SpoolError> {
        let ids = ids.to_vec();
        self.with(move |file| {
            file.expect_refused(&ids)?;
            for id in ids {
                file.log.remove(id)?;
            }
            let _ = file.log.shrink();
            Ok(file.log.sync()?)
        })
        .await?;
        self.freed.notify_waiters();
        Ok(())
    }

    /// Makes the reserve again once a full disk has room. Tries at most every
    /// [`LONGEST_DELAY`](super::delays::LONGEST_DELAY), and when nothing waits.
    pub(super) async fn regain_reserve(&self, is_empty: bool) {
        let regained = self.with(move |file| {
            if file.reserve.is_kept() || !(is_empty || file.reserve.is_due()) {
                return Ok(false);
            }
            Ok(file.reserve.keep().is_ok())
        });
        if regained.await.unwrap_or_default() {
            tracing::info!("the disk has room again");
            self.freed.notify_waiters();
        }
    }

    /// Returns how much waits.
    ///
    /// # Errors
    /// [`SpoolError::File`] if the file fails.
    pub async fn status(&self) -> Result<SpoolStatus, SpoolError> {
        let limit_bytes = self.limit_bytes;
        self.with(move |file| {
            Ok(SpoolStatus {
                waiting_batches: file.log.n_waiting() as u64,
                used_bytes: file.log.used_bytes(),
                limit_bytes,
                reserve_bytes: if file.reserve.is_kept() { RESERVE_BYTES } else { 0 },
                refused: file.all_refused(MAX_NAMED)?,
            })
        })
        .await
    }
}

/// What a batch counts against the limit at least, bytes.
const fn cost(batch: &NewBatch) -> u64 {
    (batch.body.len() as u64).div_ceil(BLOCK) * BLOCK
}
