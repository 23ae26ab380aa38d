//! Forwards the batches of a spool, in order for each asset, until each is acknowledged.

use std::collections::BTreeSet;
use std::convert::Infallible;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::body::{Body, to_bytes};
use futures_util::StreamExt;
use futures_util::stream::FuturesUnordered;
use hyper::header::{AUTHORIZATION, CONTENT_TYPE, HeaderValue, RETRY_AFTER};
use hyper::{Request, Uri};
use tokio::time::{sleep, timeout};

use super::answer::{Attempt, Failure, meaning};
use super::batch::{NewBatch, SpoolError};
use super::delays::{Delays, Due, LONGEST_DELAY, MAX_AT_ONCE};
use super::spool::{Spool, WaitingBatch};
use offbd_net::{HttpsClient, Reasons, https_client};

/// Longest wait for an answer; then the batch is sent again.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);
/// Delay after an error of the spool.
const SPOOL_RETRY: Duration = Duration::from_secs(1);
/// Longest response that is read, bytes; a longer one counts as cut off. Chosen: the
/// acknowledgement of the largest batch with a reason for each row has about 2.5 MB.
const MAX_ANSWER_BYTES: usize = 4 << 20;

/// The service to which batches go.
#[derive(Debug)]
pub struct ServiceUrl {
    base: String,
    authorization: Option<HeaderValue>,
    client: HttpsClient,
}

/// The address or the token of a service is invalid.
#[derive(Debug, thiserror::Error)]
pub enum InvalidServiceUrl {
    #[error("`{0}` is not the address of a service, such as http://127.0.0.1:8087")]
    Address(String),
    #[error("the token has characters that no token has")]
    Token,
    #[error("no root certificates to verify the service: {0}")]
    Certificates(String),
}

impl ServiceUrl {
    /// The service at `address`, to which `token` is sent.
    ///
    /// # Errors
    /// [`InvalidServiceUrl`].
    pub fn new(address: &str, token: Option<&str>) -> Result<Self, InvalidServiceUrl> {
        let wrong = || InvalidServiceUrl::Address(address.to_owned());
        let uri: Uri = address.parse().map_err(|_| wrong())?;
        let is_http = matches!(uri.scheme_str(), Some("http" | "https"));
        if !is_http || uri.host().is_none() || uri.query().is_some() {
            return Err(wrong());
        }
        let client =
            https_client(&uri).map_err(|e| InvalidServiceUrl::Certificates(e.to_string()))?;
        let authorization = token.map(|token| {
            let mut value = HeaderValue::try_from(format!("Bearer {token}"))?;
            value.set_sensitive(true);
            Ok(value)
        });
        let authorization = authorization
            .transpose()
            .map_err(|_: hyper::header::InvalidHeaderValue| InvalidServiceUrl::Token)?;
        let base = address.trim_end_matches('/').to_owned();
        Ok(Self { base, authorization, client })
    }

    async fn send(&self, batch: &NewBatch) -> Attempt {
        match timeout(ANSWER_TIMEOUT, self.post(batch)).await {
            Ok(Ok(attempt)) => attempt,
            Ok(Err(reason)) => Attempt::Failed(Failure::new(reason)),
            Err(_) => Attempt::Failed(Failure::new("no answer in time")),
        }
    }

    async fn post(&self, batch: &NewBatch) -> Result<Attempt, String> {
        let NewBatch { asset, query, media_type, body } = batch;
        let mark = if query.is_empty() { "" } else { "?" };
        let url = format!("{}/api/v1/assets/{asset}/telemetry{mark}{query}", self.base);
        let mut request = Request::post(url).header(CONTENT_TYPE, media_type);
        if let Some(authorization) = &self.authorization {
            request = request.header(AUTHORIZATION, authorization);
        }
        let request = request.body(Body::from(body.clone())).map_err(|e| e.to_string())?;
        let response = self.client.request(request).await.map_err(|e| reasons(&e))?;
        let status = response.status();
        let wait = response.headers().get(RETRY_AFTER).and_then(seconds);
        let answer = to_bytes(Body::new(response.into_body()), MAX_ANSWER_BYTES).await;
        let answer = answer
            .map_err(|e| format!("{status}, of which the rest is missing: {}", reasons(&e)))?;
        Ok(match meaning(status, &answer, batch) {
            Attempt::Failed(failure) => Attempt::Failed(Failure { wait, ..failure }),
            attempt => attempt,
        })
    }
}

/// An error with its causes.
fn reasons(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |cause| cause.source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}

/// The delay that a service asks for, up to [`LONGEST_DELAY`].
fn seconds(header: &HeaderValue) -> Option<Duration> {
    let seconds: u64 = header.to_str().ok()?.parse().ok()?;
    Some(Duration::from_secs(seconds).min(LONGEST_DELAY))
}

