//! Publishes the events of the service: the present state of each fault code, and that data
//! stay away, as a retained message, which is removed when the code is cleared or data are back.
//!
//! The events of all assets are published in the order of their commits, each once. After a
//! restart it goes on from the last one that was published; one that was published just before
//! a crash comes again, with the same number.
//!
//! After each connection the bus is asked what it has kept of the retained messages. If it has
//! lost the latest ones, their events are published again; if it has lost all, what is on record
//! is, with the numbers of the events that told last of it. Both are done by the task that
//! publishes the other events, which go on from where they were: so the last message about a code
//! is its present state.

use std::future::{Future, pending, ready};

use futures_util::FutureExt;
use serde::Deserialize;
use tokio_util::sync::CancellationToken;

use super::RETRY_INTERVAL;
use offbd_net::Reasons;
use offbd_service::{Event, EventFeed, PresentFault, Service, ServiceError};
use offbd_wire::words::{AlarmChangeWord, AlarmCodeWord};

/// Events published without storing the last one, while further ones wait.
const UNSTORED_EVENTS: u32 = 64;

/// A message about a fault.
pub(super) struct FaultMessage<'a> {
    pub(super) asset: &'a str,
    pub(super) code: &'static str,
    pub(super) document: Vec<u8>,
    /// Whether later subscribers get it too.
    pub(super) retained: bool,
}

/// What a bus has kept of the retained messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(not(feature = "mqtt"), expect(dead_code, reason = "NATS keeps none"))]
pub(super) enum Kept {
    /// It has not answered, or never keeps any.
    Unknown,
    /// None, or not all up to any event.
    Nothing,
    /// At least those up to this event.
    UpTo(i64),
}

/// How a bus publishes messages about faults. What has to do with retained messages does nothing
/// for a bus that keeps none.
pub(super) trait Publishing: Send + Sync {
    /// Completes once the bus has the message. Repeats it until then.
    fn publish(&self, message: FaultMessage<'_>) -> impl Future<Output = ()> + Send;

    /// Waits until there is a connection over which [`Self::kept`] was not answered. Cancel safe.
    fn reconnected(&mut self) -> impl Future<Output = ()> + Send {
        pending()
    }

    /// Asks over the present connection what the bus has kept.
    fn kept(&mut self) -> impl Future<Output = Kept> + Send {
        ready(Kept::Unknown)
    }

    /// Notes at the bus that everything up to `event` is published. Does nothing if
    /// [`Self::kept`] was not answered over the present connection: another broker, or one that
    /// has lost its messages, must not get the note.
    fn mark(&self, _event: i64) -> impl Future<Output = ()> + Send {
        ready(())
    }
}

#[derive(Deserialize)]
struct CodeAndStatus {
    code: AlarmCodeWord,
    status: AlarmChangeWord,
}

/// Publishes events until the service stops.
pub(super) async fn publish_faults<P: Publishing>(
    bus: &'static str,
    service: Service,
    link: impl Fn() -> P + Send + Sync,
    closing: CancellationToken,
) {
    let reasons = Reasons::default();
    let forever = async {
        loop {
            if !service.is_leader() {
                // Another node of the cluster publishes.
                tokio::time::sleep(RETRY_INTERVAL).await;
                continue;
            }
            let publisher =
                FaultPublisher { bus, service: &service, link: link(), reasons: &reasons };
            match publisher.run().await {
                Ok(()) => return,
                Err(error) if reasons.is_new(&error) => {
                    tracing::error!(bus, %error, "cannot publish faults; trying again");
                }
                Err(_) => {}
            }
            tokio::time::sleep(RETRY_INTERVAL).await;
        }
    };
    closing.run_until_cancelled(forever).await;
}

/// Publishes the events of the service until something fails.
struct FaultPublisher<'a, P> {
    bus: &'static str,
    service: &'a Service,
    /// Asks what the bus has kept once more than the publisher before: that may have failed
    /// before it had made up for what was lost.
    link: P,
    /// Why the store could not be read.
    reasons: &'a Reasons,
}

