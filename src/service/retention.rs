//! What is kept, and for how long: ended sessions are given up when they are
//! old or when their asset keeps too much, in the background and piece by
//! piece. A session is kept whole or not at all, so that what is left can be
//! judged again. One with a change of a fault has a limit of its own, and is
//! never given up for its size.

use std::time::Duration;

use super::ServiceError;
use super::deletion::Deleter;
use super::handles::Handles;
use crate::store::{Micros, Write};

/// Sessions given up by one sweep, for each reason; the next goes on. A clock
/// that is far ahead for an hour does not cost everything.
const MAX_EXPIRED: u32 = 100;

/// How long what is kept; `None` is for ever.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Retention {
    /// Age of an ended session without a change of a fault.
    pub age: Option<Duration>,
    /// Bytes of an asset's ended sessions, as stored.
    pub bytes_per_asset: Option<u64>,
    /// Age of an ended session with a change of a fault.
    pub fault_age: Option<Duration>,
    /// How often it is looked after.
    pub every: Duration,
}

impl Default for Retention {
    /// Everything for ever.
    fn default() -> Self {
        let every = Duration::from_secs(600);
        Self { age: None, bytes_per_asset: None, fault_age: None, every }
    }
}

pub(super) struct Sweeper {
    pub(super) handles: Handles,
    pub(super) deleter: Deleter,
    pub(super) retention: Retention,
}

impl Sweeper {
    /// Sweeps every so often until the service closes. What a stop interrupts
    /// goes on with the next start.
    pub(super) async fn run(self) {
        let closing = self.handles.closing.clone();
        let forever = async {
            loop {
                if let Err(error) = self.sweep().await {
                    tracing::warn!(%error, "retention has to wait");
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
        for (age, around_fault) in [(age, false), (fault_age, true)] {
            let Some(moment) = age.and_then(|age| self.before(age)) else { continue };
            let old =
                self.handles.store.sessions_ended_before(moment, around_fault, MAX_EXPIRED).await?;
            self.expire(old, "age").await?;
        }
        if let Some(bytes) = bytes_per_asset {
            self.shrink(i64::try_from(bytes).unwrap_or(i64::MAX)).await?;
        }
        self.deleter.all().await
    }

    fn before(&self, age: Duration) -> Option<Micros> {
        self.handles.clock.now().checked_sub(i64::try_from(age.as_micros()).ok()?)
    }

    /// Gives up the oldest plain sessions of the assets above `bytes`.
    async fn shrink(&self, bytes: i64) -> Result<(), ServiceError> {
        for (asset, held) in self.handles.store.assets_above(bytes).await? {
            let mut above = held - bytes;
            let plain = self.handles.store.plain_sessions(&asset, MAX_EXPIRED).await?;
            let enough = |(_, n): &(String, i64)| {
                let wanted = above > 0;
                above -= n;
                wanted
            };
            let ids: Vec<_> = plain.into_iter().take_while(enough).map(|(id, _)| id).collect();
            if ids.is_empty() {
                tracing::warn!(asset, held, "more is kept than wanted: all of it is around faults");
            }
            self.expire(ids, "size").await?;
        }
        Ok(())
    }

    async fn expire(&self, ids: Vec<String>, reason: &'static str) -> Result<(), ServiceError> {
        for session in ids {
            tracing::info!(session, reason, "given up");
            metrics::counter!("offbd_sessions_expired_total", "reason" => reason).increment(1);
            let at = self.handles.clock.now();
            self.handles.write(Write::ExpireSession { session, at }).await?;
        }
        Ok(())
    }
}
