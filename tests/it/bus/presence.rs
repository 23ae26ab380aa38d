//! The presence of devices never holds up their telemetry.

use crate::bus::{connected, count, device, metric, start_with};
use crate::support::broker::{Mosquitto, Nats, mqtt_config};
use crate::support::bus_device::{BusDevice, MqttDevice, numbered};
use crate::support::link::Link;
use crate::support::postgres::Postgres;
use crate::support::{connection, rig};
use rumqttc::{Packet, PublishOptions};
use sqlx::Executor;

const ONLINE: &str = "offbd_bus_devices_online";

const UNKNOWN: &str = "offbd_bus_messages_total{bus=\"mqtt\",outcome=\"unknown_asset\"}";

/// Devices of which a broker has two retained messages each, together more than there is room for
/// batches in a queue.
const RETAINED: usize = 2100;

/// Messages of QoS 1 that a device leaves to a broker at a time.
const AT_ONCE: usize = 300;

/// Presences that arrive at once, more than there is room for batches in a queue.
const FLOOD: usize = 6000;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn telemetry_is_acknowledged_while_presences_wait_for_the_database() {
    let (nats, mosquitto, postgres) = (Nats::start(), Mosquitto::start(), Postgres::new());
    let database = postgres.database("twin");
    let fixture = start_with(|config| {
        config.database = Some(database.clone());
        config.nats = Some(nats.config());
        config.mqtt = Some(mosquitto.config());
    })
    .await;
    let client = &fixture.client;
    connected(client, "mqtt").await;
    let secret = device(client, "nats").await;
    client.asset("mqtt").await;
    let mut devices = [
        BusDevice::nats(nats.port, "nats", ("x", &secret)).await,
        BusDevice::mqtt(mosquitto.port, "mqtt", None).await,
    ];
    let samples = rig(1100, usize::MAX);
    // Afterwards there is a row for each fault code, and a batch needs no other table than its own.
    for device in &mut devices {
        let answer = device.ask(numbered("first", &samples[..900])).await;
        assert_eq!(answer["accepted"], 900, "{answer}");
    }
    let (online, unknown) = (count(client, ONLINE).await, count(client, UNKNOWN).await);

    let mut lock = connection(&database).await;
    lock.execute("BEGIN; LOCK TABLE asset IN ACCESS EXCLUSIVE MODE").await.unwrap();
    mosquitto.publish_lines(&["-t", "offbd/v1/nobody/state"], "online\n");
    for device in &mut devices {
        device.publish("hello", b"{}".to_vec()).await;
        for i in 0..FLOOD {
            let presence = if i % 2 == 0 { "offline" } else { "online" };
            device.publish("state", presence.into()).await;
            if i % 500 == 499 {
                let part = &samples[900 + i / 500 * 10..][..10];
                let answer = device.ask(numbered("later", part)).await;
                assert_eq!(answer["accepted"], 10, "{answer}");
            }
        }
    }
    assert_eq!(count(client, ONLINE).await, online, "nothing is known yet");
    lock.execute("ROLLBACK").await.unwrap();
    metric(client, ONLINE, |n| n == online + 2.0).await;
    metric(client, UNKNOWN, |n| n == unknown + 1.0).await;
}

/// Greetings and presences that a broker has kept come all at once after each connection, at QoS 1:
/// with mosquitto's default in groups of 20, without a limit one after the other.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn retained_presences_end_no_connection_and_hold_up_no_telemetry() {
    for n_at_once in [20, 0] {
        // Without writing all that is retained after each acknowledgement.
        let settings = ["autosave_on_changes false", "autosave_interval 0"].map(str::to_owned);
        let inflight = format!("max_inflight_messages {n_at_once}");
        let mosquitto = Mosquitto::start_of(|_| [&settings[..], &[inflight]].concat());
        are_taken_beside_telemetry(&mosquitto).await;
    }
}

async fn are_taken_beside_telemetry(mosquitto: &Mosquitto) {
    let (link, port) = Link::to_port(mosquitto.port).await;
    let mut fixture = start_with(|config| config.mqtt = Some(mqtt_config(port))).await;
    let before = count(&fixture.client, ONLINE).await;
    let names: Vec<_> = (0..RETAINED).map(|i| format!("d{i}")).collect();
    for names in names.chunks(AT_ONCE / 2) {
        let client = &fixture.client;
        futures_util::future::join_all(names.iter().map(|name| client.asset(name))).await;
    }
    leave_presences(mosquitto, &names).await;
    fixture.restart().await;
    let client = &fixture.client;
    connected(client, "mqtt").await;
    let mut device = BusDevice::mqtt(mosquitto.port, "d0", None).await;
    let answer = device.ask(numbered("x", &rig(10, 10))).await;
    assert_eq!(answer["accepted"], 10, "{answer}");
    metric(client, ONLINE, |n| n == before + RETAINED as f64).await;
    // One before the restart, one after it.
    assert_eq!(link.n_connections(), 2);
    // It must not say of the next service that its connection is lost: the process has one metric.
    fixture.server.take().unwrap().shutdown().await.unwrap();
}

/// Leaves a greeting and a presence of each device to the broker.
async fn leave_presences(mosquitto: &Mosquitto, names: &[String]) {
    let mut sender = MqttDevice::connect(mosquitto.port, "all", None).await;
    let retained = PublishOptions::at_least_once().retained();
    for names in names.chunks(AT_ONCE / 2) {
        for name in names {
            for (level, text) in [("hello", "{}"), ("state", "online")] {
                let topic = format!("offbd/v1/{name}/{level}");
                sender.client.publish(topic, text, retained).await.unwrap();
            }
        }
        for _ in 0..2 * names.len() {
            sender.until(|packet| matches!(packet, Packet::PubAck(_)).then_some(())).await;
        }
    }
}
