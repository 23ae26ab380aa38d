//! A WebSocket whose messages count against the memory of request bodies from their first byte
//! on: a client that begins messages and does not end them holds no more than other callers.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::extract::FromRequestParts;
use axum::http::header::{
    CONNECTION, SEC_WEBSOCKET_ACCEPT, SEC_WEBSOCKET_KEY, SEC_WEBSOCKET_VERSION, UPGRADE,
};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode};
use axum::response::{IntoResponse, Response};
use hyper::upgrade::{OnUpgrade, Upgraded};
use hyper_util::rt::TokioIo;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, ReadBuf};
use tokio::time::{Instant, timeout};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;
use tokio_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};

use super::Problem;
use super::body::{BodyShare, ReservedBytes};
use offbd_wire::problem::UPGRADE_REQUIRED;

/// Bytes that are read at once. After a message, as many of the next one may be in memory
/// uncounted. Chosen: four messages of 100 samples in MessagePack.
const READ_BUFFER: usize = 16 << 10;

/// Limit of bytes in the socket's write buffer.
const MAX_WRITE_BUFFER: usize = 1 << 20;

/// Bytes of a control frame of a client beside its content (RFC 6455, section 5): two, and the
/// mask.
const CONTROL_HEAD: usize = 6;

/// Longest time for which the rest of a refused message is received and discarded. The system
/// resets a connection that is closed while data arrive, and the client does not get the
/// reason then.
const DISCARD_TIMEOUT: Duration = Duration::from_secs(5);

pub(super) type WebSocket = WebSocketStream<CountedConnection>;

/// A request for a WebSocket.
pub(super) struct WebSocketRequest {
    key: HeaderValue,
    on_upgrade: OnUpgrade,
}

impl<S: Send + Sync> FromRequestParts<S> for WebSocketRequest {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        let refused = |reason: &str| {
            let detail = format!("a WebSocket upgrade is required: {reason}");
            Problem::new(UPGRADE_REQUIRED, detail)
        };
        if parts.method != Method::GET {
            return Err(refused("the method is not GET"));
        }
        let words =
            [(CONNECTION, "upgrade"), (UPGRADE, "websocket"), (SEC_WEBSOCKET_VERSION, "13")];
        for (name, word) in words {
            if !has_word(&parts.headers, &name, word) {
                return Err(refused(&format!("the header `{name}` is not `{word}`")));
            }
        }
        let key = parts.headers.get(SEC_WEBSOCKET_KEY).cloned();
        let key = key.ok_or_else(|| refused("there is no header `sec-websocket-key`"))?;
        let on_upgrade = parts.extensions.remove::<OnUpgrade>();
        let on_upgrade = on_upgrade.ok_or_else(|| refused("the connection has no upgrade"))?;
        Ok(Self { key, on_upgrade })
    }
}

/// Whether a header has `word` in its list.
fn has_word(headers: &HeaderMap, name: &HeaderName, word: &str) -> bool {
    let values = headers.get_all(name).iter().filter_map(|value| value.to_str().ok());
    values.flat_map(|value| value.split(',')).any(|found| found.trim().eq_ignore_ascii_case(word))
}

impl WebSocketRequest {
    /// Answers the request, and calls `serve` with the socket. Messages have at most `longest`
    /// bytes, and count against `share`.
    pub(super) fn accept<F, Served>(self, longest: usize, share: BodyShare, serve: F) -> Response
    where
        F: FnOnce(WebSocket) -> Served + Send + 'static,
        Served: Future<Output = ()> + Send,
    {
        let config = WebSocketConfig::default()
            .read_buffer_size(READ_BUFFER)
            .max_write_buffer_size(MAX_WRITE_BUFFER)
            .max_message_size(Some(longest))
            .max_frame_size(Some(longest));
        let Self { key, on_upgrade } = self;
        tokio::spawn(async move {
            // Fails if the client is gone already.
            let Ok(upgraded) = on_upgrade.await else { return };
            let (reserved, begun_at) = (ReservedBytes::default(), None);
            let connection = TokioIo::new(upgraded);
            let connection = CountedConnection { connection, share, reserved, begun_at };
            serve(WebSocket::from_raw_socket(connection, Role::Server, Some(config)).await).await;
        });
        let accept = derive_accept_key(key.as_bytes());
        let headers = [
            (CONNECTION, "upgrade"),
            (UPGRADE, "websocket"),
            (SEC_WEBSOCKET_ACCEPT, accept.as_str()),
        ];
        (StatusCode::SWITCHING_PROTOCOLS, headers).into_response()
    }
}

/// A connection that reserves memory for what is read from it. Reading fails with
/// [`io::ErrorKind::OutOfMemory`] if there is no more.
pub(super) struct CountedConnection {
    connection: TokioIo<Upgraded>,
    /// The memory that messages may take.
    share: BodyShare,
    /// What was read of the present message.
    reserved: ReservedBytes,
    /// When its first byte was read.
    begun_at: Option<Instant>,
}

impl CountedConnection {
    /// Returns the memory of the message that is complete now.
    pub(super) fn take_reserved(&mut self) -> ReservedBytes {
        self.begun_at = None;
        std::mem::take(&mut self.reserved)
    }

    /// Releases a ping or pong. The message around it continues.
    pub(super) fn release_control(&mut self, content: usize) {
        self.reserved.release(CONTROL_HEAD + content);
        if self.reserved.is_empty() {
            self.begun_at = None;
        }
    }

    /// When the message began that is being received.
    pub(super) fn begun_at(&self) -> Option<Instant> {
        self.begun_at
    }

    /// Receives what the client still sends, and discards it.
    pub(super) async fn discard(mut self) {
        self.reserved = ReservedBytes::default();
        let mut buffer = vec![0; READ_BUFFER];
        let discarded = async {
            // Ends with the connection.
            while self.connection.read(&mut buffer).await.is_ok_and(|n| n > 0) {}
        };
        let _ = timeout(DISCARD_TIMEOUT, discarded).await;
    }

    #[expect(
        clippy::disallowed_methods,
        reason = "a message that is not completed ends the socket"
    )]
    fn count(&mut self, n: usize) -> io::Result<()> {
        if n == 0 {
            return Ok(());
        }
        self.begun_at.get_or_insert_with(Instant::now);
        self.reserved.add(n, &self.share).map_err(|_| io::ErrorKind::OutOfMemory.into())
    }
}

impl AsyncRead for CountedConnection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        ready!(Pin::new(&mut self.connection).poll_read(context, buffer))?;
        Poll::Ready(self.count(buffer.filled().len() - before))
    }
}

impl AsyncWrite for CountedConnection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        data: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.connection).poll_write(context, data)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.connection).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.connection).poll_shutdown(context)
    }
}
