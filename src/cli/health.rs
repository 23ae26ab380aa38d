//! `offbd check --health`: asks the running service whether it is ready.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, bail};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::client::danger::{
    HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier,
};
use tokio_rustls::rustls::crypto::{CryptoProvider, ring};
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use tokio_rustls::rustls::{ClientConfig, DigitallySignedStruct, Error, SignatureScheme};

use crate::config::Config;
use crate::server::own_address;

/// Longest time until the answer. Chosen: longer than the service waits for its store.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(4);

/// Most bytes of the answer that are read.
const ANSWER_BYTES: u64 = 64 << 10;

const REQUEST: &[u8] = b"GET /readyz HTTP/1.0\r\nhost: localhost\r\n\r\n";

/// Asks the service that `config` describes, on this machine.
///
/// # Errors
/// If it does not answer in time, or is not ready.
pub(super) async fn ask(config: &Config) -> anyhow::Result<()> {
    let address = own_address(config.listen);
    let answer = tokio::time::timeout(ANSWER_TIMEOUT, answer(address, config.tls.is_some())).await;
    let late = || format!("no answer within {} s at {address}", ANSWER_TIMEOUT.as_secs());
    let answer = answer.with_context(late)?;
    let answer = answer.with_context(|| format!("no service answers at {address}"))?;
    let (head, body) = answer.split_once("\r\n\r\n").unwrap_or((answer.as_str(), ""));
    if head.split(' ').nth(1) == Some("200") {
        return Ok(());
    }
    bail!("the service is not ready: {}", if body.is_empty() { head } else { body })
}

async fn answer(address: SocketAddr, is_encrypted: bool) -> anyhow::Result<String> {
    let socket = TcpStream::connect(address).await?;
    if !is_encrypted {
        return exchange(socket).await;
    }
    let provider = Arc::new(ring::default_provider());
    let verifier = Arc::new(OwnService(provider.clone()));
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()?
        .dangerous()
        .with_custom_certificate_verifier(verifier)
        .with_no_client_auth();
    let name = ServerName::IpAddress(address.ip().into());
    exchange(TlsConnector::from(Arc::new(config)).connect(name, socket).await?).await
}

async fn exchange(mut socket: impl AsyncRead + AsyncWrite + Unpin) -> anyhow::Result<String> {
    socket.write_all(REQUEST).await?;
    let mut answer = Vec::new();
    socket.take(ANSWER_BYTES).read_to_end(&mut answer).await?;
    Ok(String::from_utf8_lossy(&answer).into_owned())
}

/// Accepts any certificate: that of the service is for its name and not for an address of this
/// machine, and nothing secret is sent.
#[derive(Debug)]
struct OwnService(Arc<CryptoProvider>);

impl ServerCertVerifier for OwnService {
    fn verify_server_cert(
        &self,
        _: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: &ServerName<'_>,
        _: &[u8],
        _: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        Ok(ServerCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let algorithms = &self.0.signature_verification_algorithms;
        tokio_rustls::rustls::crypto::verify_tls12_signature(
            message,
            certificate,
            signature,
            algorithms,
        )
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let algorithms = &self.0.signature_verification_algorithms;
        tokio_rustls::rustls::crypto::verify_tls13_signature(
            message,
            certificate,
            signature,
            algorithms,
        )
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.0.signature_verification_algorithms.supported_schemes()
    }
}
