//! Devices over NATS and MQTT, with a real nats-server and a real mosquitto.

mod access;
mod bad_input;
mod faults;
mod loss;
mod mapping;
mod messages;
mod partition;
mod presence;
mod puback;
mod replies;
mod retained;
mod verdict;

use crate::support::broker::{Mosquitto, Nats};
use crate::support::process::Process;
use crate::support::{Client, ServiceFixture, config, eventually};
use offbd::config::Config;
use offbd::server;
use serde_json::json;
use std::ops::{Deref, DerefMut};
use std::path::Path;
use tokio::sync::{Mutex, MutexGuard};

/// A service with a bus. The metrics of a process are those of all services in it: one of
/// these runs at a time.
struct BusService {
    fixture: ServiceFixture,
    _alone: MutexGuard<'static, ()>,
}

impl Deref for BusService {
    type Target = ServiceFixture;

    fn deref(&self) -> &ServiceFixture {
        &self.fixture
    }
}

impl DerefMut for BusService {
    fn deref_mut(&mut self) -> &mut ServiceFixture {
        &mut self.fixture
    }
}

/// Waits until no other service with a bus runs, and starts one.
async fn start_with(configure: impl FnOnce(&mut Config)) -> BusService {
    static ALONE: Mutex<()> = Mutex::const_new(());
    let _alone = ALONE.lock().await;
    BusService { fixture: ServiceFixture::start_with(configure).await, _alone }
}

/// Starts a service with a NATS server.
async fn with_nats(nats: &Nats) -> BusService {
    start_with(|config| config.nats = Some(nats.config())).await
}

/// Starts a service with an MQTT broker.
async fn with_mosquitto(mosquitto: &Mosquitto) -> BusService {
    let fixture = start_with(|config| config.mqtt = Some(mosquitto.config())).await;
    connected(&fixture.client, "mqtt").await;
    fixture
}

/// Waits until the service is connected.
async fn connected(client: &Client, bus: &str) {
    metric(client, &format!("offbd_bus_connected{{bus=\"{bus}\"}}"), |value| value == 1.0).await;
}

/// Waits until a metric has a value, and returns it.
async fn metric(client: &Client, series: &str, wanted: impl Fn(f64) -> bool) -> f64 {
    eventually(async || {
        let text = client.get("/metrics").await.text;
        let line = text.lines().find_map(|line| line.strip_prefix(&format!("{series} ")));
        // A counter that was never counted is not there.
        let value: f64 = line.map_or(0.0, |value| value.parse().unwrap());
        wanted(value).then_some(value)
    })
    .await
}

/// Returns the value of a metric.
async fn count(client: &Client, series: &str) -> f64 {
    metric(client, series, |_| true).await
}

/// Creates an asset and a token for its device.
async fn device(client: &Client, asset: &str) -> String {
    client.asset(asset).await;
    token(client, &json!({ "name": asset, "role": "device", "asset": asset })).await
}

async fn token(client: &Client, body: &serde_json::Value) -> String {
    let made = client.post("tokens", body).await.expect(201);
    made["secret"].as_str().unwrap_or_else(|| panic!("{made}")).to_owned()
}

/// A NATS server that acknowledges before it has written to the disk is not used, nor one that
/// another key speaks for.
#[tokio::test(flavor = "multi_thread")]
async fn an_unsafe_server_is_refused_at_the_start() {
    let nats = Nats::start_with(|shipped| shipped.replace("sync_interval: always", ""));
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.nats = Some(nats.config());
    let error = server::start(config.clone()).await.err().unwrap().to_string();
    assert!(error.contains("sync_interval: always") && error.contains("120 s"), "{error}");
    let data = tempfile::tempdir().unwrap();
    let mut config = crate::support::config(data.path());
    let user = nkeys::KeyPair::new_user().seed().unwrap();
    let seed = data.path().join("seed");
    std::fs::write(&seed, user).unwrap();
    config.nats = Some(offbd::config::NatsConfig { issuer_seed: Some(seed), ..nats.config() });
    let error = server::start(config).await.err().unwrap().to_string();
    assert!(error.contains("nats.issuer_seed"), "{error}");
}

