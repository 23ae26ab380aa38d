//! Nodes that require tokens pass batches of devices on to each other.

use offbd::config::Config;
use offbd::server::tokens::create_token;
use offbd::service::access::{NewToken, Role};
use reqwest::Method;

use super::bus::leave_to_broker;
use super::{count, register_rigs};
use crate::support::broker::Mosquitto;
use crate::support::bus_device::MqttDevice;
use crate::support::cluster::{Cluster, NodeKind};
use crate::support::postgres::Postgres;
use crate::support::{eventually, rig};

/// Starts two nodes that require tokens, the first of which is at a broker.
async fn start(mosquitto: &Mosquitto) -> Cluster {
    let postgres = Postgres::new();
    let config = Config { database: Some(postgres.database("cluster")), ..Config::default() };
    let root =
        NewToken { name: "root".to_owned(), role: Role::Admin, asset: None, expires_at: None };
    let token = create_token(&config, root).await.unwrap();
    let mut second = NodeKind { token: Some(token), ..NodeKind::default() };
    second.environment.push(("OFFBD_AUTH", "required".to_owned()));
    let mut first = second.clone();
    first.environment.push(("OFFBD_MQTT__URL", mosquitto.config().url));
    Cluster::of(postgres, vec![first, second]).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_batch_at_qos_1_is_passed_on_between_nodes_that_require_tokens() {
    let (mosquitto, samples) = (Mosquitto::start(), rig(400, 400));
    let cluster = start(&mosquitto).await;
    let (first, second) = (cluster.client(0), cluster.client(1));
    let connected = async || count(&first, "offbd_bus_connected{bus=\"mqtt\"}").await == 1.0;
    eventually(async || connected().await.then_some(())).await;
    let names = register_rigs(&cluster).await;
    let owned = cluster.owned_by(1, &names).await;
    let mut stranger = second.clone();
    stranger.token = None;
    stranger.get("assets").await.problem(401);
    let forged = stranger.request(Method::POST, &format!("assets/{}/telemetry", owned[0]));
    let forged = forged.header("x-offbd-from-bus", "1").header("x-offbd-forwarded", "guessed");
    stranger.send(forged).await.problem(401);

    let mut device = MqttDevice::connect(mosquitto.port, "all", None).await;
    leave_to_broker(&mut device, &owned[..1], &samples).await;
    let stored = async || {
        let sessions = second.get(&format!("sessions?asset={}", owned[0])).await.expect(200);
        let is_there = sessions["items"].as_array().is_some_and(|items| !items.is_empty());
        let stored = if is_there { second.recording(&owned[0], "s").await } else { Vec::new() };
        (stored.len() == samples.len()).then_some(stored)
    };
    let mut stored = eventually(stored).await;
    // They are passed on side by side.
    stored.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
    assert_eq!(stored, samples);
    // The broker gives out 20 messages that are not acknowledged. Each came once.
    let elsewhere = "offbd_bus_messages_total{bus=\"mqtt\",outcome=\"elsewhere\"}";
    assert_eq!(count(&first, elsewhere).await, (samples.len() / 10) as f64);
}
