//! Reading request bodies under limits of size, time and total memory.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use axum::body::Body;
use axum::http::HeaderMap;
use futures_util::StreamExt;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout;

use super::Problem;
use offbd_net::coding::Coding;
use offbd_service::ServiceError;
use offbd_wire::problem::SLOW_BODY;

/// The limit of request body bytes in memory at a time, over all requests. A request
/// that would exceed it is answered with 429.
#[derive(Clone, Debug)]
pub struct BodyBudget {
    bytes: Arc<Semaphore>,
    limit: usize,
    /// What is left of the share of each caller who has a body in memory.
    shares: Arc<Mutex<HashMap<String, Weak<Semaphore>>>>,
}

/// The bytes that one caller may have in memory: half of the budget, so that one caller
/// never turns away all others.
#[derive(Clone, Debug)]
pub(super) struct BodyShare {
    all: Arc<Semaphore>,
    own: Option<Arc<Semaphore>>,
}

/// Shares from which on those of callers without a body in memory are removed.
const MANY_SHARES: usize = 1024;

impl BodyBudget {
    #[must_use]
    pub fn new(bytes: usize) -> Self {
        let limit = bytes.min(Semaphore::MAX_PERMITS);
        Self { bytes: Arc::new(Semaphore::new(limit)), limit, shares: Arc::default() }
    }

    /// Returns the share of the caller with this id.
    pub(super) fn share_of(&self, caller: &str) -> BodyShare {
        let mut shares = self.shares.lock().unwrap_or_else(PoisonError::into_inner);
        if shares.len() >= MANY_SHARES {
            shares.retain(|_, share| share.strong_count() > 0);
        }
        let known = shares.get(caller).and_then(Weak::upgrade);
        let own = known.unwrap_or_else(|| {
            let own = Arc::new(Semaphore::new(self.limit / 2));
            shares.insert(caller.to_owned(), Arc::downgrade(&own));
            own
        });
        BodyShare { all: self.bytes.clone(), own: Some(own) }
    }

    /// Returns the whole budget, for callers that cannot be told apart and for small bodies.
    pub(super) fn whole(&self) -> BodyShare {
        BodyShare { all: self.bytes.clone(), own: None }
    }

    /// Returns the bytes in memory now.
    pub(super) fn used(&self) -> usize {
        self.limit - self.bytes.available_permits()
    }
}

/// A request body and its permits of the [`BodyBudget`], released on drop.
pub(super) struct BudgetedBody {
    pub(super) bytes: Vec<u8>,
    reserved: ReservedBytes,
}

/// Bytes of the [`BodyBudget`], released on drop.
#[derive(Debug, Default)]
pub(super) struct ReservedBytes {
    /// Of the caller's share, if there is one, and of the whole budget.
    permits: Vec<OwnedSemaphorePermit>,
}

/// Reads a body of at most `limit` bytes within `time`, and decompresses it as the headers say.
/// The limit is for the bytes that arrive and for those that they expand to.
///
/// # Errors
/// 413 if it is longer, 408 if it takes longer, 415 if its coding is unknown, 429 if the budget is
/// exhausted, and 400 if the client aborts or the body cannot be decompressed.
pub(super) async fn read(
    headers: &HeaderMap,
    body: Body,
    limit: usize,
    time: Duration,
    share: &BodyShare,
) -> Result<BudgetedBody, Problem> {
    let coding = Coding::of(headers)?;
    timeout(time, collect(coding, body, limit, share)).await.unwrap_or_else(|_| {
        let detail = format!("the body was not complete within {} s", time.as_secs());
        Err(Problem::new(SLOW_BODY, detail))
    })
}

async fn collect(
    coding: Coding,
    body: Body,
    limit: usize,
    share: &BodyShare,
) -> Result<BudgetedBody, Problem> {
    let mut read = BudgetedBody { bytes: Vec::new(), reserved: ReservedBytes::default() };
    // What the decoder itself keeps of the decoded bytes.
    let mut window = ReservedBytes::default();
    let mut frames = coding.decode(body, limit);
    while let Some(frame) = frames.next().await {
        let frame = frame?;
        let kept = coding.window().saturating_sub(read.bytes.len()).min(frame.len());
        window.add(kept, share)?;
        read.reserved.add(frame.len(), share)?;
        read.bytes.extend_from_slice(&frame);
    }
    Ok(read)
}

impl BudgetedBody {
    /// Returns the bytes and what of the budget they take.
    pub(super) fn into_parts(self) -> (Vec<u8>, ReservedBytes) {
        (self.bytes, self.reserved)
    }
}

impl AsRef<[u8]> for BudgetedBody {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl ReservedBytes {
    /// Reserves `n` more bytes of the caller's share, if there is one, and of the whole budget.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] if one of them is exhausted.
    pub(super) fn add(&mut self, n: usize, share: &BodyShare) -> Result<(), ServiceError> {
        for (i, permit) in share.reserve(n)?.into_iter().enumerate() {
            match self.permits.get_mut(i) {
                Some(held) => held.merge(permit),
                None => self.permits.push(permit),
            }
        }
        Ok(())
    }

    /// Releases `n` bytes, or all if there are fewer.
    pub(super) fn release(&mut self, n: usize) {
        for permit in &mut self.permits {
            drop(permit.split(n.min(permit.num_permits())));
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.permits.iter().all(|permit| permit.num_permits() == 0)
    }
}

impl BodyShare {
    fn reserve(&self, n: usize) -> Result<Vec<OwnedSemaphorePermit>, ServiceError> {
        let n = u32::try_from(n).unwrap_or(u32::MAX);
        let reserve = |bytes: &Arc<Semaphore>| bytes.clone().try_acquire_many_owned(n);
        let permits: Result<_, _> = self.own.iter().chain([&self.all]).map(reserve).collect();
        permits.map_err(|_| ServiceError::Busy {
            what: "the limit of request bodies in memory is reached",
        })
    }
}
