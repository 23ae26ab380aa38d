//! A server in the test's process, a client for it, and a small rig.

#![allow(dead_code, reason = "each test uses a part")]

pub mod device;
pub mod postgres;
pub mod process;
pub mod provider;

use std::future::Future;
use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use offbd::config::Config;
use offbd::server::{self, Server};
use offbd::wire::asset::view;
use offbd_core::diagnosis::Calibration;
use offbd_core::engine::{Engine, Input, Output, Rig, Setup, calibrate};
use offbd_core::vocabulary::Sample;
use reqwest::header::CONTENT_TYPE;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use sqlx::{AssertSqlSafe, ConnectOptions, Executor};

/// Longest time to wait for anything; far more than it takes.
pub const DEADLINE: Duration = Duration::from_secs(60);

/// A server with a data directory of its own.
pub struct Bench {
    pub server: Option<Server>,
    pub client: Client,
    pub data: tempfile::TempDir,
}

/// Whether services under test use PostgreSQL: `TEST_DATABASE=postgres`.
pub fn on_postgres() -> bool {
    match std::env::var("TEST_DATABASE") {
        Ok(database) if database == "postgres" => true,
        Ok(database) if database == "sqlite" => false,
        Err(std::env::VarError::NotPresent) => false,
        other => panic!("TEST_DATABASE is sqlite or postgres, not {other:?}"),
    }
}

/// A configuration that uses `data`, or the database of its name, and any free
/// port.
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

/// The URL of the store below `data`.
pub fn url(data: &Path) -> String {
    let file = || format!("sqlite://{}/offbd.sqlite", data.display());
    config(data).database.unwrap_or_else(file)
}

pub async fn connection(url: &str) -> sqlx::AnyConnection {
    try_connection(url).await.unwrap()
}

/// The same with a server that may be away.
pub async fn try_connection(url: &str) -> sqlx::Result<sqlx::AnyConnection> {
    sqlx::any::install_default_drivers();
    url.parse::<sqlx::any::AnyConnectOptions>().unwrap().connect().await
}

/// All that the store below `data` holds, as bytes to search in: its files, or
/// its rows as text.
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

impl Bench {
    pub async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    pub async fn start_with(change: impl FnOnce(&mut Config)) -> Self {
        let data = tempfile::tempdir().unwrap();
        let mut config = config(data.path());
        change(&mut config);
        let server = server::start(config).await.unwrap();
        let client = Client::new(server.address.to_string());
        Self { server: Some(server), client, data }
    }

    /// A connection of its own to the server's store.
    pub async fn store(&self) -> sqlx::AnyConnection {
        connection(&url(self.data.path())).await
    }

    /// Lets nobody write until it is dropped or let go of.
    pub async fn hold(&self) -> Hold {
        let mut store = self.store().await;
        let words = if on_postgres() { "BEGIN; LOCK TABLE counter" } else { "BEGIN IMMEDIATE" };
        store.execute(words).await.unwrap();
        Hold { store }
    }

    /// Stops gracefully and starts again on the same data.
    pub async fn restart(&mut self) {
        self.server.take().unwrap().shutdown().await.unwrap();
        let server = server::start(config(self.data.path())).await.unwrap();
        self.client = Client::new(server.address.to_string());
        self.server = Some(server);
    }
}

/// Holds the store, see [`Bench::hold`].
pub struct Hold {
    store: sqlx::AnyConnection,
}

impl Hold {
    pub async fn let_go(mut self) {
        self.store.execute("ROLLBACK").await.unwrap();
    }
}

/// Asks the interface.
#[derive(Clone)]
pub struct Client {
    pub address: String,
    /// Shown with every request.
    pub token: Option<String>,
    http: reqwest::Client,
}

/// An answer.
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

    /// The JSON of an answer that must have `status`.
    #[track_caller]
    pub fn expect(&self, status: u16) -> Value {
        assert_eq!(self.status.as_u16(), status, "{}", self.text);
        if self.text.is_empty() { Value::Null } else { self.json() }
    }

    /// The problem of an answer that must have `status`.
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
    pub fn new(address: String) -> Self {
        Self { address, token: None, http: reqwest::Client::new() }
    }

    /// The same with a token to show.
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

    pub async fn send(&self, request: reqwest::RequestBuilder) -> Answer {
        let response = request.send().await.unwrap();
        let (status, headers) = (response.status(), response.headers().clone());
        Answer { status, headers, text: response.text().await.unwrap() }
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

    /// Sends a batch that must be taken.
    pub async fn telemetry(&self, asset: &str, session: Option<&str>, samples: &[Sample]) -> Value {
        let body = batch(session, samples);
        self.post(&format!("assets/{asset}/telemetry"), &body).await.expect(200)
    }

    /// The asset's session of this name.
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

    /// The recording of the session of this name.
    pub async fn recording(&self, asset: &str, name: &str) -> Vec<Sample> {
        let session = self.session(asset, name).await;
        let id = session["id"].as_str().unwrap();
        let csv = self.get(&format!("sessions/{id}/telemetry")).await;
        assert_eq!(csv.status, 200);
        read_csv(&csv.text)
    }
}

/// The samples of a session file.
pub fn read_csv(text: &str) -> Vec<Sample> {
    let reader = offbd::wire::session_csv::Reader::new(text.as_bytes()).unwrap();
    reader.map(Result::unwrap).collect()
}

/// A batch as JSON rows.
pub fn batch(session: Option<&str>, samples: &[Sample]) -> Value {
    let rows: Vec<_> = samples.iter().map(offbd::wire::telemetry::sample_view).collect();
    json!({ "session": session, "samples": rows })
}

