//! Connections: taken up to a number, encrypted where that is wanted, each with
//! a time in which the head of a request must come.
//!
//! A connection over which nothing comes for that time is closed, between two
//! requests too, so whoever only holds connections open loses them; and so is
//! one whose answers are not read.

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

use super::places::{Held, Place, Places};
use super::tls::Tls;
use crate::config::LimitsConfig;

/// Longest head of a request, bytes; a longer one is answered 431.
const MAX_HEAD_BYTES: usize = 64 << 10;

/// Header fields of a request; one with more is answered 431.
const MAX_HEADERS: usize = 64;

/// Pause after the system had no room for a connection.
const OUT_OF_ROOM: Duration = Duration::from_millis(100);

/// How connections are taken.
#[derive(Clone)]
pub(super) struct Connections {
    header_timeout: Duration,
    write_timeout: Duration,
    places: Places,
    tls: Option<Tls>,
    closing: CancellationToken,
}

impl Connections {
    pub(super) fn new(limits: &LimitsConfig, tls: Option<Tls>, closing: CancellationToken) -> Self {
        let header_timeout = Duration::from_secs(limits.header_timeout_s);
        let write_timeout = Duration::from_secs(limits.write_timeout_s);
        let places = Places::new(limits.connections, limits.connections_per_address);
        Self { header_timeout, write_timeout, places, tls, closing }
    }

    /// Takes connections until the server stops, then waits until the requests
    /// under way are answered.
    pub(super) async fn serve(self, listener: TcpListener, router: Router) {
        let tracker = TaskTracker::new();
        loop {
            let accepted = tokio::select! {
                () = self.closing.cancelled() => break,
                accepted = listener.accept() => accepted,
            };
            match accepted {
                Ok((socket, peer)) => match self.places.take(peer.ip().to_canonical()) {
                    Some(place) => {
                        tracker.spawn(self.clone().connection(socket, peer, place, router.clone()));
                    }
                    None => metrics::counter!("offbd_connections_refused_total").increment(1),
                },
                Err(error) if is_of_one_connection(&error) => {}
                Err(error) => {
                    tracing::error!(%error, "no connection can be taken");
                    tokio::time::sleep(OUT_OF_ROOM).await;
                }
            }
        }
        drop(listener);
        tracker.close();
        tracker.wait().await;
    }

    async fn connection(self, socket: TcpStream, peer: SocketAddr, place: Place, router: Router) {
        // Without it an answer may wait for the acknowledgement of the one before.
        let _ = socket.set_nodelay(true);
        let socket = Held::new(socket, place, self.write_timeout);
        match &self.tls {
            None => self.http(socket, peer, router).await,
            Some(tls) => {
                let encrypted = tokio::select! {
                    () = self.closing.cancelled() => return,
                    encrypted = timeout(self.header_timeout, tls.accept(socket)) => encrypted,
                };
                match encrypted {
                    Ok(Ok(socket)) => self.http(socket, peer, router).await,
                    Ok(Err(error)) => tracing::debug!(%peer, %error, "no encryption"),
                    Err(_) => tracing::debug!(%peer, "no encryption in time"),
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
            tracing::debug!(%peer, %error, "a connection broke off");
        }
    }
}

/// Whether the error is about the connection that was to be taken, not about
/// the taking.
fn is_of_one_connection(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset)
}
