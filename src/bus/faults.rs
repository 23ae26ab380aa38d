//! Publishes the events of the service: the present state of each fault code, and that data
//! stay away, as a retained message, which is removed when the code is cleared or data are back.
//!
//! The events of all assets are published in the order of their commits, each once. After a
//! restart it goes on from the last one that was published; one that was published just before
//! a crash comes again, with the same number.

use std::future::Future;

use futures_util::FutureExt;
use serde::Deserialize;
use tokio_util::sync::CancellationToken;

use super::RETRY_INTERVAL;
use crate::service::{Event, EventFeed, Service, ServiceError};
use crate::wire::words::{AlarmChangeWord, AlarmCodeWord};

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

/// How a bus publishes a message about a fault.
pub(super) trait Publishing: Send + Sync {
    /// Completes once the bus has the message. Repeats it until then.
    fn publish(&self, message: FaultMessage<'_>) -> impl Future<Output = ()> + Send;
}

#[derive(Deserialize)]
struct CodeAndStatus {
    code: AlarmCodeWord,
    status: AlarmChangeWord,
}

/// Publishes events until the service stops.
pub(super) async fn publish_faults(
    bus: &'static str,
    service: Service,
    link: impl Publishing,
    closing: CancellationToken,
) {
    let forever = async {
        loop {
            if !service.is_leader() {
                // Another node of the cluster publishes.
                tokio::time::sleep(RETRY_INTERVAL).await;
                continue;
            }
            match publish_events(bus, &service, &link).await {
                Ok(()) => return,
                Err(error) => tracing::error!(bus, %error, "cannot publish faults; trying again"),
            }
            tokio::time::sleep(RETRY_INTERVAL).await;
        }
    };
    closing.run_until_cancelled(forever).await;
}

/// Publishes events until the service has ended.
async fn publish_events(
    bus: &'static str,
    service: &Service,
    link: &impl Publishing,
) -> Result<(), ServiceError> {
    let mut feed = service.events(None, Some(service.published(bus).await?)).await?;
    let mut unstored = 0;
    loop {
        let ready = if unstored < UNSTORED_EVENTS { feed.next().now_or_never() } else { None };
        let event = match ready {
            Some(event) => event?,
            None => {
                if unstored > 0 {
                    service.set_published(bus, EventFeed::last(&feed)).await?;
                }
                unstored = 0;
                feed.next().await?
            }
        };
        let Some(event) = event else { return Ok(()) };
        publish(link, &event).await?;
        metrics::counter!("offbd_bus_faults_total", "bus" => bus).increment(1);
        unstored += 1;
    }
}

async fn publish(link: &impl Publishing, event: &Event) -> Result<(), ServiceError> {
    let parsed = serde_json::from_str::<CodeAndStatus>(&event.document);
    let CodeAndStatus { code, status } = parsed
        .map_err(|error| ServiceError::Corrupt { what: format!("event {}: {error}", event.id) })?;
    let line = event.line();
    let document = format!(r#"{{"event":{},{}"#, event.id, &line[1..]).into_bytes();
    // A fault that is cleared, or data that are back: nothing is left to tell of.
    let is_over = matches!(status, AlarmChangeWord::Cleared | AlarmChangeWord::Passed);
    let (asset, code) = (&event.asset, code.as_str());
    link.publish(FaultMessage { asset, code, document, retained: !is_over }).await;
    if is_over {
        link.publish(FaultMessage { asset, code, document: Vec::new(), retained: true }).await;
    }
    Ok(())
}
