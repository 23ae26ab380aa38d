//! An identity provider: keys, tokens signed with them, and a server that publishes the keys.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use offbd::config::JwtConfig;
use ring::rand::SystemRandom;
use ring::signature::{Ed25519KeyPair, KeyPair};
use serde_json::{Value, json};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpListener;

pub const ISSUER: &str = "https://id.example/realm";
pub const AUDIENCE: &str = "offbd";

/// Base64url without padding (RFC 7515, section 2).
pub fn base64(bytes: impl AsRef<[u8]>) -> String {
    URL_SAFE_NO_PAD.encode(bytes)
}

/// Returns a token with the signature made by `sign`.
pub fn token(header: &Value, claims: &Value, sign: impl Fn(&[u8]) -> Vec<u8>) -> String {
    let message = format!("{}.{}", base64(header.to_string()), base64(claims.to_string()));
    let signature = base64(sign(message.as_bytes()));
    format!("{message}.{signature}")
}

/// An Ed25519 key pair.
pub struct Key {
    pub id: &'static str,
    pair: Ed25519KeyPair,
}

impl Key {
    pub fn new(id: &'static str) -> Self {
        let pair = Ed25519KeyPair::generate_pkcs8(&SystemRandom::new()).unwrap();
        Self { id, pair: Ed25519KeyPair::from_pkcs8(pair.as_ref()).unwrap() }
    }

    pub fn public(&self) -> Value {
        let x = base64(self.pair.public_key());
        json!({ "kty": "OKP", "crv": "Ed25519", "use": "sig", "kid": self.id, "x": x })
    }

    pub fn sign(&self, message: &[u8]) -> Vec<u8> {
        self.pair.sign(message).as_ref().to_vec()
    }

    pub fn token(&self, claims: &Value) -> String {
        let header = json!({ "alg": "EdDSA", "typ": "JWT", "kid": self.id });
        token(&header, claims, |message| self.sign(message))
    }
}

/// Returns the JSON Web Key Set of `keys`.
pub fn jwks(keys: &[&Key]) -> String {
    let keys: Vec<Value> = keys.iter().map(|key| key.public()).collect();
    json!({ "keys": keys }).to_string()
}

/// The end of 2099, s since 1970.
pub const END: i64 = 4_102_444_800;

/// Returns claims of `subject` that expire at [`END`].
pub fn claims(subject: &str, role: &str) -> Value {
    json!({ "iss": ISSUER, "aud": AUDIENCE, "sub": subject, "exp": END, "offbd_role": role })
}

/// Returns the claims of an asset's device.
pub fn device(asset: &str) -> Value {
    let mut claims = claims(&format!("{asset}'s device"), "device");
    claims["offbd_asset"] = json!(asset);
    claims
}

/// Returns a configuration that accepts the provider's tokens, with its keys at `jwks`.
pub fn config(jwks: impl ToString) -> JwtConfig {
    let (role_claim, asset_claim) = ("offbd_role".to_owned(), "offbd_asset".to_owned());
    let (issuer, audience) = (ISSUER.to_owned(), AUDIENCE.to_owned());
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
