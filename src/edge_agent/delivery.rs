//! Forwards the batches of a spool, in order for each asset, until each is acknowledged.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use axum::body::{Body, to_bytes};
use futures_util::future::join_all;
use hyper::header::{AUTHORIZATION, CONTENT_TYPE, HeaderValue, RETRY_AFTER};
use hyper::{Request, StatusCode, Uri};
use tokio::time::{Instant, sleep, timeout};

use super::spool::{NewBatch, Spool, SpoolError, WaitingBatch};
use crate::server::{HttpsClient, https_client};

/// Longest wait for an answer; then the batch is sent again.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);
/// Delay after the first failure of an asset; it doubles with each further one.
const FIRST_DELAY: Duration = Duration::from_millis(200);
/// Longest delay between two attempts of an asset.
const LONGEST_DELAY: Duration = Duration::from_secs(30);
/// Most assets whose batches are under way at the same time; the others wait for their turn.
const MAX_AT_ONCE: usize = 8;
/// Longest answer that is read, bytes; of a longer one the reason is not reported.
const MAX_ANSWER_BYTES: usize = 64 << 10;

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
            Ok(Err(reason)) => Attempt::Failed { reason, wait: None },
            Err(_) => Attempt::Failed { reason: "no answer in time".to_owned(), wait: None },
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
        // Only a complete answer is an acknowledgement.
        let answer = to_bytes(Body::new(response.into_body()), MAX_ANSWER_BYTES).await;
        let answer = answer.map_err(|e| reasons(&e))?;
        if status.is_success() {
            return Ok(Attempt::Stored);
        }
        let reason = format!("{status}: {}", String::from_utf8_lossy(&answer));
        Ok(if is_final(status) {
            Attempt::Refused(reason)
        } else {
            Attempt::Failed { reason, wait }
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

/// Whether the same batch would be refused again. An asset or a token that is missing may come.
fn is_final(status: StatusCode) -> bool {
    matches!(
        status,
        StatusCode::BAD_REQUEST
            | StatusCode::CONFLICT
            | StatusCode::PAYLOAD_TOO_LARGE
            | StatusCode::UNSUPPORTED_MEDIA_TYPE
            | StatusCode::UNPROCESSABLE_ENTITY
    )
}

/// The result of sending a batch.
enum Attempt {
    Stored,
    Refused(String),
    Failed {
        reason: String,
        /// The delay that the service asks for.
        wait: Option<Duration>,
    },
}

/// When an asset is tried again.
struct Pause {
    until: Instant,
    delay: Duration,
}

/// Forwards what is in a spool.
pub struct SpoolSender {
    spool: Arc<Spool>,
    to: ServiceUrl,
    /// Of assets whose last attempt failed.
    pauses: HashMap<String, Pause>,
}

impl SpoolSender {
    #[must_use]
    pub fn new(spool: Arc<Spool>, to: ServiceUrl) -> Self {
        Self { spool, to, pauses: HashMap::new() }
    }

    /// Forwards for ever.
    ///
    /// # Errors
    /// [`SpoolError`] if the spool fails.
    pub async fn run(&mut self) -> Result<(), SpoolError> {
        loop {
            if !self.send_due().await? {
                self.wait().await;
            }
        }
    }

    /// Forwards until nothing waits.
    ///
    /// # Errors
    /// [`SpoolError`] if the spool fails.
    pub async fn drain(&mut self) -> Result<(), SpoolError> {
        while !self.spool.assets().await?.is_empty() {
            if !self.send_due().await? {
                self.wait().await;
            }
        }
        Ok(())
    }

    /// Sends the oldest batch of each asset that is due; returns whether there was one.
    async fn send_due(&mut self) -> Result<bool, SpoolError> {
        let assets = self.spool.assets().await?;
        self.pauses.retain(|asset, _| assets.contains(asset));
        let now = now();
        let is_due = |asset: &String| self.pauses.get(asset).is_none_or(|p| p.until <= now);
        let due: Vec<String> = assets.into_iter().filter(is_due).take(MAX_AT_ONCE).collect();
        let (spool, to) = (&self.spool, &self.to);
        let sent = join_all(due.iter().map(|asset| async move {
            let Some(waiting) = spool.oldest(asset).await? else { return Ok(None) };
            let attempt = to.send(&waiting.batch).await;
            Ok(Some((waiting, attempt)))
        }));
        let sent: Vec<Result<Option<(WaitingBatch, Attempt)>, SpoolError>> = sent.await;
        for sent in sent {
            if let Some((waiting, attempt)) = sent? {
                self.settle(waiting, attempt).await?;
            }
        }
        Ok(!due.is_empty())
    }

    async fn settle(&mut self, waiting: WaitingBatch, attempt: Attempt) -> Result<(), SpoolError> {
        let asset = waiting.batch.asset.as_str();
        match attempt {
            Attempt::Stored => {
                self.pauses.remove(asset);
                self.spool.remove(&waiting).await
            }
            Attempt::Refused(reason) => {
                tracing::error!(asset, id = waiting.id, reason, "a batch is refused for good");
                self.spool.set_aside(waiting.id, &reason).await
            }
            Attempt::Failed { reason, wait } => {
                let last = self.pauses.get(asset).map(|pause| pause.delay * 2);
                let delay = last.unwrap_or(FIRST_DELAY).min(LONGEST_DELAY);
                let until = now() + wait.unwrap_or(delay).max(delay);
                self.pauses.insert(asset.to_owned(), Pause { until, delay });
                let waiting = self.spool.status().await?.waiting_batches;
                tracing::warn!(asset, reason, waiting, "a batch waits");
                Ok(())
            }
        }
    }

    /// Waits for a new batch or the end of a pause.
    async fn wait(&self) {
        let next = self.pauses.values().map(|pause| pause.until).min();
        let rest = next.map_or(LONGEST_DELAY, |at| at.saturating_duration_since(now()));
        tokio::select! {
            () = sleep(rest) => {}
            () = self.spool.added.notified() => {}
        }
    }
}

#[expect(clippy::disallowed_methods, reason = "delays between attempts")]
fn now() -> Instant {
    Instant::now()
}