impl<P: Publishing> FaultPublisher<'_, P> {
    /// Publishes events until the service has ended.
    async fn run(mut self) -> Result<(), ServiceError> {
        let last = self.service.published(self.bus).await?;
        let mut feed = self.service.events(None, Some(last)).await?;
        self.reasons.clear();
        let mut unstored = 0;
        loop {
            let ready = if unstored < UNSTORED_EVENTS { feed.next().now_or_never() } else { None };
            let event = match ready {
                Some(event) => event?,
                None => {
                    if unstored > 0 {
                        self.store_position(EventFeed::last(&feed)).await?;
                    }
                    unstored = 0;
                    tokio::select! {
                        biased;
                        () = self.link.reconnected() => {
                            self.make_up(&mut feed).await?;
                            continue;
                        }
                        event = feed.next() => event?,
                    }
                }
            };
            let Some(event) = event else { return Ok(()) };
            if !self.service.is_leader() {
                return Err(ServiceError::Moving);
            }
            self.publish(&event, &parsed(&event)?).await;
            unstored += 1;
        }
    }

    /// Notes that everything up to `event` is published. The bus is told before it is stored, so
    /// that it never seems to have lost something.
    async fn store_position(&self, event: i64) -> Result<(), ServiceError> {
        self.link.mark(event).await;
        self.service.set_published(self.bus, event).await
    }

    /// Asks what the bus has kept, and makes up for what it has lost.
    async fn make_up(&mut self, feed: &mut EventFeed) -> Result<(), ServiceError> {
        self.check_lead().await?;
        let last = EventFeed::last(feed);
        match self.link.kept().await {
            Kept::UpTo(event) if event < last => {
                tracing::warn!(
                    bus = self.bus,
                    event,
                    last,
                    "retained faults are lost after an event; publishing again"
                );
                *feed = self.service.events(None, Some(event)).await?;
            }
            Kept::Nothing => {
                tracing::warn!(
                    bus = self.bus,
                    "no faults are retained; publishing those on record"
                );
                self.publish_present().await?;
                self.link.mark(last).await;
            }
            Kept::Unknown | Kept::UpTo(_) => {}
        }
        Ok(())
    }

    /// Publishes what is on record.
    async fn publish_present(&self) -> Result<(), ServiceError> {
        let (mut asset, mut code) = (String::new(), String::new());
        loop {
            self.check_lead().await?;
            let page = self.service.present_faults((&asset, &code)).await?;
            for fault in &page {
                self.publish_fault(fault).await?;
            }
            let Some(last) = page.into_iter().last() else { return Ok(()) };
            (asset, code) = (last.asset, last.code);
        }
    }

    /// Fails if another node may publish by now.
    async fn check_lead(&self) -> Result<(), ServiceError> {
        self.service.confirm_ownership().await?;
        if self.service.is_leader() { Ok(()) } else { Err(ServiceError::Moving) }
    }

    async fn publish_fault(&self, fault: &PresentFault) -> Result<(), ServiceError> {
        let Some(last) = &fault.last else { return Ok(()) };
        let change = parsed(last)?;
        // If the fault changes meanwhile, that event follows.
        if change.status.as_str() == fault.status {
            self.publish(last, &change).await;
        }
        Ok(())
    }

    async fn publish(&self, event: &Event, change: &CodeAndStatus) {
        let line = event.line();
        let document = format!(r#"{{"event":{},{}"#, event.id, &line[1..]).into_bytes();
        let CodeAndStatus { code, status } = change;
        // A fault that is cleared, or data that are back: nothing is left to tell of.
        let is_over = matches!(status, AlarmChangeWord::Cleared | AlarmChangeWord::Passed);
        let (asset, code) = (&event.asset, code.as_str());
        self.link.publish(FaultMessage { asset, code, document, retained: !is_over }).await;
        if is_over {
            let document = Vec::new();
            self.link.publish(FaultMessage { asset, code, document, retained: true }).await;
        }
        metrics::counter!("offbd_bus_faults_total", "bus" => self.bus).increment(1);
    }
}

fn parsed(event: &Event) -> Result<CodeAndStatus, ServiceError> {
    let parsed = serde_json::from_str(&event.document);
    parsed.map_err(|error| ServiceError::Corrupt { what: format!("event {}: {error}", event.id) })
}
