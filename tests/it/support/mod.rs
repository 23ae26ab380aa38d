//! A service in the test's process, a client for it, and samples of a small simulated rig.

#![allow(dead_code, reason = "each test uses a part")]

#[cfg(all(feature = "nats", feature = "mqtt"))]
pub mod broker;
#[cfg(all(feature = "nats", feature = "mqtt"))]
pub mod bus_device;
#[cfg(unix)]
pub mod calls;
pub mod cluster;
pub mod deletions;
pub mod described;
pub mod described_answers;
pub mod device;
pub mod fenced;
pub mod held_socket;
pub mod history;
pub mod liar;
pub mod link;
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub mod packets;
pub mod postgres;
pub mod process;
pub mod provider;
pub mod proxy;
pub mod receiver;
pub mod statement_gate;
pub mod web_socket;
#[cfg(feature = "xlsx")]
pub mod workbook;

use std::future::Future;
use std::panic::Location;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use futures_util::StreamExt;
use offbd::config::Config;
use offbd::server::{self, Server};
use offbd::wire::asset::view;
use offbd_core::diagnosis::{Calibration, CalibrationOrigin};
use offbd_core::engine::{Engine, Input, Rig, Setup, calibrate};
use offbd_core::vocabulary::Sample;
use reqwest::header::CONTENT_TYPE;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use sqlx::{AssertSqlSafe, ConnectOptions, Executor};
use sse_stream::{Sse, SseStream};

/// Longest time to wait for anything; far more than is needed, also by a thread of the lowest
/// priority beside other tests.
pub const DEADLINE: Duration = Duration::from_secs(180);

/// Returns the operations manual: all pages in `docs/operations/`, one after the other.
pub fn manual() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/operations");
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let is_page = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "md");
    let pages = paths.filter(is_page).map(|page| std::fs::read_to_string(page).unwrap());
    pages.collect()
}

/// A service with its own data directory.
pub struct ServiceFixture {
    pub server: Option<Server>,
    pub client: Client,
    pub data: tempfile::TempDir,
    pub config: Config,
}

/// Returns whether services under test use PostgreSQL: `TEST_DATABASE=postgres`.
pub fn on_postgres() -> bool {
    match std::env::var("TEST_DATABASE") {
        Ok(database) if database == "postgres" => true,
        Ok(database) if database == "sqlite" => false,
        Err(std::env::VarError::NotPresent) => false,
        other => panic!("TEST_DATABASE is sqlite or postgres, not {other:?}"),
    }
}

/// Returns a configuration that uses `data`, or the PostgreSQL database of its name, and any
/// free port.
pub fn config(data: &Path) -> Config {
    let mut config = Config { data: data.to_owned(), ..Config::default() };
    if on_postgres() {
        let name = data.file_name().unwrap().to_str().unwrap();
        config.database = Some(postgres::shared_database(name));
    }
    config.listen.set_port(0);
    config.workers.shards = 2;
    config
}

/// Returns the URL of the store of `data`.
pub fn url(data: &Path) -> String {
    let file = || format!("sqlite://{}/offbd.sqlite", data.display());
    config(data).database.unwrap_or_else(file)
}

/// Opens a connection to the store at `url`.
pub async fn connection(url: &str) -> sqlx::AnyConnection {
    try_connection(url).await.unwrap()
}

/// Like [`connection`], for a database server that may be unavailable.
pub async fn try_connection(url: &str) -> sqlx::Result<sqlx::AnyConnection> {
    offbd::store::install_drivers().unwrap();
    url.parse::<sqlx::any::AnyConnectOptions>().unwrap().connect().await
}

/// Returns the content of the store of `data` as bytes to search in: its files, or its rows
/// as text.
pub async fn stored(data: &Path) -> Vec<u8> {
    if !on_postgres() {
        let files = std::fs::read_dir(data).unwrap().map(|file| file.unwrap().path());
        return files.flat_map(|file| std::fs::read(file).unwrap()).collect();
    }
    let mut store = connection(&url(data)).await;
    let tables = "SELECT tablename::text FROM pg_tables WHERE schemaname = 'public'";
    let tables: Vec<String> = sqlx::query_scalar(tables).fetch_all(&mut store).await.unwrap();
    let mut rows = Vec::new();
    for table in tables {
        let all = AssertSqlSafe(format!("SELECT row::text FROM {table} row"));
        let of_table: Vec<String> = sqlx::query_scalar(all).fetch_all(&mut store).await.unwrap();
        rows.extend(of_table.concat().into_bytes());
    }
    rows
}

