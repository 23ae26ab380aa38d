//! What devices must not send: refused in words, counted, and nothing is taken.

use crate::bus::{connected, count, device, metric, start_with, with_mosquitto, with_nats};
use crate::support::broker::{Mosquitto, Nats, mqtt_config};
use crate::support::bus_device::{BusDevice, MqttDevice, nats, numbered};
use crate::support::link::Link;
use crate::support::rig;
use rumqttc::{PublishOptions, QoS};
use serde_json::{Value, json};

fn outcome(bus: &str, outcome: &str) -> String {
    format!("offbd_bus_messages_total{{bus=\"{bus}\",outcome=\"{outcome}\"}}")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_bad_batch_is_refused_in_words() {
    let (nats, mosquitto) = (Nats::start(), Mosquitto::start());
    let fixture = start_with(|config| {
        config.nats = Some(nats.config());
        config.mqtt = Some(mosquitto.config());
        config.limits.batch_bytes = 100_000;
        config.limits.batch_samples = 200;
        config.limits.in_flight_samples = 200;
    })
    .await;
    let client = &fixture.client;
    connected(client, "mqtt").await;
    let secret = device(client, "a").await;
    let samples = rig(300, 300);
    let over_nats = BusDevice::nats(nats.port, "a", ("a", &secret)).await;
    let over_mosquitto = BusDevice::mqtt(mosquitto.port, "a", None).await;
    client.telemetry("a", Some("ended"), &samples[..3]).await;
    client.end("a", "ended").await;
    // Not those that are recorded, which would be a retransmission.
    let mut ended_batch = crate::support::batch(Some("ended"), &samples[3..6]);
    ended_batch["id"] = json!("e");
    for (bus, mut device) in [("nats", over_nats), ("mqtt", over_mosquitto)] {
        for (document, status, word, counted) in [
            (b"junk".to_vec(), 400, "malformed", "malformed"),
            (vec![0x81, 0xff], 400, "malformed", "malformed"),
            (b"".to_vec(), 400, "malformed", "malformed"),
            (br#"{"t_s":[1],"x_m":[1,2]}"#.to_vec(), 400, "malformed", "malformed"),
            (vec![b' '; 100_001], 413, "too-large", "too_large"),
            (numbered("n", &samples), 413, "too-large", "too_large"),
            (ended_batch.to_string().into_bytes(), 409, "session-ended", "conflict"),
        ] {
            let before = count(client, &outcome(bus, counted)).await;
            let answer = device.ask(document).await;
            assert_eq!(answer["status"], status, "{bus}: {answer}");
            assert_eq!(answer["type"], format!("urn:offbd:problem:{word}"), "{answer}");
            assert!(!answer["detail"].as_str().unwrap().is_empty(), "{answer}");
            assert_eq!(answer["retry_after_s"], Value::Null, "{answer}");
            metric(client, &outcome(bus, counted), |n| n == before + 1.0).await;
        }
    }
    assert_eq!(client.recording("a", "ended").await.len(), 3);
    // An invalid row is refused alone.
    let mut device = BusDevice::mqtt(mosquitto.port, "a", None).await;
    let answer = device.ask(br#"{"session":"s","samples":[{"t_s":1},{"t_s":"x"}]}"#.to_vec()).await;
    assert_eq!((&answer["accepted"], &answer["rejected"][0]["index"]), (&json!(1), &json!(1)));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_bad_topic_is_counted_and_nothing_is_taken() {
    let mosquitto = Mosquitto::start();
    let fixture = with_mosquitto(&mosquitto).await;
    let client = &fixture.client;
    connected(client, "mqtt").await;
    client.asset("a").await;
    let samples = rig(10, 10);
    let mut device = MqttDevice::connect(mosquitto.port, "device", None).await;
    device.subscribe("offbd/v1/+/ack").await;
    // The metrics are those of the process, which has other tests.
    let before = count(client, &outcome("mqtt", "topic")).await;
    let unknown_before = count(client, &outcome("mqtt", "unknown_asset")).await;
    let batch = numbered("x", &samples);
    for topic in [
        "offbd/v1/a.b/telemetry",
        "offbd/v1/=2E/telemetry",
        "offbd/v1//telemetry",
        "offbd/v1/a b/telemetry",
    ] {
        device.publish(topic, batch.clone()).await;
    }
    device.publish("offbd/v1/nobody/telemetry", batch.clone()).await;
    let answer = device.next().await;
    metric(client, &outcome("mqtt", "topic"), |n| n == before + 4.0).await;
    assert_eq!(answer.topic, "offbd/v1/nobody/ack");
    let answer: Value = serde_json::from_slice(&answer.payload).unwrap();
    assert_eq!((&answer["status"], &answer["id"]), (&json!(404), &json!("x")));
    assert!(answer["detail"].as_str().unwrap().contains("`nobody`"), "{answer}");
    assert_eq!(count(client, &outcome("mqtt", "unknown_asset")).await, unknown_before + 1.0);
    let page = client.get("sessions").await.expect(200);
    assert_eq!(page["items"], json!([]));
}

/// A broker without a limit hands over messages of any length, and repeats one of QoS 1 that is
/// not acknowledged over each further connection.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_message_of_any_length_is_refused_and_others_are_served() {
    let mosquitto = Mosquitto::start();
    let (link, port) = Link::to_port(mosquitto.port).await;
    let fixture = start_with(|config| config.mqtt = Some(mqtt_config(port))).await;
    let client = &fixture.client;
    connected(client, "mqtt").await;
    client.asset("bad").await;
    client.asset("good").await;
    let before = count(client, &outcome("mqtt", "too_large")).await;
    let mut bad = MqttDevice::connect(mosquitto.port, "bad", None).await;
    bad.subscribe("offbd/v1/bad/ack").await;
    let mut good = BusDevice::mqtt(mosquitto.port, "good", None).await;
    for (i, part) in rig(30, 30).chunks(10).enumerate() {
        let mut long = br#"{"id":"long","note":""#.to_vec();
        long.resize(40 << 20, b'x');
        let options = PublishOptions::at_least_once();
        bad.client.publish("offbd/v1/bad/telemetry", long, options).await.unwrap();
        let answer: Value = serde_json::from_slice(&bad.next().await.payload).unwrap();
        assert_eq!((&answer["status"], &answer["id"]), (&json!(413), &json!("long")), "{answer}");
        let answer = good.ask(numbered(&i.to_string(), part)).await;
        assert_eq!(answer["accepted"], 10, "{answer}");
    }
    assert_eq!(count(client, &outcome("mqtt", "too_large")).await, before + 3.0);
    assert_eq!(link.n_connections(), 1);
}

/// What lies on a topic of telemetry since before is not new.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_retained_batch_is_ignored() {
    let mosquitto = Mosquitto::start();
    let mut device = MqttDevice::connect(mosquitto.port, "device", None).await;
    let batch = numbered("x", &rig(10, 10));
    let topic = "offbd/v1/a/telemetry";
    device.leave(topic, true, batch).await;
    let fixture = with_mosquitto(&mosquitto).await;
    metric(&fixture.client, &outcome("mqtt", "retained"), |n| n >= 1.0).await;
    let page = fixture.client.get("sessions").await.expect(200);
    assert_eq!(page["items"], json!([]), "nothing was taken");
}

/// Greetings, presence and the last will.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_device_is_online_until_its_last_will() {
    let server = Nats::start();
    let fixture = with_nats(&server).await;
    let client = &fixture.client;
    let secret = device(client, "a").await;
    let connection = nats(server.port, "a", ("a", &secret)).await.unwrap();
    let before = count(client, &outcome("nats", "malformed")).await;
    let hello = r#"{"firmware":"1.2","axes":["x","y"],"units":["m","rad"],"rate_hz":50,"more":1}"#;
    connection.publish("offbd.v1.a.hello", hello.into()).await.unwrap();
    metric(client, "offbd_bus_devices_online", |n| n == 1.0).await;
    connection.publish("offbd.v1.a.state", "offline".into()).await.unwrap();
    metric(client, "offbd_bus_devices_online", |n| n == 0.0).await;
    for junk in ["?", "{\"rate_hz\":\"fast\"}"] {
        connection.publish("offbd.v1.a.hello", junk.into()).await.unwrap();
    }
    connection.publish("offbd.v1.a.state", "asleep".into()).await.unwrap();
    metric(client, &outcome("nats", "malformed"), |n| n == before + 3.0).await;

    // The last will of a device that vanishes, by MQTT.
    let mut options = rumqttc::MqttOptions::new("will", ("127.0.0.1", server.mqtt_port));
    options.set_credentials("a", secret);
    let will = rumqttc::LastWill::new("offbd/v1/a/state", "offline", QoS::AtMostOnce, true);
    options.set_last_will(will);
    let (device, mut events) = rumqttc::AsyncClient::builder(options).build();
    let retained = PublishOptions::at_most_once().retained();
    device.publish("offbd/v1/a/state", "online", retained).await.unwrap();
    let polling = tokio::spawn(async move { while events.poll().await.is_ok() {} });
    metric(client, "offbd_bus_devices_online", |n| n == 1.0).await;
    polling.abort();
    metric(client, "offbd_bus_devices_online", |n| n == 0.0).await;
}
