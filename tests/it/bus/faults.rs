//! Faults as retained messages.

use std::collections::BTreeMap;

use crate::bus::{connected, device, with_mosquitto, with_nats};
use crate::support::broker::{Mosquitto, NATS_PASSWORD, Nats};
use crate::support::bus_device::{MqttDevice, nats};
use crate::support::{DEADLINE, rig};
use futures_util::StreamExt;
use rumqttc::QoS;
use serde_json::Value;

/// Returns the faults that a new subscriber gets at once, by topic.
pub async fn retained(port: u16, login: Option<(&str, &str)>) -> BTreeMap<String, Value> {
    let mut late = MqttDevice::connect(port, "late", login).await;
    // Of each subscription the retained messages come at once, so that this one is the last.
    late.leave("marker", true, "x").await;
    late.subscribe("offbd/v1/+/fault/+").await;
    late.client.subscribe("marker", QoS::AtLeastOnce).await.unwrap();
    let mut found = BTreeMap::new();
    loop {
        let message = late.next().await;
        if message.topic == "marker" {
            return found;
        }
        // Others are published meanwhile.
        if message.retain {
            found.insert(message.topic.clone(), serde_json::from_slice(&message.payload).unwrap());
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_late_subscriber_gets_the_present_faults_and_none_that_was_cleared() {
    let mosquitto = Mosquitto::start();
    let mut fixture = with_mosquitto(&mosquitto).await;
    let mut early = MqttDevice::connect(mosquitto.port, "early", None).await;
    early.subscribe("offbd/v1/+/fault/+").await;
    fixture.client.asset("a.b").await;
    fixture.client.telemetry("a.b", Some("s"), &rig(3000, 1500)).await;
    let topic = "offbd/v1/a=2Eb/fault/x_servo";
    let mut events = Vec::new();
    let mut confirmed = false;
    while !confirmed {
        let message = early.next().await;
        let change: Value = serde_json::from_slice(&message.payload).unwrap();
        events.push(change["event"].as_i64().unwrap());
        confirmed = message.topic == topic && change["status"] == "confirmed";
    }
    // With the program of somebody else.
    let seen = mosquitto.subscribe(&["-t", topic, "-C", "1", "-W", "30"]);
    let seen: Value = serde_json::from_str(&seen).unwrap();
    assert_eq!((&seen["asset"], &seen["code"]), (&"a.b".into(), &"x_servo".into()));
    assert_eq!(retained(mosquitto.port, None).await[topic], seen);

    // After a restart it goes on where it was.
    let before = retained(mosquitto.port, None).await;
    fixture.restart().await;
    connected(&fixture.client, "mqtt").await;
    fixture.client.delete("assets/a.b/faults/x_servo?by=me").await.expect(204);
    let mut last = None;
    while last.is_none() {
        let message = early.next().await;
        if message.payload.is_empty() {
            assert_eq!(message.topic, topic);
            last = Some(());
        } else {
            let change: Value = serde_json::from_slice(&message.payload).unwrap();
            events.push(change["event"].as_i64().unwrap());
        }
    }
    assert!(events.is_sorted_by(|a, b| a < b), "each event once, in order: {events:?}");
    let stored = fixture.client.get("assets/a.b/faults?status=all").await;
    assert_eq!(stored.status, 200, "{}", stored.text);
    let mut after = retained(mosquitto.port, None).await;
    assert!(!after.contains_key(topic), "{after:?}");
    let mut expected = before;
    expected.remove(topic);
    after.retain(|topic, _| expected.contains_key(topic));
    assert_eq!(after.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_silent_rig_is_retained_until_its_data_are_back_and_later_faults_follow() {
    let mosquitto = Mosquitto::start();
    let fixture = crate::bus::start_with(|config| {
        config.mqtt = Some(mosquitto.config());
        config.communication.lost_after_s = 1;
        config.communication.back_after_s = 0;
    })
    .await;
    let mut early = MqttDevice::connect(mosquitto.port, "early", None).await;
    early.subscribe("offbd/v1/a/fault/+").await;
    fixture.client.asset("a").await;
    let samples = rig(3000, 1500);
    fixture.client.telemetry("a", Some("s"), &samples[..100]).await;
    let (silence, servo) = ("offbd/v1/a/fault/communication_lost", "offbd/v1/a/fault/x_servo");
    let lost = early.next().await;
    assert_eq!(lost.topic, silence);
    let lost: Value = serde_json::from_slice(&lost.payload).unwrap();
    assert_eq!((&lost["asset"], &lost["status"]), (&"a".into(), &"confirmed".into()));
    assert_eq!(retained(mosquitto.port, None).await[silence], lost);

    // Data are back only as long as they keep arriving.
    let client = fixture.client.clone();
    let sending = tokio::spawn(async move {
        for batch in samples[100..].chunks(50) {
            client.telemetry("a", Some("s"), batch).await;
        }
    });
    let (mut is_removed, mut is_faulty) = (false, false);
    while !(is_removed && is_faulty) {
        let message = early.next().await;
        is_removed |= message.topic == silence && message.payload.is_empty();
        is_faulty |= message.topic == servo;
    }
    sending.await.unwrap();
}

/// Through the gateway of a NATS server, by which it can retain messages too, and which hands
/// them on to subscribers by NATS.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_nats_server_hands_faults_to_subscribers_by_nats_and_mqtt() {
    let server = Nats::start();
    let fixture = crate::bus::start_with(|config| {
        config.nats = Some(offbd::config::NatsConfig { faults: false, ..server.config() });
        config.mqtt = Some(offbd::config::MqttConfig {
            telemetry: false,
            user: Some("offbd".to_owned()),
            password: Some(NATS_PASSWORD.to_owned()),
            ..crate::support::broker::mqtt_config(server.mqtt_port)
        });
    })
    .await;
    connected(&fixture.client, "mqtt").await;
    let secret = device(&fixture.client, "a").await;
    let subscriber = nats(server.port, "a", ("a", &secret)).await.unwrap();
    let mut faults = subscriber.subscribe("offbd.v1.a.fault.*").await.unwrap();
    subscriber.flush().await.unwrap();
    fixture.client.telemetry("a", Some("s"), &rig(3000, 1500)).await;
    loop {
        let message = tokio::time::timeout(DEADLINE, faults.next()).await.unwrap().unwrap();
        let change: Value = serde_json::from_slice(&message.payload).unwrap();
        if change["status"] == "confirmed" && message.subject.as_str() == "offbd.v1.a.fault.x_servo"
        {
            break;
        }
    }
    let login = ("offbd", NATS_PASSWORD);
    let retained = retained(server.mqtt_port, Some(login)).await;
    assert_eq!(retained["offbd/v1/a/fault/x_servo"]["code"], "x_servo");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn faults_are_published_by_nats_alone() {
    let server = Nats::start();
    let fixture = with_nats(&server).await;
    let secret = device(&fixture.client, "a").await;
    let subscriber = nats(server.port, "a", ("a", &secret)).await.unwrap();
    let mut faults = subscriber.subscribe("offbd.v1.a.fault.x_servo").await.unwrap();
    subscriber.flush().await.unwrap();
    fixture.client.telemetry("a", Some("s"), &rig(3000, 1500)).await;
    let mut last = 0;
    loop {
        let message = tokio::time::timeout(DEADLINE, faults.next()).await.unwrap().unwrap();
        let change: Value = serde_json::from_slice(&message.payload).unwrap();
        assert!(change["event"].as_i64().unwrap() > last);
        last = change["event"].as_i64().unwrap();
        if change["status"] == "confirmed" {
            break;
        }
    }
}