impl ServiceFixture {
    pub async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    pub async fn start_with(change: impl FnOnce(&mut Config)) -> Self {
        let data = tempfile::tempdir().unwrap();
        let mut config = config(data.path());
        change(&mut config);
        // With all its causes in one line.
        let started = server::start(config.clone()).await;
        let server = started.unwrap_or_else(|error| panic!("{error:#}"));
        let client = Client::new(server.address.to_string());
        Self { server: Some(server), client, data, config }
    }

    /// Opens a connection to the service's store.
    pub async fn store(&self) -> sqlx::AnyConnection {
        connection(&url(self.data.path())).await
    }

    /// Locks the store against writes until the lock is released or dropped.
    pub async fn lock_store(&self) -> StoreLock {
        let mut store = self.store().await;
        let words =
            if on_postgres() { "BEGIN; LOCK TABLE counter, partition" } else { "BEGIN IMMEDIATE" };
        store.execute(words).await.unwrap();
        StoreLock { store }
    }

    /// Shuts the service down and starts it again with the same data and configuration.
    pub async fn restart(&mut self) {
        self.server.take().unwrap().shutdown().await.unwrap();
        let server = server::start(self.config.clone()).await.unwrap();
        self.client = Client::new(server.address.to_string());
        self.server = Some(server);
    }
}

/// A lock of the store, see [`ServiceFixture::lock_store`].
pub struct StoreLock {
    store: sqlx::AnyConnection,
}

impl StoreLock {
    pub async fn release(mut self) {
        self.store.execute("ROLLBACK").await.unwrap();
    }
}

/// A client of the API.
#[derive(Clone)]
pub struct Client {
    pub address: String,
    /// Bearer token sent with every request.
    pub token: Option<String>,
    http: reqwest::Client,
}

/// A response.
#[derive(Debug)]
pub struct Answer {
    pub status: StatusCode,
    pub headers: reqwest::header::HeaderMap,
    pub text: String,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.text).unwrap_or_else(|e| panic!("{e}: {}", self.text))
    }

    /// Returns the JSON of a response that must have `status`.
    #[track_caller]
    pub fn expect(&self, status: u16) -> Value {
        assert_eq!(self.status.as_u16(), status, "{}", self.text);
        if self.text.is_empty() { Value::Null } else { self.json() }
    }

    /// Returns the problem of a response that must have `status`.
    #[track_caller]
    pub fn problem(&self, status: u16) -> Value {
        let problem = self.expect(status);
        assert_eq!(self.headers[CONTENT_TYPE], "application/problem+json");
        assert_eq!(problem["status"], status);
        for field in ["type", "title", "detail", "instance"] {
            assert!(problem[field].is_string(), "{field}: {problem}");
        }
        problem
    }
}

impl Client {
    /// Waits until `/readyz` has `status`; returns its reason.
    pub async fn readiness(&self, status: u16) -> String {
        let detail = |answer: Answer| answer.json()["detail"].as_str().unwrap_or("").to_owned();
        eventually(|| async {
            let answer = self.get("/readyz").await;
            (answer.status == status).then(|| detail(answer))
        })
        .await
    }

    /// The value of the metric without labels that has this name.
    pub async fn metric(&self, name: &str) -> f64 {
        let metrics = self.get("/metrics").await.text;
        let value = |line: &str| line.strip_prefix(name)?.strip_prefix(' ')?.parse().ok();
        metrics.lines().find_map(value).unwrap()
    }

    /// The resident memory of the process, bytes.
    pub async fn resident_bytes(&self) -> f64 {
        self.metric("process_resident_memory_bytes").await
    }

    /// The number of samples that the service has evaluated again to load its assets.
    pub async fn n_evaluated_again(&self) -> f64 {
        let text = self.get("/metrics").await.text;
        let line = text.lines().find(|line| line.starts_with("offbd_samples_reevaluated_total"));
        line.map_or(0.0, |line| line.rsplit(' ').next().unwrap().parse().unwrap())
    }

