//! Forwards the batches of a spool, in order for each asset, until each is acknowledged.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::body::{Body, to_bytes};
use futures_util::future::join_all;
use hyper::header::{AUTHORIZATION, CONTENT_TYPE, HeaderValue, RETRY_AFTER};
use hyper::{Request, Uri};
use tokio::time::{sleep, timeout};

use super::answer::{Attempt, Failure, meaning};
use super::delays::{Delays, LONGEST_DELAY};
use super::spool::{NewBatch, Spool, SpoolError, WaitingBatch};
use offbd_net::{HttpsClient, Reasons, https_client};

/// Longest wait for an answer; then the batch is sent again.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);
/// Delay after an error of the spool.
const SPOOL_RETRY: Duration = Duration::from_secs(1);
/// Most assets whose batches are under way at the same time; the others wait for their turn.
const MAX_AT_ONCE: usize = 8;
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
            self.turn().await;
        }
    }

    /// Forwards until nothing waits.
    pub async fn drain(&self) {
        while !self.spool.assets().await.is_ok_and(|assets| assets.is_empty()) {
            self.turn().await;
        }
    }

    /// Sends what is due, or waits. Does not end if the spool fails: the disk may have room again,
    /// and deletions make some.
    async fn turn(&self) {
        match self.send_due().await {
            Ok(true) => self.errors.clear(),
            Ok(false) => self.wait().await,
            Err(error) => {
                if self.errors.is_new(&error) {
                    tracing::error!(%error, "trying again");
                }
                sleep(SPOOL_RETRY).await;
            }
        }
    }

    /// Sends the oldest batch of each asset that is due; returns whether there was one.
    async fn send_due(&self) -> Result<bool, SpoolError> {
        let assets = self.spool.assets().await?;
        self.spool.regain_reserve(assets.is_empty()).await;
        let due = self.delays.due(assets, MAX_AT_ONCE);
        let (spool, to) = (&self.spool, &self.to);
        let sent = join_all(due.iter().map(|asset| async move {
            let Some(waiting) = spool.oldest(asset).await? else { return Ok(None) };
            let attempt = to.send(&waiting.batch).await;
            Ok(Some((waiting, attempt)))
        }));
        let sent: Vec<Result<Option<(WaitingBatch, Attempt)>, SpoolError>> = sent.await;
        let mut read = Ok(!due.is_empty());
        for sent in sent {
            match sent {
                Ok(Some((waiting, attempt))) => self.settle(waiting, attempt).await,
                Ok(None) => {}
                Err(error) => read = Err(error),
            }
        }
        read
    }

    async fn settle(&self, waiting: WaitingBatch, attempt: Attempt) {
        let failure = match self.try_settle(&waiting, attempt).await {
            Ok(None) => return self.delays.succeeded(&waiting.batch.asset),
            Ok(Some(failure)) => failure,
            Err(error) => Failure::new(error.to_string()),
        };
        let asset = waiting.batch.asset.as_str();
        if self.delays.failed(asset, &failure) {
            let Failure { cause, answer, .. } = failure;
            let waiting = self.spool.status().await.map(|status| status.waiting_batches).ok();
            tracing::warn!(asset, reason = cause, answer, waiting, "a batch waits");
        }
    }

    /// Does with a batch what an attempt demands; returns why it still waits.
    async fn try_settle(
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

    /// Waits for a new batch or the end of a delay.
    async fn wait(&self) {
        tokio::select! {
            () = sleep(self.delays.rest()) => {}
            () = self.spool.added.notified() => {}
        }
    }
}
