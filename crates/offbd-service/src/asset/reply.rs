//! The reply to a command of an asset.

use tokio::sync::{OwnedSemaphorePermit, oneshot};

use crate::ServiceError;

/// The sender of the reply to a command.
pub(crate) struct Reply<T> {
    sender: oneshot::Sender<Result<T, ServiceError>>,
    permit: Option<OwnedSemaphorePermit>,
}

impl<T> Reply<T> {
    pub(crate) fn new() -> (Self, Answer<T>) {
        let (sender, receiver) = oneshot::channel();
        (Self { sender, permit: None }, Answer(receiver))
    }

    /// Holds `permit` until the reply is sent or dropped, whether or not it is received.
    pub(crate) fn with_permit(self, permit: OwnedSemaphorePermit) -> Self {
        Self { permit: Some(permit), ..self }
    }

    pub(super) fn send(self, outcome: Result<T, ServiceError>) {
        drop(self.permit);
        // The receiver may be gone; the changes are durable nevertheless.
        let _ = self.sender.send(outcome);
    }
}

/// The receiver of the reply to a command.
pub(crate) struct Answer<T>(oneshot::Receiver<Result<T, ServiceError>>);

impl<T> Answer<T> {
    /// Waits for the reply.
    ///
    /// # Errors
    /// Those of the command; [`ServiceError::Unavailable`] if the engine panicked.
    pub(crate) async fn wait(self) -> Result<T, ServiceError> {
        let failed = ServiceError::Unavailable { what: "the engine of the asset failed" };
        self.0.await.unwrap_or(Err(failed))
    }
}

#[cfg(test)]
impl<T> Answer<T> {
    /// Returns the reply if it is there, otherwise the answer.
    pub(crate) fn now(mut self) -> Result<Result<T, ServiceError>, Self> {
        match self.0.try_recv() {
            Ok(answer) => Ok(answer),
            Err(oneshot::error::TryRecvError::Empty) => Err(self),
            Err(oneshot::error::TryRecvError::Closed) => {
                Ok(Err(ServiceError::Unavailable { what: "the engine of the asset failed" }))
            }
        }
    }
}
