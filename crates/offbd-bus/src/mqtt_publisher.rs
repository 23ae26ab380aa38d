//! Publishes faults over the present connection to an MQTT broker, and asks each connection once
//! what the broker has kept.

use std::future::pending;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use rumqttc::{AsyncClient, PublishOptions};
use tokio::sync::{Notify, watch};
use tokio::time::Sleep;
use tokio_util::sync::CancellationToken;

use super::faults::{FaultMessage, Kept, Publishing};
use super::marker::{MarkerInbox, marker};
use offbd_wire::bus::TopicStyle;

/// Pause before a broker that has not answered is asked again what it has kept.
const ASK_INTERVAL: Duration = Duration::from_secs(300);

/// Connections that may end one after the other while the broker is asked; then it is asked only
/// after [`ASK_INTERVAL`]. Some brokers end a connection over which something is published that
/// is not permitted.
const ASK_TRIES: u32 = 2;

/// What the publisher knows of a connection to a broker.
pub(super) struct BrokerLink {
    client: AsyncClient,
    /// Notified when the broker has confirmed a message.
    pub(super) confirmed: Notify,
    pub(super) markers: MarkerInbox,
    /// Cancelled once the connection has ended.
    pub(super) ended: CancellationToken,
}

impl BrokerLink {
    pub(super) fn new(client: AsyncClient) -> Self {
        let (confirmed, markers) = (Notify::new(), MarkerInbox::default());
        Self { client, confirmed, markers, ended: CancellationToken::new() }
    }

    /// Returns whether the broker has confirmed the message before the connection has ended.
    async fn publish(&self, topic: &str, retained: bool, document: Vec<u8>) -> bool {
        let confirmed = async {
            let options = PublishOptions::at_least_once().retain(retained);
            let sent = self.client.publish(topic, document, options).await;
            if sent.is_err() {
                // The connection is about to end.
                pending::<()>().await;
            }
            self.confirmed.notified().await;
        };
        self.ended.run_until_cancelled(confirmed).await.is_some()
    }
}

/// The present connection, if there is one.
pub(super) type Connected = Option<Arc<BrokerLink>>;

/// Publishes faults over the present connection.
pub(super) struct MqttPublisher {
    links: watch::Receiver<Connected>,
    /// The connection over which the broker was asked last for the marker.
    asked: Option<Arc<BrokerLink>>,
    /// When it is asked again, if it has not answered.
    again: Option<Pin<Box<Sleep>>>,
    /// How many connections have ended one after the other instead of an answer.
    n_ended: u32,
}

impl MqttPublisher {
    pub(super) const fn new(links: watch::Receiver<Connected>) -> Self {
        Self { links, asked: None, again: None, n_ended: 0 }
    }
}

/// Waits for a connection other than `old`.
async fn other_link(
    links: &watch::Receiver<Connected>,
    old: Option<&Arc<BrokerLink>>,
) -> Arc<BrokerLink> {
    let is_new = |link: &Arc<BrokerLink>| old.is_none_or(|old| !Arc::ptr_eq(old, link));
    let mut links = links.clone();
    let found = links.wait_for(|link| link.as_ref().is_some_and(is_new)).await;
    match found.ok().and_then(|link| link.clone()) {
        Some(link) => link,
        None => pending().await,
    }
}

impl Publishing for MqttPublisher {
    async fn publish(&self, message: FaultMessage<'_>) {
        let FaultMessage { asset, code, document, retained } = message;
        let topic = TopicStyle::Mqtt.fault(asset, code);
        loop {
            let link = other_link(&self.links, None).await;
            if link.publish(&topic, retained, document.clone()).await {
                return;
            }
        }
    }

    async fn reconnected(&mut self) {
        let Self { links, asked, again, n_ended } = self;
        let new_link = async {
            if *n_ended >= ASK_TRIES {
                pending().await
            }
            other_link(links, asked.as_ref()).await
        };
        let time = async {
            match again {
                Some(time) => time.await,
                None => pending().await,
            }
        };
        tokio::select! {
            _ = new_link => {}
            () = time => {}
        }
    }

    async fn kept(&mut self) -> Kept {
        let link = other_link(&self.links, None).await;
        let answer = link.ended.run_until_cancelled(link.markers.ask(&link.client)).await;
        self.n_ended = if answer.is_none() { self.n_ended.saturating_add(1) } else { 0 };
        let is_silent = answer == Some(Kept::Unknown) || self.n_ended >= ASK_TRIES;
        self.again = is_silent.then(|| Box::pin(tokio::time::sleep(ASK_INTERVAL)));
        if is_silent {
            tracing::warn!(
                topic = TopicStyle::Mqtt.marker(),
                "the MQTT broker does not hand messages back; offbd must be permitted to publish \
                 and subscribe there"
            );
        }
        self.asked = Some(link);
        answer.unwrap_or(Kept::Unknown)
    }

    async fn mark(&self, event: i64) {
        if let (Some(link), None) = (&self.asked, &self.again) {
            link.publish(&TopicStyle::Mqtt.marker(), true, marker(event)).await;
        }
    }
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt;
    use rumqttc::MqttOptions;

    use super::*;

    #[tokio::test]
    async fn a_broker_that_ends_connections_is_not_asked_over_each() {
        let (sender, links) = watch::channel(None);
        let mut publisher = MqttPublisher::new(links);
        assert_eq!(publisher.reconnected().now_or_never(), None);
        let connect_and_end = || {
            let (client, _) = AsyncClient::builder(MqttOptions::new("x", ("localhost", 1))).build();
            let link = Arc::new(BrokerLink::new(client));
            link.ended.cancel();
            sender.send_replace(Some(link));
        };
        for _ in 0..ASK_TRIES {
            connect_and_end();
            assert_eq!(publisher.reconnected().now_or_never(), Some(()));
            assert_eq!(publisher.kept().await, Kept::Unknown);
        }
        connect_and_end();
        assert_eq!(publisher.reconnected().now_or_never(), None);
    }
}
