//! Limits of the service, and what happens when each is reached.

use std::time::Duration;

use super::{CommunicationSettings, NotificationSettings, ServiceError};
use offbd_core::vocabulary::Invalid;

/// The configurable limits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Threads that run engines.
    pub shards: usize,
    /// Replays and calibrations that run at a time; others wait in the queue.
    pub jobs: usize,
    /// Commands in the queue of a shard; at the limit a request is refused with
    /// [`ServiceError::Busy`].
    pub shard_queue: usize,
    /// Write sets in the queue of the writer; at the limit the shards wait.
    pub commit_queue: usize,
    /// Samples between arrival and commit; at the limit a batch is refused with
    /// [`ServiceError::Busy`].
    pub in_flight_samples: usize,
    /// Bytes of the journal, which are also held in memory. Above this, the oldest entries
    /// are folded into the recordings after each commit; the journal stays below twice
    /// this.
    pub journal_bytes: usize,
    /// How long sessions may be.
    pub sessions: SessionLimits,
    /// Samples in a batch; a longer batch is refused.
    pub batch_samples: usize,
    /// Bytes of a batch; a longer batch is refused.
    pub batch_bytes: usize,
    /// Bytes of an imported file; a longer file is refused.
    pub import_bytes: usize,
    /// Assets in the registry; at the limit a new asset is refused.
    pub assets: usize,
    /// Time limit to receive a request body; then the request is answered with 408.
    pub body_timeout: Duration,
    /// How long recordings are kept.
    pub retention: Retention,
    /// When the data of a rig count as lost.
    pub communication: CommunicationSettings,
    /// How notifications are sent.
    pub notifications: NotificationSettings,
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
            sessions: SessionLimits::default(),
            batch_samples: 10_000,
            batch_bytes: 4 << 20,
            import_bytes: 64 << 20,
            assets: 10_000,
            body_timeout: Duration::from_secs(30),
            retention: Retention::default(),
            communication: CommunicationSettings::default(),
            notifications: NotificationSettings::default(),
        }
    }
}

impl Limits {
    /// Returns the number of samples in the longest batch that is accepted.
    pub(super) fn longest_batch(&self) -> usize {
        self.batch_samples.min(self.in_flight_samples)
    }
}

/// How long sessions may be, and how often the state of their engines is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SessionLimits {
    /// Recorded samples from which on a session continues in another one.
    pub samples: i64,
    /// Samples between two snapshots of an engine, which a restart has to evaluate again.
    pub snapshot_interval: i64,
}

impl Default for SessionLimits {
    /// Chosen. A session has at least a day at 100 Hz. The limit is not a time, because a clock
    /// that is set must not divide a session. To evaluate as many samples as between two
    /// snapshots takes some 20 ms, and the snapshots, of about 15 kB each, take a tenth of the
    /// space of the samples.
    fn default() -> Self {
        Self { samples: 10_000_000, snapshot_interval: 16_384 }
    }
}

/// Time after which a client should retry, s (`Retry-After`).
pub const RETRY_AFTER_S: u64 = 1;

/// Longest name of a session, bytes.
pub(super) const MAX_SESSION_NAME: usize = 200;

/// Drive cycles that are computed at a time; further requests are refused meanwhile. Each
/// takes up to several seconds of a core.
pub(super) const MAX_DRIVE_CYCLES: usize = 1;

/// Traces that are computed at a time; further requests are refused meanwhile.
pub(super) const MAX_TRACES: usize = 2;

/// Whole traces that are computed and read at a time; further requests are refused meanwhile.
pub(super) const MAX_WHOLE_TRACES: usize = 2;

/// Files that are read for imports at a time, each on a thread of its own; further ones wait, as
/// whoever sent one would have to send it again. Chosen: with more, what a file expands to could
/// take more memory than all request bodies.
pub(super) const MAX_IMPORTS: usize = 2;

/// Fault recordings that are computed at a time; further requests are refused meanwhile.
pub(super) const MAX_RECORDINGS: usize = 2;

/// Sessions that a calibration learns from; a request with more is refused.
pub(super) const MAX_CALIBRATION_SESSIONS: usize = 32;

/// Samples that a calibration learns from; a calibration with more fails.
pub(super) const MAX_CALIBRATION_SAMPLES: usize = 2_000_000;

/// How long recordings are kept; `None` means without limit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Retention {
    /// Age at which an ended session without a fault transition is deleted.
    pub age: Option<Duration>,
    /// Stored bytes of an asset's ended sessions above which the oldest ones without a
    /// fault transition are deleted.
    pub bytes_per_asset: Option<u64>,
    /// Age at which an ended session with a fault transition is deleted.
    pub fault_age: Option<Duration>,
    /// Interval between two sweeps.
    pub every: Duration,
}

impl Default for Retention {
    /// Keeps everything.
    fn default() -> Self {
        let every = Duration::from_secs(600);
        Self { age: None, bytes_per_asset: None, fault_age: None, every }
    }
}

/// Checks that a session name has a valid length and no control characters.
pub(super) fn check_session_name(name: &str) -> Result<(), ServiceError> {
    let fits = (1..=MAX_SESSION_NAME).contains(&name.len());
    if fits && !name.chars().any(char::is_control) {
        return Ok(());
    }
    let reason = format!("must be 1 to {MAX_SESSION_NAME} bytes without control characters");
    Err(Invalid::new("/session", reason).into())
}
