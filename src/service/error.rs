//! Why the service will not or cannot.

use std::sync::Arc;

use tokio::sync::mpsc::error::TrySendError;

use crate::store::StoreError;
use crate::wire::telemetry::BatchError;
use offbd_core::engine::NoDriveCycle;
use offbd_core::vocabulary::{Invalid, UnknownWord};

/// Why the service will not or cannot. Knows no status codes.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ServiceError {
    #[error("there is no asset `{name}`; register it with POST /api/v1/assets")]
    UnknownAsset { name: String },
    #[error("there is no session `{id}`")]
    UnknownSession { id: String },
    #[error("there is no replay `{id}`")]
    UnknownReplay { id: String },
    #[error("asset `{asset}` has no calibration `{id}`")]
    UnknownCalibration { asset: String, id: String },
    #[error("there is no token `{id}`")]
    UnknownToken { id: String },
    #[error("no such fault code: {0}")]
    UnknownCode(UnknownWord),
    #[error("there is an asset `{name}` already; replace it with PUT /api/v1/assets/{name}")]
    AssetExists { name: String },
    #[error("there is a token `{name}` in force; revoke it first, or take another name")]
    TokenExists { name: String },
    #[error("asset `{asset}` has a session `{name}` already")]
    SessionExists { asset: String, name: String },
    #[error("session `{name}` of asset `{asset}` has ended; new samples need another session")]
    SessionEnded { asset: String, name: String },
    #[error("{code} of asset `{asset}` has no occurrence to acknowledge")]
    NothingToAcknowledge { asset: String, code: String },
    #[error(
        "{code} of asset `{asset}` has no recording: nothing is on record, or its session is gone"
    )]
    NoRecording { asset: String, code: String },
    #[error(transparent)]
    NoDriveCycle(NoDriveCycle),
    #[error("calibration `{id}` is not done: {state}")]
    NotDone { id: String, state: String },
    #[error(
        "asset `{asset}` offers no calibration: GET /api/v1/assets/{asset}/learning says how far it is"
    )]
    NothingOffered { asset: String },
    #[error("asset `{asset}` is learnt: take the calibration out of its file to learn it anew")]
    AlreadyLearnt { asset: String },
    #[error(transparent)]
    Invalid(#[from] Invalid),
    #[error(transparent)]
    Batch(#[from] BatchError),
    #[error("{what}: at most {limit}")]
    TooMany { what: &'static str, limit: usize },
    #[error("there are {limit} assets, and no more are taken")]
    RegistryFull { limit: usize },
    /// Come again after `limits::RETRY_AFTER_S`; nothing was taken.
    #[error("{what}; nothing was taken, send it again")]
    Busy { what: &'static str },
    /// The store failed, or what runs behind the service; come again.
    #[error("{what}; what was not acknowledged was not taken, send it again")]
    Unavailable { what: &'static str },
    /// The database does not take it, also alone; other changes it takes.
    #[error("the store does not take {what}; see the log")]
    NotStored { what: String },
    /// Samples in flight are at their limit, and none becomes durable.
    #[error(
        "the samples in flight are at their limit, and nothing has been committed for {seconds} s"
    )]
    Stalled { seconds: u64 },
    /// The database is away; what waits is kept, up to the limits.
    #[error("the database takes nothing now: {reason}")]
    Outage { reason: String },
    #[error("the store: {0}")]
    Store(Arc<StoreError>),
    #[error("the store holds what this version cannot read: {what}")]
    Corrupt { what: String },
}

impl ServiceError {
    pub(super) fn from_full<T>(error: TrySendError<T>) -> Self {
        match error {
            TrySendError::Full(_) => {
                metrics::counter!("offbd_turned_away_total", "queue" => "shard").increment(1);
                Self::Busy { what: "too many requests wait for this asset" }
            }
            TrySendError::Closed(_) => Self::Unavailable { what: "the service is closing" },
        }
    }

    pub(super) fn corrupt(what: impl std::fmt::Display) -> Self {
        Self::Corrupt { what: what.to_string() }
    }
}

impl From<StoreError> for ServiceError {
    fn from(error: StoreError) -> Self {
        Self::Store(Arc::new(error))
    }
}
