//! `/assets/{asset}/stream`: a WebSocket that receives batches and sends
//! acknowledgements, fault transitions and states.
//!
//! Backpressure: no frame is read while [`MAX_PENDING`] batches wait for their commit or
//! one waits for its queue; sending continues. A client that does not read is
//! disconnected.

use std::collections::VecDeque;
use std::pin::Pin;
use std::time::Duration;

use axum::Extension;
use axum::extract::State;
use axum::response::Response;
use futures_util::{FutureExt, SinkExt, StreamExt};
use serde::{Deserialize, Serialize};
use tokio::time::{Instant, Interval, MissedTickBehavior, interval_at, timeout};
use tokio_tungstenite::tungstenite::Error as SocketError;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::CloseFrame;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use utoipa::ToSchema;

use super::body::{BodyShare, ReservedBytes};
use super::web_socket::{WebSocket, WebSocketRequest};
use super::{App, AssetPath, Problem, Query};
use offbd_core::vocabulary::Invalid;
use offbd_service::access::{Caller, Right};
use offbd_service::{Event, EventFeed, PendingBatch, Service, ServiceError};
use offbd_wire::bus::BatchAckView;
use offbd_wire::problem::FORBIDDEN;
use offbd_wire::service::{StateView, TraceCursor};
use offbd_wire::telemetry::{AckView, TelemetryFormat};
use offbd_wire::trace::TraceView;

/// Limit of batches with a pending acknowledgement; at the limit reading pauses.
const MAX_PENDING: usize = 32;

/// Limit of the rows of these batches; at the limit reading pauses. An acknowledgement may
/// list every row of its batch, some 100 bytes each, so those of a stream take at most
/// some 5 MB, or one batch.
const MAX_PENDING_ROWS: usize = 50_000;

/// Longest time to send one frame; a slower client is disconnected.
const SEND_TIMEOUT: Duration = Duration::from_secs(10);

/// Interval between pings; a client that sends nothing for two intervals is disconnected, and
/// one whose message is not complete after two.
const PING_INTERVAL: Duration = Duration::from_secs(20);

/// Highest rate of states, Hz; a higher requested rate is clamped.
const MAX_STATE_HZ: f64 = 50.0;

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct StreamQuery {
    /// Rate of `state` frames, Hz, at most 50; no such frames by default.
    #[param(exclusive_minimum = 0)]
    state: Option<f64>,
    /// Sends the stored fault events after this id first; 0 for all.
    after: Option<i64>,
    /// Whether each `state` frame has a `trace` of the samples evaluated since the
    /// previous one.
    #[serde(default)]
    trace: bool,
}

/// A frame from the service: `ack` acknowledges a batch (with its `id`), `error` rejects
/// one, `fault` is a fault line, `state` is the state of the twin, with a `trace` if
/// requested.
#[derive(Debug, ToSchema)]
#[allow(dead_code, reason = "describes the frames for the interface's document")]
pub(super) struct FrameView {
    /// `ack`, `error`, `fault` or `state`.
    #[schema(rename = "type")]
    kind: String,
    /// `id` of the batch, for `ack` and `error`.
    id: Option<String>,
    #[schema(inline)]
    ack: Option<AckView>,
    /// For `state`, if requested: the samples evaluated since the previous `state`.
    trace: Option<TraceView>,
}

/// Opens a WebSocket for telemetry. The client sends batches, as JSON rows or columns in
/// text frames or as MessagePack in binary frames, each with an optional `id`. The service
/// sends JSON objects with a `type`: `ack` (once the batch is durable), `error` (with a
/// `problem`), `fault` and, if requested, `state`. Sending batches requires the right
/// `feed` for the asset; without it the stream is read-only. The stream is closed when
/// the token expires or is revoked, and with code 1013 when messages of all streams and request
/// bodies take too much memory: connect again later. In a cluster it is closed, with code 1012,
/// when another node takes the asset over: connect again, to any node.
#[utoipa::path(get, path = "/assets/{asset}/stream", tag = "telemetry",
    operation_id = "stream_telemetry",
    params(("asset" = String, description = "Name of the asset"), StreamQuery),
    responses((status = 101, body = FrameView, description = "Frames from the service"),
        (status = 404, body = Problem), (status = 426, body = Problem)))]
