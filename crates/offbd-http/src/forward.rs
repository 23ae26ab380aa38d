//! Forwards requests about an asset to the node that owns it, byte by byte, WebSockets
//! included. A request is forwarded once: a node that gets it and is not the owner answers
//! 503, and the client tries again.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use axum::extract::Request;
use axum::http::header::{
    CONNECTION, CONTENT_ENCODING, CONTENT_LENGTH, HOST, TRANSFER_ENCODING, UPGRADE,
};
use axum::http::request::Parts;
use axum::http::uri::{PathAndQuery, Uri};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode};
use axum::response::Response;
use hyper::upgrade::OnUpgrade;
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::{TokioExecutor, TokioIo};
use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::Problem;
use super::assets::MAX_ASSET_BYTES;
use super::credential::client_address;
use offbd_net::coding::Coding;
use offbd_service::{Route, Service, ServiceError};
use offbd_wire::problem::TOO_LARGE;

/// The header of a forwarded request, with the secret of the cluster.
const FORWARDED: HeaderName = HeaderName::from_static("x-offbd-forwarded");

/// The client's address in a forwarded request.
const CLIENT: HeaderName = HeaderName::from_static("x-offbd-client");

/// The header of a forwarded request that carries a batch from NATS or MQTT.
pub(super) const FROM_BUS: HeaderName = HeaderName::from_static("x-offbd-from-bus");

/// How long the service waits for the answer of a node that no longer owns the asset. Chosen: longer
/// by far than an answer that is under way takes.
const LAST_ANSWERS: Duration = Duration::from_secs(1);

/// Longest time to connect to another node. Chosen: the first packet is sent again after 1 s and
/// after 3 s, so two of them may be lost.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest time that what was sent to another node stays unacknowledged, and that a connection
/// stays silent although it is probed. Then it is given up: its packets may vanish silently,
/// while the node reaches the database and owns what it owned. As for connections to PostgreSQL
/// (`crates/offbd-store/src/writer_lock.rs`). A node that reads nothing for so long although more is sent than
/// the buffers hold loses the connection too.
#[cfg(target_os = "linux")]
const SILENCE_TIMEOUT: Duration = Duration::from_secs(6);

/// A connection on which nothing has come for so long is probed,
const PROBE_AFTER: Duration = Duration::from_secs(3);

/// with this pause between two probes. An idle one is given up after so many without an answer.
const PROBE_PAUSE: Duration = Duration::from_secs(1);
const PROBES: u32 = 3;

/// Sends requests to other nodes.
#[derive(Clone)]
pub struct Forwarder {
    // Shared, as every request has a copy of the forwarder.
    client: Arc<Client<HttpConnector, Body>>,
}

impl Default for Forwarder {
    fn default() -> Self {
        Self { client: Arc::new(Client::builder(TokioExecutor::new()).build(connector())) }
    }
}

/// Makes connections that end when the other node cannot be reached any more.
fn connector() -> HttpConnector {
    let mut connector = HttpConnector::new();
    connector.set_nodelay(true);
    connector.set_connect_timeout(Some(CONNECT_TIMEOUT));
    connector.set_keepalive(Some(PROBE_AFTER));
    connector.set_keepalive_interval(Some(PROBE_PAUSE));
    connector.set_keepalive_retries(Some(PROBES));
    #[cfg(target_os = "linux")]
    connector.set_tcp_user_timeout(Some(SILENCE_TIMEOUT));
    connector
}

/// Whether a request comes from another node of the cluster.
pub(super) fn is_forwarded(service: &Service, headers: &HeaderMap) -> bool {
    let Some(secret) = service.cluster_secret() else { return false };
    // Digests, so that the duration of the comparison tells nothing of the secret.
    let digest = |text: &[u8]| Sha256::digest(text);
    headers
        .get(FORWARDED)
        .is_some_and(|given| digest(given.as_bytes()) == digest(secret.as_bytes()))
}

/// Whether a forwarded request carries a batch that has come over NATS or MQTT. There the server
/// or broker has checked who sends for the asset.
pub(super) fn is_from_bus(headers: &HeaderMap) -> bool {
    headers.contains_key(FROM_BUS)
}

/// The address of the client of a forwarded request.
pub(super) fn original_client(headers: &HeaderMap) -> Option<std::net::IpAddr> {
    headers.get(CLIENT)?.to_str().ok()?.parse().ok()
}

/// The name in the asset file of a request that registers an asset, and the request again.
///
/// # Errors
/// A [`Problem`] if the file is too long or cannot be read.
pub(super) async fn name_in_body(request: Request) -> Result<(Option<String>, Request), Problem> {
    #[derive(Deserialize)]
    struct Named {
        name: String,
    }
    let (mut parts, body) = request.into_parts();
    let decoded = Coding::of(&parts.headers)?.decode(body, MAX_ASSET_BYTES);
    let body = Body::from_stream(decoded);
    parts.headers.remove(CONTENT_ENCODING);
    parts.headers.remove(CONTENT_LENGTH);
    let bytes = axum::body::to_bytes(body, MAX_ASSET_BYTES).await.map_err(|_| {
        let detail = "the asset file is too long, or the request ended early";
        Problem::new(TOO_LARGE, detail)
    })?;
    let named: Option<Named> = serde_json::from_slice(&bytes).ok();
    let request = Request::from_parts(parts, Body::from(bytes));
    Ok((named.map(|named| named.name), request))
}

