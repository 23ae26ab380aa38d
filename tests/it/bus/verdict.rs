//! One recording by every bus and by HTTP has one verdict.

use crate::bus::{connected, device};
use crate::support::broker::{Mosquitto, Nats};
use crate::support::bus_device::{BusDevice, numbered};
use crate::support::{batch, csv, judged, packed, rig};
use serde_json::json;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_bus_gives_the_same_recording_and_verdict_as_http() {
    let (nats, mosquitto) = (Nats::start(), Mosquitto::start());
    let fixture = crate::bus::start_with(|config| {
        config.nats = Some(nats.config());
        config.mqtt = Some(mosquitto.config());
    })
    .await;
    let client = &fixture.client;
    connected(client, "mqtt").await;
    let samples = rig(3000, 1500);
    let (hash, faults) = judged("a", &samples);
    assert!(faults.contains(&"x_servo".to_owned()), "{faults:?}");

    let secret = device(client, "nats").await;
    let over_nats = BusDevice::nats(nats.port, "nats", ("nats", &secret)).await;
    // A name with a dot.
    let secret = device(client, "by.gateway").await;
    let over_gateway =
        BusDevice::mqtt(nats.mqtt_port, "by.gateway", Some(("device", &secret))).await;
    client.asset("mosquitto").await;
    let over_mosquitto = BusDevice::mqtt(mosquitto.port, "mosquitto", None).await;
    for (mut device, is_packed) in
        [(over_nats, false), (over_gateway, true), (over_mosquitto, false)]
    {
        for (i, part) in samples.chunks(100).enumerate() {
            let id = i.to_string();
            let document = if is_packed {
                let mut document = batch(Some("s"), part);
                document["id"] = json!(id);
                packed(&document)
            } else {
                numbered(&id, part)
            };
            let ack = device.ask(document).await;
            assert_eq!((&ack["id"], &ack["accepted"]), (&json!(id), &json!(part.len())), "{ack}");
            assert_eq!(ack["last_seq"], json!(part.last().unwrap().seq), "{ack}");
        }
    }
    client.asset("http").await;
    for part in samples.chunks(100) {
        client.telemetry("http", Some("s"), part).await;
    }
    client.asset("imported").await;
    let path = "assets/imported/sessions/import?name=s";
    client.post_text(path, "text/csv", csv(&samples)).await.expect(201);
    for asset in ["nats", "by.gateway", "mosquitto", "http", "imported"] {
        let session = client.end(asset, "s").await;
        assert_eq!(session["verdict"]["verdict_hash"], json!(hash), "{asset}");
        assert_eq!(client.recording(asset, "s").await, samples, "{asset}");
    }
}
