//! Connections as they should not be, and encrypted ones, against a real server.

use std::path::PathBuf;
use std::process::{Command, Output};
use std::sync::Arc;

use crate::support::{Bench, DEADLINE, batch, eventually, rig};
use futures_util::{SinkExt, StreamExt};
use offbd::config::{Config, TlsConfig};
use reqwest::Method;
use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName, pem::PemObject};
use tokio_rustls::rustls::{ClientConfig, RootCertStore, crypto::ring};
use tokio_tungstenite::tungstenite::Message;

/// A connection to the server, without a client's manners.
struct Raw(TcpStream);

impl Raw {
    async fn new(bench: &Bench) -> Self {
        Self(TcpStream::connect(&bench.client.address).await.unwrap())
    }

    async fn send(&mut self, text: &str) -> &mut Self {
        self.0.write_all(text.as_bytes()).await.unwrap();
        self
    }

    /// What comes until `mark` has come, or the connection ends.
    async fn until(&mut self, mark: &str) -> String {
        let mut got = Vec::new();
        let read = async {
            while self.0.read_buf(&mut got).await.is_ok_and(|n| n > 0) {
                if String::from_utf8_lossy(&got).contains(mark) {
                    break;
                }
            }
        };
        tokio::time::timeout(DEADLINE, read).await.expect("the server ends it in time");
        String::from_utf8_lossy(&got).into_owned()
    }

    /// What comes until the server closes the connection.
    async fn rest(&mut self) -> String {
        self.until("\u{0}never").await
    }
}

const HEALTH: &str = "GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n";

