//! Retained faults that a broker has lost are published again, and others are not.

use std::collections::BTreeMap;

use crate::bus::faults::retained;
use crate::bus::{BusService, connected, metric, start_with};
use crate::support::broker::{Mosquitto, NATS_PASSWORD, Nats, mqtt_config};
use crate::support::bus_device::MqttDevice;
use crate::support::link::{Link, LinkMode};
use crate::support::{Client, eventually, rig};
use offbd::config::{Config, MqttConfig};
use serde_json::{Value, json};

/// Where offbd notes what it has published.
const MARKER: &str = "offbd/v1/=service/faults";

fn topic(asset: &str, code: &str) -> String {
    format!("offbd/v1/{}/fault/{code}", asset.replace('.', "=2E"))
}

/// Starts a service by whose settings rigs are lost after a second.
async fn start(configure: impl FnOnce(&mut Config)) -> BusService {
    start_with(|config| {
        config.communication.lost_after_s = 1;
        config.communication.back_after_s = 0;
        configure(config);
    })
    .await
}

/// Makes rigs with a fault of a servo, of which data stay away then.
async fn fail(client: &Client, assets: &[&str]) {
    for asset in assets {
        client.asset(asset).await;
        client.telemetry(asset, Some("s"), &rig(3000, 1500)).await;
    }
}

async fn clear(client: &Client, asset: &str) {
    client.delete(&format!("assets/{asset}/faults/x_servo?by=me")).await.expect(204);
}

/// Waits until a new subscriber gets the faults that are wanted.
async fn until_retained(
    port: u16,
    login: Option<(&str, &str)>,
    wanted: impl Fn(&BTreeMap<String, Value>) -> bool,
) -> BTreeMap<String, Value> {
    eventually(async || Some(retained(port, login).await).filter(&wanted)).await
}

