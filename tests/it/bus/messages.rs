//! What devices and the service publish is what `asyncapi.yaml` describes.

use std::pin::Pin;

use crate::bus::{connected, device};
use crate::messages::batches;
use crate::support::broker::{Mosquitto, NATS_PASSWORD, Nats};
use crate::support::bus_device::{BusDevice, MqttDevice, nats};
use crate::support::described::Described;
use crate::support::{DEADLINE, packed, rig};
use futures_util::{Stream, StreamExt};
use serde_json::Value;
use tokio::time::timeout;

/// What is published: topic and payload.
type Published = Pin<Box<dyn Stream<Item = (String, Vec<u8>)>>>;

/// Somebody who takes note of all that is published.
struct Observer {
    described: Described,
    published: Published,
    /// What the names of the channels end with.
    suffix: &'static str,
}

impl Observer {
    fn channels(&self) -> Vec<String> {
        let names = ["ack", "fault", "hello", "state", "telemetry"];
        let mut channels: Vec<_> =
            names.iter().map(|name| format!("{name}{}", self.suffix)).collect();
        let own = ["faultMarkerMqtt", "serviceStateMqtt"].map(str::to_owned);
        channels.extend((self.suffix == "Mqtt").then_some(own).into_iter().flatten());
        channels
    }

    /// Takes note of messages until one has this name.
    async fn until(&mut self, wanted: &str) {
        let found = async {
            loop {
                let (topic, payload) = self.published.next().await.unwrap();
                let levels: Vec<&str> = topic.split(['/', '.']).skip(3).collect();
                let level = match levels[..] {
                    ["faults"] => "faultMarker",
                    [_, "state"] => "serviceState",
                    _ => levels[0],
                };
                let channel = format!("{level}{}", self.suffix);
                if self.described.note(&channel, &document(level, &payload)) == wanted {
                    return;
                }
            }
        };
        timeout(DEADLINE, found).await.unwrap_or_else(|_| panic!("no {wanted} in time"));
    }
}

/// Returns the content of a message: a text, or a document as JSON or MessagePack.
fn document(level: &str, payload: &[u8]) -> Value {
    if payload.is_empty() || ["state", "serviceState"].contains(&level) {
        return String::from_utf8(payload.to_vec()).unwrap().into();
    }
    let json = serde_json::from_slice(payload);
    json.unwrap_or_else(|_| rmp_serde::from_slice(payload).unwrap())
}

/// A device says what it is, sends its batches, of which one is broken, falls silent and comes
/// back.
async fn live(device: &mut BusDevice, observer: &mut Observer) {
    device.publish("state", b"online".to_vec()).await;
    let hello = r#"{"firmware":"1.2","axes":["x","y"],"units":["m","rad"],"rate_hz":100}"#;
    device.publish("hello", hello.into()).await;
    let mut batches = batches(&rig(3000, 1500));
    let last = batches.pop().unwrap();
    for (i, batch) in batches.iter().enumerate() {
        let payload = if i % 3 == 2 { packed(batch) } else { batch.to_string().into_bytes() };
        let answer = device.ask(payload).await;
        assert!(answer["accepted"].is_number(), "{answer}");
    }
    observer.until("communication").await;
    device.ask(last.to_string().into_bytes()).await;
    // Data are back.
    observer.until("communication").await;
}

/// Sends a batch that is refused. It is not a message that the document describes, its answer is.
async fn be_refused(device: &mut BusDevice, described: &mut Described, channel: &str) {
    let answer = device.ask(br#"{"id":"broken","samples":1}"#.to_vec()).await;
    assert_eq!(described.note(channel, &answer), "batchRefusal");
}

fn quick(config: &mut offbd::config::Config) {
    // Longer than a batch waits on a busy machine.
    config.communication.lost_after_s = 5;
    config.communication.back_after_s = 0;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn messages_over_mqtt_are_as_described() {
    let mosquitto = Mosquitto::start();
    // Before the service, which asks the broker something when it has connected.
    let mut subscriber = MqttDevice::connect(mosquitto.port, "observer", None).await;
    subscriber.subscribe("offbd/v1/#").await;
    let fixture = crate::bus::start_with(|config| {
        config.mqtt = Some(offbd::config::MqttConfig { state: true, ..mosquitto.config() });
        quick(config);
    })
    .await;
    connected(&fixture.client, "mqtt").await;
    fixture.client.asset("a").await;
    // Read at all times: the broker drops who does not.
    let (published, mut noted) = tokio::sync::mpsc::unbounded_channel();
    tokio::spawn(async move {
        loop {
            let message = subscriber.next().await;
            if published.send((message.topic, message.payload.to_vec())).is_err() {
                return;
            }
        }
    });
    let published = futures_util::stream::poll_fn(move |context| noted.poll_recv(context));
    let (described, suffix) = (Described::read(), "Mqtt");
    let mut observer = Observer { described, published: Box::pin(published), suffix };
    let mut device = BusDevice::mqtt(mosquitto.port, "a", None).await;
    live(&mut device, &mut observer).await;
    observer.until("cleared").await;
    be_refused(&mut device, &mut observer.described, "ackMqtt").await;
    assert_all_seen(&observer);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn messages_over_nats_are_as_described() {
    let server = Nats::start();
    let fixture = crate::bus::start_with(|config| {
        config.nats = Some(server.config());
        quick(config);
    })
    .await;
    let secret = device(&fixture.client, "a").await;
    let subscriber = nats(server.port, "a", ("offbd", NATS_PASSWORD)).await.unwrap();
    let published = subscriber.subscribe("offbd.v1.>").await.unwrap();
    subscriber.flush().await.unwrap();
    let published =
        published.map(|message| (message.subject.to_string(), message.payload.to_vec()));
    let (described, suffix) = (Described::read(), "Nats");
    let mut observer = Observer { described, published: Box::pin(published), suffix };
    let mut device = BusDevice::nats(server.port, "a", ("a", &secret)).await;
    live(&mut device, &mut observer).await;
    observer.until("cleared").await;
    be_refused(&mut device, &mut observer.described, "ackNats").await;
    assert_all_seen(&observer);
}

fn assert_all_seen(observer: &Observer) {
    let channels = observer.channels();
    let channels: Vec<&str> = channels.iter().map(String::as_str).collect();
    assert_eq!(observer.described.unseen(&channels), Vec::new());
}
