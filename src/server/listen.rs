//! Accepts connections up to a limit, encrypts them if TLS is configured, and serves
//! HTTP.
//!
//! A connection is closed if the head of the next request does not arrive in time, also
//! between two requests, or if the client does not read its responses. So a client cannot
//! occupy connections without using them.

use std::io;
use std::net::SocketAddr;
use std::time::Duration;

use axum::Router;
use axum::extract::ConnectInfo;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use super::connections::{ConnectionLimits, ConnectionPermit, LimitedConnection};
use super::tls::Tls;
use offbd_service::RequestLimits;

/// Longest head of a request, bytes; a longer one is answered 431.
const MAX_HEAD_BYTES: usize = 64 << 10;

/// Most header fields of a request; a request with more is answered 431.
const MAX_HEADERS: usize = 64;

/// Pause after the operating system could not accept a connection, for example for lack
/// of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Accepts connections and serves HTTP over them.
#[derive(Clone)]
pub(super) struct HttpListener {
    header_timeout: Duration,
    write_timeout: Duration,
    limits: ConnectionLimits,
    tls: Option<Tls>,
    closing: CancellationToken,
}

impl HttpListener {
    pub(super) fn new(
        limits: &RequestLimits,
        tls: Option<Tls>,
        closing: CancellationToken,
    ) -> Self {
        let header_timeout = Duration::from_secs(limits.header_timeout_s);
        let write_timeout = Duration::from_secs(limits.write_timeout_s);
        let limits = ConnectionLimits::new(limits.connections, limits.connections_per_address);
        Self { header_timeout, write_timeout, limits, tls, closing }
    }

    /// Accepts connections until the server stops, then waits until the requests in
    /// progress are answered.
    pub(super) async fn serve(self, listener: TcpListener, router: Router) {
        let tracker = TaskTracker::new();
        loop {
            let accepted = tokio::select! {
                () = self.closing.cancelled() => break,
                accepted = listener.accept() => accepted,
            };
            match accepted {
                Ok((socket, peer)) => match self.limits.take(peer.ip().to_canonical()) {
                    Some(permit) => {
                        tracker.spawn(self.clone().connection(
                            socket,
                            peer,
                            permit,
                            router.clone(),
                        ));
                    }
                    None => metrics::counter!("offbd_connections_refused_total").increment(1),
                },
                Err(error) if concerns_one_connection(&error) => {}
                Err(error) => {
                    tracing::error!(%error, "cannot accept connections");
                    tokio::time::sleep(ACCEPT_PAUSE).await;
                }
            }
        }
        drop(listener);
        tracker.close();
        tracker.wait().await;
    }

    async fn connection(
        self,
        socket: TcpStream,
        peer: SocketAddr,
        permit: ConnectionPermit,
        router: Router,
    ) {
        // Otherwise a response may wait for the TCP acknowledgement of the previous one.
        let _ = socket.set_nodelay(true);
        let socket = LimitedConnection::new(socket, permit, self.write_timeout);
        match &self.tls {
            None => self.http(socket, peer, router).await,
            Some(tls) => {
                let encrypted = tokio::select! {
                    () = self.closing.cancelled() => return,
                    encrypted = timeout(self.header_timeout, tls.accept(socket)) => encrypted,
                };
                match encrypted {
                    Ok(Ok(socket)) => self.http(socket, peer, router).await,
                    Ok(Err(error)) => tracing::debug!(%peer, %error, "TLS handshake failed"),
                    Err(_) => tracing::debug!(%peer, "TLS handshake timed out"),
                }
            }
        }
    }

    async fn http(
        &self,
        socket: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
        peer: SocketAddr,
        router: Router,
    ) {
        let router = TowerToHyperService::new(router);
        let service = service_fn(move |mut request: hyper::Request<Incoming>| {
            request.extensions_mut().insert(ConnectInfo(peer));
            hyper::service::Service::call(&router, request)
        });
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(self.header_timeout)
            .max_buf_size(MAX_HEAD_BYTES)
            .max_headers(MAX_HEADERS)
            .serve_connection(TokioIo::new(socket), service)
            .with_upgrades();
        tokio::pin!(connection);
        let ended = tokio::select! {
            ended = connection.as_mut() => ended,
            () = self.closing.cancelled() => {
                connection.as_mut().graceful_shutdown();
                connection.as_mut().await
            }
        };
        if let Err(error) = ended {
            tracing::debug!(%peer, %error, "connection ended with an error");
        }
    }
}

/// Returns whether the error concerns only the connection that was to be accepted, not the
/// listener.
fn concerns_one_connection(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset)
}
