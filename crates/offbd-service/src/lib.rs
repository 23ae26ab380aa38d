//! The service: many assets, each with a running engine, on one store.
//!
//! # The path of a batch
//!
//! 1. **Request** (`requests`): [`Service::submit`] takes one permit per sample from the
//!    limit of samples in flight, or returns [`ServiceError::Busy`]. It queues an
//!    `AssetCommand::Ingest` with a `Reply` and returns a [`PendingBatch`], which waits for
//!    the acknowledgement.
//! 2. **Shard** (`asset`): the hash of the asset's name selects a shard, a thread with a
//!    bounded queue that owns the engines of its assets and executes their commands one
//!    after the other. An asset is loaded from the store by its first command that does more than
//!    look, beside the shard; its commands wait meanwhile.
//! 3. **Turn**: the shard executes the command. The engine evaluates the samples; all
//!    resulting changes (samples, transitions, fault memory, session) are collected in a
//!    `Turn` and handed to the writer as one `WriteSet`. The shard does not wait for the
//!    commit: it continues with the next command.
//! 4. **Writer** (`writing`): one thread commits all write sets in its queue, up to 512, in
//!    a single transaction (group commit), so that many small batches share one commit.
//! 5. **Reply**: after the commit the fault transitions are published as [`Event`]s, the
//!    permits are released, and the reply is sent.
//!
//! # Guarantees
//!
//! - An acknowledgement means durable: a reply to a command that changes something, and
//!   every event, follows the commit. A reply to a query may show changes that are not
//!   durable yet.
//! - The changes of a command are committed together or not at all, and those of an asset
//!   in the order of its commands.
//! - If a commit fails, the affected engines are ahead of the store. Their
//!   `EngineGeneration` is invalidated: write sets of it that are still queued are refused,
//!   and the asset is loaded again by the next command, on another thread. From the last
//!   snapshot on, or from the start, the recording is evaluated again. The engine reaches the
//!   same state, because it depends only on the samples and actions, never on the clock.
//! - A client may send a batch again if it was not acknowledged: recorded samples are
//!   counted as duplicates.
//! - Every queue is bounded ([`Limits`]). If the queue of a shard is full, the request gets
//!   [`ServiceError::Busy`]; if that of the writer is full, the shards wait.
//!
//! # Folders
//!
//! - `requests`: the public methods of [`Service`], by subject.
//! - `asset`: the asset as an actor: commands, shards, engine, sessions, fault memory,
//!   automatic calibration.
//! - `writing`: the writer thread, group commit, events.
//! - `jobs`: background jobs (replays and calibrations).
//! - `reanalysis`: evaluates a recording again for plots and for the recording of a
//!   fault, without storing anything.
//! - `notifications`: tells people of changes of faults.
//! - `communication`: finds rigs whose data stay away.
//! - `mutes`: the monitors that a person has muted.
//! - `tags`: what is permitted as a tag of a rig.
//! - `edition`: entity tags, and changes that depend on them.
//! - `upkeep`: deletion in parts, retention, the watchdog of ingest.
//! - `background`: long computations on threads of a low priority.
//! - `simulation_tests`: the whole service without threads, with devices and faults.
//! - [`access`]: roles and rights, tokens, JSON Web Tokens, audit entries.
//!
//! Contains no HTTP and no SQL. The wall clock is read only for timestamps that are stored
//! beside the samples (arrival, opening, actions).

pub mod access;
mod asset;
mod asset_quota;
mod background;
mod clock;
mod cluster;
mod communication;
mod edition;
mod error;
mod job;
mod jobs;
mod limits;
mod mutes;
mod notifications;
mod ownership;
mod playback;
mod reanalysis;
mod replay_settings;
mod requests;
#[cfg(test)]
mod simulation_tests;
mod snapshots;
mod start;
mod tags;
mod upkeep;
mod views;
mod writing;

use offbd_net::Reasons;
pub use offbd_store::RecordingReader;

pub use clock::{Clock, parse_timestamp};
pub use cluster::Route;
pub use communication::CommunicationSettings;
pub use edition::{Edition, EntityTag, Expected};
pub use error::ServiceError;
pub use limits::{
    Limits, NumberKey, OutOfRange, RETRY_AFTER_S, RequestLimits, Retention, WorkerLimits,
};
pub use notifications::settings::key as webhook_key;
pub use notifications::{
    NotificationSettings, NotificationTransport, Notifier, SendOutcome, TargetPolicy,
};
pub use reanalysis::fault_recording::RecordingWindow;
pub use reanalysis::trace::{MAX_TRACE_POINTS, TraceQuery};
pub use requests::{
    AlarmQuery, DeliveryQuery, FaultQuery, FleetQuery, ImportFile, MAX_SERIES_SESSIONS,
    PendingBatch, PresentFault, QueueLoad, SeriesQuery, SessionListQuery, TraceReader,
};
pub use start::{Service, Workers};
pub use writing::{Event, EventFeed, EventKind};
