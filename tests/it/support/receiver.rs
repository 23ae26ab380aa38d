//! Receivers of notifications: an HTTP server in the test's process, and foreign programs.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, OnceLock};

use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::task::JoinHandle;

use super::eventually;

/// How a receiver answers a request.
#[derive(Clone, Debug)]
pub enum Reply {
    Status(u16),
    /// 302 to this URL.
    Redirect(String),
    /// 503 with `Retry-After`, s.
    RetryAfter(u64),
    /// No answer at all.
    Hang,
}

/// A request as it arrived.
#[derive(Clone, Debug)]
pub struct Received {
    pub path: String,
    pub headers: HeaderMap,
    pub body: String,
}

impl Received {
    pub fn header(&self, name: &str) -> &str {
        self.headers[name].to_str().unwrap()
    }

    pub fn message(&self) -> Value {
        serde_json::from_str(&self.body).unwrap()
    }
}

/// An HTTP server that answers with the replies of a queue, and with 200 once it is empty.
pub struct WebhookReceiver {
    pub address: String,
    script: Arc<Script>,
    serving: JoinHandle<()>,
}

#[derive(Default)]
struct Script {
    replies: Mutex<VecDeque<Reply>>,
    received: Mutex<Vec<Received>>,
}

impl WebhookReceiver {
    pub async fn start(replies: &[Reply]) -> Self {
        Self::listen("127.0.0.1:0", replies).await
    }

    /// Listens on an address that was free a moment ago.
    pub async fn listen(address: &str, replies: &[Reply]) -> Self {
        let listener = TcpListener::bind(address).await.unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let script = Arc::new(Script {
            replies: Mutex::new(replies.to_vec().into()),
            received: Mutex::default(),
        });
        let router = Router::new().fallback(receive).with_state(script.clone());
        let serving = tokio::spawn(async move { axum::serve(listener, router).await.unwrap() });
        Self { address, script, serving }
    }

    pub fn url(&self) -> String {
        format!("http://{}/hook", self.address)
    }

    pub fn received(&self) -> Vec<Received> {
        self.script.received.lock().unwrap().clone()
    }

    /// Waits until there are at least `n` requests.
    pub async fn wait_for(&self, n: usize) -> Vec<Received> {
        eventually(async || Some(self.received()).filter(|received| received.len() >= n)).await
    }
}

impl Drop for WebhookReceiver {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

async fn receive(
    State(script): State<Arc<Script>>,
    uri: Uri,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    let body = String::from_utf8(body.to_vec()).unwrap();
    let received = Received { path: uri.path().to_owned(), headers, body };
    script.received.lock().unwrap().push(received);
    let reply = script.replies.lock().unwrap().pop_front().unwrap_or(Reply::Status(200));
    match reply {
        Reply::Status(status) => StatusCode::from_u16(status).unwrap().into_response(),
        Reply::Redirect(to) => (StatusCode::FOUND, [("location", to)]).into_response(),
        Reply::RetryAfter(s) => {
            (StatusCode::SERVICE_UNAVAILABLE, [("retry-after", s.to_string())]).into_response()
        }
        Reply::Hang => std::future::pending().await,
    }
}

/// The Python of the venv that `scripts/receivers` makes.
fn python() -> &'static str {
    static PYTHON: OnceLock<String> = OnceLock::new();
    PYTHON.get_or_init(|| {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/scripts/receivers");
        let output = Command::new(script).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    })
}

fn program(name: &str) -> String {
    format!("{}/tests/it/support/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Whether the reference implementation of Standard Webhooks accepts a request.
pub fn is_signed(received: &Received, secret: &str) -> bool {
    let names = ["webhook-id", "webhook-timestamp", "webhook-signature"];
    let headers: Value = names.iter().map(|name| (*name, received.header(name))).collect();
    let given = json!({ "secret": secret, "headers": headers, "body": received.body });
    let mut verifier = Command::new(python())
        .arg(program("verify_webhook.py"))
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    verifier.stdin.take().unwrap().write_all(given.to_string().as_bytes()).unwrap();
    let output = verifier.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() || stderr.contains("WebhookVerificationError"), "{stderr}");
    output.status.success()
}

/// A foreign mail server, as a process.
pub struct MailServer {
    child: Child,
    lines: BufReader<ChildStdout>,
    pub port: u16,
}

impl MailServer {
    pub fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(python())
            .arg(program("mail_server.py"))
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap());
        let mut port = String::new();
        lines.read_line(&mut port).unwrap();
        Self { child, lines, port: port.trim().parse().unwrap() }
    }

    /// Waits for the next mail.
    pub fn next(&mut self) -> Value {
        let mut line = String::new();
        self.lines.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap()
    }
}

impl Drop for MailServer {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
