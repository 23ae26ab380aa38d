//! Posts messages to a URL in the format of the channel, signed as Standard Webhooks say (symmetric
//! signature, version 1). Redirects are not followed.

use std::error::Error;
use std::future::Future;
use std::net::SocketAddr;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::body::Body;
use data_encoding::BASE64;
use hyper::header::{CONTENT_TYPE, HeaderValue, RETRY_AFTER, USER_AGENT};
use hyper::{Request, StatusCode};
use hyper_rustls::builderstates::WantsSchemes;
use hyper_rustls::{HttpsConnector, HttpsConnectorBuilder};
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::client::legacy::connect::dns::Name;
use hyper_util::rt::TokioExecutor;
use ring::hmac;
use tokio_rustls::rustls::crypto::ring as provider;
use tokio_rustls::rustls::{ALL_VERSIONS, ClientConfig, RootCertStore};
use tower_service::Service;

use super::{addresses, failed};
use offbd_service::{SendOutcome, TargetPolicy, webhook_key};
use offbd_wire::notification::NotificationView;
use offbd_wire::words::WebhookFormat;

type WebhookClient = Client<HttpsConnector<HttpConnector<PermittedHosts>>, Body>;

/// Posts to URLs.
pub(super) struct WebhookSender {
    client: WebhookClient,
    targets: TargetPolicy,
}

/// Resolves only hosts whose addresses are permitted.
#[derive(Clone)]
struct PermittedHosts(TargetPolicy);

/// A host whose address may not be connected to, or is not known.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct NotPermitted(String);

impl Service<Name> for PermittedHosts {
    type Response = std::vec::IntoIter<SocketAddr>;
    type Error = NotPermitted;
    type Future = Pin<Box<dyn Future<Output = Result<Self::Response, NotPermitted>> + Send>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), NotPermitted>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, name: Name) -> Self::Future {
        let targets = self.0.clone();
        Box::pin(async move {
            let found = addresses(name.as_str(), 0, &targets).await;
            found.map(Vec::into_iter).map_err(NotPermitted)
        })
    }
}

impl WebhookSender {
    pub(super) fn new(targets: &TargetPolicy) -> Self {
        let mut http = HttpConnector::new_with_resolver(PermittedHosts(targets.clone()));
        http.enforce_http(false);
        let connector = with_roots().https_or_http().enable_http1().wrap_connector(http);
        let mut builder = Client::builder(TokioExecutor::new());
        // A connection is closed after each message: they are rare.
        builder.pool_max_idle_per_host(0);
        Self { client: builder.build(connector), targets: targets.clone() }
    }

    /// Posts `message` to a URL with the key of a secret, at `now` (µs).
    pub(super) async fn send(
        &self,
        (url, secret): (&str, &str),
        format: WebhookFormat,
        message: &NotificationView,
        now: i64,
    ) -> SendOutcome {
        let posted = message.posted(format);
        let request = match self.request((url, secret), &message.id, posted, now / 1_000_000) {
            Ok(request) => request,
            Err(reason) => return failed(reason),
        };
        match self.client.request(request).await {
            Ok(response) => outcome(response.status(), response.headers().get(RETRY_AFTER)),
            Err(error) => failed(cause(&error)),
        }
    }

    fn request(
        &self,
        (url, secret): (&str, &str),
        id: &str,
        (media_type, body): (&str, String),
        now_s: i64,
    ) -> Result<Request<Body>, String> {
        let uri: hyper::Uri = url.parse().map_err(|_| "the URL is not valid".to_owned())?;
        // The connector does not resolve an address.
        let checked = self.targets.check_host(uri.host().unwrap_or_default());
        checked.map_err(|reason| format!("the host {reason}"))?;
        let key = webhook_key(secret).ok_or("the secret is not valid")?;
        let timestamp = now_s.to_string();
        let signature = signature(&key, &format!("{id}.{timestamp}.{body}"));
        Request::post(uri)
            .header(CONTENT_TYPE, media_type)
            .header(USER_AGENT, concat!("offbd/", env!("CARGO_PKG_VERSION")))
            .header("webhook-id", id)
            .header("webhook-timestamp", timestamp)
            .header("webhook-signature", signature)
            .body(Body::from(body))
            .map_err(|error| error.to_string())
    }
}

/// TLS with the root certificates of the machine, or of `SSL_CERT_FILE`; with none, every
/// encrypted connection fails and says so.
fn with_roots() -> HttpsConnectorBuilder<WantsSchemes> {
    let with_native =
        HttpsConnectorBuilder::new().with_provider_and_native_roots(provider::default_provider());
    with_native.unwrap_or_else(|error| {
        tracing::warn!(%error, "no root certificates: webhooks with https:// will fail");
        let tls = ClientConfig::builder_with_provider(provider::default_provider().into())
            .with_protocol_versions(ALL_VERSIONS)
            .unwrap_or_else(|_| unreachable!("ring supports all versions of TLS"))
            .with_root_certificates(RootCertStore::empty())
            .with_no_client_auth();
        HttpsConnectorBuilder::new().with_tls_config(tls)
    })
}

/// Returns the signature of `content`, with its version.
fn signature(key: &[u8], content: &str) -> String {
    let key = hmac::Key::new(hmac::HMAC_SHA256, key);
    format!("v1,{}", BASE64.encode(hmac::sign(&key, content.as_bytes()).as_ref()))
}

/// Returns what the status of a response means.
fn outcome(status: StatusCode, retry_after: Option<&HeaderValue>) -> SendOutcome {
    if status.is_success() {
        return SendOutcome::Delivered;
    }
    let reason = match status.is_redirection() {
        true => format!("answered {}: redirects are not followed", status.as_u16()),
        false => format!("answered {}", status.as_u16()),
    };
    if status == StatusCode::GONE {
        return SendOutcome::Refused { reason };
    }
    let seconds = retry_after.and_then(|value| value.to_str().ok()?.trim().parse().ok());
    SendOutcome::Failed { reason, retry_after: seconds.map(Duration::from_secs) }
}

/// Returns the innermost cause of an error, which says what happened. None of them has the URL.
fn cause(error: &dyn Error) -> String {
    let mut cause = error;
    while let Some(inner) = cause.source() {
        cause = inner;
    }
    cause.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn retry_after_and_gone_are_respected() {
        let after = HeaderValue::from_static("120");
        let failed = outcome(StatusCode::SERVICE_UNAVAILABLE, Some(&after));
        let retry_after = Some(Duration::from_secs(120));
        assert_eq!(failed, SendOutcome::Failed { reason: "answered 503".into(), retry_after });
        assert_eq!(outcome(StatusCode::NO_CONTENT, None), SendOutcome::Delivered);
        let gone = SendOutcome::Refused { reason: "answered 410".into() };
        assert_eq!(outcome(StatusCode::GONE, None), gone);
        let moved = outcome(StatusCode::FOUND, None);
        assert!(
            matches!(moved, SendOutcome::Failed { reason, .. } if reason.contains("redirects"))
        );
    }
}