#[tokio::test(flavor = "multi_thread")]
async fn a_head_that_never_ends_is_given_up() {
    let bench = Bench::start_with(|config| config.limits.header_timeout_s = 1).await;
    let mut slow = Raw::new(&bench).await;
    slow.send("GET /healthz HTTP/1.1\r\nhost: localhost\r\nx-slow: ").await;
    let answer = slow.rest().await;
    assert!(!answer.contains(" 200 "), "{answer}");
    let mut silent = Raw::new(&bench).await;
    assert_eq!(silent.rest().await, "");
    // Between two requests, too.
    let mut idle = Raw::new(&bench).await;
    assert!(idle.send(HEALTH).await.until("}").await.contains(" 200 OK"));
    assert_eq!(idle.rest().await, "");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_head_that_is_too_long_is_refused() {
    let bench = Bench::start().await;
    let long = "x".repeat(200 << 10);
    let many = (0..200).map(|i| format!("x-{i}: 1\r\n")).collect::<String>();
    for fields in [format!("x-long: {long}\r\n"), many] {
        let mut raw = Raw::new(&bench).await;
        let head = format!("GET /healthz HTTP/1.1\r\nhost: localhost\r\n{fields}\r\n");
        // The server may close before all is sent.
        let _ = raw.0.write_all(head.as_bytes()).await;
        let answer = raw.until("\r\n").await;
        assert!(answer.is_empty() || answer.contains(" 431 "), "{answer}");
    }
    bench.client.get("/healthz").await.expect(200);
}

/// A server with room for one connection, and one that takes it up with half a
/// request.
async fn taken(change: impl FnOnce(&mut Config)) -> (Bench, Raw) {
    let bench = Bench::start_with(|config| {
        config.limits.connections = 1;
        change(config);
    })
    .await;
    let mut raw = Raw::new(&bench).await;
    let head = "POST /api/v1/assets HTTP/1.1\r\nhost: localhost\r\ncontent-length: 100\r\n\
        expect: 100-continue\r\n\r\n";
    // That it is to continue says that the request is under way.
    assert!(raw.send(head).await.until("\r\n\r\n").await.contains(" 100 "));
    raw.send("{\"name\":").await;
    (bench, raw)
}

/// Waits until the one place is free.
async fn free(bench: &Bench) {
    let asked = || async {
        let mut raw = Raw::new(bench).await;
        let sent = raw.0.write_all(HEALTH.as_bytes()).await;
        let answer = if sent.is_ok() { raw.until("}").await } else { String::new() };
        answer.contains(" 200 OK").then_some(())
    };
    eventually(asked).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn one_connection_too_many_is_closed_at_once() {
    let (bench, raw) = taken(|_| {}).await;
    let mut refused = Raw::new(&bench).await;
    assert_eq!(refused.rest().await, "");
    drop(raw);
    free(&bench).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn one_address_has_its_share_of_the_connections() {
    let (bench, raw) = taken(|config| {
        config.limits.connections = 100;
        config.limits.connections_per_address = 1;
    })
    .await;
    assert_eq!(Raw::new(&bench).await.rest().await, "");
    drop(raw);
    free(&bench).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_half_closed_connection_holds_nothing() {
    let (bench, mut raw) = taken(|_| {}).await;
    raw.0.shutdown().await.unwrap();
    free(&bench).await;
    let list = || async { bench.client.request(Method::GET, "assets").send().await.ok() };
    let list = eventually(list).await.json::<Value>().await.unwrap();
    assert_eq!(list["items"], Value::Array(vec![]), "half a request does nothing");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_websocket_holds_its_place() {
    let bench = Bench::start_with(|config| config.limits.connections = 2).await;
    bench.client.asset("a").await;
    let url = format!("ws://{}/api/v1/assets/a/stream", bench.client.address);
    let (mut socket, _) = tokio_tungstenite::connect_async(url).await.unwrap();
    // The client's own connection is the other.
    bench.client.get("/healthz").await.expect(200);
    assert_eq!(Raw::new(&bench).await.rest().await, "");
    socket.close(None).await.unwrap();
    while socket.next().await.is_some_and(|frame| frame.is_ok()) {}
    free(&bench).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_reads_nothing_is_cut_off() {
    let bench = Bench::start_with(|config| {
        config.limits.connections = 1;
        config.limits.write_timeout_s = 1;
    })
    .await;
    let mut deaf = Raw::new(&bench).await;
    // More than the buffers between hold: some 150 kB each.
    let ask = "GET /openapi.json HTTP/1.1\r\nhost: localhost\r\n\r\n".repeat(400);
    deaf.send(&ask).await;
    free(&bench).await;
}

/// A certificate for this machine in `directory`, and the files of it.
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

/// Runs curl.
async fn curl(arguments: Vec<String>) -> Output {
    let run = move || {
        Command::new("curl").args(["--silent", "--max-time", "60"]).args(arguments).output()
    };
    tokio::task::spawn_blocking(run).await.unwrap().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn validate_curl_and_a_websocket_come_in_encrypted() {
    let directory = tempfile::tempdir().unwrap();
    let files = certificate(directory.path());
    let bench = Bench::start_with(|config| {
        config.tls = Some(files.clone());
        config.limits.header_timeout_s = 1;
    })
    .await;
    let address = bench.client.address.clone();
    let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let trusted = format!("--cacert {}", files.certificate.display());
    let health = curl(words(&format!("{trusted} https://{address}/healthz"))).await;
    assert!(String::from_utf8_lossy(&health.stdout).contains("\"ok\""), "{health:?}");
    let asset = format!("{trusted} --json {{\"name\":\"a\"}} https://{address}/api/v1/assets");
    let made = curl(words(&asset)).await;
    assert!(String::from_utf8_lossy(&made.stdout).contains("\"name\":\"a\""), "{made:?}");
    // 60: not trusted, 35: no encryption that both know.
    let strange = curl(words(&format!("https://{address}/healthz"))).await;
    assert_eq!(strange.status.code(), Some(60), "{strange:?}");
    let old = curl(words(&format!("{trusted} --tls-max 1.1 https://{address}/healthz"))).await;
    assert_eq!(old.status.code(), Some(35), "{old:?}");
    let plain = curl(words(&format!("http://{address}/healthz"))).await;
    assert!(!plain.status.success(), "{plain:?}");
    // Whoever begins no encryption is not waited for.
    assert_eq!(Raw::new(&bench).await.rest().await, "");

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