    /// The number of engines in memory.
    pub async fn n_engines(&self) -> f64 {
        let text = self.get("/metrics").await.text;
        let of_shard = |line: &str| {
            let number = line.strip_prefix("offbd_engines{")?.split(' ').nth(1)?;
            Some(number.parse::<f64>().unwrap())
        };
        text.lines().filter_map(of_shard).sum()
    }

    /// Loads the engine of an asset by a batch without samples, since no question does.
    pub async fn load(&self, asset: &str) {
        assert_eq!(self.telemetry(asset, None, &[]).await["accepted"], 0);
    }

    pub fn new(address: String) -> Self {
        Self { address, token: None, http: reqwest::Client::new() }
    }

    /// Returns a client with a token.
    pub fn with(&self, token: &str) -> Self {
        Self { token: Some(token.to_owned()), ..self.clone() }
    }

    pub fn url(&self, path: &str) -> String {
        let base = if path.starts_with('/') { "" } else { "/api/v1/" };
        format!("http://{}{base}{path}", self.address)
    }

    pub fn request(&self, method: Method, path: &str) -> reqwest::RequestBuilder {
        let request = self.http.request(method, self.url(path));
        match &self.token {
            Some(token) => request.bearer_auth(token),
            None => request,
        }
    }

    /// Sends a request; the response must be as described.
    pub async fn send(&self, request: reqwest::RequestBuilder) -> Answer {
        let request = request.build().unwrap();
        let (method, path) = (request.method().clone(), request.url().path().to_owned());
        let response = self.http.execute(request).await.unwrap();
        let (status, headers) = (response.status(), response.headers().clone());
        let answer = Answer { status, headers, text: response.text().await.unwrap() };
        described_answers::check(&method, &path, &answer);
        answer
    }

    pub async fn get(&self, path: &str) -> Answer {
        self.send(self.request(Method::GET, path)).await
    }

    pub async fn delete(&self, path: &str) -> Answer {
        self.send(self.request(Method::DELETE, path)).await
    }

    pub async fn post(&self, path: &str, body: &Value) -> Answer {
        self.send(self.request(Method::POST, path).json(body)).await
    }

    pub async fn put(&self, path: &str, body: &Value) -> Answer {
        self.send(self.request(Method::PUT, path).json(body)).await
    }

    pub async fn post_text(&self, path: &str, kind: &str, body: impl Into<String>) -> Answer {
        let request = self.request(Method::POST, path).header(CONTENT_TYPE, kind);
        self.send(request.body(body.into())).await
    }

    /// Posts `body` as MessagePack.
    pub async fn post_packed(&self, path: &str, body: &Value) -> Answer {
        let request = self.request(Method::POST, path).header(CONTENT_TYPE, "application/msgpack");
        self.send(request.body(packed(body))).await
    }

    pub async fn asset(&self, name: &str) {
        self.post("assets", &registration(name)).await.expect(201);
    }

    /// Sends a batch that must be accepted.
    pub async fn telemetry(&self, asset: &str, session: Option<&str>, samples: &[Sample]) -> Value {
        let body = batch(session, samples);
        self.post(&format!("assets/{asset}/telemetry"), &body).await.expect(200)
    }

    /// Returns the asset's session of this name.
    pub async fn session(&self, asset: &str, name: &str) -> Value {
        let page = self.get(&format!("sessions?asset={asset}&limit=500")).await.expect(200);
        let items = page["items"].as_array().unwrap();
        items.iter().find(|s| s["name"] == name).unwrap_or_else(|| panic!("{page}")).clone()
    }

    /// Ends the session of this name and returns it.
    pub async fn end(&self, asset: &str, name: &str) -> Value {
        let session = self.session(asset, name).await;
        let id = session["id"].as_str().unwrap();
        self.post(&format!("sessions/{id}/end"), &Value::Null).await.expect(200)
    }

    /// Returns the recording of the session of this name.
    pub async fn recording(&self, asset: &str, name: &str) -> Vec<Sample> {
        let session = self.session(asset, name).await;
        let id = session["id"].as_str().unwrap();
        let csv = self.get(&format!("sessions/{id}/telemetry")).await;
        assert_eq!(csv.status, 200);
        read_csv(&csv.text)
    }
}

