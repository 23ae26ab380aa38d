//! `/assets/{asset}/stream`: batches up; acknowledgements, faults and state
//! down, over one WebSocket.
//!
//! Back-pressure is not reading: while `MAX_PENDING` batches wait for their
//! commit, or one waits for room, the next frame stays in the socket; answers
//! and all else go on. A client that does not read its answers is cut off.

use std::collections::VecDeque;
use std::pin::Pin;
use std::time::Duration;

use axum::Extension;
use axum::extract::State;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade, close_code};
use axum::http::StatusCode;
use axum::response::Response;
use futures_util::{FutureExt, SinkExt};
use serde::{Deserialize, Serialize};
use serde_json::json;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval_at, timeout};
use utoipa::ToSchema;

use super::telemetry::Format;
use super::{App, Asset, Problem, Query};
use crate::service::access::{Caller, Right};
use crate::service::{Event, EventFeed, Pending, Service, ServiceError};
use crate::wire::telemetry::AckView;
use crate::wire::trace::TraceView;
use offbd_core::vocabulary::Invalid;

/// Batches whose acknowledgement is owed; then nothing more is read.
const MAX_PENDING: usize = 32;

/// Rows of those batches, from which on nothing more is read either. An answer may
/// list every row of its batch, some 100 bytes each, so a stream's answers are kept
/// to some 5 MB, or to one batch.
const MAX_PENDING_ROWS: usize = 50_000;

/// Longest time to send one frame; a client slower than that is cut off.
const SEND_TIMEOUT: Duration = Duration::from_secs(10);

/// Bytes that may wait in the socket's buffer for a client that reads slowly.
const MAX_WRITE_BUFFER: usize = 1 << 20;

/// Silence after which the client is asked whether it is there; after twice as
/// long it is cut off.
const PING_EVERY: Duration = Duration::from_secs(20);

/// Most states a second; a higher wish gets this many.
const MAX_STATE_HZ: f64 = 50.0;

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct StreamQuery {
    /// States per second wanted, at most 50; none without it.
    #[param(exclusive_minimum = 0)]
    state: Option<f64>,
    /// Fault events after the one with this id come first; 0 for all.
    after: Option<i64>,
    /// Whether each state brings a `trace` of what was judged since the last.
    #[serde(default)]
    trace: bool,
}

/// Frames from the service: `ack` answers a batch (with its `id`), `error` says
/// why one was not taken, `fault` is a fault line, `state` where the twin is,
/// with a `trace` if that was asked for.
#[derive(Debug, ToSchema)]
#[allow(dead_code, reason = "describes the frames for the interface's document")]
pub(super) struct FrameView {
    /// `ack`, `error`, `fault` or `state`.
    #[schema(rename = "type")]
    kind: String,
    /// The `id` of the batch, for `ack` and `error`.
    id: Option<String>,
    #[schema(inline)]
    ack: Option<AckView>,
    /// With a `state`, if asked for: what was judged since the one before.
    trace: Option<TraceView>,
}

/// A WebSocket: batches up, as JSON rows or columns in text frames or the same as
/// MessagePack in binary frames, each with an optional `id`; down come `ack` (once durable), `error` (with a
/// `problem`), `fault` and, if asked for, `state` frames, all JSON objects
/// with a `type`. Batches are taken from whoever may send the asset's telemetry;
/// others see. When the token ends, so does the stream.
#[utoipa::path(get, path = "/assets/{asset}/stream", tag = "telemetry",
    operation_id = "stream_telemetry",
    params(("asset" = String, description = "Name of the asset"), StreamQuery),
    responses((status = 101, body = FrameView, description = "Frames from the service"),
        (status = 404, body = Problem), (status = 426, body = Problem)))]
