//! The connection of `offbd watch`: the WebSocket of an asset, over TLS or not.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, anyhow, bail};
use clap::Args;
use hyper_rustls::ConfigBuilderExt;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, RootCertStore};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Error;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::handshake::client::Request;
use tokio_tungstenite::tungstenite::http::header::AUTHORIZATION;
use tokio_tungstenite::tungstenite::http::{HeaderValue, StatusCode, Uri};

use offbd_terminal::errors::{self, InputError};

/// Where the service is, and how to be let in.
#[derive(Clone, Debug, Args)]
pub(super) struct ConnectArgs {
    /// Address of the service; with `https://` the connection is encrypted
    #[arg(
        long = "url",
        visible_alias = "address",
        default_value = "127.0.0.1:8087",
        value_name = "[https://]HOST[:PORT]"
    )]
    address: String,
    /// File with a token, if the service requires one. Without TLS it is sent to this
    /// machine only
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// File with the certificate, PEM, of the authority that signed the service's, if the
    /// system does not trust it
    #[arg(long, value_name = "FILE")]
    ca_file: Option<PathBuf>,
}

pub(super) trait Transport: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> Transport for T {}

/// The WebSocket of an asset.
pub(super) type Socket = WebSocketStream<Box<dyn Transport>>;

/// Opens the stream of `asset` with `hz` states per second.
///
/// # Errors
/// If an argument is invalid, the service does not answer or refuses.
pub(super) async fn connect(args: &ConnectArgs, asset: &str, hz: f64) -> anyhow::Result<Socket> {
    let service = ServiceAddress::parse(&args.address)?;
    let request = request(args, &service, asset, hz)?;
    let ServiceAddress { host, port, is_encrypted } = &service;
    let missing = || format!("cannot stream {asset} from {}", args.address);
    let socket = TcpStream::connect((host.as_str(), *port)).await;
    let socket = socket.map_err(|error| no_service(&args.address, &error))?;
    let transport: Box<dyn Transport> = if *is_encrypted {
        let name = ServerName::try_from(host.clone())?;
        let connector = TlsConnector::from(Arc::new(tls(args.ca_file.as_deref())?));
        Box::new(connector.connect(name, socket).await.with_context(missing)?)
    } else {
        Box::new(socket)
    };
    match tokio_tungstenite::client_async(request, transport).await {
        Ok((socket, _)) => Ok(socket),
        Err(Error::Http(answer)) => Err(refusal(answer.status(), asset, &args.address)),
        Err(error) => Err(error).with_context(missing),
    }
}

/// The error if no service answers; it says what to do.
fn no_service(address: &str, error: &std::io::Error) -> anyhow::Error {
    anyhow!(
        "no service answers at {address} ({error}); start one with `offbd serve` or `offbd demo`, \
         or give its address with `--url HOST:PORT`"
    )
}

/// The error if the service refuses the stream: why, and what to do.
fn refusal(status: StatusCode, asset: &str, address: &str) -> anyhow::Error {
    match status {
        StatusCode::NOT_FOUND => anyhow!(
            "the service at {address} has no asset `{asset}`; {address}/api/v1/fleet lists those \
             that it has"
        ),
        StatusCode::UNAUTHORIZED => {
            anyhow!("the service at {address} requires a valid token: `--token-file FILE`")
        }
        StatusCode::FORBIDDEN => anyhow!("the token may not read the asset `{asset}`"),
        StatusCode::TOO_MANY_REQUESTS | StatusCode::SERVICE_UNAVAILABLE => {
            anyhow!("the service at {address} is busy ({status}); try again")
        }
        _ => anyhow!("the service at {address} refuses the stream of `{asset}`: {status}"),
    }
}

#[derive(Debug, PartialEq, Eq)]
struct ServiceAddress {
    host: String,
    port: u16,
    is_encrypted: bool,
}

impl ServiceAddress {
    fn parse(address: &str) -> anyhow::Result<Self> {
        let full =
            if address.contains("://") { address.to_owned() } else { format!("http://{address}") };
        let invalid = || format!("`--url`: {address} is not [https://]HOST[:PORT]");
        let uri: Uri = full.parse().with_context(invalid)?;
        let is_encrypted = match uri.scheme_str() {
            Some("https" | "wss") => true,
            Some("http" | "ws") => false,
            _ => bail!(invalid()),
        };
        let host = uri.host().filter(|_| uri.path() == "/" && uri.query().is_none());
        let host = host.with_context(invalid)?.trim_matches(['[', ']']).to_owned();
        let port = uri.port_u16().unwrap_or(if is_encrypted { 443 } else { 80 });
        Ok(Self { host, port, is_encrypted })
    }

