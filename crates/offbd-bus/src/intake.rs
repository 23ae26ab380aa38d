//! Messages of devices: makes a batch of each, and an answer of the result.

use std::future::Future;
use std::mem::replace;
use std::sync::Arc;

use futures_util::future::BoxFuture;
use futures_util::stream::FuturesUnordered;
use futures_util::{FutureExt, StreamExt};
use hyper::body::Bytes;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};
use tokio::time::sleep;

use super::batch_id::{batch_id, is_msgpack};
use super::held::Held;
use super::presence::Attendance;
use super::{MAX_PENDING, MAX_QUEUED, MAX_QUEUED_BYTES, count};
use offbd_http::{Forwarder, MessageOutcome, Problem};
use offbd_service::{Route, Service, ServiceError};
use offbd_wire::bus::{BatchAckView, BatchRefusalView, DeviceTopic};
use offbd_wire::mapping::MappedTopic;
use offbd_wire::telemetry::{self, AckView, Batch, BatchError};

/// The error of a batch that finds the queue or its bytes full.
const BUSY: ServiceError = ServiceError::Busy { what: "too many messages wait to be parsed" };

/// A batch of a device that waits to be parsed, or is tried again.
pub(super) struct Delivery<R> {
    pub(super) asset: String,
    pub(super) form: Form,
    pub(super) payload: Bytes,
    /// What the bus needs to answer.
    pub(super) receipt: R,
    /// Whether the bus keeps the batch until it is settled: it waits for room, and is tried again
    /// if it is refused only for the moment.
    pub(super) waits: bool,
    /// Counts the bytes of the payload while the batch waits.
    room: Option<OwnedSemaphorePermit>,
    /// Whether the batch has been tried.
    is_tried: bool,
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
            Self::Own if is_msgpack(payload) => telemetry::msgpack(payload, limit),
            Self::Own => telemetry::json(payload, limit),
            Self::Mapped(topic) => topic.batch(payload, limit),
        }
    }

    /// Returns the id of a batch that is not taken; `None` if it has none or cannot be read.
    fn id(&self, payload: &[u8]) -> Option<String> {
        match self {
            Self::Own => batch_id(payload),
            Self::Mapped(_) => None,
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
    /// Nothing is sent: it was not a batch, or the owner of the asset answers.
    Nothing,
    /// Nothing is sent, and the message has to come again, if the bus can repeat it.
    Again,
}

impl MessageReply {
    /// Whether another attempt may give another reply.
    const fn is_temporary(&self) -> bool {
        match self {
            Self::Answer(answer) => answer.retry_after_s().is_some(),
            Self::Nothing => false,
            Self::Again => true,
        }
    }
}

/// The result of an attempt to store a batch.
struct Attempt<R> {
    /// The number of the message, in order of arrival.
    number: u64,
    delivery: Delivery<R>,
    reply: MessageReply,
}

/// How a bus answers a message.
pub(super) trait Answering: Send + Sync {
    /// What it needs for this, besides the asset.
    type Receipt: Clone + Send + 'static;

    /// Sends the answer to a message. A batch that the bus keeps, and that is refused only for
    /// the moment, is answered once more.
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

    /// Queues a batch. Returns the reply with the receipt if the owner of the asset takes it, the
    /// batch is too long, the queue is full, or the message is a presence, which is not queued
    /// here.
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
        // Each node of a cluster gets the message, and the owner alone answers it.
        let is_owner = self.service.route(&asset) == Route::Here;
        if !is_owner {
            self.count(MessageOutcome::Elsewhere);
            if !waits {
                return Err((asset, receipt, Box::new(MessageReply::Nothing)));
            }
        }
        let room = match self.admit(&payload) {
            Ok(room) => Some(room),
            Err(error) => {
                let reply = self.refused(is_owner, form.id(&payload), error);
                return Err((asset, receipt, Box::new(reply)));
            }
        };
        let delivery = Delivery { asset, form, payload, receipt, waits, room, is_tried: false };
        queue.try_send(delivery).map_err(|error| {
            let Delivery { asset, form, payload, receipt, .. } = error.into_inner();
            (asset, receipt, Box::new(self.refused(is_owner, form.id(&payload), BUSY)))
        })
    }

    /// Returns room for a batch that is not too long.
    fn admit(&self, payload: &Bytes) -> Result<OwnedSemaphorePermit, ServiceError> {
        let limit = self.service.limits().requests.batch_bytes;
        if payload.len() > limit {
            return Err(ServiceError::TooMany { what: "bytes in one message", limit });
        }
        let size = u32::try_from(payload.len()).unwrap_or(u32::MAX);
        self.bytes.clone().try_acquire_many_owned(size).map_err(|_| BUSY)
    }

    /// Returns the reply to a batch that is not queued.
    fn refused(&self, is_owner: bool, id: Option<String>, error: ServiceError) -> MessageReply {
        let answer = BatchAnswer::of(id, Err(error.into()));
        if is_owner {
            self.count(answer.outcome());
            return MessageReply::Answer(answer);
        }
        // The bus keeps it for the owner, which has got it too, unless it was not there.
        if answer.retry_after_s().is_some() { MessageReply::Again } else { MessageReply::Nothing }
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
        let (mut pending, mut pauses) = (FuturesUnordered::new(), FuturesUnordered::new());
        let (mut held, mut n_arrived, mut open) = (Held::default(), 0, true);
        while open || !pending.is_empty() {
            tokio::select! {
                delivery = queue.recv(), if open && pending.len() < MAX_PENDING => match delivery {
                    Some(delivery) => {
                        n_arrived += 1;
                        let asset = delivery.asset.clone();
                        if let Some(delivery) = held.join(&asset, n_arrived, delivery) {
                            let attempt = self.attempt(n_arrived, delivery).await;
                            pending.push(attempt);
                        }
                    }
                    None => open = false,
                },
                Some(attempt) = pending.next(), if !pending.is_empty() => {
                    let (asset, number) = (attempt.delivery.asset.clone(), attempt.number);
                    let kept = self.conclude(bus, attempt).await;
                    if let Some(delivery) = kept {
                        let pause = held.keep(&asset, number, delivery);
                        pauses.extend(pause.map(|pause| async move {
                            sleep(pause).await;
                            asset
                        }));
                    } else if open
                        && let Some((number, delivery)) = held.settle(&asset, number)
                    {
                        let attempt = self.attempt(number, delivery).await;
                        pending.push(attempt);
                    }
                }
                Some(asset) = pauses.next(), if open && !pauses.is_empty() => {
                    if let Some((number, delivery)) = held.due(&asset) {
                        let attempt = self.attempt(number, delivery).await;
                        pending.push(attempt);
                    }
                }
            }
        }
    }

    /// Answers a batch. Returns it if it is to be tried again.
    async fn conclude<A: Answering>(
        &self,
        bus: &A,
        attempt: Attempt<A::Receipt>,
    ) -> Option<Delivery<A::Receipt>> {
        let Attempt { mut delivery, mut reply, .. } = attempt;
        let is_first = !replace(&mut delivery.is_tried, true);
        let is_held = delivery.waits && reply.is_temporary();
        if let MessageReply::Answer(answer) = &reply
            && (is_first || !is_held)
        {
            self.count(answer.outcome());
        }
        if is_held && delivery.room.is_none() {
            delivery.room = self.admit(&delivery.payload).ok();
        }
        let is_kept = is_held && delivery.room.is_some();
        if is_held && !is_kept {
            reply = MessageReply::Again;
        }
        let is_news = is_first && matches!(reply, MessageReply::Answer(_));
        if is_news || !is_kept {
            bus.answer(&delivery.asset, delivery.receipt.clone(), reply).await;
        }
        is_kept.then_some(delivery)
    }

    /// Tries to have a batch stored: submits it, so that the batches of an asset reach it in order
    /// of arrival, and returns the future of its reply.
    async fn attempt<R: Send + 'static>(
        &self,
        number: u64,
        mut delivery: Delivery<R>,
    ) -> BoxFuture<'static, Attempt<R>> {
        let limit = self.service.limits().requests.batch_samples;
        let batch = delivery.form.batch(&delivery.payload, limit);
        if self.service.route(&delivery.asset) != Route::Here {
            let intake = self.clone();
            return async move {
                let reply =
                    intake.pass_on(&delivery.asset, batch.ok().filter(|_| delivery.waits)).await;
                Attempt { number, delivery, reply }
            }
            .boxed();
        }
        let (id, submitted) = match batch {
            Err(error) => (delivery.form.id(&delivery.payload), Err(error.into())),
            Ok(mut batch) => {
                let id = batch.id.take();
                (id, self.submit(&delivery.asset, batch, delivery.waits).await)
            }
        };
        delivery.room = None;
        if !delivery.waits {
            delivery.payload = Bytes::new();
        }
        async move {
            let ack = match submitted {
                Ok(pending) => pending.acknowledged().await,
                Err(error) => Err(error),
            };
            let reply = MessageReply::Answer(BatchAnswer::of(id, ack.map_err(Problem::from)));
            Attempt { number, delivery, reply }
        }
        .boxed()
    }

    /// Handles a batch of an asset that another node owns, which gets and answers it too. If the
    /// bus keeps the batch until it is acknowledged, it is sent to the owner as well, which may
    /// have failed before the batch was stored.
    async fn pass_on(&self, asset: &str, batch: Option<Batch>) -> MessageReply {
        let Some(batch) = batch else { return MessageReply::Nothing };
        if self.forwarder.deliver(&self.service, asset, &batch).await {
            MessageReply::Nothing
        } else {
            MessageReply::Again
        }
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