pub(super) async fn stream(
    State(app): State<App>,
    AssetPath(asset): AssetPath,
    Query(query): Query<StreamQuery>,
    Extension(caller): Extension<Caller>,
    share: Option<Extension<BodyShare>>,
    upgrade: WebSocketRequest,
) -> Result<Response, Problem> {
    let share = share.map_or_else(|| app.budget.whole(), |Extension(share)| share);
    let period = query.state.map(period).transpose()?;
    let states = RequestedStates { period, cursor: query.trace.then(TraceCursor::default) };
    let events = app.service.events(Some(asset.clone()), query.after).await?;
    let longest = app.service.limits().requests.batch_bytes;
    Ok(upgrade.accept(longest, share, move |socket| async move {
        metrics::gauge!("offbd_streams").increment(1.0);
        let stream = StreamConnection::new(socket, app, caller, asset, events, states);
        stream.run().await;
        metrics::gauge!("offbd_streams").decrement(1.0);
    }))
}

fn period(hz: f64) -> Result<Duration, Problem> {
    if hz > 0.0 && hz.is_finite() {
        return Ok(Duration::from_secs_f64(1.0 / hz.clamp(0.01, MAX_STATE_HZ)));
    }
    Err(Invalid::new("?state", format!("{hz} is not a finite number above 0")).into())
}

