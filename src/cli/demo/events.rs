//! Reads fault transitions from the service's Server-Sent Events.

use std::pin::pin;

use futures_util::StreamExt;
use reqwest::{Body, Response};
use sse_stream::SseStream;
use tokio::sync::mpsc;

use offbd_wire::verdict::FaultView;

/// Capacity of the queue of transitions to be printed; chosen.
const MAX_WAITING: usize = 1024;

/// Reads fault transitions from `answer` until it ends or fails.
pub(super) fn listen(answer: Response) -> mpsc::Receiver<FaultView> {
    let (sender, receiver) = mpsc::channel(MAX_WAITING);
    tokio::spawn(async move {
        let mut events = pin!(SseStream::new(Body::from(answer)));
        while let Some(Ok(event)) = events.next().await {
            let fault = event.data.and_then(|data| serde_json::from_str(&data).ok());
            let Some(fault) = fault else { continue };
            if sender.send(fault).await.is_err() {
                return;
            }
        }
    });
    receiver
}
