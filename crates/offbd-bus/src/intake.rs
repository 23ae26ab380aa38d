//! Messages of devices: from a message to a batch, from a batch to its answer.

use std::future::Future;
use std::sync::Arc;

use futures_util::future::BoxFuture;
use futures_util::stream::FuturesUnordered;
use futures_util::{FutureExt, StreamExt};
use hyper::body::Bytes;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};

use super::presence::Attendance;
use super::{MAX_PENDING, MAX_QUEUED, MAX_QUEUED_BYTES, count};
use offbd_http::{Forwarder, MessageOutcome, Problem};
use offbd_service::{Route, Service, ServiceError};
use offbd_wire::bus::{BatchAckView, BatchRefusalView, DeviceTopic};
use offbd_wire::mapping::MappedTopic;
use offbd_wire::telemetry::{self, AckView, Batch, BatchError};

/// A batch of a device that waits to be parsed.
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

/// A message of a device.
pub(super) enum BusMessage {
    Batch(Form),
    /// A greeting or a presence.
    Presence(DeviceTopic),
}

impl From<DeviceTopic> for BusMessage {
    fn from(topic: DeviceTopic) -> Self {
        match topic {
            DeviceTopic::Telemetry => Self::Batch(Form::Own),
            DeviceTopic::Hello | DeviceTopic::State => Self::Presence(topic),
        }
    }
}

/// The form of a batch.
#[derive(Clone)]
pub(super) enum Form {
    Own,
    Mapped(Arc<MappedTopic>),
}

impl Form {
    /// Parses a batch of at most `limit` samples.
    fn batch(&self, payload: &[u8], limit: usize) -> Result<Batch, BatchError> {
        match self {
            Self::Own => parse(payload, limit),
            Self::Mapped(topic) => topic.batch(payload, limit),
        }
    }
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

    fn outcome(&self) -> MessageOutcome {
        let Self::Refused(refusal) = self else { return MessageOutcome::Taken };
        match refusal.status {
            400 | 422 => MessageOutcome::Malformed,
            404 => MessageOutcome::UnknownAsset,
            409 => MessageOutcome::Conflict,
            413 => MessageOutcome::TooLarge,
            429 => MessageOutcome::Busy,
            _ => MessageOutcome::Unavailable,
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

/// What becomes of a message.
pub(super) enum MessageReply {
    /// The answer is sent to the device.
    Answer(BatchAnswer),
    /// Nothing is sent: it was no batch, or the owner of the asset answers.
    Nothing,
    /// Nothing is sent, and the message has to come again, if the bus can repeat it.
    Again,
}

/// The reply to a message, with its asset and receipt, once it is known.
type PendingReply<R> = BoxFuture<'static, (String, R, MessageReply)>;

/// How a bus answers a message.
pub(super) trait Answering: Send + Sync {
    /// What it needs for this, besides the asset.
    type Receipt: Send + 'static;

    /// Sends the answer to a message.
    fn answer(
        &self,
        asset: &str,
        receipt: Self::Receipt,
        reply: MessageReply,
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
    forwarder: Forwarder,
}

impl Intake {
    pub(super) fn new(bus: &'static str, service: Service) -> Self {
        let bytes = Arc::new(Semaphore::new(MAX_QUEUED_BYTES));
        let attendance = Attendance::new(bus);
        Self { bus, service, attendance, bytes, forwarder: Forwarder::default() }
    }

    /// Counts a message by what became of it.
    pub(super) fn count(&self, outcome: MessageOutcome) {
        count(self.bus, outcome, 1);
    }

    /// Queues a batch. Returns the reply with the receipt if the batch is too long, the queue is
    /// full, or the message is a presence, which is not queued here.
    pub(super) fn queue<R>(
        &self,
        queue: &mpsc::Sender<Delivery<R>>,
        (asset, message): (String, BusMessage),
        payload: Bytes,
        receipt: R,
        waits: bool,
    ) -> Result<(), (String, R, Box<MessageReply>)> {
        let form = match message {
            BusMessage::Batch(form) => form,
            BusMessage::Presence(topic) => {
                self.attendance.arrive(&self.service, asset.clone(), topic, &payload);
                return Err((asset, receipt, Box::new(MessageReply::Nothing)));
            }
        };
        let limit = self.service.limits().requests.batch_bytes;
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

    fn refused(&self, error: ServiceError) -> MessageReply {
        let answer = BatchAnswer::of(None, Err(error.into()));
        self.count(answer.outcome());
        MessageReply::Answer(answer)
    }

    /// Answers the batches of the queue until it is closed, and checks presences meanwhile.
    pub(super) async fn run<A: Answering>(
        self,
        bus: &A,
        queue: mpsc::Receiver<Delivery<A::Receipt>>,
    ) {
        tokio::select! {
            () = self.answer_batches(bus, queue) => {}
            () = self.attendance.check_assets(&self.service) => {}
        }
        bus.finish().await;
    }

    async fn answer_batches<A: Answering>(
        &self,
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
                Some((asset, receipt, reply)) = pending.next(), if !pending.is_empty() => {
                    if let MessageReply::Answer(answer) = &reply {
                        self.count(answer.outcome());
                    }
                    bus.answer(&asset, receipt, reply).await;
                }
            }
        }
    }

    /// Submits a batch and returns its pending reply; `None` if there is none.
    async fn take<A: Answering>(
        &self,
        bus: &A,
        delivery: Delivery<A::Receipt>,
    ) -> Option<PendingReply<A::Receipt>> {
        if self.service.route(&delivery.asset) != Route::Here {
            return self.pass_on(bus, delivery).await;
        }
        let limit = self.service.limits().requests.batch_samples;
        let Delivery { asset, form, payload, receipt, waits, room } = delivery;
        let batch = form.batch(&payload, limit);
        drop((payload, room));
        let (id, submitted) = match batch {
            Err(error) => (None, Err(error.into())),
            Ok(mut batch) => (batch.id.take(), self.submit(&asset, batch, waits).await),
        };
        let answered = async move {
            let ack = match submitted {
                Ok(pending) => pending.acknowledged().await,
                Err(error) => Err(error),
            };
            (asset, receipt, MessageReply::Answer(BatchAnswer::of(id, ack.map_err(Problem::from))))
        };
        Some(answered.boxed())
    }

    /// Handles a message of an asset that another node owns. In a cluster each node gets the
    /// message, and the owner takes and answers it. A batch that the bus keeps until it is
    /// acknowledged is sent to the owner as well, which may have failed before it was stored.
    async fn pass_on<A: Answering>(
        &self,
        bus: &A,
        delivery: Delivery<A::Receipt>,
    ) -> Option<PendingReply<A::Receipt>> {
        self.count(MessageOutcome::Elsewhere);
        let Delivery { asset, form, payload, receipt, waits, .. } = delivery;
        let limit = self.service.limits().requests.batch_samples;
        let Some(Ok(batch)) = waits.then(|| form.batch(&payload, limit)) else {
            bus.answer(&asset, receipt, MessageReply::Nothing).await;
            return None;
        };
        let (service, forwarder) = (self.service.clone(), self.forwarder.clone());
        let delivered = async move {
            let is_settled = forwarder.deliver(&service, &asset, &batch).await;
            (asset, receipt, if is_settled { MessageReply::Nothing } else { MessageReply::Again })
        };
        Some(delivered.boxed())
    }

    async fn submit(
        &self,
        asset: &str,
        batch: Batch,
        waits: bool,
    ) -> Result<offbd_service::PendingBatch, ServiceError> {
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
