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

/// A key of the configuration whose value is a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NumberKey {
    /// Section and name, `limits.assets`.
    pub path: &'static str,
    pub value: u64,
    pub least: u64,
    pub most: u64,
}

impl NumberKey {
    fn check(&self) -> Result<(), OutOfRange> {
        let Self { path, value, least, most, .. } = *self;
        if (least..=most).contains(&value) {
            return Ok(());
        }
        let reason = format!("is {value}; it must be from {least} to {most}");
        Err(OutOfRange { key: path, reason })
    }

    /// Checks the ranges of a section.
    ///
    /// # Errors
    /// The first key whose value is out of its range.
    pub fn check_all(keys: &[Self]) -> Result<(), OutOfRange> {
        keys.iter().try_for_each(Self::check)
    }
}

/// Defines a section of the configuration from a row for each key: its type, its default and
/// its range, which may depend on the other values of the section (`$this`). The comments are
/// the texts of the manual.
#[macro_export]
macro_rules! config_section {
    ($(#[$doc:meta])* $name:ident as $section:literal |$this:ident| { $(
        $(#[doc = $vdoc:literal])+ $key:ident: $type:ty = $default:expr, $range:expr;
    )+ }) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, Eq, ::serde::Deserialize, ::serde::Serialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name { $($(#[doc = $vdoc])+ pub $key: $type),+ }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $default),+ }
            }
        }

        impl $name {
            /// The name of each key and what it sets.
            pub const KEYS: &'static [(&'static str, &'static str)] =
                &[$((stringify!($key), concat!($($vdoc),+))),+];

            /// The keys with their values and ranges.
            #[must_use]
            pub fn numbers(&self) -> Vec<$crate::NumberKey> {
                let $this = self;
                vec![$({
                    let range: ::std::ops::RangeInclusive<$type> = $range;
                    $crate::NumberKey {
                        path: concat!($section, ".", stringify!($key)),
                        value: $this.$key as u64,
                        least: *range.start() as u64,
                        most: *range.end() as u64,
                    }
                }),+]
            }
        }
    };
}

config_section! {
    /// Limits of requests, memory and connections.
    RequestLimits as "limits" |limits| {
        /// Samples in a batch; a longer one is answered with 413, and closes a WebSocket.
        batch_samples: usize = 10_000, 1..=1_000_000;
        /// Bytes of a batch; a longer one is answered with 413, and closes a WebSocket.
        batch_bytes: usize = 4 << 20, 1024..=1 << 30;
        /// Bytes of an imported file; a longer one is answered with 413.
        import_bytes: usize = 128 << 20, 1024..=1 << 30;
        /// Bytes of all request bodies and messages in memory; then 429, and 1013 on a WebSocket.
        /// One token, or one address of another machine, has half of it. A body in zstd counts
        /// up to 8 MiB more while it arrives.
        bodies_bytes: usize = 256 << 20, 1024..=1 << 34;
        /// Samples between arrival and commit; then 429.
        in_flight_samples: usize = 500_000, limits.batch_samples..=100_000_000;
        /// Bytes of the journal, which are also in memory. Above this, its oldest data are folded
        /// after each commit; a smaller journal writes more pages.
        journal_bytes: usize = 16 << 20, 1..=1 << 30;
        /// Samples from which on a session continues in another one, its next part. By default
        /// at least a day at 100 Hz; not a time, because clocks are set.
        session_samples: usize = 10_000_000, 1000..=1_000_000_000;
        /// Assets; then 507 for a new one. Nodes of a cluster may exceed it by 64 each.
        assets: usize = 10_000, 1..=1_000_000;
        /// Time for a request body to arrive, s; then 408. An import may take ten times as long.
        body_timeout_s: u64 = 30, 1..=3600;
        /// Time for the TLS handshake and for the head of a request, s; then the connection is
        /// closed.
        header_timeout_s: u64 = 30, 1..=3600;
        /// Time for which a client may stop reading, s; then the connection is closed.
        write_timeout_s: u64 = 30, 1..=3600;
        /// Connections; further ones are closed at once.
        connections: usize = 16_384, 1..=1_000_000;
        /// Connections of one address; further ones are closed at once.
        connections_per_address: usize = 4096, 1..=1_000_000;
        /// Time for a graceful stop, s; then the process exits with an error, and devices send
        /// again what is not acknowledged.
        shutdown_s: u64 = 20, 1..=3600;
    }
}

config_section! {
    /// Threads and queues.
    WorkerLimits as "workers" |_this| {
        /// Threads that run engines; by default one for each core, and at most 16.
        shards: usize = std::thread::available_parallelism().map_or(2, usize::from).clamp(1, 16),
            1..=256;
        /// Commands in the queue of each of these threads; then 429.
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

/// Files that are read for imports at a time, each on its own thread; further ones wait, as
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
