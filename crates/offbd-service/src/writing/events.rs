//! Publishes fault transitions once they are durable.

use std::collections::VecDeque;
use std::sync::Arc;

use std::time::Duration;

use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{Notify, broadcast, watch};
use tokio_util::sync::CancellationToken;

use crate::ServiceError;
use offbd_store::{ActionRow, CommunicationChange, EventRow, Store, StoreError, TransitionRow};

/// Longest time for one read of the store. Chosen: twice the time that a reader waits for
/// a connection; a database that takes longer is unavailable.
pub(super) const READ_TIMEOUT: Duration = Duration::from_secs(20);

/// Events buffered for slow subscribers; one that lags further behind reads the events from
/// the store.
const MAX_BUFFERED: usize = 1024;

/// How often a node of a cluster looks for events of others that it was not told of.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Pause of a node after it has read the events of the cluster, and after it has announced its own:
/// many events then cost one read. Chosen: nobody who reads an alarm notices it.
const PAUSE: Duration = Duration::from_millis(100);

/// Events read from the store per query.
const PAGE: u32 = 256;

/// What an event is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// A change of the status of a fault.
    Fault,
    /// Data of a rig stay away or come back.
    Communication,
}

impl EventKind {
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Fault => "fault",
            Self::Communication => "communication",
        }
    }
}

/// A fault transition, or a change of communication.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// Unique and increasing.
    pub id: i64,
    pub kind: EventKind,
    pub asset: String,
    /// The id of the session; `None` if none was open.
    pub session: Option<String>,
    /// The fault line or the change of communication, JSON.
    pub document: String,
}

impl From<EventRow> for Event {
    fn from(row: EventRow) -> Self {
        let EventRow { id, kind, asset, session, document } = row;
        let kind = match kind.as_str() {
            "communication" => EventKind::Communication,
            _ => EventKind::Fault,
        };
        Self { id, kind, asset, session, document }
    }
}

impl Event {
    pub(crate) fn of_transition(row: TransitionRow) -> Self {
        let TransitionRow { id, asset, session, document, .. } = row;
        Self { id, kind: EventKind::Fault, asset, session: Some(session), document }
    }

    /// None for an act that changed nothing, or that a transition tells of.
    pub(crate) fn of_act(row: ActionRow) -> Option<Self> {
        let document = row.event?;
        let ActionRow { id, asset, session, .. } = row;
        Some(Self { id, kind: EventKind::Fault, asset, session, document })
    }

    /// None if the asset has been deleted.
    pub(crate) fn of_communication(row: CommunicationChange) -> Option<Self> {
        let CommunicationChange { id, asset, session, document, .. } = row;
        let kind = EventKind::Communication;
        (id != 0).then_some(Self { id, kind, asset, session, document })
    }

    /// Returns the fault line with `asset` and `session_id`, a JSON object.
    #[must_use]
    pub fn line(&self) -> String {
        line(&self.asset, self.session.as_deref(), &self.document)
    }
}

/// Returns the `document` of an event with `asset` and `session_id`, a JSON object.
pub(crate) fn line(asset: &str, session: Option<&str>, document: &str) -> String {
    let rest = document.strip_prefix('{').unwrap_or(document);
    // Names and ids need no escaping: letters, digits, `-`, `_`, `.`.
    let session = session.map(|id| format!("\"{id}\""));
    let session = session.as_deref().unwrap_or("null");
    format!(r#"{{"asset":"{asset}","session_id":{session},{rest}"#)
}

/// The publisher of events. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Events {
    store: Store,
    sender: broadcast::Sender<Arc<Event>>,
    /// In a cluster, where other nodes have events too.
    of_cluster: Option<Arc<ClusterEvents>>,
}

/// Wakes the tasks of a node that read the events of all nodes from the store, in the order of
/// their ids, and tell the others of new ones.
#[derive(Debug, Default)]
struct ClusterEvents {
    read: Notify,
    announce: Notify,
    /// Whether the events are read: only while somebody listens.
    is_read: watch::Sender<bool>,
}

impl Events {
    pub(crate) fn new(store: Store, in_cluster: bool) -> Self {
        let of_cluster = in_cluster.then(Arc::default);
        Self { store, sender: broadcast::Sender::new(MAX_BUFFERED), of_cluster }
    }

    /// Publishes an event of this process.
    pub(crate) fn publish(&self, event: Event) {
        match &self.of_cluster {
            Some(tasks) => {
                tasks.read.notify_one();
                tasks.announce.notify_one();
            }
            None => self.send(event),
        }
    }

    /// Says that another process may have events.
    pub(crate) fn wake(&self) {
        self.of_cluster.iter().for_each(|tasks| tasks.read.notify_one());
    }