/// Forwards what is in a spool.
pub struct SpoolSender {
    spool: Arc<Spool>,
    to: ServiceUrl,
    delays: Arc<Delays>,
    /// Of the spool.
    errors: Reasons,
}

impl SpoolSender {
    #[must_use]
    pub fn new(spool: Arc<Spool>, to: ServiceUrl) -> Self {
        Self { spool, to, delays: Arc::default(), errors: Reasons::default() }
    }

    /// The assets whose batches could not be sent, for [`super::router`].
    #[must_use]
    pub fn delays(&self) -> Arc<Delays> {
        self.delays.clone()
    }

    /// Forwards for ever.
    pub async fn run(&self) -> Infallible {
        loop {
            self.drain().await;
            let _ = timeout(LONGEST_DELAY, self.spool.added.notified()).await;
        }
    }

    /// Forwards until nothing waits: one batch of each asset at a time, and the next one as soon as
    /// it is settled, so that an asset without an answer holds up no other. Does not end if the
    /// spool fails: the disk may have room again, and deletions make some.
    pub async fn drain(&self) {
        let mut under_way = BTreeSet::new();
        let mut settled = FuturesUnordered::new();
        loop {
            let mut waiting = pin!(self.waiting());
            let waiting = loop {
                tokio::select! {
                    waiting = &mut waiting => break waiting,
                    // Goes on meanwhile: one of these may be the next that gets the file.
                    Some(asset) = settled.next() => {
                        under_way.remove(&asset);
                    }
                }
            };
            let next = match waiting {
                Ok(assets) => {
                    self.errors.clear();
                    if assets.is_empty() && under_way.is_empty() {
                        return;
                    }
                    let Due { assets, next } = self.delays.due(assets, &under_way);
                    under_way.extend(assets.iter().cloned());
                    settled.extend(assets.into_iter().map(|asset| self.forward_oldest(asset)));
                    next
                }
                Err(error) => {
                    if self.errors.is_new(&error) {
                        tracing::error!(%error, "trying again");
                    }
                    SPOOL_RETRY
                }
            };
            let has_room = under_way.len() < MAX_AT_ONCE;
            tokio::select! {
                Some(asset) = settled.next() => {
                    under_way.remove(&asset);
                }
                () = sleep(next) => {}
                () = self.spool.added.notified(), if has_room => {}
            }
        }
    }

    /// The assets of which batches wait. Also looks whether the disk has room again.
    async fn waiting(&self) -> Result<Vec<String>, SpoolError> {
        let assets = self.spool.assets().await?;
        self.spool.regain_reserve(assets.is_empty()).await;
        Ok(assets)
    }

    /// Sends the oldest batch of an asset once; returns the asset.
    async fn forward_oldest(&self, asset: String) -> String {
        let failure = match self.try_oldest(&asset).await {
            Ok(None) => {
                self.delays.succeeded(&asset);
                return asset;
            }
            Ok(Some(failure)) => failure,
            Err(error) => Failure::new(error.to_string()),
        };
        if self.delays.failed(&asset, &failure) {
            let Failure { cause, answer, .. } = failure;
            let waiting = self.spool.status().await.map(|status| status.waiting_batches).ok();
            tracing::warn!(asset, reason = cause, answer, waiting, "a batch waits");
        }
        asset
    }

    /// As [`Self::forward_oldest`]; returns why the batch still waits.
    async fn try_oldest(&self, asset: &str) -> Result<Option<Failure>, SpoolError> {
        let Some(waiting) = self.spool.oldest(asset).await? else { return Ok(None) };
        let attempt = self.to.send(&waiting.batch).await;
        self.settle(&waiting, attempt).await
    }

    /// Does with a batch what an attempt demands; returns why it still waits.
    async fn settle(
        &self,
        waiting: &WaitingBatch,
        attempt: Attempt,
    ) -> Result<Option<Failure>, SpoolError> {
        let WaitingBatch { id, batch } = waiting;
        let asset = batch.asset.as_str();
        match attempt {
            Attempt::Failed(failure) => return Ok(Some(failure)),
            Attempt::Stored => self.spool.remove(waiting).await?,
            Attempt::Rejected { samples, reason } => {
                self.spool.set_aside(waiting, &samples, &reason).await?;
                tracing::error!(asset, id, reason, "samples are rejected and set aside");
            }
            Attempt::Refused(reason) => {
                self.spool.set_aside(waiting, batch, &reason).await?;
                tracing::error!(asset, id, reason, "a batch is refused and set aside");
            }
        }
        Ok(None)
    }
}
