//! A proxy that answers requests itself, like a captive portal, until it passes them on, or that
//! holds some of them.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::header::{CONTENT_TYPE, HeaderMap};
use axum::http::{Method, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use tokio::net::TcpListener;
use tokio::sync::watch;

use super::eventually;

/// Status, media type and body of an answer that is not the service's.
pub type Lie = (u16, &'static str, String);

pub struct LyingProxy {
    pub url: String,
    lies: Arc<Lies>,
}

struct Lies {
    service: String,
    /// The answer to all requests; `None` passes them on.
    lie: Mutex<Option<Lie>>,
    n_told: AtomicUsize,
    n_passed: AtomicUsize,
    /// The part of a path whose requests wait until it is another one.
    held: watch::Sender<Option<&'static str>>,
    n_held: AtomicUsize,
    client: reqwest::Client,
}

impl LyingProxy {
    /// Starts a proxy to the service at `address`, which passes everything on.
    pub async fn start(address: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let lies = Arc::new(Lies {
            service: format!("http://{address}"),
            lie: Mutex::default(),
            n_told: AtomicUsize::default(),
            n_passed: AtomicUsize::default(),
            held: watch::Sender::default(),
            n_held: AtomicUsize::default(),
            client: reqwest::Client::new(),
        });
        let router = Router::new().fallback(answer).with_state(lies.clone());
        tokio::spawn(async move { axum::serve(listener, router).await.unwrap() });
        Self { url, lies }
    }

    /// Answers all requests with `lie` from now on, or passes them on.
    pub fn tell(&self, lie: Option<Lie>) {
        *self.lies.lie.lock().unwrap() = lie;
    }

    /// Waits until it has lied `n` times more.
    pub async fn has_told(&self, n: usize) {
        let n_told = || self.lies.n_told.load(Ordering::Relaxed);
        let before = n_told();
        eventually(async || (n_told() >= before + n).then_some(())).await;
    }

    /// Holds requests to paths with `part` from now on, or none; those that it holds go on then.
    pub fn hold(&self, part: Option<&'static str>) {
        self.lies.held.send_replace(part);
    }

    /// Number of requests that it held.
    pub fn n_held(&self) -> usize {
        self.lies.n_held.load(Ordering::Relaxed)
    }

    /// Number of requests that were passed on.
    pub fn n_passed(&self) -> usize {
        self.lies.n_passed.load(Ordering::Relaxed)
    }
}

async fn answer(
    State(lies): State<Arc<Lies>>,
    method: Method,
    uri: Uri,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    let lie = lies.lie.lock().unwrap().clone();
    if let Some((status, kind, body)) = lie {
        lies.n_told.fetch_add(1, Ordering::Relaxed);
        let status = StatusCode::from_u16(status).unwrap();
        return (status, [(CONTENT_TYPE, kind)], body).into_response();
    }
    let is_held = |held: &Option<&str>| held.is_some_and(|part| uri.path().contains(part));
    if is_held(&lies.held.borrow()) {
        lies.n_held.fetch_add(1, Ordering::Relaxed);
        lies.held.subscribe().wait_for(|held| !is_held(held)).await.unwrap();
    }
    lies.n_passed.fetch_add(1, Ordering::Relaxed);
    let request = lies.client.request(method, format!("{}{uri}", lies.service));
    let kind = headers[CONTENT_TYPE].clone();
    let answer = request.header(CONTENT_TYPE, kind).body(body).send().await.unwrap();
    let (status, kind) = (answer.status(), answer.headers()[CONTENT_TYPE].clone());
    (status, [(CONTENT_TYPE, kind)], answer.bytes().await.unwrap()).into_response()
}
