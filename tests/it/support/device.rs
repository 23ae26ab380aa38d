//! Devices that retry until their samples are acknowledged, even if the service fails, and
//! check what is stored in the end.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use offbd_core::vocabulary::{FaultCode, Sample};
use reqwest::Method;
use reqwest::header::CONTENT_TYPE;
use serde_json::{Value, json};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Message;

use super::history::Recorder;
use super::{
    Answer, Client, batch, csv, eventually, judgement, packed, registration, rig, try_connection,
};

/// Ways in which a device can send a batch: JSON, MessagePack, CSV, NDJSON and a WebSocket.
const N_WAYS: usize = 5;

/// Answers to refused batches that are kept.
const MAX_REFUSALS: usize = 20;

/// The connection of several devices to the service, whose address may change.
#[derive(Clone)]
pub struct ServiceLink {
    client: Client,
    address: watch::Sender<String>,
    acknowledged: Arc<AtomicU64>,
    refused: Arc<AtomicU64>,
    /// The first answers to refused batches.
    refusals: Arc<Mutex<Vec<String>>>,
    stopped: Arc<AtomicBool>,
    /// If there is one, what is stored is compared with its history in the end, and not by the
    /// devices.
    recorder: Option<Recorder>,
}

impl ServiceLink {
    pub fn to(client: &Client) -> Self {
        let (address, _) = watch::channel(client.address.clone());
        let client = client.clone();
        Self {
            client,
            address,
            acknowledged: Arc::default(),
            refused: Arc::default(),
            refusals: Arc::default(),
            stopped: Arc::default(),
            recorder: None,
        }
    }

    /// Returns the address of the service, now and whenever it changes.
    pub fn address(&self) -> watch::Receiver<String> {
        self.address.subscribe()
    }

    /// Sets the address of the service to that of `client`.
    pub fn set_service(&self, client: &Client) {
        self.address.send_replace(client.address.clone());
    }

    /// Returns a client of the service at its present address.
    pub fn client(&self) -> Client {
        let address = self.address.borrow().clone();
        Client { address, ..self.client.clone() }
    }

    /// Registers an asset, unless it is there.
    pub async fn register(&self, asset: &str) {
        let made = self.request(Method::POST, "assets", &registration(asset)).await;
        assert!([201, 409].contains(&made.status.as_u16()), "{}", made.text);
    }

    /// Returns the number of samples acknowledged so far.
    pub fn acknowledged(&self) -> u64 {
        self.acknowledged.load(Ordering::SeqCst)
    }

    /// Returns how often a batch was refused with 429 or 503.
    pub fn n_refused(&self) -> u64 {
        self.refused.load(Ordering::SeqCst)
    }

    /// Returns the answers to the first batches that were refused.
    pub fn refusals(&self) -> Vec<String> {
        self.refusals.lock().unwrap().clone()
    }

    fn note_refusals(&self, refusals: Vec<String>) {
        self.refused.fetch_add(refusals.len() as u64, Ordering::SeqCst);
        let mut first = self.refusals.lock().unwrap();
        first.extend(refusals);
        first.truncate(MAX_REFUSALS);
    }

    /// Waits until `n` more samples are acknowledged.
    pub async fn wait_for_samples(&self, n: u64) {
        let due = self.acknowledged() + n;
        eventually(|| async { (self.acknowledged() >= due).then_some(()) }).await;
    }

    /// Makes every device stop after its present recording.
    pub fn stop_devices(&self) {
        self.stopped.store(true, Ordering::SeqCst);
    }

    /// Sends a request until there is a response other than 429 and 503.
    async fn request(&self, method: Method, path: &str, body: &Value) -> Answer {
        self.send(|client| client.request(method.clone(), path).json(body)).await.0
    }

    /// Sends the request that `make` returns until there is a response other than 429 and 503.
    /// Returns the response and the refusals before.
    async fn send(
        &self,
        make: impl Fn(&Client) -> reqwest::RequestBuilder,
    ) -> (Answer, Vec<String>) {
        let mut address = self.address.subscribe();
        let mut refusals = Vec::new();
        loop {
            let mut client = self.client.clone();
            client.address = address.borrow_and_update().clone();
            // What was asked at the former address is asked again.
            let answered = tokio::select! {
                response = make(&client).send() => response,
                Ok(()) = address.changed() => continue,
            };
            let Ok(response) = answered else {
                wait_for_service(&mut address).await;
                continue;
            };
            let (status, headers) = (response.status(), response.headers().clone());
            if [429, 503].contains(&status.as_u16()) {
                // More than 1 if many are refused.
                assert!(headers["retry-after"].to_str().unwrap().parse::<u32>().unwrap() >= 1);
                refusals.push(response.text().await.unwrap_or_default());
                tokio::task::yield_now().await;
                continue;
            }
            match response.text().await {
                Ok(text) => return (Answer { status, headers, text }, refusals),
                Err(_) => wait_for_service(&mut address).await,
            }
        }
    }