impl Forwarder {
    /// Sends `request` to the owner of `asset`, if that is another node; otherwise returns it.
    ///
    /// # Errors
    /// A [`Problem`] if no node owns it at the moment, or the owner cannot be reached.
    pub(super) async fn forward(
        &self,
        service: &Service,
        asset: &str,
        request: Request,
    ) -> Result<Result<Response, Request>, Problem> {
        if request.method().is_safe() {
            service.confirm_ownership().await?;
        }
        let address = match service.route(asset) {
            Route::Here => return Ok(Err(request)),
            Route::Nowhere => return Err(ServiceError::Moving.into()),
            Route::Node { address, .. } => address,
        };
        if is_forwarded(service, request.headers()) {
            return Err(ServiceError::Moving.into());
        }
        metrics::counter!("offbd_requests_forwarded_total").increment(1);
        let (mut request, mut moved) = (request, Box::pin(moved(service, asset, &address)));
        let upgrade = request.extensions_mut().remove::<OnUpgrade>();
        let answer = tokio::select! {
            biased;
            answer = self.send(service, &address, request) => answer?,
            () = &mut moved => return Err(ServiceError::Moving.into()),
        };
        Ok(Ok(match upgrade {
            Some(client) if answer.status() == StatusCode::SWITCHING_PROTOCOLS => {
                upgraded(answer, client, moved)
            }
            _ => answer,
        }))
    }

    /// Sends `request` to the node at `address`. Returns its answer as this node's.
    ///
    /// # Errors
    /// A [`Problem`] if it cannot be reached.
    pub(super) async fn send(
        &self,
        service: &Service,
        address: &str,
        request: Request,
    ) -> Result<Response, Problem> {
        let secret = service.cluster_secret().unwrap_or_default();
        let (mut parts, body) = request.into_parts();
        address_to(&mut parts, address, secret)?;
        let answer = self.client.request(Request::from_parts(parts, body)).await;
        let mut answer = answer.map_err(|error| {
            tracing::debug!(address, %error, "another node cannot be reached");
            Problem::from(ServiceError::Moving)
        })?;
        if answer.status() != StatusCode::SWITCHING_PROTOCOLS {
            answer.headers_mut().remove(CONNECTION);
        }
        answer.headers_mut().remove(TRANSFER_ENCODING);
        Ok(answer.map(Body::new))
    }
}

/// Waits until the node at `address` has lost `asset`, and has had time to answer what it had
/// completed before. One that is paused or cut off does not answer.
pub(super) fn moved(
    service: &Service,
    asset: &str,
    address: &str,
) -> impl Future<Output = ()> + use<> {
    let moved = service.moved_from(asset, address);
    async {
        moved.await;
        tokio::time::sleep(LAST_ANSWERS).await;
    }
}

/// Changes the head of a request so that it goes to `address`.
fn address_to(parts: &mut Parts, address: &str, secret: &str) -> Result<(), Problem> {
    let moving = |_| Problem::from(ServiceError::Moving);
    let path = parts.uri.path_and_query().map_or("/", PathAndQuery::as_str);
    let uri: Uri = format!("http://{address}{path}").parse().map_err(moving)?;
    if let Some(client) = client_address(&parts.extensions)
        && let Ok(client) = HeaderValue::from_str(&client.to_string())
    {
        parts.headers.insert(CLIENT, client);
    }
    if !parts.headers.contains_key(HOST)
        && let Some(Ok(host)) = parts.uri.host().map(HeaderValue::from_str)
    {
        parts.headers.insert(HOST, host);
    }
    if !parts.headers.contains_key(UPGRADE) {
        parts.headers.remove(CONNECTION);
    }
    parts.headers.remove(TRANSFER_ENCODING);
    let secret = HeaderValue::from_str(secret).map_err(|_| ServiceError::Moving)?;
    parts.headers.insert(FORWARDED, secret);
    parts.uri = uri;
    parts.version = axum::http::Version::HTTP_11;
    if parts.method == Method::HEAD {
        parts.headers.remove(CONTENT_LENGTH);
    }
    Ok(())
}

/// Returns the answer to a client that is to speak another protocol from now on: bytes are
/// copied in both directions until one side ends, or the asset has `moved` to another node. The
/// client then connects again.
fn upgraded(
    mut answer: Response,
    client: OnUpgrade,
    moved: impl Future<Output = ()> + Send + 'static,
) -> Response {
    let owner = hyper::upgrade::on(&mut answer);
    tokio::spawn(async move {
        let (Ok(client), Ok(owner)) = tokio::join!(client, owner) else { return };
        let (mut client, mut owner) = (TokioIo::new(client), TokioIo::new(owner));
        tokio::select! {
            // Ends when one side is gone, which is not an error.
            _ = tokio::io::copy_bidirectional(&mut client, &mut owner) => {}
            () = moved => {}
        }
    });
    answer
}
