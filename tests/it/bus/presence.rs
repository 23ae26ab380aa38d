//! The presence of devices never holds up their telemetry.

use crate::bus::{connected, count, device, metric, start_with};
use crate::support::broker::{Mosquitto, Nats};
use crate::support::bus_device::{BusDevice, numbered};
use crate::support::postgres::Postgres;
use crate::support::{connection, rig};
use sqlx::Executor;

const ONLINE: &str = "offbd_bus_devices_online";

const UNKNOWN: &str = "offbd_bus_messages_total{bus=\"mqtt\",outcome=\"unknown_asset\"}";

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