    async fn get(&self, path: &str) -> Value {
        self.request(Method::GET, path, &Value::Null).await.expect(200)
    }

    /// Sends a batch in one of the ways in which a device can, until it is acknowledged.
    async fn post(&self, asset: &str, samples: &[Sample], way: usize) -> Value {
        let path = format!("assets/{asset}/telemetry");
        let named = format!("{path}?session=s");
        let document = batch(Some("s"), samples);
        let text = |kind: &'static str, body: String| {
            let named = &named;
            move |client: &Client| {
                let request = client.request(Method::POST, named);
                request.header(CONTENT_TYPE, kind).body(body.clone())
            }
        };
        let json = |client: &Client| client.request(Method::POST, &path).json(&document);
        let (answer, refusals) = match way {
            0 => self.send(json).await,
            1 => {
                let packed = |client: &Client| {
                    let request = client.request(Method::POST, &path);
                    request.header(CONTENT_TYPE, "application/msgpack").body(packed(&document))
                };
                self.send(packed).await
            }
            2 => self.send(text("text/csv", csv(samples))).await,
            3 => {
                let rows = document["samples"].as_array().unwrap();
                let lines: Vec<_> = rows.iter().map(Value::to_string).collect();
                self.send(text("application/x-ndjson", lines.join("\n"))).await
            }
            _ => return self.post_by_stream(asset, &document).await,
        };
        self.note_refusals(refusals);
        answer.expect(200)
    }

    /// Sends a batch over WebSockets, each for one try, until it is acknowledged.
    async fn post_by_stream(&self, asset: &str, document: &Value) -> Value {
        let mut address = self.address.subscribe();
        loop {
            let service = address.borrow_and_update().clone();
            let answered = tokio::select! {
                answer = post_once(&service, asset, document) => answer,
                Ok(()) = address.changed() => continue,
            };
            match answered {
                Some(answer) if answer["accepted"].is_u64() => return answer,
                Some(refusal) => {
                    self.note_refusals(vec![refusal.to_string()]);
                    tokio::task::yield_now().await;
                }
                None => wait_for_service(&mut address).await,
            }
        }
    }

    /// Sends `samples` in batches of 1 to 100, in all ways, sometimes with samples that are
    /// already acknowledged.
    async fn stream(&self, asset: &str, samples: &[Sample], random: &mut Random) {
        let mut at = 0;
        while at < samples.len() {
            let repeated = if random.below(5) == 0 { random.below(100) } else { 0 };
            let end = (at + 1 + random.below(100)).min(samples.len());
            let part = &samples[at.saturating_sub(repeated)..end];
            let number = self.recorder.as_ref().map(|to| to.lock().send_batch(asset, "s", part));
            let ack = self.post(asset, part, random.below(N_WAYS)).await;
            if let (Some(recorder), Some(number)) = (&self.recorder, number) {
                recorder.lock().tell_batch(number, &ack);
            }
            let n = |field: &str| ack[field].as_u64().unwrap();
            assert_eq!(n("accepted") + n("duplicate"), part.len() as u64, "{ack}");
            self.acknowledged.fetch_add((end - at) as u64, Ordering::SeqCst);
            at = end;
        }
    }
}

/// Sends a batch over a WebSocket; returns its answer, `None` if the connection is lost.
async fn post_once(service: &str, asset: &str, document: &Value) -> Option<Value> {
    let url = format!("ws://{service}/api/v1/assets/{asset}/stream");
    let (mut socket, _) = connect_async(url).await.ok()?;
    socket.send(Message::text(document.to_string())).await.ok()?;
    loop {
        match socket.next().await?.ok()? {
            Message::Text(text) => {
                let message: Value = serde_json::from_str(&text).ok()?;
                // The fault of an earlier batch may come first.
                if message["type"] != "fault" {
                    return Some(message);
                }
            }
            Message::Close(_) => return None,
            _ => {}
        }
    }
}

/// Waits for a new address of the service, but at most 50 ms: a connection to a running
/// service may also be lost.
async fn wait_for_service(address: &mut watch::Receiver<String>) {
    let longest = Duration::from_millis(50);
    let _ = tokio::time::timeout(longest, address.changed()).await;
}

/// Devices that send until they are stopped.
pub struct DeviceLoad {
    pub link: ServiceLink,
    devices: Vec<JoinHandle<usize>>,
}

