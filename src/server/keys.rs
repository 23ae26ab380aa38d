//! The keys of the identity provider, read from a file or fetched, again and
//! again. What cannot be read is reported, and the old go on.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use axum::body::{Body, Bytes, to_bytes};
use hyper::{StatusCode, Uri};
use hyper_rustls::{HttpsConnector, HttpsConnectorBuilder};
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::TokioExecutor;
use tokio::io::AsyncReadExt;
use tokio::time::{Instant, timeout};
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::{ClientConfig, RootCertStore};
use tokio_util::sync::CancellationToken;

use crate::config::{JwtConfig, KeyPlace};
use crate::service::Clock;
use crate::service::access::jwt::KeySet;
use crate::service::access::{KeyFeed, Provider};

/// How often the keys are read: a key that is withdrawn is refused after that.
const READ_EVERY: Duration = Duration::from_secs(300);

/// How often they are read at most because a token names one that is not there.
const ASK_EVERY: Duration = Duration::from_secs(10);

/// How long fetching them may take; then it has failed.
const FETCH_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest document, bytes; a longer one is not read. Providers have some kilobytes.
const MAX_DOCUMENT: usize = 256 * 1024;

/// Where keys come from.
enum Source {
    File(PathBuf),
    Url(Uri, Box<Client<HttpsConnector<HttpConnector>, Body>>),
}

/// Keeps the keys of the provider fresh.
pub(super) struct Keys {
    source: Source,
    feed: KeyFeed,
}

impl Keys {
    /// The provider with its keys, and what keeps them fresh. A file must be there;
    /// who is fetched from may come later.
    pub(super) async fn read(config: &JwtConfig) -> Result<(Provider, Self)> {
        let source = match config.place()? {
            KeyPlace::File(path) => Source::File(path),
            KeyPlace::Url(url) => {
                let client = client(&url).context("`jwt.jwks`: no certificates to check it by")?;
                Source::Url(url, Box::new(client))
            }
        };
        let (provider, feed) = Provider::new(config.expected());
        let keys = Self { source, feed };
        match (keys.renew().await, &keys.source) {
            (Err(error), Source::File(_)) => return Err(error),
            (Err(error), Source::Url(..)) => {
                tracing::error!("nobody comes in by a JSON Web Token yet: {error:#}");
            }
            (Ok(()), _) => {}
        }
        Ok((provider, keys))
    }

    /// Reads them again and again, until the server stops.
    pub(super) async fn watch(self, closing: CancellationToken) {
        let _ = closing.run_until_cancelled(self.keep()).await;
    }

    #[expect(clippy::disallowed_methods, reason = "keys are read again by the clock")]
    async fn keep(self) {
        let mut asked: Option<Instant> = None;
        let mut ticks = tokio::time::interval_at(Instant::now() + READ_EVERY, READ_EVERY);
        loop {
            tokio::select! {
                _ = ticks.tick() => {}
                () = self.feed.wanted() => {
                    if asked.is_some_and(|at| at.elapsed() < ASK_EVERY) {
                        self.feed.bring_nothing();
                        continue;
                    }
                    asked = Some(Instant::now());
                }
            }
            if let Err(error) = self.renew().await {
                tracing::error!("the provider's keys are not renewed: {error:#}");
                self.feed.bring_nothing();
            }
        }
    }

    async fn renew(&self) -> Result<()> {
        let (place, document) = match &self.source {
            Source::File(path) => (path.display().to_string(), read(path).await),
            Source::Url(url, client) => {
                let fetched = timeout(FETCH_TIMEOUT, fetch(client, url)).await;
                let late = format!("no answer within {} s", FETCH_TIMEOUT.as_secs());
                (url.to_string(), fetched.context(late).flatten())
            }
        };
        let document = document.with_context(|| format!("`jwt.jwks`: cannot read {place}"))?;
        let keys = KeySet::parse(&document).with_context(|| format!("`jwt.jwks`: {place}"))?;
        tracing::debug!(place, keys = keys.n_keys(), "the provider's keys are read");
        self.feed.bring(keys, Clock.now());
        Ok(())
    }
}

async fn read(path: &Path) -> Result<Bytes> {
    let file = tokio::fs::File::open(path).await?;
    let mut document = Vec::new();
    let most = u64::try_from(MAX_DOCUMENT)? + 1;
    if file.take(most).read_to_end(&mut document).await? > MAX_DOCUMENT {
        bail!("it has more than {MAX_DOCUMENT} bytes");
    }
    Ok(document.into())
}

/// Follows nobody elsewhere: the answer is the keys, or none.
async fn fetch(client: &Client<HttpsConnector<HttpConnector>, Body>, url: &Uri) -> Result<Bytes> {
    let answer = client.get(url.clone()).await?;
    if answer.status() != StatusCode::OK {
        bail!("the answer is {}", answer.status());
    }
    let body = to_bytes(Body::new(answer.into_body()), MAX_DOCUMENT).await;
    body.with_context(|| format!("it broke off, or has more than {MAX_DOCUMENT} bytes"))
}

/// A client that trusts whom the machine trusts, or SSL_CERT_FILE names.
fn client(url: &Uri) -> Result<Client<HttpsConnector<HttpConnector>, Body>> {
    let builder = HttpsConnectorBuilder::new();
    let builder = if url.scheme_str() == Some("https") {
        builder.with_provider_and_native_roots(ring::default_provider())?
    } else {
        let tls = ClientConfig::builder_with_provider(ring::default_provider().into());
        let tls = tls.with_safe_default_protocol_versions()?;
        builder.with_tls_config(
            tls.with_root_certificates(RootCertStore::empty()).with_no_client_auth(),
        )
    };
    let connector = builder.https_or_http().enable_http1().build();
    Ok(Client::builder(TokioExecutor::new()).build(connector))
}
