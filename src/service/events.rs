//! Fault transitions as they become durable, to whoever listens.

use std::collections::VecDeque;
use std::sync::Arc;

use tokio::sync::broadcast;
use tokio::sync::broadcast::error::RecvError;

use super::ServiceError;
use crate::store::{ActionRow, EventRow, Store, TransitionRow};

/// Events kept for listeners that are behind; one further behind reads them
/// from the store.
const MAX_BEHIND: usize = 1024;

/// Events read from the store at a time.
const PAGE: u32 = 256;

/// A fault transition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// Rises with every event, never given twice.
    pub id: i64,
    pub asset: String,
    /// The service's id of the session; none if none was open.
    pub session: Option<String>,
    /// The fault line, JSON.
    pub document: String,
}

impl From<EventRow> for Event {
    fn from(row: EventRow) -> Self {
        Self { id: row.id, asset: row.asset, session: row.session, document: row.document }
    }
}

impl Event {
    pub(super) fn of_transition(row: TransitionRow) -> Self {
        let session = Some(row.session);
        Self { id: row.id, asset: row.asset, session, document: row.document }
    }

    /// None for an act that changed nothing, or that a transition tells of.
    pub(super) fn of_act(row: ActionRow) -> Option<Self> {
        let document = row.event?;
        Some(Self { id: row.id, asset: row.asset, session: row.session, document })
    }

    /// The fault line with `asset` and the session's id, a JSON object.
    #[must_use]
    pub fn line(&self) -> String {
        let rest = self.document.strip_prefix('{').unwrap_or(&self.document);
        // Names and ids need no escaping: letters, digits, `-`, `_`, `.`.
        let session = self.session.as_ref().map(|id| format!("\"{id}\""));
        let session = session.as_deref().unwrap_or("null");
        format!(r#"{{"asset":"{}","session_id":{session},{rest}"#, self.asset)
    }
}

#[derive(Clone, Debug)]
pub(super) struct Events {
    store: Store,
    sender: broadcast::Sender<Arc<Event>>,
}

impl Events {
    pub(super) fn new(store: Store) -> Self {
        Self { store, sender: broadcast::Sender::new(MAX_BEHIND) }
    }

    pub(super) fn publish(&self, event: Event) {
        // Nobody listening is no error.
        let _ = self.sender.send(Arc::new(event));
    }

    pub(super) async fn feed(
        &self,
        asset: Option<String>,
        after: Option<i64>,
    ) -> Result<EventFeed, ServiceError> {
        let receiver = self.sender.subscribe();
        let newest = self.store.last_event().await?;
        let last = after.map_or(newest, |id| id.min(newest));
        let (store, backlog) = (self.store.clone(), VecDeque::new());
        Ok(EventFeed { store, receiver, asset, last, backlog, behind: after.is_some() })
    }
}

/// Events of one asset or of all, each once, in order.
#[derive(Debug)]
pub struct EventFeed {
    store: Store,
    receiver: broadcast::Receiver<Arc<Event>>,
    asset: Option<String>,
    last: i64,
    backlog: VecDeque<Arc<Event>>,
    /// Whether the store has events that were missed.
    behind: bool,
}

impl EventFeed {
    /// The id after which the feed goes on.
    #[must_use]
    pub const fn last(&self) -> i64 {
        self.last
    }

    /// The next event; none once the service ends. Safe to cancel.
    ///
    /// # Errors
    /// [`ServiceError::Store`] if missed events cannot be read.
    pub async fn next(&mut self) -> Result<Option<Arc<Event>>, ServiceError> {
        loop {
            if let Some(event) = self.backlog.pop_front() {
                self.last = event.id;
                return Ok(Some(event));
            }
            if self.behind {
                let rows = self.store.events(self.asset.as_deref(), self.last, PAGE).await?;
                self.behind = rows.len() == PAGE as usize;
                self.backlog.extend(rows.into_iter().map(|row| Arc::new(Event::from(row))));
                continue;
            }
            match self.receiver.recv().await {
                Ok(event) if event.id > self.last && self.wants(&event) => {
                    self.last = event.id;
                    return Ok(Some(event));
                }
                Ok(_) => {}
                Err(RecvError::Lagged(_)) => self.behind = true,
                Err(RecvError::Closed) => return Ok(None),
            }
        }
    }

    fn wants(&self, event: &Event) -> bool {
        self.asset.as_ref().is_none_or(|asset| *asset == event.asset)
    }
}

impl super::Service {
    /// Events from now on, or from the one after the id `after`.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::Store`].
    pub async fn events(
        &self,
        asset: Option<String>,
        after: Option<i64>,
    ) -> Result<EventFeed, ServiceError> {
        if let Some(name) = &asset {
            self.asset(name).await?;
        }
        self.inner.events.feed(asset, after).await
    }
}
