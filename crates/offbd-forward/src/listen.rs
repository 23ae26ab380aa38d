//! Accepts connections and serves HTTP over them, until a stop signal.

use std::pin::pin;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

use super::stop::Stop;

/// Longest time until the head of the next request is there, also between two requests; then the
/// connection is closed.
const HEAD_TIMEOUT: Duration = Duration::from_secs(30);
/// Most connections at a time; further ones wait. Chosen: some for each rig of a site, and less
/// than the descriptors that a process may have.
const MAX_CONNECTIONS: usize = 256;
/// Longest time for the requests in progress after a stop signal.
const STOP_TIMEOUT: Duration = Duration::from_secs(5);
/// Pause after the operating system could not accept a connection.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Serves until a stop signal, and then until the requests in progress are answered.
pub(super) async fn serve(listener: TcpListener, router: Router, mut stop: Stop) {
    let mut connections = JoinSet::new();
    loop {
        let has_room = connections.len() < MAX_CONNECTIONS;
        tokio::select! {
            () = stop.told() => break,
            Some(_) = connections.join_next() => {}
            accepted = listener.accept(), if has_room => match accepted {
                Ok((socket, _)) => {
                    connections.spawn(connection(socket, router.clone(), stop.clone()));
                }
                Err(error) => {
                    tracing::error!(%error, "cannot accept connections");
                    sleep(ACCEPT_PAUSE).await;
                }
            },
        }
    }
    drop(listener);
    let ended = async { while connections.join_next().await.is_some() {} };
    if timeout(STOP_TIMEOUT, ended).await.is_err() {
        tracing::warn!("some requests are not complete, and are not taken");
    }
}

async fn connection(socket: TcpStream, router: Router, mut stop: Stop) {
    // Otherwise a response may wait for the TCP acknowledgement of the previous one.
    let _ = socket.set_nodelay(true);
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIMEOUT)
        .serve_connection(TokioIo::new(socket), TowerToHyperService::new(router));
    let mut connection = pin!(connection);
    let ended = tokio::select! {
        ended = connection.as_mut() => ended,
        () = stop.told() => {
            connection.as_mut().graceful_shutdown();
            connection.as_mut().await
        }
    };
    if let Err(error) = ended {
        tracing::debug!(%error, "a connection has ended with an error");
    }
}
