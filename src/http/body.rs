//! Reading a body that may be too long, may come too slowly, or may never end.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use axum::http::StatusCode;
use futures_util::StreamExt;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout;

use super::Problem;

/// Bytes of request bodies that may be in memory at a time, over all requests;
/// one more is told to come again.
#[derive(Clone, Debug)]
pub struct Budget {
    bytes: Arc<Semaphore>,
    all: usize,
}

impl Budget {
    #[must_use]
    pub fn new(bytes: usize) -> Self {
        let all = bytes.min(Semaphore::MAX_PERMITS);
        Self { bytes: Arc::new(Semaphore::new(all)), all }
    }

    /// Bytes in memory now.
    pub(super) fn used(&self) -> usize {
        self.all - self.bytes.available_permits()
    }
}

/// A body, and its share of the budget.
pub(super) struct Bytes {
    pub(super) bytes: Vec<u8>,
    share: Option<OwnedSemaphorePermit>,
}

/// Reads a body of at most `limit` bytes within `time`.
///
/// # Errors
/// 413, 408, 429 or, when the client breaks off, 400.
pub(super) async fn read(
    body: Body,
    limit: usize,
    time: Duration,
    budget: &Budget,
) -> Result<Bytes, Problem> {
    timeout(time, collect(body, limit, budget)).await.unwrap_or_else(|_| {
        let detail = format!("the body did not end within {} s", time.as_secs());
        Err(Problem::new(StatusCode::REQUEST_TIMEOUT, "slow-body", "The body is too slow", detail))
    })
}

async fn collect(body: Body, limit: usize, budget: &Budget) -> Result<Bytes, Problem> {
    let mut read = Bytes { bytes: Vec::new(), share: None };
    let mut frames = body.into_data_stream();
    while let Some(frame) = frames.next().await {
        let frame = frame.map_err(|error| {
            let detail = format!("the body broke off: {error}");
            Problem::new(StatusCode::BAD_REQUEST, "malformed", "The body cannot be read", detail)
        })?;
        if read.bytes.len() + frame.len() > limit {
            let detail = format!("the body is longer than {limit} bytes");
            return Err(Problem::new(
                StatusCode::PAYLOAD_TOO_LARGE,
                "too-large",
                "Too large",
                detail,
            ));
        }
        read.take_share(frame.len(), budget)?;
        read.bytes.extend_from_slice(&frame);
    }
    Ok(read)
}

impl Bytes {
    fn take_share(&mut self, n: usize, budget: &Budget) -> Result<(), Problem> {
        let n = u32::try_from(n).unwrap_or(u32::MAX);
        let share = budget.bytes.clone().try_acquire_many_owned(n).map_err(|_| {
            let detail = "too many bodies are under way; nothing was taken, send it again";
            Problem::new(StatusCode::TOO_MANY_REQUESTS, "busy", "Too much at once", detail)
        })?;
        match &mut self.share {
            Some(held) => held.merge(share),
            none => *none = Some(share),
        }
        Ok(())
    }
}
