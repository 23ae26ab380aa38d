//! Devices over an MQTT broker, at QoS 0, of whose messages some are dropped: each keeps a
//! batch until it is acknowledged, and sends it again when no acknowledgement comes.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use axum::body::Bytes;
use offbd::config::{Config, MqttConfig};
use offbd::server;
use offbd_core::vocabulary::Sample;
use rumqttc::{AsyncClient, Event, EventLoop, MqttOptions, Packet, PublishOptions, QoS};
use tokio::time::timeout;

use crate::client::Client;
use crate::load::{DEVICES, columns};
use crate::{Clocks, Rate, register, show};

/// Samples of a batch.
const BATCH: usize = 100;
/// Of so many messages one is dropped, in either direction.
const DROPPED: u64 = 20;
/// Batches of a device that wait for their acknowledgements at a time.
const WINDOW: usize = 16;
/// Silence after which what is not acknowledged is sent again.
const SILENCE: Duration = Duration::from_millis(500);

/// Measures `rounds` rounds, each on a new store, with the broker on `port` of this machine.
pub(crate) async fn measure(port: u16, samples: &[Sample], rounds: usize) -> Result<()> {
    let bodies: Vec<Bytes> =
        samples.chunks(BATCH).enumerate().map(|(n, part)| numbered(n, part)).collect();
    let mut rates = Vec::new();
    for round in 0..rounds {
        rates.push(round_of(port, round, &bodies, samples.len()).await?);
    }
    show(&format!("MQTT by {BATCH}, 1 of {DROPPED} lost"), &mut rates, &mut []);
    Ok(())
}

/// A batch with its number as id, by which its acknowledgement is told from others.
fn numbered(n: usize, part: &[Sample]) -> Bytes {
    let mut document = columns(part);
    document["id"] = n.to_string().into();
    rmp_serde::to_vec_named(&document).expect("plain values").into()
}

async fn round_of(port: u16, round: usize, bodies: &[Bytes], n_samples: usize) -> Result<Rate> {
    let data = tempfile::tempdir()?;
    let mut config = Config { data: data.path().to_owned(), ..Config::default() };
    config.listen.set_port(0);
    config.mqtt = Some(MqttConfig {
        client_id: Some(format!("offbd{round}")),
        faults: false,
        ..MqttConfig::at(format!("mqtt://127.0.0.1:{port}"))
    });
    let server = server::start(config).await?;
    register(server.address, 0..DEVICES).await?;
    let mut devices = Vec::new();
    for n in 0..DEVICES {
        devices.push(MqttDevice::connect(port, round, n).await?);
    }
    let clocks = Clocks::start();
    let sending: Vec<_> =
        devices.into_iter().map(|device| tokio::spawn(device.send_all(bodies.to_vec()))).collect();
    for device in sending {
        device.await??;
    }
    let rate = clocks.rate(n_samples * DEVICES);
    let mut client = Client::connect(server.address).await?;
    for n in 0..DEVICES {
        let page = client.get(&format!("/api/v1/sessions?asset=device-{n}")).await?;
        let page: serde_json::Value = serde_json::from_str(&page)?;
        ensure!(page["items"][0]["samples"] == n_samples, "lost or doubled: {page}");
    }
    server.shutdown().await?;
    Ok(rate)
}

/// A device with its connection to the broker.
struct MqttDevice {
    client: AsyncClient,
    events: EventLoop,
    topic: String,
    /// State of the generator of losses.
    random: u64,
}

impl MqttDevice {
    async fn connect(port: u16, round: usize, n: usize) -> Result<Self> {
        let mut options = MqttOptions::new(format!("d{round}x{n}"), ("127.0.0.1", port));
        options.set_max_packet_size(1 << 20, 1 << 20);
        let (client, mut events) = AsyncClient::builder(options).capacity(10 * WINDOW).build();
        client.subscribe(format!("offbd/v1/device-{n}/ack"), QoS::AtMostOnce).await?;
        while !matches!(events.poll().await?, Event::Incoming(Packet::SubAck(_))) {}
        let topic = format!("offbd/v1/device-{n}/telemetry");
        Ok(Self { client, events, topic, random: n as u64 })
    }

    fn is_lost(&mut self) -> bool {
        self.random = self
            .random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 33).is_multiple_of(DROPPED)
    }

    /// Sends every body until all are acknowledged.
    async fn send_all(mut self, bodies: Vec<Bytes>) -> Result<()> {
        let mut fresh = bodies.into_iter().enumerate();
        // A device without session names waits for its first acknowledgement, so that its first
        // batch is not taken for a restart if it is lost and comes late.
        let mut window = 1;
        let mut kept: BTreeMap<usize, (Bytes, Instant)> = BTreeMap::new();
        loop {
            while kept.len() < window
                && let Some((n, body)) = fresh.next()
            {
                self.publish(body.clone()).await?;
                kept.insert(n, (body, Instant::now()));
            }
            if kept.is_empty() {
                return Ok(());
            }
            if let Ok(n) = timeout(SILENCE, self.acknowledged()).await {
                kept.remove(&n?);
                window = WINDOW;
            }
            for (body, sent) in kept.values_mut().filter(|(_, sent)| sent.elapsed() > SILENCE) {
                *sent = Instant::now();
                self.publish(body.clone()).await?;
            }
        }
    }

    async fn publish(&mut self, body: Bytes) -> Result<()> {
        if !self.is_lost() {
            let options = PublishOptions::at_most_once();
            self.client.publish(&self.topic, body, options).await?;
        }
        Ok(())
    }

    /// Waits for the next acknowledgement that is not lost; returns the number of its batch.
    async fn acknowledged(&mut self) -> Result<usize> {
        loop {
            let Event::Incoming(Packet::Publish(publish)) = self.events.poll().await? else {
                continue;
            };
            let answer: serde_json::Value = serde_json::from_slice(&publish.payload)?;
            if self.is_lost() || answer["retry_after_s"].is_number() {
                continue;
            }
            ensure!(answer["rejected"] == serde_json::json!([]), "{answer}");
            return Ok(answer["id"].as_str().context("no id")?.parse()?);
        }
    }
}
