//! Background upkeep: deletion in parts, retention, the scrub of stored data, and the watchdog of
//! ingest.

mod deletion;
mod page_scrub;
mod retention;
mod scrub;
mod verdict_check;
mod watchdog;

use tokio::task::JoinHandle;

pub(super) use deletion::Deleter;
pub(super) use watchdog::{STALLED_AFTER, Watchdog};

use self::page_scrub::PageScrubber;
use self::retention::Sweeper;
use self::scrub::Scrubber;
use super::asset::Shards;
use super::limits::Limits;
use super::writing::Handles;

/// The background tasks, before they are started.
pub(super) struct Upkeep {
    sweeper: Sweeper,
    scrubber: Scrubber,
    page_scrubber: PageScrubber,
    watchdog: Watchdog,
}

impl Upkeep {
    pub(super) fn new(
        handles: &Handles,
        deleter: &Deleter,
        limits: &Limits,
        shards: &Shards,
        watchdog: Watchdog,
    ) -> Self {
        let (handles, shards) = (handles.clone(), shards.clone());
        let (deleter, retention) = (deleter.clone(), limits.retention.clone());
        Self {
            sweeper: Sweeper { handles: handles.clone(), deleter, retention },
            scrubber: Scrubber { handles: handles.clone(), shards },
            page_scrubber: PageScrubber { handles },
            watchdog,
        }
    }

    /// Starts the tasks on the current runtime.
    pub(super) fn spawn(self) -> [JoinHandle<()>; 4] {
        [
            tokio::spawn(self.sweeper.run()),
            tokio::spawn(self.scrubber.run()),
            tokio::spawn(self.page_scrubber.run()),
            tokio::spawn(self.watchdog.run()),
        ]
    }
}