/// A client that has lost its server connects to another one of its list: that one is checked
/// too, and used, but told of. At the start one of several servers may be away.
#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_connected_to_later_is_checked() {
    let mut safe = Nats::start();
    let mut other = Nats::start_with(|shipped| shipped.replace("sync_interval: always", ""));
    other.kill();
    let fixture = start_with(|config| {
        let (first, second) = (safe.config(), other.config());
        let both = |a: &str, b: &str| format!("{a},{b}");
        let monitor = both(&first.monitor.clone().unwrap(), &second.monitor.unwrap());
        let url = both(&first.url, &second.url);
        config.nats = Some(offbd::config::NatsConfig { url, monitor: Some(monitor), ..first });
    })
    .await;
    connected(&fixture.client, "nats").await;
    let is_unsafe = "offbd_bus_unsafe{bus=\"nats\"}";
    assert_eq!(count(&fixture.client, is_unsafe).await, 0.0);
    other.restart();
    safe.kill();
    metric(&fixture.client, is_unsafe, |value| value == 1.0).await;
    connected(&fixture.client, "nats").await;
    fixture.client.get("/readyz").await.expect(200);
}

/// Without a broker the service starts, and connects when there is one.
#[tokio::test(flavor = "multi_thread")]
async fn the_service_waits_for_a_broker_that_is_away() {
    let (mut nats, mut mosquitto) = (Nats::start(), Mosquitto::start());
    nats.kill();
    mosquitto.kill();
    let fixture = start_with(|config| {
        config.nats = Some(nats.config());
        config.mqtt = Some(mosquitto.config());
    })
    .await;
    fixture.client.get("/readyz").await.expect(200);
    nats.restart();
    mosquitto.restart();
    connected(&fixture.client, "nats").await;
    connected(&fixture.client, "mqtt").await;
}

/// What devices over the MQTT port of a NATS server must do is said at the start.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_warning_says_that_the_mqtt_port_of_a_nats_server_keeps_nothing() {
    let (nats, mqtt) = (Path::new("nats://127.0.0.1:1"), Path::new("mqtt://127.0.0.1:1"));
    let urls = [("OFFBD_NATS__URL", nats), ("OFFBD_MQTT__URL", mqtt)];
    for telemetry in ["false", "true"] {
        let data = tempfile::tempdir().unwrap();
        let telemetry_is = ("OFFBD_MQTT__TELEMETRY", Path::new(telemetry));
        let service = Process::start_with(data.path(), &[urls[0], urls[1], telemetry_is]);
        // Logged after it, if at all.
        let log = eventually(async || {
            Some(service.log()).filter(|log| log.contains("cannot connect to the NATS server"))
        });
        assert_eq!(log.await.contains("at QoS 1"), telemetry == "false");
    }
}

/// A broker is reached over TLS if its certificate comes from those that are named.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_broker_is_reached_over_tls() {
    let mosquitto = Mosquitto::start_encrypted(&[]);
    let fixture = start_with(|config| config.mqtt = Some(mosquitto.encrypted_config())).await;
    connected(&fixture.client, "mqtt").await;
}

/// A broker that demands a certificate lets in only a service that has one.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_broker_can_demand_a_certificate() {
    let mosquitto = Mosquitto::start_encrypted(&["require_certificate true"]);
    let data = tempfile::tempdir().unwrap();
    let config = mosquitto.encrypted_config();
    let (ca, key) = (config.ca.unwrap(), mosquitto.key());
    let with = |more: &[(&str, &Path)]| {
        let url = ("OFFBD_MQTT__URL", Path::new(&config.url));
        Process::start_with(data.path(), &[&[url, ("OFFBD_MQTT__CA", &ca)], more].concat())
    };
    let refused = with(&[]);
    eventually(async || {
        refused.log().contains("the connection to the MQTT broker is lost").then_some(())
    })
    .await;
    assert_eq!(count(&refused.client, "offbd_bus_connected{bus=\"mqtt\"}").await, 0.0);
    drop(refused);
    let named = with(&[("OFFBD_MQTT__CERTIFICATE", &ca), ("OFFBD_MQTT__KEY", &key)]);
    connected(&named.client, "mqtt").await;
}

/// The broker says by itself that the service is gone, so that nobody believes old faults.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_broker_knows_whether_the_service_is_there() {
    let mosquitto = Mosquitto::start();
    let data = tempfile::tempdir().unwrap();
    let url = mosquitto.config().url;
    let environment =
        [("OFFBD_MQTT__URL", Path::new(&url)), ("OFFBD_MQTT__STATE", Path::new("true"))];
    let start = || Process::start_with(data.path(), &environment);
    let topic = "offbd/v1/=service/offbd/state";
    let state = || mosquitto.subscribe(&["-t", topic, "-C", "1", "-W", "5"]);
    let is = async |expected: &str| {
        eventually(async || (state().trim() == expected).then_some(())).await;
    };
    let mut service = start();
    is("online").await;
    service.child.kill().unwrap();
    is("offline").await;
    let service = start();
    is("online").await;
    service.terminate();
    is("offline").await;
}
