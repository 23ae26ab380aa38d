//! Messages of devices: from a message to a batch, from a batch to its answer.

use std::future::Future;
use std::sync::Arc;

use futures_util::StreamExt;
use futures_util::stream::FuturesUnordered;
use hyper::body::Bytes;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};

use super::presence::Attendance;
use super::{MAX_PENDING, MAX_QUEUED, MAX_QUEUED_BYTES};
use crate::http::Problem;
use crate::service::{Route, Service, ServiceError};
use crate::wire::bus::{BatchAckView, BatchRefusalView, DeviceTopic};
use crate::wire::mapping::MappedTopic;
use crate::wire::telemetry::{self, AckView, Batch, BatchError};

/// A message of a device that waits to be parsed.
pub(super) struct Delivery<R> {
    pub(super) asset: String,
    pub(super) form: Form,
    pub(super) payload: Bytes,
    /// What the bus needs to answer.
    pub(super) receipt: R,
    /// Whether to wait for room instead of refusing the batch.
    pub(super) waits: bool,
    /// Counts the bytes of the payload.
    room: OwnedSemaphorePermit,
}

/// The form of a payload.
#[derive(Clone)]
pub(super) enum Form {
    Device(DeviceTopic),
    Mapped(Arc<MappedTopic>),
}

/// The answer to a batch.
pub(super) enum BatchAnswer {
    Taken(BatchAckView),
    Refused(BatchRefusalView),
}

impl BatchAnswer {
    /// Returns the document for the device, JSON.
    pub(super) fn document(&self) -> Vec<u8> {
        let document = match self {
            Self::Taken(ack) => serde_json::to_vec(ack),
            Self::Refused(refusal) => serde_json::to_vec(refusal),
        };
        document.unwrap_or_default()
    }

    /// Seconds after which the batch is to be sent again, if that can help.
    #[cfg(feature = "mqtt")]
    pub(super) const fn retry_after_s(&self) -> Option<u64> {
        match self {
            Self::Taken(_) => None,
            Self::Refused(refusal) => refusal.retry_after_s,
        }
    }

    /// Returns the label of the metric of messages.
    fn outcome(&self) -> &'static str {
        let Self::Refused(refusal) = self else { return "taken" };
        match refusal.status {
            400 | 422 => "malformed",
            404 => "unknown_asset",
            409 => "conflict",
            413 => "too_large",
            429 => "busy",
            _ => "unavailable",
        }
    }

    fn of(id: Option<String>, answer: Result<AckView, Problem>) -> Self {
        match answer {
            Ok(ack) => Self::Taken(BatchAckView { id, ack }),
            Err(problem) => Self::Refused(refusal(id, problem)),
        }
    }
}

fn refusal(id: Option<String>, problem: Problem) -> BatchRefusalView {
    let retry = matches!(problem.status, 429 | 503).then_some(u64::from(problem.retry_after_s));
    BatchRefusalView {
        id,
        kind: problem.kind.into(),
        title: problem.title.to_owned(),
        status: problem.status,
        detail: problem.detail.into(),
        pointer: problem.pointer.map(Into::into),
        retry_after_s: retry,
    }
}

/// How a bus answers a message.
pub(super) trait Answering: Send + Sync {
    /// What it needs for this, besides the asset.
    type Receipt: Send;

    /// Sends the answer to a batch; `None` if the message was no batch.
    fn answer(
        &self,
        asset: &str,
        receipt: Self::Receipt,
        answer: Option<BatchAnswer>,
    ) -> impl Future<Output = ()> + Send;

    /// Ends the connection after the last answer.
    fn finish(&self) -> impl Future<Output = ()> + Send;
}

/// Takes the messages of one bus.
#[derive(Clone)]
pub(super) struct Intake {
    pub(super) bus: &'static str,
    pub(super) service: Service,
    attendance: Attendance,
    bytes: Arc<Semaphore>,
}

impl Intake {
    pub(super) fn new(bus: &'static str, service: Service) -> Self {
        let bytes = Arc::new(Semaphore::new(MAX_QUEUED_BYTES));
        Self { bus, service, attendance: Attendance::default(), bytes }
    }

    /// Counts a message by what became of it.
    pub(super) fn count(&self, outcome: &'static str) {
        metrics::counter!("offbd_bus_messages_total", "bus" => self.bus, "outcome" => outcome)
            .increment(1);
    }

