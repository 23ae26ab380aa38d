//! Misbehaving and encrypted connections to a real service.

use std::path::PathBuf;
use std::process::{Command, Output};
use std::sync::Arc;

use crate::support::{DEADLINE, ServiceFixture, batch, eventually, rig};
use futures_util::{SinkExt, StreamExt};
use offbd::config::{Config, TlsConfig};
use reqwest::Method;
use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName, pem::PemObject};
use tokio_rustls::rustls::{ClientConfig, RootCertStore, crypto::ring};
use tokio_tungstenite::tungstenite::Message;

/// A TCP connection to the service, on which a test can send anything.
struct RawConnection(TcpStream);

impl RawConnection {
    async fn new(fixture: &ServiceFixture) -> Self {
        Self(TcpStream::connect(&fixture.client.address).await.unwrap())
    }

    async fn send(&mut self, text: &str) -> &mut Self {
        self.0.write_all(text.as_bytes()).await.unwrap();
        self
    }

    /// Reads until `mark` has been received or the connection ends.
    async fn read_until(&mut self, mark: &str) -> String {
        let mut got = Vec::new();
        let read = async {
            while self.0.read_buf(&mut got).await.is_ok_and(|n| n > 0) {
                if String::from_utf8_lossy(&got).contains(mark) {
                    break;
                }
            }
        };
        tokio::time::timeout(DEADLINE, read)
            .await
            .expect("the service responds within the deadline");
        String::from_utf8_lossy(&got).into_owned()
    }

    /// Reads until the service closes the connection.
    async fn read_to_end(&mut self) -> String {
        self.read_until("\u{0}never").await
    }
}

const HEALTH: &str = "GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n";

