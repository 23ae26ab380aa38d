//! Requests to the writer about the ownership of partitions, which it executes between two
//! commits.

use tokio::sync::{mpsc, oneshot};

use crate::ServiceError;
use offbd_store::{NodeRow, PartitionId, PartitionRow};

/// Requests that wait; further ones wait for room.
const MAX_REQUESTS: usize = 8;

/// The sender of the result of a request.
type TransferReply<T> = oneshot::Sender<Result<T, ServiceError>>;

/// A request to the writer.
pub(crate) enum TransferRequest {
    /// Reads which nodes are alive and who owns which partition.
    Observe(TransferReply<(Vec<NodeRow>, Vec<PartitionRow>)>),
    /// Takes those partitions that have no owner; returns which.
    Take(Vec<PartitionId>, TransferReply<Vec<PartitionId>>),
    /// Gives partitions up.
    Release(Vec<PartitionId>, TransferReply<()>),
    /// Says that this node will hand all its partitions over.
    Leave(TransferReply<()>),
}

/// Sends requests to the writer. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Transfers(mpsc::Sender<TransferRequest>);

impl Transfers {
    pub(crate) fn new() -> (Self, mpsc::Receiver<TransferRequest>) {
        let (sender, receiver) = mpsc::channel(MAX_REQUESTS);
        (Self(sender), receiver)
    }

    /// Waits for the result of the request that `make` returns.
    ///
    /// # Errors
    /// [`ServiceError`] if the database fails or the writer has stopped.
    pub(crate) async fn call<T>(
        &self,
        make: impl FnOnce(TransferReply<T>) -> TransferRequest,
    ) -> Result<T, ServiceError> {
        let (sender, receiver) = oneshot::channel();
        let stopped = ServiceError::Unavailable { what: "the writer has stopped" };
        if self.0.send(make(sender)).await.is_err() {
            return Err(stopped);
        }
        receiver.await.unwrap_or(Err(stopped))
    }
}