pub(super) async fn stream(
    State(app): State<App>,
    Asset(asset): Asset,
    Query(query): Query<StreamQuery>,
    Extension(caller): Extension<Caller>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Problem> {
    let upgrade = upgrade.map_err(|rejection| {
        let detail = format!("this address takes WebSockets: {}", rejection.body_text());
        Problem::new(StatusCode::UPGRADE_REQUIRED, "websocket", "Not a WebSocket", detail)
    })?;
    let period = query.state.map(period).transpose()?;
    let watch = query.trace.then(Watched::default);
    let events = app.service.events(Some(asset.clone()), query.after).await?;
    let frame = app.service.limits().batch_bytes;
    let upgrade = upgrade
        .max_frame_size(frame)
        .max_message_size(frame)
        .max_write_buffer_size(MAX_WRITE_BUFFER);
    Ok(upgrade.on_upgrade(move |socket| async move {
        metrics::gauge!("offbd_streams").increment(1.0);
        let session = Session::new(socket, app, caller, asset, events, period, watch);
        session.run().await;
        metrics::gauge!("offbd_streams").decrement(1.0);
    }))
}

fn period(hz: f64) -> Result<Duration, Problem> {
    if hz > 0.0 && hz.is_finite() {
        return Ok(Duration::from_secs_f64(1.0 / hz.clamp(0.01, MAX_STATE_HZ)));
    }
    Err(Invalid::new("?state", format!("{hz} is not a rate above 0")).into())
}

/// Why a connection ends.
enum End {
    /// The other side is gone, or did not keep up.
    Gone,
    /// We say why.
    Close(u16, &'static str),
}

/// A batch whose acknowledgement is owed.
struct Owed {
    id: Option<String>,
    n_rows: usize,
    answer: Outcome<AckView>,
}

/// A batch that waits for room.
struct Waiting {
    id: Option<String>,
    n_rows: usize,
    submitted: Outcome<Pending>,
}

type Outcome<T> = Pin<Box<dyn Future<Output = Result<T, ServiceError>> + Send>>;

fn answer(submitted: Result<Pending, ServiceError>) -> Outcome<AckView> {
    match submitted {
        Ok(pending) => Box::pin(pending.acknowledged()),
        Err(error) => Box::pin(std::future::ready(Err(error))),
    }
}

/// The outcome of what is there; for ever without.
async fn outcome<T>(of: Option<&mut Outcome<T>>) -> Result<T, ServiceError> {
    match of {
        Some(outcome) => outcome.as_mut().await,
        None => std::future::pending().await,
    }
}

/// What a watcher has been told.
#[derive(Default)]
struct Watched {
    session_id: Option<String>,
    seen: u64,
}

struct Session {
    socket: WebSocket,
    app: App,
    /// Whether batches are taken.
    feeds: bool,
    /// Ends with the caller's token.
    lapse: Pin<Box<dyn Future<Output = ()> + Send>>,
    asset: String,
    events: EventFeed,
    states: Option<Interval>,
    pings: Interval,
    heard: Instant,
    owed: VecDeque<Owed>,
    /// The last batch that was read, after those that are owed their answer.
    waiting: Option<Waiting>,
    /// None if no traces are asked for.
    watched: Option<Watched>,
}

/// What happens next on a connection.
enum Next {
    Closing,
    Lapsed,
    Answer(Result<AckView, ServiceError>),
    Submitted(Result<Pending, ServiceError>),
    Frame(Option<Result<Message, axum::Error>>),
    Event(Result<Option<std::sync::Arc<Event>>, ServiceError>),
    State,
    Ping,
}

impl Session {
    #[expect(clippy::disallowed_methods, reason = "a silent socket is closed by the clock")]
    fn new(
        socket: WebSocket,
        app: App,
        caller: Caller,
        asset: String,
        events: EventFeed,
        period: Option<Duration>,
        watched: Option<Watched>,
    ) -> Self {
        let ticks = |period| {
            let mut ticks = interval_at(Instant::now() + period, period);
            ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
            ticks
        };
        let (states, pings) = (period.map(ticks), ticks(PING_EVERY));
        let (owed, waiting, heard) = (VecDeque::new(), None, Instant::now());
        let feeds = caller.may(Right::Feed, &asset);
        let service = app.service.clone();
        let lapse = Box::pin(async move { service.lapse(&caller).await });
        Self {
            socket,
            app,
            feeds,
            lapse,
            asset,
            events,
            states,
            pings,
            heard,
            owed,
            waiting,
            watched,
        }
    }

    async fn run(mut self) {
        let end = loop {
            let next = self.next().await;
            if let Err(end) = self.follow(next).await {
                break end;
            }
        };
        if let End::Close(code, reason) = end {
            let frame = CloseFrame { code, reason: reason.into() };
            let _ = timeout(SEND_TIMEOUT, self.socket.send(Message::Close(Some(frame)))).await;
        }
    }

    async fn next(&mut self) -> Next {
        let full = self.is_full();
        let Self { socket, app, lapse, events, states, pings, owed, waiting, .. } = self;
        let state = async {
            match states {
                Some(states) => states.tick().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            biased;
            () = app.closing.cancelled() => Next::Closing,
            () = lapse => Next::Lapsed,
            answer = outcome(owed.front_mut().map(|owed| &mut owed.answer)) => Next::Answer(answer),
            submitted = outcome(waiting.as_mut().map(|waiting| &mut waiting.submitted)) => {
                Next::Submitted(submitted)
            }
            event = events.next() => Next::Event(event),
            _ = pings.tick() => Next::Ping,
            _ = state => Next::State,
            frame = socket.recv(), if !full => Next::Frame(frame),
        }
    }

    /// Whether nothing more is read now.
    fn is_full(&self) -> bool {
        let n_rows: usize = self.owed.iter().map(|owed| owed.n_rows).sum();
        let n_pending = self.owed.len();
        self.waiting.is_some() || n_pending >= MAX_PENDING || n_rows >= MAX_PENDING_ROWS
    }

    async fn follow(&mut self, next: Next) -> Result<(), End> {
        match next {
            Next::Closing => self.close().await,
            Next::Lapsed => Err(End::Close(close_code::POLICY, "the token is no longer in force")),
            Next::Answer(answer) => self.answers(answer).await,
            Next::Submitted(submitted) => {
                let waiting = self.waiting.take();
                self.owed.extend(waiting.map(|Waiting { id, n_rows, .. }| Owed {
                    id,
                    n_rows,
                    answer: answer(submitted),
                }));
                Ok(())
            }
            Next::Event(Ok(Some(event))) => self.fault(&event).await,
            Next::Event(Ok(None)) => Err(End::Close(close_code::AWAY, "the service is closing")),
            Next::Event(Err(_)) => Err(End::Close(close_code::ERROR, "the store failed")),
            Next::Ping => self.ping().await,
            Next::State => self.state().await,
            Next::Frame(Some(Ok(message))) => self.message(message).await,
            Next::Frame(Some(Err(error))) => {
                tracing::debug!(%error, asset = self.asset, "stream broke off");
                Err(End::Close(close_code::SIZE, "a frame that is broken or too long"))
            }
            Next::Frame(None) => Err(End::Gone),
        }
    }

    /// The service stops: what was taken is still acknowledged, a batch that waits
    /// for room is not taken.
    async fn close(&mut self) -> Result<(), End> {
        self.waiting = None;
        while let Some(owed) = self.owed.pop_front() {
            let answer = owed.answer.await;
            self.send(answer_frame(owed.id.as_deref(), answer)).await?;
        }
        Err(End::Close(close_code::AWAY, "the service is closing"))
    }

    #[expect(clippy::disallowed_methods, reason = "a silent socket is closed by the clock")]
    async fn message(&mut self, message: Message) -> Result<(), End> {
        self.heard = Instant::now();
        match message {
            Message::Text(text) => self.batch(Format::Json, text.as_bytes()).await,
            Message::Binary(bytes) => self.batch(Format::of_bytes(&bytes), &bytes).await,
            Message::Close(_) => Err(End::Gone),
            Message::Ping(_) | Message::Pong(_) => Ok(()),
        }
    }

    /// Takes a batch, when there is room; its answer comes after those of the ones
    /// before.
    async fn batch(&mut self, format: Format, document: &[u8]) -> Result<(), End> {
        if !self.feeds {
            let detail = "the token's role does not send telemetry of this asset";
            let title = "Not allowed";
            let problem = Problem::new(StatusCode::FORBIDDEN, "forbidden", title, detail);
            return self.send(json!({ "type": "error", "problem": problem }).to_string()).await;
        }
        let parsed = format.parse(document, self.app.service.limits().batch_samples);
        match parsed {
            Ok(mut batch) => {
                let (id, n_rows) = (batch.id.take(), batch.rows.len());
                let submitted = self.app.service.submit_in_turn(&self.asset, batch, false);
                self.waiting = Some(Waiting { id, n_rows, submitted: Box::pin(submitted) });
            }
            Err(error) => {
                let answer = answer(Err(error.into()));
                self.owed.push_back(Owed { id: None, n_rows: 0, answer });
            }
        }
        Ok(())
    }

    /// Gives the answer to the first batch that is owed one, and to those after it
    /// whose answers are there too, in one write.
    async fn answers(&mut self, first: Result<AckView, ServiceError>) -> Result<(), End> {
        let mut frames = Vec::new();
        let mut next = Some(first);
        while let Some(answer) = next {
            let id = self.owed.pop_front().and_then(|owed| owed.id);
            frames.push(Message::Text(answer_frame(id.as_deref(), answer).into()));
            next = self.owed.front_mut().and_then(|owed| owed.answer.as_mut().now_or_never());
        }
        self.send_messages(frames).await
    }

    async fn fault(&mut self, event: &Event) -> Result<(), End> {
        // A fault line has the type `fault` already.
        let line = event.line();
        let rest = line.strip_prefix('{').unwrap_or(&line);
        self.send(format!(r#"{{"event":{},{rest}"#, event.id)).await
    }

    async fn state(&mut self) -> Result<(), End> {
        match self.look().await {
            Ok(mut frame) => {
                frame["type"] = "state".into();
                self.send(frame.to_string()).await
            }
            // Telemetry goes first; the next state comes when there is room.
            Err(ServiceError::Busy { .. }) => Ok(()),
            Err(error) => self.send(answer_frame(None, Err(error))).await,
        }
    }

    /// The state and, for a watcher, the trace since the last.
    async fn look(&mut self) -> Result<serde_json::Value, ServiceError> {
        let service: &Service = &self.app.service;
        let Some(watched) = &mut self.watched else {
            let state = service.state(&self.asset).await?;
            return Ok(serde_json::to_value(&state).unwrap_or_default());
        };
        let seen = service.watch(&self.asset, watched.session_id.clone(), watched.seen).await?;
        *watched = Watched { session_id: seen.state.session_id.clone(), seen: seen.seen };
        let mut frame = serde_json::to_value(&seen.state).unwrap_or_default();
        frame["trace"] = serde_json::to_value(&seen.trace).unwrap_or_default();
        Ok(frame)
    }

    async fn ping(&mut self) -> Result<(), End> {
        if self.heard.elapsed() > 2 * PING_EVERY {
            return Err(End::Close(close_code::POLICY, "nothing heard for too long"));
        }
        self.send_messages(vec![Message::Ping(axum::body::Bytes::new())]).await
    }

    async fn send(&mut self, text: String) -> Result<(), End> {
        self.send_messages(vec![Message::Text(text.into())]).await
    }

    async fn send_messages(&mut self, messages: Vec<Message>) -> Result<(), End> {
        let send = async {
            for message in messages {
                self.socket.feed(message).await?;
            }
            self.socket.flush().await
        };
        match timeout(SEND_TIMEOUT, send).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) => Err(End::Gone),
            Err(_) => {
                metrics::counter!("offbd_streams_cut_off_total").increment(1);
                Err(End::Gone)
            }
        }
    }
}

/// An acknowledgement as it goes out.
#[derive(Serialize)]
struct AckFrame<'a> {
    #[serde(rename = "type")]
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<&'a str>,
    #[serde(flatten)]
    ack: &'a AckView,
}

fn answer_frame(id: Option<&str>, answer: Result<AckView, ServiceError>) -> String {
    match answer {
        Ok(ack) => {
            let frame = AckFrame { kind: "ack", id, ack: &ack };
            serde_json::to_string(&frame).unwrap_or_default()
        }
        Err(error) => {
            let mut frame = json!({ "type": "error", "problem": Problem::from(error) });
            if let Some(id) = id {
                frame["id"] = id.into();
            }
            frame.to_string()
        }
    }
}
