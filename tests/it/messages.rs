//! What the service really sends and takes is what `asyncapi.yaml` describes: over the
//! WebSocket, as Server-Sent Events and as webhooks. `bus/messages.rs` has MQTT and NATS.

use crate::support::described::Described;
use crate::support::receiver::{Received, WebhookReceiver};
use crate::support::{
    Client, DEADLINE, Events, ServiceFixture, batch, columns, eventually, packed, rig,
};
use futures_util::{SinkExt, StreamExt};
use offbd_core::vocabulary::Sample;
use reqwest::Method;
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

/// Returns a recording in batches of every accepted shape: rows, rows without numbers and
/// positions, columns, and columns that a device lacks.
pub fn batches(samples: &[Sample]) -> Vec<Value> {
    let mut batches = Vec::new();
    for (i, part) in samples.chunks(500).enumerate() {
        let mut document = if i % 2 == 0 { batch(Some("s"), part) } else { columns("s", part) };
        document["id"] = json!(i.to_string());
        batches.push(document);
    }
    let after = samples.last().unwrap().t_s;
    batches.push(json!({ "samples": [{ "t_s": after + 0.01, "x_m": null, "y_m": null }] }));
    batches.push(json!({ "t_s": [after + 0.02], "x_m": [null] }));
    batches
}

struct Watcher {
    described: Described,
    socket: WebSocketStream<MaybeTlsStream<TcpStream>>,
}

impl Watcher {
    async fn send(&mut self, document: &Value, is_packed: bool) {
        assert_eq!(self.described.note("stream", document), "batch");
        let message = match is_packed {
            true => Message::binary(packed(document)),
            false => Message::text(document.to_string()),
        };
        self.socket.send(message).await.unwrap();
    }

    /// Takes note of frames until one is as wanted.
    async fn until(&mut self, wanted: impl Fn(&Value) -> bool) {
        let found = async {
            loop {
                let Message::Text(text) = self.socket.next().await.unwrap().unwrap() else {
                    continue;
                };
                let frame: Value = serde_json::from_str(&text).unwrap();
                self.described.note("stream", &frame);
                if wanted(&frame) {
                    return;
                }
            }
        };
        timeout(DEADLINE, found).await.expect("the frame in time");
    }
}

/// A rig fails, falls silent, comes back, and a person clears its fault.
async fn live(client: &Client, watcher: &mut Watcher) {
    let mut batches = batches(&rig(3000, 1500));
    let last = batches.pop().unwrap();
    for (i, document) in batches.iter().enumerate() {
        watcher.send(document, i % 3 == 2).await;
        watcher.until(|frame| frame["type"] == "ack").await;
    }
    watcher.until(|frame| frame["trace"]["t_s"].is_array()).await;
    watcher.socket.send(Message::text(r#"{"id":"broken","samples":1}"#)).await.unwrap();
    watcher.until(|frame| frame["type"] == "error").await;
    let lost = |frame: &Value| frame["type"] == "communication" && frame["status"] == "confirmed";
    watcher.until(lost).await;
    watcher.send(&last, false).await;
    let back = |frame: &Value| frame["type"] == "communication" && frame["status"] == "passed";
    watcher.until(back).await;
    client.end("a", "s").await;
    client.delete("assets/a/faults/x_servo?by=ann").await.expect(204);
    watcher.until(|frame| frame["status"] == "cleared" && frame["by"] == "ann").await;
}

/// Has every message of the service posted to `receiver`, and returns the channel's id.
async fn subscribe(client: &Client, receiver: &WebhookReceiver) -> String {
    let hook = json!({ "name": "hook", "webhook": { "url": receiver.url() } });
    let channel = client.post("notifications/channels", &hook).await.expect(201);
    let id = channel["id"].as_str().unwrap().to_owned();
    let rule = json!({ "name": "all", "channel": id,
        "changes": ["pending", "confirmed", "passed", "healed", "cleared"] });
    client.post("notifications/rules", &rule).await.expect(201);
    id
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn frames_events_and_notifications_are_as_described() {
    let receiver = WebhookReceiver::start(&[]).await;
    let fixture = ServiceFixture::start_with(|config| {
        config.communication.lost_after_s = 1;
        config.communication.back_after_s = 0;
    })
    .await;
    let client = &fixture.client;
    client.asset("a").await;
    let channel = subscribe(client, &receiver).await;
    let url = format!("ws://{}/api/v1/assets/a/stream?state=50&trace=true", client.address);
    let (socket, _) = connect_async(url).await.unwrap();
    let mut watcher = Watcher { described: Described::read(), socket };
    live(client, &mut watcher).await;

    let mut described = watcher.described;
    let events = client.request(Method::GET, "events?after=0").send().await.unwrap();
    let mut events = Events::new(events);
    loop {
        let (kind, mut data) = events.any().await;
        if kind == "begin" {
            continue;
        }
        // The id is that of the event, not in its data.
        data.as_object_mut().unwrap().remove("id");
        assert_eq!(described.note("events", &data), format!("{kind}Event"));
        if data["by"] == "ann" {
            break;
        }
    }

    client.post(&format!("notifications/channels/{channel}/test"), &Value::Null).await.expect(202);
    let is = |kind: &'static str| move |received: &Received| received.message()["type"] == kind;
    let received = eventually(async || {
        let received = receiver.received();
        let kinds = ["org.offbd.test.v1", "org.offbd.fault.cleared.v1"];
        kinds.iter().all(|kind| received.iter().any(is(kind))).then_some(received)
    })
    .await;
    for message in received.iter().map(Received::message) {
        described.note("webhook", &message);
    }
    assert!(received.iter().any(|one| one.message()["subject"] == "communication_lost"));
    assert_eq!(described.unseen(&["stream", "events", "webhook"]), Vec::new());
}

#[test]
fn every_channel_is_tested() {
    let described = Described::read();
    let buses = ["ack", "fault", "hello", "state", "telemetry"];
    let of_buses = buses.iter().flat_map(|name| [format!("{name}Mqtt"), format!("{name}Nats")]);
    let mut tested = Vec::from_iter(of_buses);
    let others = ["faultMarkerMqtt", "serviceStateMqtt", "stream", "events", "webhook"];
    tested.extend(others.map(str::to_owned));
    tested.sort();
    assert_eq!(described.channels(), tested);
}
