//! Finds out what an MQTT broker still has of the retained messages.
//!
//! offbd keeps its own retained message at the broker, the marker, with the number of the
//! event up to which everything is published. To ask for it, offbd subscribes to its topic, and
//! then publishes a question there. A broker queues the retained messages for a subscriber before
//! it handles the subscriber's next packet, and keeps the order of messages of the same topic and
//! QoS: when the question comes back, the marker has come before, or is lost. If the question
//! does not come back, offbd may not read or write there, and nothing is known.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use rumqttc::{AsyncClient, PublishOptions, QoS};
use tokio::sync::oneshot;
use tokio::time::timeout;
use uuid::Uuid;

use super::faults::Kept;
use offbd_wire::bus::{FaultMarkerQuestionView, FaultMarkerView, TopicStyle};

/// Longest wait for a question to come back; it is asked again later. Chosen: much longer than a
/// message takes. No faults are published meanwhile.
const MARKER_TIMEOUT: Duration = Duration::from_secs(5);

/// Where a connection's answers arrive.
#[derive(Default)]
pub(super) struct MarkerInbox {
    open: Mutex<Option<OpenQuestion>>,
}

struct OpenQuestion {
    id: String,
    /// The event in the marker, once that has arrived.
    published: Option<i64>,
    answer: oneshot::Sender<Kept>,
}

impl MarkerInbox {
    fn lock(&self) -> MutexGuard<'_, Option<OpenQuestion>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks over a connection. One question is open at a time.
    pub(super) async fn ask(&self, client: &AsyncClient) -> Kept {
        let (topic, (question, answer)) = (TopicStyle::Mqtt.marker(), self.open());
        let asked = async {
            // QoS 0, because messages of QoS 1 may wait for others.
            // The client may send the question before the subscription unless this is confirmed.
            let subscribed = client.subscribe_tracked(&topic, QoS::AtMostOnce).await.ok()?;
            subscribed.wait_async().await.ok()?;
            client.publish(&topic, question, PublishOptions::at_most_once()).await.ok()?;
            answer.await.ok()
        };
        let kept = timeout(MARKER_TIMEOUT, asked).await.ok().flatten();
        // Otherwise each later marker would come back too.
        let _ = client.try_unsubscribe(&topic);
        kept.unwrap_or(Kept::Unknown)
    }

    /// Opens a question; returns it and where its answer arrives.
    fn open(&self) -> (Vec<u8>, oneshot::Receiver<Kept>) {
        let (id, (answer, answered)) = (Uuid::now_v7().to_string(), oneshot::channel());
        let view = FaultMarkerQuestionView { question: id.clone() };
        *self.lock() = Some(OpenQuestion { id, published: None, answer });
        (document(&view), answered)
    }

    /// Takes a message of the marker's topic.
    pub(super) fn arrive(&self, payload: &[u8]) {
        let mut open = self.lock();
        let Some(question) = open.as_mut() else { return };
        if let Ok(FaultMarkerView { published }) = serde_json::from_slice(payload) {
            question.published = Some(published);
        }
        let echo = serde_json::from_slice::<FaultMarkerQuestionView>(payload);
        // Another node of a cluster may ask too.
        if echo.is_ok_and(|echo| echo.question == question.id)
            && let Some(OpenQuestion { published, answer, .. }) = open.take()
        {
            // Nobody waits for an answer that is late.
            let _ = answer.send(published.map_or(Kept::Nothing, Kept::UpTo));
        }
    }
}

/// Returns the marker's payload once the event `published` and those before it are published.
pub(super) fn marker(published: i64) -> Vec<u8> {
    document(&FaultMarkerView { published })
}

fn document(view: &impl serde::Serialize) -> Vec<u8> {
    // Plain texts and numbers can be written.
    serde_json::to_vec(view).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_question_is_answered_by_what_came_before_it() {
        let inbox = MarkerInbox::default();
        let (question, mut answered) = inbox.open();
        inbox.arrive(&question);
        assert_eq!(answered.try_recv(), Ok(Kept::Nothing));
        inbox.arrive(&question);
        let (second, mut answered) = inbox.open();
        for payload in [&marker(6), &marker(7), &question, &b"x".to_vec()] {
            inbox.arrive(payload);
            assert!(answered.try_recv().is_err(), "{payload:?}");
        }
        inbox.arrive(&second);
        assert_eq!(answered.try_recv(), Ok(Kept::UpTo(7)));
    }
}
