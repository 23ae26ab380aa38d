//! An identity provider: keys, tokens signed with them, and a server that publishes the keys.

mod tokens;

pub use tokens::*;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use offbd::config::JwtConfig;
use offbd::service::access::jwt::ExpectedClaims;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpListener;

/// Returns a configuration that accepts the provider's tokens, with its keys at `jwks`.
pub fn config(jwks: impl ToString) -> JwtConfig {
    let ExpectedClaims { issuer, audience, role_claim, asset_claim } = expected();
    JwtConfig { issuer, audience, jwks: jwks.to_string(), role_claim, asset_claim }
}

/// The document published at an address of this machine.
#[derive(Clone, Default)]
pub struct Published {
    pub document: Arc<std::sync::Mutex<String>>,
    /// Number of requests.
    pub requests: Arc<AtomicUsize>,
}

impl Published {
    pub fn new(document: String) -> Self {
        let published = Self::default();
        published.set(document);
        published
    }

    /// Sets the document; if it is empty, requests get 503.
    pub fn set(&self, document: String) {
        *self.document.lock().unwrap() = document;
    }

    pub fn n_requests(&self) -> usize {
        self.requests.load(Ordering::SeqCst)
    }

    /// Starts the server, with TLS if `tls` is given, and returns its port.
    pub async fn serve(&self, tls: Option<tokio_rustls::TlsAcceptor>) -> u16 {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let port = listener.local_addr().unwrap().port();
        let published = self.clone();
        tokio::spawn(async move {
            while let Ok((socket, _)) = listener.accept().await {
                match &tls {
                    Some(tls) => match tls.accept(socket).await {
                        Ok(socket) => published.answer(socket).await,
                        Err(error) => eprintln!("{error}"),
                    },
                    None => published.answer(socket).await,
                }
            }
        });
        port
    }

    async fn answer(&self, mut socket: impl AsyncRead + AsyncWrite + Unpin) {
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            if socket.read_buf(&mut head).await.unwrap_or(0) == 0 {
                return;
            }
        }
        self.requests.fetch_add(1, Ordering::SeqCst);
        let body = self.document.lock().unwrap().clone();
        let status = if body.is_empty() { "503 Service Unavailable" } else { "200 OK" };
        let head = format!(
            "HTTP/1.1 {status}\r\nconnection: close\r\ncontent-length: {}\r\n\r\n",
            body.len()
        );
        // The client may have closed the connection.
        let _ = socket.write_all((head + &body).as_bytes()).await;
        let _ = socket.shutdown().await;
    }
}
