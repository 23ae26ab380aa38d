//! What the clients of a cluster sent and were told: a history that can be compared with what
//! is stored.

use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard};

use futures_util::StreamExt;
use offbd_core::vocabulary::{FaultCode, Sample};
use reqwest::Method;
use serde_json::Value;
use sse_stream::SseStream;
use tokio::sync::watch;

use super::Client;

/// A moment of the history: the number of things that clients have done before it.
pub type Moment = usize;

/// Everything that clients did. What was done first is first.
#[derive(Clone, Debug, Default)]
pub struct ClientHistory {
    now: Moment,
    pub batches: Vec<SentBatch>,
    pub actions: Vec<SentAction>,
    pub progress: Vec<SeenProgress>,
    pub events: Vec<SeenEvent>,
}

/// Samples of one session that were sent together, perhaps several times.
#[derive(Clone, Debug)]
pub struct SentBatch {
    pub asset: String,
    pub session: String,
    pub samples: Vec<Sample>,
    pub sent: Moment,
    pub told: Option<ToldBatch>,
}

/// An acknowledgement of a batch.
#[derive(Clone, Copy, Debug)]
pub struct ToldBatch {
    pub at: Moment,
    /// The highest number of a stored sample.
    pub last_seq: Option<u64>,
}

/// An acknowledgement or a clearing of a fault, sent once, in the name of an actor who sends
/// nothing else.
#[derive(Clone, Debug)]
pub struct SentAction {
    pub asset: String,
    pub code: FaultCode,
    /// As it is stored.
    pub kind: &'static str,
    pub actor: String,
    pub sent: Moment,
    pub told: Option<ToldAction>,
}

/// The answer to a [`SentAction`].
#[derive(Clone, Copy, Debug)]
pub struct ToldAction {
    pub at: Moment,
    /// Otherwise it was refused: there was nothing to acknowledge.
    pub is_done: bool,
}

/// How many samples of the open session of an asset a node has answered with.
#[derive(Clone, Debug)]
pub struct SeenProgress {
    pub asset: String,
    pub n_samples: u64,
    pub asked: Moment,
    pub told: Moment,
}

/// A change of a fault, as a subscriber got it or as it is stored.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SeenEvent {
    pub id: i64,
    pub asset: String,
    /// Absent if no session was open.
    pub session_id: Option<String>,
    pub code: String,
    pub status: String,
}

impl ClientHistory {
    /// Counts the next thing that is done.
    fn next(&mut self) -> Moment {
        self.now += 1;
        self.now
    }

    pub fn send_batch(&mut self, asset: &str, session: &str, samples: &[Sample]) -> usize {
        let (asset, session) = (asset.to_owned(), session.to_owned());
        let sent = self.next();
        let batch = SentBatch { asset, session, samples: samples.to_vec(), sent, told: None };
        self.batches.push(batch);
        self.batches.len() - 1
    }

    /// Notes the acknowledgement `ack` of the batch with this number.
    pub fn tell_batch(&mut self, number: usize, ack: &Value) {
        let told = ToldBatch { at: self.next(), last_seq: ack["last_seq"].as_u64() };
        self.batches[number].told = Some(told);
    }

    pub fn send_action(&mut self, asset: &str, code: FaultCode, kind: &'static str) -> usize {
        let (asset, sent) = (asset.to_owned(), self.next());
        let actor = format!("person-{}", self.actions.len());
        self.actions.push(SentAction { asset, code, kind, actor, sent, told: None });
        self.actions.len() - 1
    }

    /// Notes the status of the answer to the action with this number.
    pub fn tell_action(&mut self, number: usize, status: u16) {
        let told = ToldAction { at: self.next(), is_done: status < 300 };
        // After another status it may be stored nevertheless.
        self.actions[number].told = [200, 204, 409].contains(&status).then_some(told);
    }
}

/// Records a history. Clones record the same one.
#[derive(Clone, Debug, Default)]
pub struct Recorder(Arc<Mutex<ClientHistory>>);

impl Recorder {
    pub fn lock(&self) -> MutexGuard<'_, ClientHistory> {
        self.0.lock().unwrap()
    }

    /// Sends an action once, to `client`.
    pub async fn act(&self, client: &Client, asset: &str, code: FaultCode, kind: &'static str) {
        let number = self.lock().send_action(asset, code, kind);
        let actor = self.lock().actions[number].actor.clone();
        let fault = format!("assets/{asset}/faults/{code}");
        let request = match kind {
            "clear" => client.request(Method::DELETE, &format!("{fault}?by={actor}")),
            _ => client.request(Method::POST, &format!("{fault}/acknowledge?by={actor}")),
        };
        if let Ok(answer) = request.send().await {
            self.lock().tell_action(number, answer.status().as_u16());
        }
    }

    /// Asks `client` once how many samples the open session of an asset has.
    pub async fn look(&self, client: &Client, asset: &str) {
        let asked = self.lock().next();
        let request = client.request(Method::GET, &format!("assets/{asset}/state"));
        let Ok(answer) = request.send().await else { return };
        let Ok(state) = answer.json::<Value>().await else { return };
        let Some(n_samples) = state["samples"].as_u64() else { return };
        let mut history = self.lock();
        let (asset, told) = (asset.to_owned(), history.next());
        history.progress.push(SeenProgress { asset, n_samples, asked, told });
    }

    /// Follows the events of all assets through the node whose address is in `address`, without
    /// end. After a lost connection it goes on after the last event.
    pub async fn follow(&self, client: Client, mut address: watch::Receiver<String>) {
        let mut last = 0;
        loop {
            let mut client = client.clone();
            client.address = address.borrow_and_update().clone();
            let path = format!("events?after={last}");
            tokio::select! {
                () = self.follow_once(client.request(Method::GET, &path), &mut last) => {}
                _ = address.changed() => {}
            }
            tokio::task::yield_now().await;
        }
    }

    async fn follow_once(&self, request: reqwest::RequestBuilder, last: &mut i64) {
        let Ok(answer) = request.send().await else { return };
        if answer.status() != 200 {
            return;
        }
        let mut feed: Pin<Box<SseStream<reqwest::Body>>> = Box::pin(SseStream::new(answer.into()));
        while let Some(Ok(message)) = feed.next().await {
            let (Some(id), Some(data)) = (message.id, message.data) else { continue };
            let id = id.parse().unwrap();
            if message.event.as_deref() == Some("fault") {
                let event = SeenEvent::of(id, &serde_json::from_str(&data).unwrap());
                self.lock().events.push(event);
            }
            *last = id;
        }
    }
}

impl SeenEvent {
    /// The event with this id in `line`.
    pub fn of(id: i64, line: &Value) -> Self {
        let word = |key: &str| line[key].as_str().map(str::to_owned);
        let required = |key| word(key).unwrap_or_else(|| panic!("{key}: {line}"));
        let [asset, code, status] = ["asset", "code", "status"].map(required);
        Self { id, asset, session_id: word("session_id"), code, status }
    }
}
