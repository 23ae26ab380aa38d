//! Errors of the service.

use std::sync::Arc;

use tokio::sync::mpsc::error::TrySendError;

use super::EntityTag;
use offbd_core::engine::NoDriveCycle;
use offbd_core::vocabulary::{Invalid, UnknownWord};
use offbd_store::StoreError;
use offbd_wire::telemetry::BatchError;

/// An error of the service. The messages are shown to users; HTTP statuses are assigned
/// by the HTTP interface.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ServiceError {
    #[error("there is no asset `{name}`; register it with POST /api/v1/assets")]
    UnknownAsset { name: String },
    #[error("there is no session `{id}`")]
    UnknownSession { id: String },
    #[error("there is no replay `{id}`")]
    UnknownReplay { id: String },
    #[error("the session has no remark `{id}`")]
    UnknownRemark { id: String },
    #[error("asset `{asset}` has no calibration `{id}`")]
    UnknownCalibration { asset: String, id: String },
    #[error("there is no token `{id}`")]
    UnknownToken { id: String },
    #[error("there is no channel `{id}`")]
    UnknownChannel { id: String },
    #[error("there is no rule `{id}`")]
    UnknownRule { id: String },
    #[error("there is no delivery `{id}`; of each channel the last 1000 are kept")]
    UnknownDelivery { id: String },
    #[error("there is a channel `{name}` already")]
    ChannelExists { name: String },
    #[error("the rule `{rule}` uses the channel `{name}`; delete the rule first")]
    ChannelInUse { name: String, rule: String },
    #[error("the limit of {limit} {what} is reached; delete one first")]
    TooManySettings { what: &'static str, limit: usize },
    #[error("no such fault code: {0}")]
    UnknownCode(UnknownWord),
    #[error("asset `{name}` already exists; replace it with PUT /api/v1/assets/{name}")]
    AssetExists { name: String },
    #[error("a valid token named `{name}` exists; revoke it first, or use another name")]
    TokenExists { name: String },
    #[error("asset `{asset}` already has a session `{name}`")]
    SessionExists { asset: String, name: String },
    #[error("session `{name}` of asset `{asset}` has ended; send new samples to another session")]
    SessionEnded { asset: String, name: String },
    #[error("{code} of asset `{asset}` has no current occurrence to acknowledge")]
    NothingToAcknowledge { asset: String, code: String },
    #[error(
        "{code} of asset `{asset}` has no recording: it never failed, or its session was deleted"
    )]
    NoRecording { asset: String, code: String },
    #[error(transparent)]
    NoDriveCycle(NoDriveCycle),
    #[error("the job `{id}` neither waits nor runs here")]
    JobEnded { id: String },
    #[error("calibration `{id}` is not done: {state}")]
    NotDone { id: String, state: String },
    #[error(
        "asset `{asset}` offers no calibration; see its progress at \
         GET /api/v1/assets/{asset}/learning"
    )]
    NothingOffered { asset: String },
    #[error(
        "asset `{asset}` is calibrated; remove the calibration from its asset file to calibrate it \
         again"
    )]
    AlreadyLearnt { asset: String },
    /// The request is for an earlier edition of what it replaces. `now` is the present one.
    #[error("{}", changed(now.as_ref()))]
    Changed { now: Option<EntityTag> },
    #[error(transparent)]
    Invalid(#[from] Invalid),
    #[error(transparent)]
    Batch(#[from] BatchError),
    #[error("too many {what}: the limit is {limit}")]
    TooMany { what: &'static str, limit: usize },
    #[error("the limit of {limit} assets is reached")]
    RegistryFull { limit: usize },
    /// A limit is reached. The request had no effect; retry after
    /// [`RETRY_AFTER_S`](super::RETRY_AFTER_S), or later if many are refused.
    #[error("{what}; the request was not processed, retry it")]
    Busy { what: &'static str },
    /// The asset is being loaded, and its recording is long.
    #[error(
        "the engine of this asset is being rebuilt from its recording; retry in {retry_after_s} s"
    )]
    Rebuilding { retry_after_s: u64 },
    /// The partition of the asset has no owner at the moment, or another node owns it.
    #[error("the asset is moving to another node; the request was not processed, retry it")]
    Moving,
    /// The store or a part of the service failed. Unacknowledged changes may not be
    /// stored; retry.
    #[error("{what}; unacknowledged data were not stored, retry")]
    Unavailable { what: &'static str },
    /// The database rejects these changes, even alone, and accepts others.
    #[error("the store does not accept {what}; see the log")]
    NotStored { what: String },
    /// Batches wait, and nothing is committed.
    #[error("batches wait, and nothing has been committed for {seconds} s")]
    Stalled { seconds: u64 },
    /// The database is unavailable. Accepted changes wait, up to the limits.
    #[error("the database is unavailable: {reason}")]
    Outage { reason: String },
    #[error("store error: {0}")]
    Store(Arc<StoreError>),
    #[error("the store contains data that this version cannot read: {what}")]
    Corrupt { what: String },
}

fn changed(now: Option<&EntityTag>) -> String {
    match now {
        Some(now) => format!(
            "somebody has changed it since it was read; its entity tag is now {now}: read it \
             again, and send the change with this tag in `If-Match`"
        ),
        None => "it does not exist, or no longer; a request with `If-Match` creates nothing".into(),
    }
}

impl ServiceError {
    pub(super) fn from_full<T>(error: TrySendError<T>) -> Self {
        match error {
            TrySendError::Full(_) => {
                metrics::counter!("offbd_turned_away_total", "queue" => "shard").increment(1);
                Self::Busy { what: "the queue of this asset is full" }
            }
            TrySendError::Closed(_) => Self::Unavailable { what: "the service is shutting down" },
        }
    }

    pub(super) fn corrupt(what: impl std::fmt::Display) -> Self {
        Self::Corrupt { what: what.to_string() }
    }
}

impl From<StoreError> for ServiceError {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Deleted { session } => Self::UnknownSession { id: session },
            StoreError::DamagedPage(_)
            | StoreError::DamagedHeader
            | StoreError::DamagedLog { .. }
            | StoreError::Chunk { .. }
            | StoreError::Incomplete { .. }
            | StoreError::Snapshot { .. }
            | StoreError::Journal { .. }
            | StoreError::UnknownValue { .. } => Self::corrupt(error),
            error => Self::Store(Arc::new(error)),
        }
    }
}
