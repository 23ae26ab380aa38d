//! A device's offbd token is its password at the NATS server, and gives it its own asset only.

use crate::bus::{count, device, metric, token, with_nats};
use crate::support::broker::Nats;
use crate::support::bus_device::{MqttDevice, nats, numbered};
use crate::support::{DEADLINE, rig};
use futures_util::StreamExt;
use serde_json::json;

const TAKEN: &str = "offbd_bus_messages_total{bus=\"nats\",outcome=\"taken\"}";

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn only_a_valid_token_opens_a_connection() {
    let server = Nats::start();
    let fixture = with_nats(&server).await;
    let client = &fixture.client;
    let secret = device(client, "a").await;
    let forged = format!("{}0", &secret[..secret.len() - 1]);
    for password in ["", "offbd_", "x", &forged] {
        if password != secret {
            assert!(nats(server.port, "a", ("a", password)).await.is_err(), "{password}");
            let refusal = MqttDevice::refusal(server.mqtt_port, "a", Some(("a", password))).await;
            assert!(!refusal.is_empty());
        }
    }
    assert!(async_nats::connect(format!("nats://127.0.0.1:{}", server.port)).await.is_err());
    let refused = count(client, "offbd_bus_logins_total{outcome=\"refused\"}").await;
    assert!(refused >= 6.0, "{refused}");
    // A revoked token is one no longer.
    let list = client.get("tokens").await.expect(200);
    let id = list["items"].as_array().unwrap().iter().find(|token| token["name"] == "a").unwrap();
    nats(server.port, "a", ("a", &secret)).await.unwrap();
    client.delete(&format!("tokens/{}", id["id"].as_str().unwrap())).await.expect(204);
    assert!(nats(server.port, "a", ("a", &secret)).await.is_err());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_device_cannot_send_for_another_asset_nor_read_of_it() {
    let server = Nats::start();
    let fixture = with_nats(&server).await;
    let client = &fixture.client;
    let taken_before = count(client, TAKEN).await;
    let secret = device(client, "a").await;
    device(client, "b").await;
    let samples = rig(20, 20);
    let (errors, mut seen) = tokio::sync::mpsc::unbounded_channel();
    let thief = async_nats::ConnectOptions::new()
        .user_and_password("b".to_owned(), secret.clone())
        .event_callback(move |event| {
            let errors = errors.clone();
            async move { drop(errors.send(event.to_string())) }
        })
        .connect(format!("nats://127.0.0.1:{}", server.port))
        .await
        .unwrap();
    let mut violation = async |what: &str| loop {
        let event = tokio::time::timeout(DEADLINE, seen.recv()).await.expect("a refusal").unwrap();
        if event.to_lowercase().contains("permissions violation") {
            assert!(event.contains(what), "{event}");
            return;
        }
    };
    for subject in [
        "offbd.v1.b.telemetry",
        "offbd.v1.a.ack",
        "offbd.v1.a.fault.x_servo",
        "$SYS.REQ.USER.AUTH",
        "$JS.API.INFO",
    ] {
        thief.publish(subject, numbered("x", &samples).into()).await.unwrap();
        violation(subject).await;
    }
    for subject in ["offbd.v1.>", "offbd.v1.b.ack", "_INBOX.>", "$SYS.REQ.USER.AUTH", ">"] {
        let _subscriber = thief.subscribe(subject).await.unwrap();
        violation(subject).await;
    }
    // By MQTT: the server drops what is not permitted; what is permitted comes after it.
    let mut stranger =
        MqttDevice::connect(server.mqtt_port, "stranger", Some(("b", &secret))).await;
    stranger.subscribe("offbd/v1/a/ack").await;
    for asset in ["b", "a"] {
        let topic = format!("offbd/v1/{asset}/telemetry");
        stranger.publish(&topic, numbered(asset, &samples)).await;
    }
    let ack: serde_json::Value = serde_json::from_slice(&stranger.next().await.payload).unwrap();
    assert_eq!((&ack["id"], &ack["accepted"]), (&json!("a"), &json!(20)), "{ack}");
    metric(client, TAKEN, |n| n == taken_before + 1.0).await;
    let sessions = client.get("sessions?asset=b").await.expect(200);
    assert_eq!(sessions["items"], json!([]));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_request_is_answered_to_its_sender_and_a_viewer_only_reads() {
    let server = Nats::start();
    let fixture = with_nats(&server).await;
    let client = &fixture.client;
    let secret = device(client, "a").await;
    let viewer = token(client, &json!({ "name": "v", "role": "viewer" })).await;
    let viewer = async_nats::ConnectOptions::with_user_and_password("v".to_owned(), viewer)
        .connect(format!("nats://127.0.0.1:{}", server.port))
        .await
        .unwrap();
    let mut acks = viewer.subscribe("offbd.v1.*.ack").await.unwrap();
    let samples = rig(20, 20);
    // Not permitted; had it been taken, it would be the first acknowledgement.
    viewer.publish("offbd.v1.a.telemetry", numbered("viewer", &samples).into()).await.unwrap();
    viewer.flush().await.unwrap();
    let sender = nats(server.port, "a", ("a", &secret)).await.unwrap();
    let reply =
        sender.request("offbd.v1.a.telemetry", numbered("7", &samples).into()).await.unwrap();
    let reply: serde_json::Value = serde_json::from_slice(&reply.payload).unwrap();
    assert_eq!((&reply["id"], &reply["accepted"]), (&json!("7"), &json!(20)), "{reply}");
    let ack = tokio::time::timeout(DEADLINE, acks.next()).await.unwrap().unwrap();
    assert_eq!(serde_json::from_slice::<serde_json::Value>(&ack.payload).unwrap(), reply);
}
