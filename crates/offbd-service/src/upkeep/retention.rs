//! Retention: deletes ended sessions that are too old, or whose asset stores too much, in
//! the background. A session is deleted as a whole, so that the remaining ones can be
//! evaluated again. Sessions with a fault transition have their own age limit and are
//! never deleted because of their size.

use std::time::Duration;

use super::deletion::Deleter;
use crate::writing::Handles;
use crate::{Retention, ServiceError};
use offbd_store::{Micros, PartitionId, Write};

/// Limit of sessions that one sweep deletes for each reason; the next sweep continues. It
/// bounds the loss if the clock is wrong for a while.
const MAX_EXPIRED: u32 = 100;

/// The background task of retention.
pub(crate) struct Sweeper {
    pub(crate) handles: Handles,
    pub(crate) deleter: Deleter,
    pub(crate) retention: Retention,
}

impl Sweeper {
    /// Sweeps periodically until the service shuts down. A sweep that is interrupted
    /// continues with the next start.
    pub(crate) async fn run(self) {
        let closing = self.handles.closing.clone();
        let forever = async {
            loop {
                if let Err(error) = self.sweep().await {
                    tracing::warn!(%error, "the retention sweep failed and is retried later");
                }
                tokio::time::sleep(self.retention.every).await;
            }
        };
        tokio::select! {
            () = closing.cancelled() => {}
            () = forever => {}
        }
    }

    async fn sweep(&self) -> Result<(), ServiceError> {
        let Retention { age, bytes_per_asset, fault_age, .. } = self.retention;
        let owned = self.handles.ownership.filter();
        let owned = owned.as_deref();
        for (age, around_fault) in [(age, false), (fault_age, true)] {
            let Some(limit) = age.and_then(|age| self.before(age)) else { continue };
            let old =
                self.handles.store.sessions_ended_before(limit, around_fault, owned, MAX_EXPIRED);
            let old = old.await?;
            self.expire(old, "age").await?;
        }
        if let Some(bytes) = bytes_per_asset {
            self.shrink(i64::try_from(bytes).unwrap_or(i64::MAX), owned).await?;
        }
        self.deleter.all().await
    }

    fn before(&self, age: Duration) -> Option<Micros> {
        self.handles.clock.now().checked_sub(i64::try_from(age.as_micros()).ok()?)
    }

    /// Hides the oldest sessions without a fault transition of the assets that store more
    /// than `bytes`.
    async fn shrink(&self, bytes: i64, owned: Option<&[PartitionId]>) -> Result<(), ServiceError> {
        for (asset, held) in self.handles.store.assets_above(bytes, owned).await? {
            let mut above = held - bytes;
            let plain = self.handles.store.plain_sessions(&asset, MAX_EXPIRED).await?;
            let needed = |(_, n): &(String, i64)| {
                let is_needed = above > 0;
                above -= n;
                is_needed
            };
            let chosen = plain.into_iter().take_while(needed);
            let ids: Vec<_> = chosen.map(|(id, _)| (id, asset.clone())).collect();
            if ids.is_empty() {
                tracing::warn!(
                    asset,
                    held,
                    "above the size limit, but all sessions have fault transitions"
                );
            }
            self.expire(ids, "size").await?;
        }
        Ok(())
    }

    /// Hides sessions, each given with its asset.
    async fn expire(
        &self,
        sessions: Vec<(String, String)>,
        reason: &'static str,
    ) -> Result<(), ServiceError> {
        for (session, asset) in sessions {
            tracing::info!(session, reason, "session deleted by retention");
            metrics::counter!("offbd_sessions_expired_total", "reason" => reason).increment(1);
            let at = self.handles.clock.now();
            self.handles.write(&asset, vec![Write::HideSession { session, at }]).await?;
        }
        Ok(())
    }
}
