//! A client of HTTP servers, with TLS for addresses with `https`.

use anyhow::Result;
use axum::body::Body;
use hyper::Uri;
use hyper_rustls::{HttpsConnector, HttpsConnectorBuilder};
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::TokioExecutor;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::{ClientConfig, RootCertStore};

/// An HTTP client, with TLS on request.
pub type HttpsClient = Client<HttpsConnector<HttpConnector>, Body>;

/// Returns a client that trusts the root certificates of the machine, or of `SSL_CERT_FILE`.
///
/// # Errors
/// If `url` needs TLS and the machine has no root certificates.
pub fn https_client(url: &Uri) -> Result<HttpsClient> {
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