#[tokio::test(flavor = "multi_thread")]
async fn an_incomplete_request_head_times_out() {
    let fixture = ServiceFixture::start_with(|config| config.limits.header_timeout_s = 1).await;
    let mut slow = RawConnection::new(&fixture).await;
    slow.send("GET /healthz HTTP/1.1\r\nhost: localhost\r\nx-slow: ").await;
    let answer = slow.read_to_end().await;
    assert!(!answer.contains(" 200 "), "{answer}");
    let mut silent = RawConnection::new(&fixture).await;
    assert_eq!(silent.read_to_end().await, "");
    // Also between two requests.
    let mut idle = RawConnection::new(&fixture).await;
    assert!(idle.send(HEALTH).await.read_until("}").await.contains(" 200 OK"));
    assert_eq!(idle.read_to_end().await, "");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_head_that_is_too_long_gets_431() {
    let fixture = ServiceFixture::start().await;
    let long = "x".repeat(200 << 10);
    let many = (0..200).map(|i| format!("x-{i}: 1\r\n")).collect::<String>();
    for fields in [format!("x-long: {long}\r\n"), many] {
        let mut raw = RawConnection::new(&fixture).await;
        let head = format!("GET /healthz HTTP/1.1\r\nhost: localhost\r\n{fields}\r\n");
        // The service may close the connection before everything is sent.
        let _ = raw.0.write_all(head.as_bytes()).await;
        let answer = raw.read_until("\r\n").await;
        assert!(answer.is_empty() || answer.contains(" 431 "), "{answer}");
    }
    fixture.client.get("/healthz").await.expect(200);
}

/// Starts a service that allows one connection, and opens a connection with an incomplete
/// request.
async fn service_with_open_connection(
    change: impl FnOnce(&mut Config),
) -> (ServiceFixture, RawConnection) {
    let fixture = ServiceFixture::start_with(|config| {
        config.limits.connections = 1;
        change(config);
    })
    .await;
    let mut raw = RawConnection::new(&fixture).await;
    let head = "POST /api/v1/assets HTTP/1.1\r\nhost: localhost\r\ncontent-length: 100\r\n\
        expect: 100-continue\r\n\r\n";
    // The response 100 shows that the service handles the request.
    assert!(raw.send(head).await.read_until("\r\n\r\n").await.contains(" 100 "));
    raw.send("{\"name\":").await;
    (fixture, raw)
}

/// Waits until the service accepts a new connection.
async fn wait_until_accepted(fixture: &ServiceFixture) {
    let asked = || async {
        let mut raw = RawConnection::new(fixture).await;
        let sent = raw.0.write_all(HEALTH.as_bytes()).await;
        let answer = if sent.is_ok() { raw.read_until("}").await } else { String::new() };
        answer.contains(" 200 OK").then_some(())
    };
    eventually(asked).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_above_the_limit_is_closed_at_once() {
    let (fixture, raw) = service_with_open_connection(|_| {}).await;
    let mut refused = RawConnection::new(&fixture).await;
    assert_eq!(refused.read_to_end().await, "");
    drop(raw);
    wait_until_accepted(&fixture).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn connections_per_address_are_limited() {
    let (fixture, raw) = service_with_open_connection(|config| {
        config.limits.connections = 100;
        config.limits.connections_per_address = 1;
    })
    .await;
    assert_eq!(RawConnection::new(&fixture).await.read_to_end().await, "");
    drop(raw);
    wait_until_accepted(&fixture).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_half_closed_connection_is_released() {
    let (fixture, mut raw) = service_with_open_connection(|_| {}).await;
    raw.0.shutdown().await.unwrap();
    wait_until_accepted(&fixture).await;
    let list = || async { fixture.client.request(Method::GET, "assets").send().await.ok() };
    let list = eventually(list).await.json::<Value>().await.unwrap();
    assert_eq!(list["items"], Value::Array(vec![]), "an incomplete request changes nothing");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_open_websocket_counts_as_a_connection() {
    let fixture = ServiceFixture::start_with(|config| config.limits.connections = 2).await;
    fixture.client.asset("a").await;
    let url = format!("ws://{}/api/v1/assets/a/stream", fixture.client.address);
    let (mut socket, _) = tokio_tungstenite::connect_async(url).await.unwrap();
    // The connection of `client` is the second one.
    fixture.client.get("/healthz").await.expect(200);
    assert_eq!(RawConnection::new(&fixture).await.read_to_end().await, "");
    socket.close(None).await.unwrap();
    while socket.next().await.is_some_and(|frame| frame.is_ok()) {}
    wait_until_accepted(&fixture).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_does_not_read_is_disconnected() {
    let fixture = ServiceFixture::start_with(|config| {
        config.limits.connections = 1;
        config.limits.write_timeout_s = 1;
    })
    .await;
    let mut silent = RawConnection::new(&fixture).await;
    // The responses of about 150 kB each exceed all buffers.
    let requests = "GET /openapi.json HTTP/1.1\r\nhost: localhost\r\n\r\n".repeat(400);
    silent.send(&requests).await;
    wait_until_accepted(&fixture).await;
}

/// Writes a self-signed certificate for this machine to `directory`.
fn certificate(directory: &std::path::Path) -> TlsConfig {
    let names = ["localhost".to_owned(), "127.0.0.1".to_owned()];
    let made = rcgen::generate_simple_self_signed(names).unwrap();
    let file = |name: &str, text: String| -> PathBuf {
        let path = directory.join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    TlsConfig {
        certificate: file("certificate.pem", made.cert.pem()),
        key: file("key.pem", made.signing_key.serialize_pem()),
    }
}

/// Runs `offbd` with these arguments.
async fn offbd(arguments: Vec<String>) -> Output {
    let run = move || Command::new(env!("CARGO_BIN_EXE_offbd")).args(arguments).output();
    tokio::task::spawn_blocking(run).await.unwrap().unwrap()
}

/// Runs curl.
async fn curl(arguments: Vec<String>) -> Output {
    let run = move || {
        Command::new("curl").args(["--silent", "--max-time", "60"]).args(arguments).output()
    };
    tokio::task::spawn_blocking(run).await.unwrap().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn validate_curl_and_a_websocket_client_connect_over_tls() {
    let directory = tempfile::tempdir().unwrap();
    let files = certificate(directory.path());
    let fixture = ServiceFixture::start_with(|config| {
        config.tls = Some(files.clone());
        config.limits.header_timeout_s = 1;
    })
    .await;
    let address = fixture.client.address.clone();
    let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let trusted = format!("--cacert {}", files.certificate.display());
    let health = curl(words(&format!("{trusted} https://{address}/healthz"))).await;
    assert!(String::from_utf8_lossy(&health.stdout).contains("\"ok\""), "{health:?}");
    let headers = curl(words(&format!("{trusted} -i https://{address}/healthz"))).await;
    let headers = String::from_utf8_lossy(&headers.stdout).to_lowercase();
    assert!(headers.contains("strict-transport-security: max-age="), "{headers}");
    let asset = format!("{trusted} --json {{\"name\":\"a\"}} https://{address}/api/v1/assets");
    let made = curl(words(&asset)).await;
    assert!(String::from_utf8_lossy(&made.stdout).contains("\"name\":\"a\""), "{made:?}");
    // 60: not trusted; 35: no common TLS version.
    let untrusted = curl(words(&format!("https://{address}/healthz"))).await;
    assert_eq!(untrusted.status.code(), Some(60), "{untrusted:?}");
    let old = curl(words(&format!("{trusted} --tls-max 1.1 https://{address}/healthz"))).await;
    assert_eq!(old.status.code(), Some(35), "{old:?}");
    let plain = curl(words(&format!("http://{address}/healthz"))).await;
    assert!(!plain.status.success(), "{plain:?}");
    // A connection without a TLS handshake times out.
    assert_eq!(RawConnection::new(&fixture).await.read_to_end().await, "");

    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_file(&files.certificate).unwrap()).unwrap();
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let config = config.with_safe_default_protocol_versions().unwrap();
    let config = config.with_root_certificates(roots).with_no_client_auth();
    let connector = tokio_rustls::TlsConnector::from(Arc::new(config));
    let name = ServerName::try_from("127.0.0.1").unwrap();
    let stream = TcpStream::connect(&address).await.unwrap();
    let stream = connector.connect(name, stream).await.unwrap();
    let url = format!("wss://{address}/api/v1/assets/a/stream");
    let (mut socket, _) = tokio_tungstenite::client_async(url, stream).await.unwrap();
    let sent = batch(None, &rig(10, usize::MAX)).to_string();
    socket.send(Message::text(sent)).await.unwrap();
    let answer = tokio::time::timeout(DEADLINE, socket.next()).await.unwrap().unwrap().unwrap();
    let answer: Value = serde_json::from_str(answer.to_text().unwrap()).unwrap();
    assert_eq!(answer["accepted"], 10, "{answer}");
}

#[tokio::test(flavor = "multi_thread")]
async fn check_asks_the_service_whether_it_is_ready() {
    let directory = tempfile::tempdir().unwrap();
    let files = certificate(directory.path());
    let config = directory.path().join("offbd.toml");
    let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    for tls in [None, Some(files)] {
        let mut fixture = ServiceFixture::start_with(|config| config.tls = tls.clone()).await;
        let mut text = format!("listen = \"{}\"\n", fixture.client.address);
        if let Some(TlsConfig { certificate, key }) = &tls {
            text += &format!("[tls]\ncertificate = {certificate:?}\nkey = {key:?}\n");
        }
        std::fs::write(&config, text).unwrap();
        let line = format!("check --health --config {}", config.display());
        let done = offbd(words(&line)).await;
        assert!(done.status.success() && done.stdout.is_empty(), "{done:?}");
        // Over TLS or not, as the configuration says.
        if tls.is_some() {
            let other = format!("check --health --listen {}", fixture.client.address);
            assert_eq!(offbd(words(&other)).await.status.code(), Some(1));
        }
        fixture.server.take().unwrap().shutdown().await.unwrap();
        let done = offbd(words(&line)).await;
        assert_eq!(done.status.code(), Some(1), "{done:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn watch_connects_over_tls_if_the_certificate_is_trusted() {
    let directory = tempfile::tempdir().unwrap();
    let files = certificate(directory.path());
    let fixture = ServiceFixture::start_with(|config| config.tls = Some(files.clone())).await;
    let address = fixture.client.address.clone();
    let asset = format!("--cacert {} --json {{\"name\":\"a\"}}", files.certificate.display());
    let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    curl(words(&format!("{asset} https://{address}/api/v1/assets"))).await;
    let watch = format!("watch a --states 1 --address https://{address}");
    let ca_file = files.certificate.display();
    let done = offbd(words(&format!("{watch} --ca-file {ca_file}"))).await;
    assert!(String::from_utf8_lossy(&done.stdout).starts_with("a, no session\n"), "{done:?}");
    let json = offbd(words(&format!("{watch} --ca-file {ca_file} --format json"))).await;
    let state: Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!((&state["type"], &state["asset"]), (&"state".into(), &"a".into()));
    let other = format!("watch nobody --ca-file {ca_file} --address https://{address}");
    let done = offbd(words(&other)).await;
    let stderr = String::from_utf8_lossy(&done.stderr);
    assert!(stderr.contains("has no asset `nobody`"), "{stderr}");
    let done = offbd(words(&watch)).await;
    let stderr = String::from_utf8_lossy(&done.stderr);
    assert!(!done.status.success() && stderr.contains("certificate"), "{stderr}");
}