    /// Whether nobody else can read what is sent.
    fn is_private(&self) -> bool {
        let is_loopback =
            |host: &str| host.parse().is_ok_and(|ip: std::net::IpAddr| ip.is_loopback());
        self.is_encrypted || self.host == "localhost" || is_loopback(&self.host)
    }

    fn url(&self, path: &str) -> String {
        let scheme = if self.is_encrypted { "wss" } else { "ws" };
        let brackets = if self.host.contains(':') { ["[", "]"] } else { [""; 2] };
        format!("{scheme}://{}{}{}:{}{path}", brackets[0], self.host, brackets[1], self.port)
    }
}

/// The request for the stream, with the token if given.
fn request(
    args: &ConnectArgs,
    service: &ServiceAddress,
    asset: &str,
    hz: f64,
) -> anyhow::Result<Request> {
    let url = service.url(&format!("/api/v1/assets/{asset}/stream?state={hz}"));
    let mut request = url.into_client_request()?;
    if let Some(file) = &args.token_file {
        if !service.is_private() {
            let reason = "the token would be sent unencrypted; use `--url https://…`";
            return Err(InputError::new("`--token-file`", reason).into());
        }
        let token = String::from_utf8(errors::read(file)?);
        let token = token.map_err(|error| InputError::file(file, error))?;
        let value = HeaderValue::from_str(&format!("Bearer {}", token.trim()));
        let mut value = value.map_err(|error| InputError::file(file, error))?;
        value.set_sensitive(true);
        request.headers_mut().insert(AUTHORIZATION, value);
    }
    Ok(request)
}

/// Trusts the authorities of the system, or only the one of `ca_file`.
fn tls(ca_file: Option<&Path>) -> anyhow::Result<ClientConfig> {
    let config = ClientConfig::builder_with_provider(ring::default_provider().into())
        .with_safe_default_protocol_versions()?;
    let Some(file) = ca_file else {
        return Ok(config.with_native_roots()?.with_no_client_auth());
    };
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_file_iter(file).map_err(|e| InputError::file(file, e))? {
        roots.add(certificate.map_err(|e| InputError::file(file, e))?)?;
    }
    Ok(config.with_root_certificates(roots).with_no_client_auth())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(address: &str, token_file: Option<PathBuf>) -> ConnectArgs {
        ConnectArgs { address: address.to_owned(), token_file, ca_file: None }
    }

    #[test]
    fn an_address_is_a_host_with_or_without_scheme_and_port() {
        let parsed =
            |text: &str| ServiceAddress::parse(text).map(|a| (a.url("/x"), a.is_private()));
        for (text, url, is_private) in [
            ("127.0.0.1:8087", "ws://127.0.0.1:8087/x", true),
            ("localhost:8087", "ws://localhost:8087/x", true),
            ("[::1]:8087", "ws://[::1]:8087/x", true),
            ("rig.example:8087", "ws://rig.example:8087/x", false),
            ("https://rig.example", "wss://rig.example:443/x", true),
            ("https://rig.example:8443/", "wss://rig.example:8443/x", true),
        ] {
            assert_eq!(parsed(text).unwrap(), (url.to_owned(), is_private), "{text}");
        }
        for text in ["ftp://a", "", "a b", "https://a/path", "http://"] {
            assert!(parsed(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_token_is_not_sent_unencrypted_to_another_machine() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "offbd_secret\n").unwrap();
        let sent = |address: &str| {
            let args = args(address, Some(file.path().to_owned()));
            let service = ServiceAddress::parse(address).unwrap();
            request(&args, &service, "a", 4.0).map(|r| r.headers()[AUTHORIZATION].clone())
        };
        for address in ["https://rig.example", "127.0.0.1:8087", "localhost:8087", "[::1]:1"] {
            assert_eq!(sent(address).unwrap(), "Bearer offbd_secret", "{address}");
        }
        for address in ["rig.example:8087", "http://10.0.0.1:8087", "localhost.example:80"] {
            let error = sent(address).unwrap_err().to_string();
            assert!(error.contains("unencrypted"), "{address}: {error}");
        }
    }
}
