//! Devices that send over MQTT and NATS, and keep a batch until it is acknowledged.

use std::collections::BTreeMap;
use std::time::Duration;

use axum::body::Bytes;
use futures_util::StreamExt;
use rumqttc::{AsyncClient, Event, EventLoop, MqttOptions, Packet, Publish, PublishOptions, QoS};
use serde_json::{Value, json};
use tokio::time::timeout;

use super::{DEADLINE, batch};
use offbd_core::vocabulary::Sample;

/// After this long a device sends a batch again.
const ANSWERED_WITHIN: Duration = Duration::from_secs(1);

/// A message that a broker has sent.
pub struct MqttMessage {
    pub topic: String,
    pub payload: Bytes,
    pub retain: bool,
}

/// A client of a broker.
pub struct MqttDevice {
    pub client: AsyncClient,
    events: EventLoop,
}

impl MqttDevice {
    /// Connects to the broker on `port`.
    pub async fn connect(port: u16, id: &str, login: Option<(&str, &str)>) -> Self {
        let mut options = MqttOptions::new(id, ("127.0.0.1", port));
        options.set_keep_alive(60);
        options.set_max_packet_size(64 << 20, 64 << 20);
        if let Some((user, password)) = login {
            options.set_credentials(user, password.to_owned());
        }
        let (client, events) = AsyncClient::builder(options).capacity(1000).build();
        let mut device = Self { client, events };
        device.until(|packet| matches!(packet, Packet::ConnAck(_)).then_some(())).await;
        device
    }

    /// Subscribes, and waits until the broker has confirmed it.
    pub async fn subscribe(&mut self, filter: &str) {
        self.client.subscribe(filter, QoS::AtLeastOnce).await.unwrap();
        self.until(|packet| matches!(packet, Packet::SubAck(_)).then_some(())).await;
    }

    pub async fn publish(&self, topic: &str, payload: impl Into<Vec<u8>>) {
        let options = PublishOptions::at_most_once();
        self.client.publish(topic, payload.into(), options).await.unwrap();
    }

    /// Publishes at QoS 1, and waits until the broker has acknowledged it.
    pub async fn leave(&mut self, topic: &str, is_retained: bool, payload: impl Into<Vec<u8>>) {
        let options = PublishOptions::at_least_once().retain(is_retained);
        self.client.publish(topic, payload.into(), options).await.unwrap();
        self.until(|packet| matches!(packet, Packet::PubAck(_)).then_some(())).await;
    }

    /// Returns the next message.
    pub async fn next(&mut self) -> MqttMessage {
        self.until(|packet| match packet {
            Packet::Publish(Publish { topic, payload, retain, .. }) => {
                let topic = String::from_utf8(topic.to_vec()).unwrap();
                Some(MqttMessage { topic, payload, retain })
            }
            _ => None,
        })
        .await
    }

    /// Handles packets until one is the wanted one; connects again if the broker is away.
    pub async fn until<T>(&mut self, wanted: impl Fn(Packet) -> Option<T>) -> T {
        let found = async {
            loop {
                match self.events.poll().await {
                    Ok(Event::Incoming(packet)) => {
                        if let Some(found) = wanted(packet) {
                            return found;
                        }
                    }
                    Ok(Event::Outgoing(_)) => {}
                    Err(_) => tokio::task::yield_now().await,
                }
            }
        };
        timeout(DEADLINE, found).await.expect("a packet in time")
    }

    /// Returns the error with which the broker ends or refuses the connection.
    pub async fn refusal(port: u16, id: &str, login: Option<(&str, &str)>) -> String {
        let mut options = MqttOptions::new(id, ("127.0.0.1", port));
        if let Some((user, password)) = login {
            options.set_credentials(user, password.to_owned());
        }
        let (_client, mut events) = AsyncClient::builder(options).build();
        match timeout(DEADLINE, events.poll()).await.expect("an answer in time") {
            Ok(event) => panic!("accepted: {event:?}"),
            Err(error) => error.to_string(),
        }
    }
}

/// What a device sends over and gets acknowledgements from.
pub enum Way {
    Mqtt(Box<MqttDevice>),
    Nats(async_nats::Client, async_nats::Subscriber),
}

/// A device of one asset.
pub struct BusDevice {
    asset: String,
    way: Way,
}

impl BusDevice {
    pub async fn mqtt(port: u16, asset: &str, login: Option<(&str, &str)>) -> Self {
        let id = asset.replace(['.', '-'], "");
        let mut device = MqttDevice::connect(port, &id, login).await;
        device.subscribe(&format!("offbd/v1/{}/ack", asset.replace('.', "=2E"))).await;
        Self { asset: asset.to_owned(), way: Way::Mqtt(Box::new(device)) }
    }

    pub async fn nats(port: u16, asset: &str, login: (&str, &str)) -> Self {
        Self::nats_of(&[port], asset, login).await
    }