/// A document as MessagePack.
pub fn packed(document: &Value) -> Vec<u8> {
    rmp_serde::to_vec_named(document).unwrap()
}

/// Samples as a session file.
pub fn csv(samples: &[Sample]) -> String {
    let mut text = Vec::new();
    offbd::wire::session_csv::write(&mut text, samples).unwrap();
    String::from_utf8(text).unwrap()
}

/// A servo of the small rig: dead time 40 ms, lag 60 ms, at 100 Hz.
struct Servo {
    waiting: [f64; 4],
    angle: f64,
    dead: bool,
}

impl Servo {
    fn turn(&mut self, command: f64) -> f64 {
        self.waiting.rotate_left(1);
        let due = std::mem::replace(&mut self.waiting[3], command);
        if !self.dead {
            self.angle += (due - self.angle) * 0.01 / 0.06;
        }
        self.angle
    }
}

/// `n` samples at 100 Hz of a ball that is to follow a circle; the x servo is
/// dead from sample `dead_from` on.
pub fn rig(n: usize, dead_from: usize) -> Vec<Sample> {
    const STEP: f64 = 0.01;
    let servo = || Servo { waiting: [0.0; 4], angle: 0.0, dead: false };
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

/// The asset of this name, learnt from a minute of its own.
pub fn learnt(name: &str) -> Rig {
    static LEARNT: OnceLock<Calibration> = OnceLock::new();
    let learn = || {
        let healthy = rig(6000, usize::MAX);
        calibrate(&Rig::chapter("a"), &[healthy], "", "2026-01-01T00:00:00Z").unwrap()
    };
    let calibration = Some(LEARNT.get_or_init(learn).clone());
    Rig { calibration, ..Rig::chapter(name) }
}

/// What registers [`learnt`].
pub fn registration(name: &str) -> Value {
    serde_json::to_value(view(&learnt(name))).unwrap()
}

/// The verdict hash of a recording of an asset learnt so, and what was confirmed.
pub fn judged(name: &str, samples: &[Sample]) -> (String, Vec<String>) {
    let Judgement { hash, faults, .. } = judgement(name, samples);
    (hash, faults)
}

/// What the engine itself says of a recording.
pub struct Judgement {
    pub hash: String,
    pub faults: Vec<String>,
    pub n_transitions: usize,
    pub memory: offbd_core::diagnosis::FaultMemory,
}

pub fn judgement(name: &str, samples: &[Sample]) -> Judgement {
    let setup = Setup::new(learnt(name), None).unwrap();
    let mut engine = Engine::new(setup, Default::default());
    let mut verdict = offbd::wire::verdict::Verdict::default();
    let (mut outputs, mut n_transitions) = (Vec::new(), 0);
    for input in samples.iter().map(|s| Input::Sample(*s)).chain([Input::End]) {
        outputs.clear();
        engine.handle(input, &mut outputs);
        outputs.iter().for_each(|o| verdict.take(o));
        n_transitions += outputs.iter().filter(|o| matches!(o, Output::Transition(_))).count();
    }
    let faults = verdict.confirmed().iter().map(ToString::to_string).collect();
    Judgement { hash: verdict.hash(), faults, n_transitions, memory: engine.memory().clone() }
}

/// Server-Sent Events, one by one.
pub struct Events {
    response: reqwest::Response,
    text: String,
}

impl Events {
    pub fn new(response: reqwest::Response) -> Self {
        assert_eq!(response.status(), 200);
        Self { response, text: String::new() }
    }

    /// The next fault event's data, with its `id`; the first event of all,
    /// `begin`, only says where the others follow on.
    pub async fn next(&mut self) -> Value {
        loop {
            let (kind, data) = self.any().await;
            if kind == "fault" {
                return data;
            }
        }
    }

    /// The next event's type, and its data with its `id`.
    pub async fn any(&mut self) -> (String, Value) {
        loop {
            if let Some((event, rest)) = self.text.split_once("\n\n") {
                let event = event.to_owned();
                self.text = rest.to_owned();
                let field = |name: &str| {
                    event.lines().find_map(|l| l.strip_prefix(name)).map(|v| v.trim().to_owned())
                };
                if let Some(data) = field("data:") {
                    let mut data: Value = serde_json::from_str(&data).unwrap();
                    data["id"] = field("id:").unwrap().parse::<i64>().unwrap().into();
                    return (field("event:").unwrap(), data);
                }
                continue;
            }
            let chunk = tokio::time::timeout(DEADLINE, self.response.chunk()).await;
            let chunk = chunk.unwrap().unwrap().expect("the stream goes on");
            self.text.push_str(std::str::from_utf8(&chunk).unwrap());
        }
    }
}

impl Events {
    /// Whether the service ends the stream without another event.
    pub async fn ended(&mut self) -> bool {
        let chunk = tokio::time::timeout(DEADLINE, self.response.chunk()).await;
        matches!(chunk, Ok(Ok(None))) && self.text.is_empty()
    }
}

/// Asks again until `done` gives something; fails after [`DEADLINE`].
#[expect(clippy::disallowed_methods, reason = "a test must not wait for ever")]
pub async fn eventually<T, F: Future<Output = Option<T>>>(mut done: impl FnMut() -> F) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = done().await {
            return found;
        }
        assert!(begun.elapsed() < DEADLINE, "it did not come about in time");
        tokio::task::yield_now().await;
    }
}
