//! The public keys of the identity provider, read from a file or fetched from a URL at
//! regular intervals. If that fails, the error is logged and the previous keys stay in
//! use.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use axum::body::{Body, Bytes, to_bytes};
use hyper::{StatusCode, Uri};
use tokio::io::AsyncReadExt;
use tokio::time::{Instant, timeout};
use tokio_util::sync::CancellationToken;

use offbd_net::{HttpsClient, https_client};

use crate::config::{JwtConfig, KeyLocation};
use offbd_service::Clock;
use offbd_service::access::jwt::KeySet;
use offbd_service::access::{KeyFeed, Provider};

/// Interval at which the keys are read. A withdrawn key is refused after this time at most.
const REFRESH_INTERVAL: Duration = Duration::from_secs(300);

/// Shortest interval between two reads that are caused by tokens with an unknown key.
const MIN_REQUEST_INTERVAL: Duration = Duration::from_secs(10);

/// Longest duration of a fetch.
const FETCH_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest document with keys, bytes; a longer one is refused. Typical ones have some
/// kilobytes.
const MAX_DOCUMENT: usize = 256 * 1024;

/// Where the keys are read from.
enum KeySource {
    File(PathBuf),
    Url(Uri, Box<HttpsClient>),
}

/// Keeps the keys of the provider up to date.
pub(super) struct KeyRefresher {
    source: KeySource,
    feed: KeyFeed,
}

impl KeyRefresher {
    /// Reads the keys. Returns the provider, and what keeps its keys up to date.
    ///
    /// # Errors
    /// If a file cannot be read. A failed fetch is logged and repeated later.
    pub(super) async fn start(config: &JwtConfig) -> Result<(Provider, Self)> {
        let source = match config.location()? {
            KeyLocation::File(path) => KeySource::File(path),
            KeyLocation::Url(url) => {
                let client = https_client(&url)
                    .context("`jwt.jwks`: no root certificates to verify the server")?;
                KeySource::Url(url, Box::new(client))
            }
        };
        let (provider, feed) = Provider::new(config.expected());
        let refresher = Self { source, feed };
        match (refresher.refresh().await, &refresher.source) {
            (Err(error), KeySource::File(_)) => return Err(error),
            (Err(error), KeySource::Url(..)) => {
                tracing::error!("no JSON Web Token is accepted yet: {error:#}");
            }
            (Ok(()), _) => {}
        }
        Ok((provider, refresher))
    }

    /// Reads the keys again at intervals and on request, until the server stops.
    pub(super) async fn watch(self, closing: CancellationToken) {
        let _ = closing.run_until_cancelled(self.refresh_forever()).await;
    }

    #[expect(clippy::disallowed_methods, reason = "the keys are read at intervals")]
    async fn refresh_forever(self) {
        let mut last_request: Option<Instant> = None;
        let mut ticks =
            tokio::time::interval_at(Instant::now() + REFRESH_INTERVAL, REFRESH_INTERVAL);
        loop {
            tokio::select! {
                _ = ticks.tick() => {}
                () = self.feed.refresh_requested() => {
                    if last_request.is_some_and(|at| at.elapsed() < MIN_REQUEST_INTERVAL) {
                        self.feed.publish_unchanged();
                        continue;
                    }
                    last_request = Some(Instant::now());
                }
            }
            if let Err(error) = self.refresh().await {
                tracing::error!("cannot refresh the provider's keys: {error:#}");
                self.feed.publish_unchanged();
            }
        }
    }

    async fn refresh(&self) -> Result<()> {
        let (location, document) = match &self.source {
            KeySource::File(path) => (path.display().to_string(), read(path).await),
            KeySource::Url(url, client) => {
                let fetched = timeout(FETCH_TIMEOUT, fetch(client, url)).await;
                let late = format!("no response within {} s", FETCH_TIMEOUT.as_secs());
                (url.to_string(), fetched.context(late).flatten())
            }
        };
        let document = document.with_context(|| format!("`jwt.jwks`: cannot read {location}"))?;
        let keys = KeySet::parse(&document).with_context(|| format!("`jwt.jwks`: {location}"))?;
        tracing::debug!(location, keys = keys.n_keys(), "the provider's keys are read");
        self.feed.publish(keys, Clock::System.now());
        Ok(())
    }
}

async fn read(path: &Path) -> Result<Bytes> {
    let file = tokio::fs::File::open(path).await?;
    let mut document = Vec::new();
    let most = u64::try_from(MAX_DOCUMENT)? + 1;
    if file.take(most).read_to_end(&mut document).await? > MAX_DOCUMENT {
        bail!("the file has more than {MAX_DOCUMENT} bytes");
    }
    Ok(document.into())
}

/// Fetches a document. Redirects are not followed.
async fn fetch(client: &HttpsClient, url: &Uri) -> Result<Bytes> {
    let response = client.get(url.clone()).await?;
    if response.status() != StatusCode::OK {
        bail!("the status of the response is {}", response.status());
    }
    let body = to_bytes(Body::new(response.into_body()), MAX_DOCUMENT).await;
    body.with_context(|| format!("the response is incomplete or exceeds {MAX_DOCUMENT} bytes"))
}
