//! Limits of the service, and what happens when each is reached.

use std::time::Duration;

use super::{CommunicationSettings, NotificationSettings, ServiceError};
use offbd_core::vocabulary::Invalid;

/// A value of the configuration that is out of its range.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutOfRange {
    pub key: &'static str,
    pub reason: String,
}

/// Defines a section of the configuration from a row for each key: its type, its default and
/// its range, which may depend on the other values of the section (`$this`).
#[macro_export]
macro_rules! config_section {
    ($(#[$doc:meta])* $name:ident as $section:literal |$this:ident| { $(
        $(#[$vdoc:meta])* $key:ident: $type:ty = $default:expr, $range:expr;
    )+ }) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, Eq, ::serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name { $($(#[$vdoc])* pub $key: $type),+ }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $default),+ }
            }
        }

        impl $name {
            /// The keys in the configuration.
            pub const KEYS: &'static [&'static str] =
                &[$(concat!($section, ".", stringify!($key))),+];

            /// Checks the ranges.
            ///
            /// # Errors
            /// The first key whose value is out of its range.
            pub fn check(&self) -> Result<(), $crate::OutOfRange> {
                let $this = self;
                $(
                    let (value, range) = ($this.$key, $range);
                    if !range.contains(&value) {
                        let (least, most) = (range.start(), range.end());
                        let key = concat!($section, ".", stringify!($key));
                        let reason = format!("is {value}; it must be from {least} to {most}");
                        return Err($crate::OutOfRange { key, reason });
                    }
                )+
                Ok(())
            }
        }
    };
}

config_section! {
    /// Limits of requests, memory and connections.
    RequestLimits as "limits" |limits| {
        /// Samples in a batch; a longer batch is refused.
        batch_samples: usize = 10_000, 1..=1_000_000;
        /// Bytes of a batch; a longer batch is refused.
        batch_bytes: usize = 4 << 20, 1024..=1 << 30;
        /// Bytes of an imported file; a longer file is refused.
        import_bytes: usize = 64 << 20, 1024..=1 << 30;
        /// Bytes of all request bodies in memory at a time.
        bodies_bytes: usize = 256 << 20, 1024..=1 << 34;
        /// Samples between arrival and commit; at the limit a batch is refused with
        /// [`ServiceError::Busy`].
        in_flight_samples: usize = 500_000, limits.batch_samples..=100_000_000;
        /// Bytes of the journal, which are also held in memory. Above this, the oldest entries
        /// are folded into the recordings after each commit; the journal stays below twice
        /// this.
        journal_bytes: usize = 16 << 20, 1..=1 << 30;
        /// Recorded samples from which on a session continues in another one. Chosen: at least
        /// a day at 100 Hz. It is not a time, because a clock that is set must not divide a
        /// session.
        session_samples: usize = 10_000_000, 1000..=1_000_000_000;
        /// Assets in the registry; at the limit a new asset is refused.
        assets: usize = 10_000, 1..=1_000_000;
        /// Time limit to receive a request body, s; then the request is answered with 408.
        body_timeout_s: u64 = 30, 1..=3600;
        /// Longest time for the TLS handshake, and for the head of each request to arrive, s;
        /// then the connection is closed.
        header_timeout_s: u64 = 30, 1..=3600;
        /// Longest time for which a client may stop reading, s; then the connection is closed.
        write_timeout_s: u64 = 30, 1..=3600;
        /// Connections at a time; further ones are closed at once.
        connections: usize = 16_384, 1..=1_000_000;
        /// Connections of one address at a time; further ones are closed at once.
        connections_per_address: usize = 4096, 1..=1_000_000;
        /// Longest time for a graceful stop, s.
        shutdown_s: u64 = 20, 1..=3600;
    }
}

config_section! {
    /// Threads and queues.
    WorkerLimits as "workers" |_this| {
        /// Threads that run engines.
        shards: usize = std::thread::available_parallelism().map_or(2, usize::from).clamp(1, 16),
            1..=256;
        /// Commands in the queue of a shard; at the limit a request is refused with
        /// [`ServiceError::Busy`].
        queue: usize = 256, 1..=100_000;
        /// Replays and calibrations that run at a time; others wait in the queue.
        jobs: usize = 1, 1..=256;
    }
}

/// The limits of the service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    pub requests: RequestLimits,
    pub workers: WorkerLimits,
    /// Write sets in the queue of the writer; at the limit the shards wait.
    pub commit_queue: usize,
    /// Samples between two snapshots of an engine, which a restart has to evaluate again.
    pub snapshot_interval: i64,
    /// How long recordings are kept.
    pub retention: Retention,
    /// When the data of a rig count as lost.
    pub communication: CommunicationSettings,
    /// How notifications are sent.
    pub notifications: NotificationSettings,
}

impl Default for Limits {
    /// Chosen. To evaluate as many samples as between two snapshots takes some 20 ms, and the
    /// snapshots, of about 15 kB each, take a tenth of the space of the samples.
    fn default() -> Self {
        Self {
            requests: RequestLimits::default(),
            workers: WorkerLimits::default(),
            commit_queue: 1024,
            snapshot_interval: 16_384,
            retention: Retention::default(),
            communication: CommunicationSettings::default(),
            notifications: NotificationSettings::default(),
        }
    }
}

impl RequestLimits {
    /// Returns the number of samples in the longest batch that is accepted.
    pub(super) fn longest_batch(&self) -> usize {
        self.batch_samples.min(self.in_flight_samples)
    }

    /// Returns the time limit to receive a request body.
    #[must_use]
    pub const fn body_timeout(&self) -> Duration {
        Duration::from_secs(self.body_timeout_s)
    }
}

/// How long sessions may be, and how often the state of their engines is stored.
#[derive(Clone, Copy, Debug)]
pub(super) struct SessionLimits {
    pub samples: i64,
    pub snapshot_interval: i64,
}

impl SessionLimits {
    pub(super) fn of(limits: &Limits) -> Self {
        let samples = i64::try_from(limits.requests.session_samples).unwrap_or(i64::MAX);
        Self { samples, snapshot_interval: limits.snapshot_interval }
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