    /// Puts a message into the queue. If it is too long or there is no room, returns the answer
    /// with the receipt.
    pub(super) fn queue<R>(
        &self,
        queue: &mpsc::Sender<Delivery<R>>,
        (asset, form): (String, Form),
        payload: Bytes,
        receipt: R,
        waits: bool,
    ) -> Result<(), (String, R, Box<BatchAnswer>)> {
        let limit = self.service.limits().batch_bytes;
        if payload.len() > limit {
            let error = ServiceError::TooMany { what: "bytes in one message", limit };
            return Err((asset, receipt, Box::new(self.refused(error))));
        }
        let busy = ServiceError::Busy { what: "too many messages wait to be parsed" };
        let size = u32::try_from(payload.len()).unwrap_or(u32::MAX);
        let Ok(room) = self.bytes.clone().try_acquire_many_owned(size) else {
            return Err((asset, receipt, Box::new(self.refused(busy))));
        };
        let delivery = Delivery { asset, form, payload, receipt, waits, room };
        queue.try_send(delivery).map_err(|error| {
            let delivery = error.into_inner();
            (delivery.asset, delivery.receipt, Box::new(self.refused(busy)))
        })
    }

    fn refused(&self, error: ServiceError) -> BatchAnswer {
        let answer = BatchAnswer::of(None, Err(error.into()));
        self.count(answer.outcome());
        answer
    }

    /// Handles the messages of the queue until it is closed, and answers all of them.
    pub(super) async fn run<A: Answering>(
        self,
        bus: &A,
        mut queue: mpsc::Receiver<Delivery<A::Receipt>>,
    ) {
        let mut pending = FuturesUnordered::new();
        let mut open = true;
        while open || !pending.is_empty() {
            tokio::select! {
                delivery = queue.recv(), if open && pending.len() < MAX_PENDING => match delivery {
                    Some(delivery) => {
                        if let Some(answer) = self.take(bus, delivery).await {
                            pending.push(answer);
                        }
                    }
                    None => open = false,
                },
                Some((asset, receipt, answer)) = pending.next(), if !pending.is_empty() => {
                    self.count(BatchAnswer::outcome(&answer));
                    bus.answer(&asset, receipt, Some(answer)).await;
                }
            }
        }
        bus.finish().await;
    }

    /// Submits a batch and returns its pending answer; anything else is done at once.
    async fn take<A: Answering>(
        &self,
        bus: &A,
        delivery: Delivery<A::Receipt>,
    ) -> Option<impl Future<Output = (String, A::Receipt, BatchAnswer)> + use<A>> {
        let Delivery { asset, form, payload, receipt, waits, room } = delivery;
        if self.service.route(&asset) != Route::Here {
            // In a cluster each node gets the message, and the owner of the asset answers.
            self.count("elsewhere");
            bus.answer(&asset, receipt, None).await;
            return None;
        }
        let limit = self.service.limits().batch_samples;
        let batch = match form {
            Form::Device(DeviceTopic::Telemetry) => parse(&payload, limit),
            Form::Mapped(topic) => topic.batch(&payload, limit),
            Form::Device(topic) => {
                let outcome = self.attendance.note(&self.service, &asset, topic, &payload).await;
                self.count(outcome);
                bus.answer(&asset, receipt, None).await;
                return None;
            }
        };
        drop((payload, room));
        let (id, submitted) = match batch {
            Err(error) => (None, Err(error.into())),
            Ok(mut batch) => (batch.id.take(), self.submit(&asset, batch, waits).await),
        };
        Some(async move {
            let ack = match submitted {
                Ok(pending) => pending.acknowledged().await,
                Err(error) => Err(error),
            };
            (asset, receipt, BatchAnswer::of(id, ack.map_err(Problem::from)))
        })
    }

    async fn submit(
        &self,
        asset: &str,
        batch: Batch,
        waits: bool,
    ) -> Result<crate::service::PendingBatch, ServiceError> {
        if waits {
            return self.service.submit_when_ready(asset, batch, false).await;
        }
        self.service.submit(asset, batch)
    }
}

/// Returns the queue of one bus.
pub(super) fn queue<R>() -> (mpsc::Sender<Delivery<R>>, mpsc::Receiver<Delivery<R>>) {
    mpsc::channel(MAX_QUEUED)
}

/// Parses a batch of a device: MessagePack starts with the tag of a map, with which no JSON
/// document starts.
fn parse(payload: &[u8], limit: usize) -> Result<Batch, BatchError> {
    match payload.first() {
        Some(0x80..=0x8f | 0xde | 0xdf) => telemetry::msgpack(payload, limit),
        _ => telemetry::json(payload, limit),
    }
}
