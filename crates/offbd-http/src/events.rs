//! `/events`: fault transitions as Server-Sent Events.

use std::convert::Infallible;
use std::time::Duration;

use axum::Extension;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Sse;
use axum::response::sse::{Event as Message, KeepAlive};
use futures_util::{Stream, StreamExt};
use serde::Deserialize;
use tokio_util::sync::CancellationToken;
use utoipa::ToSchema;

use super::{App, Problem, Query};
use offbd_core::vocabulary::Invalid;
use offbd_service::access::Caller;
use offbd_service::{EventFeed, Service};

/// Interval without events after which a comment is sent, so that proxies do not close
/// the connection as idle.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct EventsQuery {
    /// Only events of this asset.
    asset: Option<String>,
    /// Starts after the event with this id, as the header `Last-Event-ID` does; 0 for
    /// all stored events.
    after: Option<i64>,
}

/// An event of the stream, as a browser's `EventSource` delivers it.
#[derive(Debug, ToSchema)]
#[allow(dead_code, reason = "describes the events for the interface's document")]
pub(super) struct MessageView {
    /// `fault`, `communication`, or `begin` for the first event.
    event: String,
    /// Event id, an increasing integer.
    id: String,
    /// JSON: an `EventView` for `fault`, a `CommunicationView` with `asset` and `session_id`
    /// for `communication`, an empty object for `begin`.
    data: String,
}

/// Streams fault transitions as they become durable (Server-Sent Events). Each is an
/// event of type `fault` with an id; its data is a fault line with `asset` and
/// `session_id`. A code that is cleared while no session is open is an event without a
/// session and without `t_s`. Data of a rig that stay away or come back are an event of type
/// `communication`. With the header `Last-Event-ID` the missed events are sent
/// first. The first event of every stream has type `begin`; its id is the one after which
/// the stream starts.
#[utoipa::path(get, path = "/events", tag = "faults", operation_id = "stream_events",
    params(EventsQuery),
    responses((status = 200, body = MessageView, content_type = "text/event-stream"),
        (status = 400, body = Problem), (status = 404, body = Problem)))]
pub(super) async fn events(
    State(app): State<App>,
    Query(query): Query<EventsQuery>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
) -> Result<Sse<impl Stream<Item = Result<Message, Infallible>>>, Problem> {
    let after = match headers.get("last-event-id") {
        Some(id) => Some(last_id(id.to_str().unwrap_or_default())?),
        None => query.after,
    };
    let feed = app.service.events(query.asset, after).await?;
    let keep_alive = KeepAlive::new().interval(KEEP_ALIVE);
    let begin = Message::default().id(feed.last().to_string()).event("begin").data("{}");
    let begin = futures_util::stream::once(std::future::ready(Ok(begin)));
    let ended = ended(app.service, caller, app.closing);
    Ok(Sse::new(begin.chain(messages(feed).take_until(ended))).keep_alive(keep_alive))
}

fn last_id(text: &str) -> Result<i64, Problem> {
    let reason = || Invalid::new("?Last-Event-ID", format!("`{text}` is not the id of an event"));
    Ok(text.trim().parse().map_err(|_| reason())?)
}

/// Completes when the service stops, or the caller's token expires or is revoked.
async fn ended(service: Service, caller: Caller, closing: CancellationToken) {
    tokio::select! {
        () = closing.cancelled() => {}
        () = service.wait_for_revocation(&caller) => {}
    }
}

fn messages(feed: EventFeed) -> impl Stream<Item = Result<Message, Infallible>> {
    futures_util::stream::unfold(feed, |mut feed| async {
        match feed.next().await {
            Ok(Some(event)) => {
                let data = event.line();
                let message =
                    Message::default().id(event.id.to_string()).event(event.kind.as_str());
                Some((Ok(message.data(data)), feed))
            }
            Ok(None) => None,
            Err(error) => {
                tracing::error!(%error, "cannot read missed events");
                None
            }
        }
    })
}
