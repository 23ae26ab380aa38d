//! Devices that send until they are acknowledged, whatever becomes of the
//! service meanwhile, and what must be stored of them in the end.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use offbd_core::vocabulary::{FaultCode, Sample};
use reqwest::Method;
use serde_json::{Value, json};
use tokio::sync::watch;
use tokio::task::JoinHandle;

use super::{Answer, Client, batch, eventually, judgement, registration, rig, try_connection};

/// The way to the service, which may move to another address.
#[derive(Clone)]
pub struct Line {
    client: Client,
    address: watch::Sender<String>,
    acknowledged: Arc<AtomicU64>,
    turned_away: Arc<AtomicU64>,
    full: Arc<AtomicU64>,
    hung_up: Arc<AtomicBool>,
}

impl Line {
    pub fn to(client: &Client) -> Self {
        let (address, _) = watch::channel(client.address.clone());
        let (client, none) = (client.clone(), || Arc::new(AtomicU64::new(0)));
        let hung_up = Arc::default();
        Self { client, address, acknowledged: none(), turned_away: none(), full: none(), hung_up }
    }

    /// The service is at the address of `client` from now on.
    pub fn moves(&self, client: &Client) {
        self.address.send_replace(client.address.clone());
    }

    /// Samples acknowledged so far.
    pub fn acknowledged(&self) -> u64 {
        self.acknowledged.load(Ordering::SeqCst)
    }

    /// Requests that were told to come again.
    pub fn turned_away(&self) -> u64 {
        self.turned_away.load(Ordering::SeqCst)
    }

    /// How many of them with 429.
    pub fn full(&self) -> u64 {
        self.full.load(Ordering::SeqCst)
    }

    /// Waits until `n` more samples are acknowledged.
    pub async fn progress(&self, n: u64) {
        let due = self.acknowledged() + n;
        eventually(|| async { (self.acknowledged() >= due).then_some(()) }).await;
    }

    /// The devices end what they are at.
    pub fn hang_up(&self) {
        self.hung_up.store(true, Ordering::SeqCst);
    }

    /// Asks until there is an answer other than to come again.
    async fn ask(&self, method: Method, path: &str, body: &Value) -> Answer {
        let mut address = self.address.subscribe();
        loop {
            let mut client = self.client.clone();
            client.address = address.borrow_and_update().clone();
            let request = client.request(method.clone(), path).json(body);
            let Ok(response) = request.send().await else {
                comes_back(&mut address).await;
                continue;
            };
            let (status, headers) = (response.status(), response.headers().clone());
            if [429, 503].contains(&status.as_u16()) {
                assert_eq!(headers["retry-after"], "1");
                self.turned_away.fetch_add(1, Ordering::SeqCst);
                self.full.fetch_add(u64::from(status == 429), Ordering::SeqCst);
                tokio::task::yield_now().await;
                continue;
            }
            match response.text().await {
                Ok(text) => return Answer { status, headers, text },
                Err(_) => comes_back(&mut address).await,
            }
        }
    }

    async fn get(&self, path: &str) -> Value {
        self.ask(Method::GET, path, &Value::Null).await.expect(200)
    }

    /// Sends `samples` in batches of 1 to 100; now and then also what was
    /// acknowledged already.
    async fn stream(&self, asset: &str, samples: &[Sample], random: &mut Random) {
        let mut at = 0;
        while at < samples.len() {
            let again = if random.below(5) == 0 { random.below(100) } else { 0 };
            let end = (at + 1 + random.below(100)).min(samples.len());
            let part = &samples[at.saturating_sub(again)..end];
            let path = format!("assets/{asset}/telemetry");
            let ack = self.ask(Method::POST, &path, &batch(Some("s"), part)).await.expect(200);
            let n = |field: &str| ack[field].as_u64().unwrap();
            assert_eq!(n("accepted") + n("duplicate"), part.len() as u64, "{ack}");
            self.acknowledged.fetch_add((end - at) as u64, Ordering::SeqCst);
            at = end;
        }
    }
}

/// Waits for the service to move, or a moment: a connection may also be lost to one
/// that goes on.
async fn comes_back(address: &mut watch::Receiver<String>) {
    let moment = Duration::from_millis(50);
    let _ = tokio::time::timeout(moment, address.changed()).await;
}

/// A device that sends one recording after the other, each as a new asset, and
/// compares what is stored in the database at `url`, or else below `data`; says
/// how many there were.
pub fn device(
    line: &Line,
    name: &str,
    counts: bool,
    data: &Path,
    url: Option<&str>,
) -> JoinHandle<usize> {
    let (line, name) = (line.clone(), name.to_owned());
    let url = url.map_or_else(|| super::url(data), str::to_owned);
    tokio::spawn(async move {
        let mut random = Random(name.bytes().map(u64::from).sum());
        let mut samples = rig(1500, 500);
        if !counts {
            samples.iter_mut().for_each(|sample| sample.seq = None);
        }
        for lap in 1.. {
            let asset = format!("{name}-{lap}");
            let made = line.ask(Method::POST, "assets", &registration(&asset)).await;
            assert!([201, 409].contains(&made.status.as_u16()), "{}", made.text);
            line.stream(&asset, &samples, &mut random).await;
            check(&line, &asset, &samples, &url).await;
            if line.hung_up.load(Ordering::SeqCst) {
                return lap;
            }
        }
        unreachable!()
    })
}

/// That what is stored is `samples`, each once, and what follows from them.
async fn check(line: &Line, asset: &str, samples: &[Sample], url: &str) {
    let page = line.get(&format!("sessions?asset={asset}")).await;
    assert_eq!(page["items"].as_array().unwrap().len(), 1, "{page}");
    let id = page["items"][0]["id"].as_str().unwrap();
    let ended = line.ask(Method::POST, &format!("sessions/{id}/end"), &Value::Null).await;
    let verdict = &ended.expect(200)["verdict"];
    let wanted = judgement(asset, samples);
    assert_eq!(verdict["verdict_hash"], wanted.hash, "{asset}");
    assert_eq!(verdict["faults"], json!(wanted.faults), "{asset}");
    assert_eq!(verdict["samples"], samples.len());
    let stored = line.ask(Method::GET, &format!("sessions/{id}/telemetry"), &Value::Null).await;
    assert_eq!(super::read_csv(&stored.text), samples, "{asset}");
    let faults = line.get(&format!("assets/{asset}/faults?status=all")).await;
    for fault in faults["items"].as_array().unwrap_or_else(|| faults.as_array().unwrap()) {
        let code: FaultCode = fault["code"].as_str().unwrap().parse().unwrap();
        let record = wanted.memory.record(code);
        assert_eq!(fault["status"], record.word().to_string(), "{asset} {code}");
    }
    let told = told_transitions(url, id).await;
    let n = i64::try_from(wanted.n_transitions).unwrap();
    assert_eq!(told, (n, n, n), "{asset}");
}

/// Number of the transitions stored of a session, of their different ordinals, and the
/// highest ordinal plus one; asked again while the server is away.
async fn told_transitions(url: &str, session: &str) -> (i64, i64, i64) {
    let query = "SELECT COUNT(*), COUNT(DISTINCT ordinal), MAX(ordinal) + 1 FROM transition
                 WHERE session = $1";
    eventually(|| async {
        let mut connection = try_connection(url).await.ok()?;
        sqlx::query_as(query).bind(session.to_owned()).fetch_one(&mut connection).await.ok()
    })
    .await
}

/// Numbers that look random and are the same each time.
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, n: usize) -> usize {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap() % n
    }
}
