//! The service publishes with its own rights: a reply subject leads nowhere else.

use crate::bus::{count, device, metric, start_with, with_nats};
use crate::support::broker::{NATS_PASSWORD, Nats};
use crate::support::bus_device::{nats, numbered};
use crate::support::{DEADLINE, rig};
use async_nats::{ConnectOptions, Subscriber};
use data_encoding::BASE64URL_NOPAD;
use futures_util::StreamExt;
use offbd::config::NatsConfig;
use serde_json::{Value, json};
use tokio::time::timeout;

const REFUSED: &str = "offbd_bus_replies_refused_total";

/// Reply subjects that no device may receive on.
const FOREIGN: [&str; 18] = [
    "offbd.v1.b.ack",
    "offbd.v1.b.fault.x_servo",
    "offbd.v1.b.telemetry",
    "offbd.v1.b.state",
    "offbd.v1.a.ack",
    "offbd.v1.a.telemetry",
    "offbd.v1..ack",
    "offbd.v1.*.ack",
    "$SYS.REQ.USER.AUTH",
    "$SYS.REQ.SERVER.PING",
    "$SYS._INBOX.x",
    "$JS.API.STREAM.PURGE.$MQTT_msgs",
    "_INBOX",
    "_INBOX.",
    "_INBOX..x",
    "_INBOX.offbd.a.>",
    "_INBOX.offbd.a.x.*",
    ">",
];

/// Reply subjects that are not those of asset `a`, where each asset has its own.
const OF_OTHERS: [&str; 7] = [
    "_INBOX.x",
    "_INBOX.offbd",
    "_INBOX.offbd.a",
    "_INBOX.offbd.b.x",
    "_INBOX.offbd.ab.x",
    "_INBOX.offbd.*.x",
    "_INBOX.offbd.=service.x",
];