/// Parses a session file.
pub fn read_csv(text: &str) -> Vec<Sample> {
    let reader =
        offbd::wire::table::TableReader::batch(text.as_bytes(), &Default::default()).unwrap();
    reader.map(Result::unwrap).collect()
}

/// Returns a batch as JSON rows.
pub fn batch(session: Option<&str>, samples: &[Sample]) -> Value {
    let rows: Vec<_> = samples.iter().map(offbd::wire::telemetry::sample_view).collect();
    json!({ "session": session, "samples": rows })
}

/// Returns a batch as JSON columns.
pub fn columns(session: &str, samples: &[Sample]) -> Value {
    let column = |value: fn(&Sample) -> Value| samples.iter().map(value).collect::<Value>();
    json!({
        "session": session,
        "seq": column(|s| json!(s.seq)),
        "t_s": column(|s| json!(s.t_s)),
        "cmd_qx_rad": column(|s| json!(s.cmd_qx_rad)),
        "cmd_qy_rad": column(|s| json!(s.cmd_qy_rad)),
        "x_m": column(|s| json!(s.x_m)),
        "y_m": column(|s| json!(s.y_m)),
    })
}

/// Returns a document as MessagePack.
pub fn packed(document: &Value) -> Vec<u8> {
    rmp_serde::to_vec_named(document).unwrap()
}

/// Returns samples as a session file.
pub fn csv(samples: &[Sample]) -> String {
    let mut text = Vec::new();
    offbd::wire::session_csv::write(&mut text, samples).unwrap();
    String::from_utf8(text).unwrap()
}

/// A simulated servo with a dead time of 40 ms and a lag of 60 ms, at 100 Hz.
struct SimulatedServo {
    waiting: [f64; 4],
    angle: f64,
    dead: bool,
}

impl SimulatedServo {
    fn turn(&mut self, command: f64) -> f64 {
        self.waiting.rotate_left(1);
        let due = std::mem::replace(&mut self.waiting[3], command);
        if !self.dead {
            self.angle += (due - self.angle) * 0.01 / 0.06;
        }
        self.angle
    }
}

/// Returns `n` samples at 100 Hz of a ball that follows a circle; the x servo is dead from
/// sample `dead_from` on.
pub fn rig(n: usize, dead_from: usize) -> Vec<Sample> {
    const STEP: f64 = 0.01;
    let servo = || SimulatedServo { waiting: [0.0; 4], angle: 0.0, dead: false };
    let (mut servos, mut at, mut v) = ([servo(), servo()], [0.0f64; 2], [0.0f64; 2]);
    let mut noise = 1u64;
    let mut samples = Vec::new();
    for i in 0..n {
        let t = i as f64 * STEP;
        servos[0].dead = i >= dead_from;
        let wanted = [0.05 * (1.3 * t).sin(), 0.05 * (0.9 * t).cos()];
        let mut command = [0.0; 2];
        for axis in 0..2 {
            command[axis] = (1.2 * (wanted[axis] - at[axis]) - 0.7 * v[axis]).clamp(-0.15, 0.15);
            v[axis] += 5.0 / 7.0 * 9.81 * servos[axis].turn(command[axis]).sin() * STEP;
            at[axis] = (at[axis] + v[axis] * STEP).clamp(-0.11, 0.11);
        }
        let mut reading = |x: f64| {
            noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            Some(x + ((noise >> 40) as f64 / f64::from(1u32 << 24) - 0.5) * 4e-4)
        };
        samples.push(Sample {
            seq: Some(i as u64),
            t_s: t,
            cmd_qx_rad: Some(-command[1]),
            cmd_qy_rad: Some(command[0]),
            x_m: reading(at[0]),
            y_m: reading(at[1]),
        });
    }
    samples
}

/// Returns the asset of this name, calibrated with healthy samples of [`rig`].
pub fn learnt(name: &str) -> Rig {
    static LEARNT: OnceLock<Calibration> = OnceLock::new();
    let learn = || {
        let healthy = rig(6000, usize::MAX);
        let made_at = "2026-01-01T00:00:00Z".to_owned();
        let origin = CalibrationOrigin { made_at, ..CalibrationOrigin::default() };
        Calibration { origin, ..calibrate(&Rig::chapter("a"), &[healthy]).unwrap() }
    };
    let calibration = Some(Box::new(LEARNT.get_or_init(learn).clone()));
    Rig { calibration, ..Rig::chapter(name) }
}