    /// Connects to one of the servers on `ports`, and to another one when that is gone.
    pub async fn nats_of(ports: &[u16], asset: &str, login: (&str, &str)) -> Self {
        let client = nats_of(ports, asset, login).await.unwrap();
        let subject = format!("offbd.v1.{}.ack", asset.replace('.', "=2E"));
        let acks = client.subscribe(subject).await.unwrap();
        client.flush().await.unwrap();
        Self { asset: asset.to_owned(), way: Way::Nats(client, acks) }
    }

    pub async fn send(&self, document: Vec<u8>) {
        self.publish("telemetry", document).await;
    }

    /// Publishes on the device's topic that ends with `level`.
    pub async fn publish(&self, level: &str, payload: Vec<u8>) {
        let token = self.asset.replace('.', "=2E");
        match &self.way {
            Way::Mqtt(device) => {
                device.publish(&format!("offbd/v1/{token}/{level}"), payload).await;
            }
            Way::Nats(client, _) => {
                let subject = format!("offbd.v1.{token}.{level}");
                client.publish(subject, payload.into()).await.unwrap();
            }
        }
    }

    /// Returns the next acknowledgement or refusal.
    pub async fn answer(&mut self) -> Value {
        let payload = match &mut self.way {
            Way::Mqtt(device) => device.next().await.payload,
            Way::Nats(_, acks) => {
                timeout(DEADLINE, acks.next()).await.expect("an answer in time").unwrap().payload
            }
        };
        serde_json::from_slice(&payload).unwrap()
    }

    /// Sends one batch and returns its answer.
    pub async fn ask(&mut self, document: Vec<u8>) -> Value {
        self.send(document).await;
        self.answer().await
    }

    /// Sends batches one after the other, each again until it is acknowledged: while no node
    /// owns the asset, or no server is connected, nobody answers.
    pub async fn deliver(&mut self, samples: &[Sample], size: usize) {
        for part in samples.chunks(size) {
            let id = format!("{:?}", part[0].seq);
            let delivered = async {
                loop {
                    self.send(numbered(&id, part)).await;
                    let answer = timeout(ANSWERED_WITHIN, self.answer_to(&id)).await;
                    if answer.is_ok_and(|answer| answer["accepted"].is_number()) {
                        break;
                    }
                }
            };
            timeout(DEADLINE, delivered).await.expect("an acknowledgement in time");
        }
    }

    /// Returns the next answer to the batch `id`; skips those to others.
    async fn answer_to(&mut self, id: &str) -> Value {
        loop {
            let answer = self.answer().await;
            if answer["id"] == id {
                return answer;
            }
        }
    }

    /// Sends all batches at first, of which some are lost on the way, and some acknowledgements
    /// on the way back; then again what was not acknowledged, until all is. Returns how many
    /// messages were lost.
    pub async fn send_until_acknowledged(
        &mut self,
        samples: &[Sample],
        size: usize,
        mut is_lost: impl FnMut() -> bool,
    ) -> usize {
        let mut kept: BTreeMap<String, &[Sample]> =
            samples.chunks(size).enumerate().map(|(i, part)| (format!("{i:06}"), part)).collect();
        let mut n_lost = 0;
        while !kept.is_empty() {
            let mut arriving = 0;
            for (id, part) in &kept {
                if is_lost() {
                    n_lost += 1;
                    continue;
                }
                self.send(numbered(id, part)).await;
                arriving += 1;
            }
            for _ in 0..arriving {
                let answer = self.answer().await;
                if is_lost() {
                    n_lost += 1;
                } else if answer["accepted"].is_number() {
                    kept.remove(answer["id"].as_str().unwrap());
                } else {
                    assert!(answer["retry_after_s"].is_number(), "{answer}");
                }
            }
        }
        n_lost
    }
}

/// Connects to a NATS server, with an inbox of the device's own.
pub async fn nats(
    port: u16,
    asset: &str,
    login: (&str, &str),
) -> Result<async_nats::Client, async_nats::ConnectError> {
    nats_of(&[port], asset, login).await
}

async fn nats_of(
    ports: &[u16],
    asset: &str,
    (user, password): (&str, &str),
) -> Result<async_nats::Client, async_nats::ConnectError> {
    let server = |port: &u16| format!("nats://127.0.0.1:{port}").parse().unwrap();
    let servers: Vec<async_nats::ServerAddr> = ports.iter().map(server).collect();
    async_nats::ConnectOptions::new()
        .user_and_password(user.to_owned(), password.to_owned())
        .custom_inbox_prefix(format!("_INBOX.offbd.{}", asset.replace('.', "=2E")))
        .connect(servers)
        .await
}

/// Returns a batch of session `s` with an id, JSON.
pub fn numbered(id: &str, samples: &[Sample]) -> Vec<u8> {
    let mut document = batch(Some("s"), samples);
    document["id"] = json!(id);
    document.to_string().into_bytes()
}