/// Sends a batch of asset `a` with each reply subject. Each is stored and acknowledged on the
/// topic of its asset; nothing else is published.
async fn send_with_replies(
    sender: &async_nats::Client,
    observed: &mut Subscriber,
    replies: &[&'static str],
) {
    let samples = rig(10 * replies.len(), usize::MAX);
    for (part, reply) in samples.chunks(10).zip(replies) {
        let batch = numbered("of-b-17", part);
        sender.publish_with_reply("offbd.v1.a.telemetry", *reply, batch.into()).await.unwrap();
    }
    let (mut n_acks, mut strange) = (0, Vec::new());
    while n_acks < replies.len() {
        let message = timeout(DEADLINE, observed.next()).await.expect("a message in time").unwrap();
        let document = serde_json::from_slice::<Value>(&message.payload).unwrap_or_default();
        let is_ack = document["id"] == "of-b-17" && document["samples"].is_null();
        match message.subject.as_str() {
            "offbd.v1.a.ack" => {
                assert_eq!(document["accepted"], json!(10), "{document}");
                n_acks += 1;
            }
            // A reply is sent before the acknowledgement on the topic.
            subject if is_ack => strange.push(subject.to_owned()),
            _ => {}
        }
    }
    assert_eq!(strange, Vec::<String>::new());
}

/// Subscribes to all that is published.
async fn observer(port: u16, options: ConnectOptions) -> Subscriber {
    let client = options.connect(format!("nats://127.0.0.1:{port}")).await.unwrap();
    let observed = client.subscribe(">").await.unwrap();
    client.flush().await.unwrap();
    observed
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_device_is_answered_below_the_inbox_of_its_asset_only() {
    let server = Nats::start();
    let fixture = with_nats(&server).await;
    let client = &fixture.client;
    let secret = device(client, "a").await;
    device(client, "b").await;
    let service = ConnectOptions::with_user_and_password("offbd".into(), NATS_PASSWORD.into());
    let mut observed = observer(server.port, service).await;
    let before = count(client, REFUSED).await;
    let sender = nats(server.port, "a", ("a", &secret)).await.unwrap();
    let replies = [&FOREIGN[..], &OF_OTHERS].concat();
    send_with_replies(&sender, &mut observed, &replies).await;
    metric(client, REFUSED, |n| n == before + replies.len() as f64).await;
    let other = rig(1000, usize::MAX).split_off(990);
    let request = sender.request("offbd.v1.a.telemetry", numbered("own", &other).into());
    let answer: Value = serde_json::from_slice(&request.await.unwrap().payload).unwrap();
    assert_eq!((&answer["id"], &answer["accepted"]), (&json!("own"), &json!(10)), "{answer}");
    assert_eq!(count(client, REFUSED).await, before + replies.len() as f64);
}

/// A NATS server that everybody may use, and that asks for no rights.
fn open_nats() -> Nats {
    Nats::start_with(|shipped| {
        let (before_rights, _) = shipped.split_once("authorization {").unwrap();
        format!("{before_rights}\nno_auth_user: offbd\n")
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_rights_of_devices_a_request_is_answered_in_any_inbox() {
    let server = open_nats();
    let config = NatsConfig { issuer_seed: None, ..server.config() };
    let fixture = start_with(|service| service.nats = Some(config)).await;
    let client = &fixture.client;
    client.asset("a").await;
    client.asset("b").await;
    let mut observed = observer(server.port, ConnectOptions::new()).await;
    let before = count(client, REFUSED).await;
    let url = format!("nats://127.0.0.1:{}", server.port);
    let sender = async_nats::connect(url).await.unwrap();
    send_with_replies(&sender, &mut observed, &FOREIGN).await;
    metric(client, REFUSED, |n| n == before + FOREIGN.len() as f64).await;
    let other = rig(1000, usize::MAX).split_off(990);
    let request = sender.request("offbd.v1.a.telemetry", numbered("own", &other).into());
    let answer: Value = serde_json::from_slice(&request.await.unwrap().payload).unwrap();
    assert_eq!((&answer["id"], &answer["accepted"]), (&json!("own"), &json!(10)), "{answer}");
}

/// What the service sends to itself is not below the inbox of any asset, so that no device can
/// receive it or send something else in its place.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_inbox_of_the_service_is_that_of_no_asset() {
    let server = Nats::start();
    let _fixture = with_nats(&server).await;
    let service = ConnectOptions::with_user_and_password("offbd".into(), NATS_PASSWORD.into());
    let mut observed = observer(server.port, service).await;
    let own = async {
        loop {
            let subject = observed.next().await.unwrap().subject;
            if let Some(own) = subject.strip_prefix("_INBOX.offbd.") {
                return own.split('.').next().unwrap().to_owned();
            }
        }
    };
    let level = timeout(DEADLINE, own).await.expect("a message to itself in time");
    assert!(offbd::wire::bus::decoded(&level).is_err(), "{level}");
}

/// Returns a question for the rights of a client with a bad password, signed by a key that its
/// sender has made.
fn forged_question() -> Vec<u8> {
    let (server, user) = (nkeys::KeyPair::new_server(), nkeys::KeyPair::new_user());
    let id = server.public_key();
    let claims = json!({
        "iss": id,
        "nats": { "user_nkey": user.public_key(), "server_id": { "id": id } },
    });
    let parts = [json!({ "typ": "JWT", "alg": "ed25519-nkey" }), claims]
        .map(|part| BASE64URL_NOPAD.encode(part.to_string().as_bytes()));
    let message = parts.join(".");
    let signature = BASE64URL_NOPAD.encode(&server.sign(message.as_bytes()).unwrap());
    format!("{message}.{signature}").into_bytes()
}

/// A server that asks for rights lets nobody else ask; one that does not lets everybody.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_question_for_rights_is_answered_to_a_server_only() {
    let server = open_nats();
    let fixture = with_nats(&server).await;
    let client = &fixture.client;
    let forger = async_nats::connect(format!("nats://127.0.0.1:{}", server.port)).await.unwrap();
    let mut observed = forger.subscribe("*.>").await.unwrap();
    let before = count(client, REFUSED).await;
    let foreign = ["offbd.v1.b.ack", "$JS.API.STREAM.PURGE.$MQTT_msgs", "_INBOX.x"];
    let replies = foreign.into_iter().chain(["$SYS._INBOX.N.x"]);
    for reply in replies {
        let question = forged_question().into();
        forger.publish_with_reply("$SYS.REQ.USER.AUTH", reply, question).await.unwrap();
    }
    let mut strange = Vec::new();
    let answered = async {
        loop {
            let subject = observed.next().await.unwrap().subject;
            if subject.as_str() == "$SYS._INBOX.N.x" {
                return;
            }
            strange.extend(foreign.contains(&subject.as_str()).then_some(subject));
        }
    };
    timeout(DEADLINE, answered).await.expect("an answer in time");
    assert_eq!(strange, Vec::new());
    assert_eq!(count(client, REFUSED).await, before + foreign.len() as f64);
}