/// Waits until it is published that the data of the rigs stay away, the last event of each.
async fn until_silent(
    port: u16,
    login: Option<(&str, &str)>,
    assets: &[&str],
) -> BTreeMap<String, Value> {
    let silent = |asset: &&str| topic(asset, "communication_lost");
    until_retained(port, login, |faults| {
        assets.iter().map(silent).all(|topic| faults.contains_key(&topic))
    })
    .await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_broker_without_its_disk_gets_what_is_on_record_with_the_same_numbers() {
    let mut mosquitto = Mosquitto::start();
    let fixture = start(|config| config.mqtt = Some(mosquitto.config())).await;
    let (client, assets) = (&fixture.client, ["a.b", "c", "d"]);
    fail(client, &assets).await;
    clear(client, "c").await;
    let mut expected = until_silent(mosquitto.port, None, &assets).await;
    assert!(expected.contains_key(&topic("a.b", "x_servo")), "{expected:?}");
    assert!(!expected.contains_key(&topic("c", "x_servo")), "{expected:?}");
    mosquitto.kill();
    clear(client, "d").await;
    expected.remove(&topic("d", "x_servo")).unwrap();
    mosquitto.restart_with(None);
    until_retained(mosquitto.port, None, |faults| *faults == expected).await;
    // What changes then is published as before.
    clear(client, "a.b").await;
    expected.remove(&topic("a.b", "x_servo")).unwrap();
    until_retained(mosquitto.port, None, |faults| *faults == expected).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_broker_that_has_lost_the_latest_messages_gets_them_again() {
    let mut mosquitto = Mosquitto::start();
    let fixture = start(|config| config.mqtt = Some(mosquitto.config())).await;
    fail(&fixture.client, &["a", "b"]).await;
    let mut expected = until_silent(mosquitto.port, None, &["a", "b"]).await;
    mosquitto.kill();
    let stored = mosquitto.stored();
    mosquitto.restart();
    clear(&fixture.client, "a").await;
    expected.remove(&topic("a", "x_servo")).unwrap();
    until_retained(mosquitto.port, None, |faults| *faults == expected).await;
    mosquitto.restart_with(Some(&stored));
    until_retained(mosquitto.port, None, |faults| *faults == expected).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_nats_server_without_its_disk_gets_what_is_on_record() {
    let mut server = Nats::start();
    let fixture = start(|config| {
        config.nats = Some(offbd::config::NatsConfig { faults: false, ..server.config() });
        config.mqtt = Some(MqttConfig {
            telemetry: false,
            user: Some("offbd".to_owned()),
            password: Some(NATS_PASSWORD.to_owned()),
            ..mqtt_config(server.mqtt_port)
        });
    })
    .await;
    fail(&fixture.client, &["a.b"]).await;
    let login = Some(("offbd", NATS_PASSWORD));
    let expected = until_silent(server.mqtt_port, login, &["a.b"]).await;
    server.forget();
    until_retained(server.mqtt_port, login, |faults| *faults == expected).await;
}

/// Starts a service and rigs with faults, of which a broker gets only a part after it has lost
/// them, before each connection ends. Returns what it should get.
async fn interrupted(
    mosquitto: &mut Mosquitto,
    link: &Link,
    port: u16,
) -> (BusService, BTreeMap<String, Value>) {
    let fixture = start(|config| config.mqtt = Some(mqtt_config(port))).await;
    let assets = ["a", "b", "c", "d", "e", "f"];
    fail(&fixture.client, &assets).await;
    let expected = until_silent(mosquitto.port, None, &assets).await;
    link.set(LinkMode::CutAfter(4000), LinkMode::Pass);
    mosquitto.restart_with(None);
    until_part_of(&expected, mosquitto.port).await;
    (fixture, expected)
}

async fn until_part_of(faults: &BTreeMap<String, Value>, port: u16) {
    until_retained(port, None, |found| (1..faults.len()).contains(&found.len())).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_broker_that_loses_its_disk_twice_gets_everything_in_the_end() {
    let mut mosquitto = Mosquitto::start();
    let (link, port) = Link::to_port(mosquitto.port).await;
    let (_fixture, expected) = interrupted(&mut mosquitto, &link, port).await;
    link.set(LinkMode::Pass, LinkMode::Pass);
    mosquitto.restart_with(None);
    until_retained(mosquitto.port, None, |faults| *faults == expected).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_a_stop_interrupts_is_done_by_the_next_start() {
    let mut mosquitto = Mosquitto::start();
    let (link, port) = Link::to_port(mosquitto.port).await;
    let (mut fixture, expected) = interrupted(&mut mosquitto, &link, port).await;
    fixture.restart().await;
    link.set(LinkMode::Pass, LinkMode::Pass);
    until_retained(mosquitto.port, None, |faults| *faults == expected).await;
}

/// Returns topic and document of the next message that has one.
async fn next(observer: &mut MqttDevice) -> (String, Value) {
    loop {
        let message = observer.next().await;
        if !message.payload.is_empty() {
            return (message.topic, serde_json::from_slice(&message.payload).unwrap());
        }
    }
}

/// Checks that a live subscriber gets nothing again after a reconnection of offbd.
async fn is_quiet_after_a_reconnection(mosquitto: &Mosquitto, may_mark: bool) {
    let fixture = start(|config| config.mqtt = Some(mosquitto.config())).await;
    let client = &fixture.client;
    let mut observer = MqttDevice::connect(mosquitto.port, "observer", None).await;
    observer.subscribe("offbd/v1/#").await;
    fail(client, &["a"]).await;
    let (mut last, mut marked) = (Value::Null, Value::Null);
    while last["code"] != "communication_lost" || (may_mark && marked != last["event"]) {
        match next(&mut observer).await {
            (topic, document) if topic == MARKER => marked = document["published"].clone(),
            (_, document) => last = document,
        }
    }
    // Another client of its name throws offbd off.
    let _other = MqttDevice::connect(mosquitto.port, "offbd", None).await;
    metric(client, "offbd_bus_connected{bus=\"mqtt\"}", |value| value == 0.0).await;
    connected(client, "mqtt").await;
    clear(client, "a").await;
    let (mut questions, mut event) = (0, Value::Null);
    while event.is_null() {
        match next(&mut observer).await {
            (topic, document) if topic == MARKER => {
                questions += u32::from(document["question"].is_string());
            }
            (_, document) => event = document,
        }
    }
    assert_eq!((&event["status"], questions), (&json!("cleared"), u32::from(may_mark)), "{event}");
    assert!(event["event"].as_i64() > last["event"].as_i64(), "{event}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_reconnection_tells_a_live_subscriber_nothing_again() {
    is_quiet_after_a_reconnection(&Mosquitto::start(), true).await;
}

/// A broker that does not let offbd find out what it has kept is believed to have all. With these
/// settings mosquitto ends the connection at each attempt: there are not many.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_the_right_to_its_own_topic_nothing_is_published_again() {
    let permitted = "topic readwrite offbd/v1/+/telemetry\ntopic readwrite offbd/v1/+/fault/+\n";
    is_quiet_after_a_reconnection(&Mosquitto::start_with(Some(permitted)), false).await;
}