impl DeviceLoad {
    pub fn start(n: usize, client: &Client, data: &Path, url: Option<&str>) -> Self {
        Self::start_on(ServiceLink::to(client), n, data, url)
    }

    /// Starts devices whose history is recorded.
    pub fn start_recorded(n: usize, client: &Client, data: &Path, recorder: &Recorder) -> Self {
        let recorder = Some(recorder.clone());
        Self::start_on(ServiceLink { recorder, ..ServiceLink::to(client) }, n, data, None)
    }

    fn start_on(link: ServiceLink, n: usize, data: &Path, url: Option<&str>) -> Self {
        let devices =
            (0..n).map(|i| device(&link, &format!("d{i}"), i % 2 == 0, data, url)).collect();
        Self { link, devices }
    }

    /// Stops the devices and returns the number of recordings that they have compared.
    pub async fn stop(self) -> usize {
        self.link.stop_devices();
        let mut laps = 0;
        for device in self.devices {
            laps += device.await.unwrap();
        }
        laps
    }
}

/// Starts a device that sends recordings, each for a new asset, and compares what is stored in
/// the database at `url`, or in the store of `data`, unless it is recorded. Returns the number of recordings.
pub fn device(
    link: &ServiceLink,
    name: &str,
    numbered: bool,
    data: &Path,
    url: Option<&str>,
) -> JoinHandle<usize> {
    let (link, name) = (link.clone(), name.to_owned());
    let url = url.map_or_else(|| super::url(data), str::to_owned);
    tokio::spawn(async move {
        let mut random = Random(name.bytes().map(u64::from).sum());
        let mut samples = rig(1500, 500);
        if !numbered {
            samples.iter_mut().for_each(|sample| sample.seq = None);
        }
        for lap in 1.. {
            let asset = format!("{name}-{lap}");
            link.register(&asset).await;
            link.stream(&asset, &samples, &mut random).await;
            let (id, verdict) = end(&link, &asset).await;
            if link.recorder.is_none() {
                check(&link, &asset, &samples, (&id, &verdict), &url).await;
            }
            if link.stopped.load(Ordering::SeqCst) {
                return lap;
            }
        }
        unreachable!()
    })
}

/// Ends the only session of an asset; returns its id and its verdict.
async fn end(link: &ServiceLink, asset: &str) -> (String, Value) {
    let page = link.get(&format!("sessions?asset={asset}")).await;
    assert_eq!(page["items"].as_array().unwrap().len(), 1, "{page}");
    let id = page["items"][0]["id"].as_str().unwrap();
    let ended = link.request(Method::POST, &format!("sessions/{id}/end"), &Value::Null).await;
    (id.to_owned(), ended.expect(200)["verdict"].take())
}

/// Checks that each of `samples` is stored once, with the right verdict, faults and
/// transitions.
async fn check(
    link: &ServiceLink,
    asset: &str,
    samples: &[Sample],
    (id, verdict): (&str, &Value),
    url: &str,
) {
    let wanted = judgement(asset, samples);
    assert_eq!(verdict["verdict_hash"], wanted.hash, "{asset}");
    assert_eq!(verdict["faults"], json!(wanted.faults), "{asset}");
    assert_eq!(verdict["samples"], samples.len());
    let stored = link.request(Method::GET, &format!("sessions/{id}/telemetry"), &Value::Null).await;
    assert_eq!(super::read_csv(&stored.text), samples, "{asset}");
    let faults = link.get(&format!("assets/{asset}/faults?status=all")).await;
    for fault in faults["items"].as_array().unwrap_or_else(|| faults.as_array().unwrap()) {
        let code: FaultCode = fault["code"].as_str().unwrap().parse().unwrap();
        let record = wanted.memory.record(code);
        assert_eq!(fault["status"], record.word().to_string(), "{asset} {code}");
    }
    let stored = count_transitions(url, id).await;
    let n = i64::try_from(wanted.n_transitions).unwrap();
    assert_eq!(stored, (n, n, n), "{asset}");
}

/// Returns the number of stored transitions of a session, the number of their distinct
/// ordinals, and the highest ordinal plus one. Retries while the database is unavailable.
async fn count_transitions(url: &str, session: &str) -> (i64, i64, i64) {
    let query = "SELECT COUNT(*), COUNT(DISTINCT ordinal), MAX(ordinal) + 1 FROM transition
                 WHERE session = $1";
    eventually(|| async {
        let mut connection = try_connection(url).await.ok()?;
        sqlx::query_as(query).bind(session.to_owned()).fetch_one(&mut connection).await.ok()
    })
    .await
}

/// A deterministic pseudo-random number generator.
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, n: usize) -> usize {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap() % n
    }
}