/// Returns the asset file of [`learnt`], to register it.
pub fn registration(name: &str) -> Value {
    serde_json::to_value(view(&learnt(name))).unwrap()
}

/// Returns the verdict hash and the confirmed codes of a recording of [`learnt`].
pub fn judged(name: &str, samples: &[Sample]) -> (String, Vec<String>) {
    let Judgement { hash, faults, .. } = judgement(name, samples);
    (hash, faults)
}

/// The result of the engine for a recording.
pub struct Judgement {
    pub hash: String,
    pub faults: Vec<String>,
    pub n_transitions: usize,
    pub memory: offbd_core::diagnosis::FaultMemory,
}

/// Judges a recording of [`learnt`].
pub fn judgement(name: &str, samples: &[Sample]) -> Judgement {
    let setup = Setup::new(learnt(name), None).unwrap();
    let mut engine = Engine::new(setup, Default::default());
    let mut verdict = offbd::wire::verdict::Verdict::default();
    let (mut transitions, mut n_transitions) = (Vec::new(), 0);
    for input in samples.iter().map(|s| Input::Sample(*s)).chain([Input::End]) {
        transitions.clear();
        engine.handle(input, &mut transitions);
        verdict.take(engine.n_accepted(), &transitions);
        n_transitions += transitions.len();
    }
    let faults = verdict.confirmed().iter().map(ToString::to_string).collect();
    Judgement { hash: verdict.hash(), faults, n_transitions, memory: engine.memory().clone() }
}

/// Server-Sent Events, one by one.
pub struct Events(Pin<Box<SseStream<reqwest::Body>>>);

impl Events {
    pub fn new(response: reqwest::Response) -> Self {
        assert_eq!(response.status(), 200);
        Self(Box::pin(SseStream::new(response.into())))
    }

    /// Returns the data of the next fault event, with its `id`, and skips the first event,
    /// `begin`, which has only the id after which the stream starts.
    pub async fn next(&mut self) -> Value {
        loop {
            let (kind, data) = self.any().await;
            if kind == "fault" {
                return data;
            }
        }
    }

    /// Returns the type of the next event, and its data with its `id`.
    pub async fn any(&mut self) -> (String, Value) {
        loop {
            let event = self.event().await.expect("the stream continues");
            let Some(data) = event.data else { continue };
            let mut data: Value = serde_json::from_str(&data).unwrap();
            data["id"] = event.id.unwrap().parse::<i64>().unwrap().into();
            return (event.event.unwrap(), data);
        }
    }

    /// Returns whether the service ends the stream without another event.
    pub async fn ended(&mut self) -> bool {
        self.event().await.is_none()
    }

    async fn event(&mut self) -> Option<Sse> {
        let event = tokio::time::timeout(DEADLINE, self.0.next()).await.expect("an event in time");
        event.map(Result::unwrap)
    }
}

/// Pause between two looks at what is to come. It leaves the processors to the service under test,
/// and is short beside what a test does.
const POLL_PAUSE: Duration = Duration::from_millis(10);

/// Repeats `done` until it returns something; fails after [`DEADLINE`], and names the caller.
#[expect(clippy::disallowed_methods, reason = "a test must not wait forever")]
#[track_caller]
pub fn eventually<T, F: Future<Output = Option<T>>>(
    mut done: impl FnMut() -> F,
) -> impl Future<Output = T> {
    let caller = Location::caller();
    async move {
        let start = Instant::now();
        loop {
            if let Some(found) = done().await {
                return found;
            }
            assert!(start.elapsed() < DEADLINE, "not fulfilled within the deadline: {caller}");
            tokio::time::sleep(POLL_PAUSE).await;
        }
    }
}

/// A time this many hours from now, RFC 3339.
#[expect(clippy::disallowed_methods, reason = "mutes end at a time of the wall clock")]
pub fn hours_from_now(hours: i64) -> String {
    (jiff::Timestamp::now() + jiff::SignedDuration::from_hours(hours)).to_string()
}