    fn send(&self, event: Event) {
        // Fails without subscribers, which is not an error.
        let _ = self.sender.send(Arc::new(event));
    }

    /// Subscribes to be woken by events; returns once those of other nodes are read too. If the
    /// store does not answer for [`READ_TIMEOUT`], they are read later.
    pub(crate) async fn subscribe(&self) -> broadcast::Receiver<Arc<Event>> {
        let receiver = self.sender.subscribe();
        if let Some(tasks) = &self.of_cluster {
            tasks.read.notify_one();
            let mut is_read = tasks.is_read.subscribe();
            let _ = tokio::time::timeout(READ_TIMEOUT, is_read.wait_for(|is| *is)).await;
        }
        receiver
    }

    /// In a cluster, reads the events of all nodes and publishes them here while somebody listens,
    /// until `closing`.
    pub(crate) async fn read_all(self, closing: CancellationToken) {
        let Some(tasks) = self.of_cluster.clone() else { return };
        let forever = async {
            let mut last = None;
            loop {
                if self.is_listened_to(&tasks) {
                    let read = tokio::time::timeout(READ_TIMEOUT, self.read_new(&mut last)).await;
                    match read.unwrap_or_else(|_| Err(StoreError::too_slow())) {
                        Ok(()) => drop(tasks.is_read.send_replace(true)),
                        Err(error) => {
                            tracing::debug!(%error, "cannot read the events of the cluster");
                        }
                    }
                } else {
                    last = None;
                }
                tokio::time::sleep(PAUSE).await;
                let _ = tokio::time::timeout(LOOK_EVERY, tasks.read.notified()).await;
            }
        };
        closing.run_until_cancelled(forever).await;
        // Nobody waits for them any more.
        tasks.is_read.send_replace(true);
    }

    fn is_listened_to(&self, tasks: &ClusterEvents) -> bool {
        if self.sender.receiver_count() > 0 {
            return true;
        }
        tasks.is_read.send_replace(false);
        // Who has subscribed before this was known counts on the events being read.
        self.sender.receiver_count() > 0
    }

    /// In a cluster, tells the other nodes of the events of this one, until `closing`. What they
    /// are not told of they find by themselves.
    pub(crate) async fn announce_all(self, closing: CancellationToken) {
        let Some(tasks) = self.of_cluster.clone() else { return };
        let forever = async {
            loop {
                tasks.announce.notified().await;
                if let Err(error) = self.store.announce_events().await {
                    tracing::debug!(%error, "cannot tell other nodes of events");
                }
                tokio::time::sleep(PAUSE).await;
            }
        };
        closing.run_until_cancelled(forever).await;
    }

    async fn read_new(&self, last: &mut Option<i64>) -> Result<(), StoreError> {
        let mut after = match *last {
            Some(last) => last,
            None => self.store.last_event().await?,
        };
        *last = Some(after);
        loop {
            metrics::counter!("offbd_event_reads_total").increment(1);
            let rows = self.store.events(None, after, PAGE).await?;
            let is_last_page = rows.len() < PAGE as usize;
            for row in rows {
                after = row.id;
                *last = Some(after);
                self.send(row.into());
            }
            if is_last_page {
                return Ok(());
            }
        }
    }

    pub(crate) async fn feed(
        &self,
        asset: Option<String>,
        after: Option<i64>,
    ) -> Result<EventFeed, ServiceError> {
        let receiver = self.subscribe().await;
        let newest = self.store.last_event().await?;
        let last = after.map_or(newest, |id| id.min(newest));
        let (store, backlog) = (self.store.clone(), VecDeque::new());
        Ok(EventFeed { store, receiver, asset, last, backlog, behind: after.is_some() })
    }
}

/// A subscription to the events of one asset or of all: each event once, in order.
#[derive(Debug)]
pub struct EventFeed {
    store: Store,
    receiver: broadcast::Receiver<Arc<Event>>,
    asset: Option<String>,
    last: i64,
    backlog: VecDeque<Arc<Event>>,
    /// Whether missed events must be read from the store.
    behind: bool,
}

impl EventFeed {
    /// Returns the id of the last event delivered, after which the feed continues.
    #[must_use]
    pub const fn last(&self) -> i64 {
        self.last
    }

    /// Waits for the next event; returns `None` once the service has ended. Cancel safe.
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
                Ok(event) if event.id > self.last && self.matches(&event) => {
                    self.last = event.id;
                    return Ok(Some(event));
                }
                Ok(_) => {}
                Err(RecvError::Lagged(_)) => self.behind = true,
                Err(RecvError::Closed) => return Ok(None),
            }
        }
    }

    fn matches(&self, event: &Event) -> bool {
        self.asset.as_ref().is_none_or(|asset| *asset == event.asset)
    }
}
