//! How much the service takes on, and what happens at each bound.

use std::time::Duration;

use super::retention::Retention;

/// The bounds that an operator may set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Threads that run engines.
    pub shards: usize,
    /// Replays and calibrations at a time; others wait.
    pub jobs: usize,
    /// Requests that wait for one shard; the next is told to come again.
    pub shard_queue: usize,
    /// Write sets that wait for the writer; then the shards wait for it.
    pub commit_queue: usize,
    /// Samples between arrival and commit; the next batch is told to come again.
    pub in_flight_samples: usize,
    /// Bytes of the journal, of which memory holds as many; above, what has been in
    /// it longest is folded into the recordings after each commit. It stays below
    /// twice this.
    pub journal_bytes: usize,
    /// Samples in one batch; a longer one is refused.
    pub batch_samples: usize,
    /// Bytes of one batch; a longer one is refused.
    pub batch_bytes: usize,
    /// Bytes of one imported file; a longer one is refused.
    pub import_bytes: usize,
    /// Assets in the registry; the next is refused.
    pub assets: usize,
    /// Longest time for a request's body to arrive; then the request is given up.
    pub body_timeout: Duration,
    /// How long recordings are kept.
    pub retention: Retention,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            shards: std::thread::available_parallelism().map_or(2, usize::from).clamp(1, 16),
            jobs: 1,
            shard_queue: 256,
            commit_queue: 1024,
            in_flight_samples: 500_000,
            journal_bytes: 16 << 20,
            batch_samples: 10_000,
            batch_bytes: 4 << 20,
            import_bytes: 64 << 20,
            assets: 10_000,
            body_timeout: Duration::from_secs(30),
            retention: Retention::default(),
        }
    }
}

impl Limits {
    /// Samples in the longest batch that is taken.
    pub(super) fn longest_batch(&self) -> usize {
        self.batch_samples.min(self.in_flight_samples)
    }
}

/// Seconds after which a caller who was turned away may come again.
pub const RETRY_AFTER_S: u64 = 1;

/// Longest name of a session, bytes.
pub(super) const MAX_SESSION_NAME: usize = 200;