/// Why a connection ends.
enum CloseReason {
    /// The client has disconnected or is too slow; no close frame is sent.
    Gone,
    /// The service closes the connection with this code and reason.
    Close(CloseCode, &'static str),
    /// Likewise, while the client may still send the rest of a message.
    Refuse(CloseCode, &'static str),
}

/// A batch that is queued and not acknowledged yet.
struct PendingAck {
    id: Option<String>,
    n_rows: usize,
    ack: ServiceFuture<AckView>,
}

/// A batch that waits for room in the queue of its shard.
struct QueuedBatch {
    id: Option<String>,
    n_rows: usize,
    submitted: ServiceFuture<PendingBatch>,
    /// The memory of its message.
    _memory: ReservedBytes,
}

type ServiceFuture<T> = Pin<Box<dyn Future<Output = Result<T, ServiceError>> + Send>>;

fn acknowledgement(submitted: Result<PendingBatch, ServiceError>) -> ServiceFuture<AckView> {
    match submitted {
        Ok(pending) => Box::pin(pending.acknowledged()),
        Err(error) => Box::pin(std::future::ready(Err(error))),
    }
}

/// Waits for `future`; never completes if it is `None`.
async fn wait<T>(future: Option<&mut ServiceFuture<T>>) -> Result<T, ServiceError> {
    match future {
        Some(future) => future.as_mut().await,
        None => std::future::pending().await,
    }
}

/// The states that a client has requested.
struct RequestedStates {
    period: Option<Duration>,
    /// `None` if no trace is requested.
    cursor: Option<TraceCursor>,
}

struct StreamConnection {
    socket: WebSocket,
    app: App,
    /// Whether the caller may send batches.
    may_send: bool,
    /// Completes when the caller's token expires or is revoked.
    revoked: Pin<Box<dyn Future<Output = ()> + Send>>,
    /// Completes when another node owns the asset.
    moved: Pin<Box<dyn Future<Output = ()> + Send>>,
    asset: String,
    events: EventFeed,
    states: Option<Interval>,
    pings: Interval,
    /// When the last frame was received.
    received_at: Instant,
    /// In the order in which the batches were received.
    pending: VecDeque<PendingAck>,
    /// The batch that was received last, if it is not queued yet.
    waiting: Option<QueuedBatch>,
    /// `None` if no trace is requested.
    cursor: Option<TraceCursor>,
    /// The last stored state, until the rig's engine is loaded. Read once: it changes only when
    /// the engine is loaded.
    stored: Option<StateView>,
}

/// The next event on a connection.
enum StreamEvent {
    Closing,
    Revoked,
    Moved,
    Acknowledged(Result<AckView, ServiceError>),
    Submitted(Result<PendingBatch, ServiceError>),
    Frame(Option<Result<Message, SocketError>>),
    Event(Result<Option<std::sync::Arc<Event>>, ServiceError>),
    State,
    Ping,
}

impl StreamConnection {
    #[expect(clippy::disallowed_methods, reason = "an idle socket is closed after a timeout")]
    fn new(
        socket: WebSocket,
        app: App,
        caller: Caller,
        asset: String,
        events: EventFeed,
        states: RequestedStates,
    ) -> Self {
        let ticks = |period| {
            let mut ticks = interval_at(Instant::now() + period, period);
            ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
            ticks
        };
        let RequestedStates { period, cursor } = states;
        let (states, pings) = (period.map(ticks), ticks(PING_INTERVAL));
        let (pending, waiting, received_at) = (VecDeque::new(), None, Instant::now());
        let may_send = caller.may(Right::SendTelemetry, &asset);
        let service = app.service.clone();
        let revoked = Box::pin(async move { service.wait_for_revocation(&caller).await });
        let (service, name) = (app.service.clone(), asset.clone());
        let moved = Box::pin(async move { service.moved_away(&name).await });
        Self {
            socket,
            app,
            may_send,
            revoked,
            moved,
            asset,
            events,
            states,
            pings,
            received_at,
            pending,
            waiting,
            cursor,
            stored: None,
        }
    }

    async fn run(mut self) {
        let reason = loop {
            let event = self.next_event().await;
            if let Err(reason) = self.handle(event).await {
                break reason;
            }
        };
        let is_refused = matches!(reason, CloseReason::Refuse(..));
        if let CloseReason::Close(code, reason) | CloseReason::Refuse(code, reason) = reason {
            let frame = CloseFrame { code, reason: reason.into() };
            // The client may be gone.
            let _ = timeout(SEND_TIMEOUT, self.socket.send(Message::Close(Some(frame)))).await;
        }
        if is_refused {
            // Without what the socket has read.
            self.socket.into_inner().discard().await;
        }
    }

    async fn next_event(&mut self) -> StreamEvent {
        let full = self.is_full();
        let Self { socket, app, revoked, moved, events, states, pings, pending, waiting, .. } =
            self;
        let state = async {
            match states {
                Some(states) => states.tick().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            biased;
            () = app.closing.cancelled() => StreamEvent::Closing,
            () = revoked => StreamEvent::Revoked,
            () = moved => StreamEvent::Moved,
            ack = wait(pending.front_mut().map(|pending| &mut pending.ack)) => {
                StreamEvent::Acknowledged(ack)
            }
            submitted = wait(waiting.as_mut().map(|waiting| &mut waiting.submitted)) => {
                StreamEvent::Submitted(submitted)
            }
            event = events.next() => StreamEvent::Event(event),
            _ = pings.tick() => StreamEvent::Ping,
            _ = state => StreamEvent::State,
            frame = socket.next(), if !full => StreamEvent::Frame(frame),
        }
    }

    /// Whether reading is paused.
    fn is_full(&self) -> bool {
        let n_rows: usize = self.pending.iter().map(|pending| pending.n_rows).sum();
        let n_pending = self.pending.len();
        self.waiting.is_some() || n_pending >= MAX_PENDING || n_rows >= MAX_PENDING_ROWS
    }

    async fn handle(&mut self, event: StreamEvent) -> Result<(), CloseReason> {
        match event {
            StreamEvent::Closing => {
                self.close(CloseCode::Away, "the service is shutting down").await
            }
            StreamEvent::Moved => {
                let reason = "another node serves the asset now; connect again";
                self.close(CloseCode::Restart, reason).await
            }
            StreamEvent::Revoked => {
                Err(CloseReason::Close(CloseCode::Policy, "the token has expired or was revoked"))
            }
            StreamEvent::Acknowledged(ack) => self.send_acks(ack).await,
            StreamEvent::Submitted(submitted) => {
                let waiting = self.waiting.take();
                self.pending.extend(waiting.map(|QueuedBatch { id, n_rows, .. }| PendingAck {
                    id,
                    n_rows,
                    ack: acknowledgement(submitted),
                }));
                Ok(())
            }
            StreamEvent::Event(Ok(Some(event))) => self.send_fault(&event).await,
            StreamEvent::Event(Ok(None)) => {
                Err(CloseReason::Close(CloseCode::Away, "the service is shutting down"))
            }
            StreamEvent::Event(Err(_)) => {
                Err(CloseReason::Close(CloseCode::Error, "the store failed"))
            }
            StreamEvent::Ping => self.send_ping().await,
            StreamEvent::State => self.send_state().await,
            StreamEvent::Frame(Some(Ok(message))) => self.receive(message).await,
            StreamEvent::Frame(Some(Err(error))) => {
                tracing::debug!(%error, asset = self.asset, "the stream failed");
                let (code, reason) = failure(&error);
                Err(CloseReason::Refuse(code, reason))
            }
            StreamEvent::Frame(None) => Err(CloseReason::Gone),
        }
    }

    /// Closes the connection when the service stops or the asset has moved: queued batches are
    /// still answered, one that waits for room is dropped.
    async fn close(&mut self, code: CloseCode, reason: &'static str) -> Result<(), CloseReason> {
        self.waiting = None;
        while let Some(pending) = self.pending.pop_front() {
            let ack = pending.ack.await;
            self.send_messages(vec![text(&answer(pending.id, ack))]).await?;
        }
        Err(CloseReason::Close(code, reason))
    }

    #[expect(clippy::disallowed_methods, reason = "an idle socket is closed after a timeout")]
    async fn receive(&mut self, message: Message) -> Result<(), CloseReason> {
        self.received_at = Instant::now();
        match message {
            Message::Text(text) => self.ingest(TelemetryFormat::Json, text.as_bytes()).await,
            Message::Binary(bytes) => self.ingest(TelemetryFormat::of_bytes(&bytes), &bytes).await,
            Message::Close(_) => Err(CloseReason::Gone),
            Message::Ping(content) | Message::Pong(content) => {
                self.socket.get_mut().release_control(content.len());
                Ok(())
            }
            // Only a frame that is sent.
            Message::Frame(_) => Ok(()),
        }
    }

    /// Submits a batch; acknowledgements are sent in the order of the batches.
    async fn ingest(
        &mut self,
        format: TelemetryFormat,
        document: &[u8],
    ) -> Result<(), CloseReason> {
        let memory = self.socket.get_mut().take_reserved();
        if !self.may_send {
            let detail = "the token does not permit sending telemetry of this asset";
            let problem = Problem::new(FORBIDDEN, detail);
            let refused = StreamErrorView { id: None, problem };
            return self.send_messages(vec![text(&StreamFrameView::Error(refused))]).await;
        }
        let most = self.app.service.limits().requests.batch_samples;
        match format.parse(document, most) {
            Ok(mut batch) => {
                let (id, n_rows) = (batch.id.take(), batch.rows.len());
                let submitted = self.app.service.submit_when_ready(&self.asset, batch, false);
                let submitted = Box::pin(submitted);
                self.waiting = Some(QueuedBatch { id, n_rows, submitted, _memory: memory });
            }
            Err(error) => {
                let ack = acknowledgement(Err(error.into()));
                self.pending.push_back(PendingAck { id: None, n_rows: 0, ack });
            }
        }
        Ok(())
    }

    /// Sends the first acknowledgement, and those after it that are ready, in one write.
    async fn send_acks(&mut self, first: Result<AckView, ServiceError>) -> Result<(), CloseReason> {
        let mut frames = Vec::new();
        let mut next = Some(first);
        while let Some(ack) = next {
            let id = self.pending.pop_front().and_then(|pending| pending.id);
            frames.push(text(&answer(id, ack)));
            next = self.pending.front_mut().and_then(|pending| pending.ack.as_mut().now_or_never());
        }
        self.send_messages(frames).await
    }

    async fn send_fault(&mut self, event: &Event) -> Result<(), CloseReason> {
        // A fault line has a `type` already.
        let line = event.line();
        let rest = line.strip_prefix('{').unwrap_or(&line);
        self.send(format!(r#"{{"event":{},{rest}"#, event.id)).await
    }

    async fn send_state(&mut self) -> Result<(), CloseReason> {
        let frame = match self.state().await {
            Ok(state) => StreamFrameView::State(Box::new(state)),
            // Telemetry has priority, or the engine is not ready: this state is skipped.
            Err(ServiceError::Busy { .. } | ServiceError::Rebuilding { .. }) => return Ok(()),
            Err(error) => answer(None, Err(error)),
        };
        self.send_messages(vec![text(&frame)]).await
    }

    /// Returns the state and, if requested, the trace since the previous state.
    async fn state(&mut self) -> Result<WatchedStateView, ServiceError> {
        let service: &Service = &self.app.service;
        let Some(view) = service.watch(&self.asset, self.cursor.clone()).await? else {
            let state = match self.stored.take() {
                Some(stored) => service.with_mutes(stored),
                None => service.state(&self.asset).await?,
            };
            self.stored = Some(state.clone());
            let trace = self.cursor.as_ref().map(|_| TraceView::default());
            return Ok(WatchedStateView { state, trace });
        };
        (self.stored, self.cursor) = (None, view.cursor);
        Ok(WatchedStateView { state: view.state, trace: view.trace })
    }

    async fn send_ping(&mut self) -> Result<(), CloseReason> {
        if self.received_at.elapsed() > 2 * PING_INTERVAL {
            return Err(CloseReason::Close(
                CloseCode::Policy,
                "the client did not answer the pings",
            ));
        }
        if self.socket.get_mut().begun_at().is_some_and(|at| at.elapsed() > 2 * PING_INTERVAL) {
            return Err(CloseReason::Close(CloseCode::Policy, "the message was not completed"));
        }
        self.send_messages(vec![Message::Ping(axum::body::Bytes::new())]).await
    }

    async fn send(&mut self, text: String) -> Result<(), CloseReason> {
        self.send_messages(vec![Message::Text(text.into())]).await
    }

    async fn send_messages(&mut self, messages: Vec<Message>) -> Result<(), CloseReason> {
        let send = async {
            for message in messages {
                self.socket.feed(message).await?;
            }
            self.socket.flush().await
        };
        match timeout(SEND_TIMEOUT, send).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) => Err(CloseReason::Gone),
            Err(_) => {
                metrics::counter!("offbd_streams_cut_off_total").increment(1);
                Err(CloseReason::Gone)
            }
        }
    }
}

/// A frame from the service that is not an event.
#[derive(Debug, Serialize, ToSchema)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(super) enum StreamFrameView {
    /// A batch is durable.
    Ack(BatchAckView),
    /// A batch was refused, or there is no state.
    Error(StreamErrorView),
    /// The state of rig and twin.
    State(Box<WatchedStateView>),
}

/// Why a batch was refused.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct StreamErrorView {
    /// The id of the batch, if it has one and could be read.
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<String>,
    problem: Problem,
}

/// The state of rig and twin.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct WatchedStateView {
    #[serde(flatten)]
    state: StateView,
    /// The samples evaluated since the previous state, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    trace: Option<TraceView>,
}

/// Returns the frame of the answer to a batch.
fn answer(id: Option<String>, ack: Result<AckView, ServiceError>) -> StreamFrameView {
    match ack {
        Ok(ack) => StreamFrameView::Ack(BatchAckView { id, ack }),
        Err(error) => StreamFrameView::Error(StreamErrorView { id, problem: error.into() }),
    }
}

fn text(frame: &StreamFrameView) -> Message {
    Message::Text(serde_json::to_string(frame).unwrap_or_default().into())
}

/// Returns the close code and the reason for a frame that could not be read (RFC 6455,
/// section 7.4.1, and the IANA registry).
fn failure(error: &SocketError) -> (CloseCode, &'static str) {
    match error {
        SocketError::Capacity(_) => (CloseCode::Size, "the message is too long"),
        SocketError::Utf8(_) => (CloseCode::Invalid, "a text message is not UTF-8"),
        SocketError::Io(error) if error.kind() == std::io::ErrorKind::OutOfMemory => {
            (CloseCode::Again, "messages take too much memory at present; connect again later")
        }
        _ => (CloseCode::Protocol, "a malformed frame"),
    }
}
