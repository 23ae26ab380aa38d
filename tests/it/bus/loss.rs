//! Nothing is lost or doubled if messages are lost, or a broker is killed.

use crate::bus::{connected, device, with_mosquitto, with_nats};
use crate::support::broker::{Mosquitto, Nats};
use crate::support::bus_device::BusDevice;
use crate::support::{Client, rig};
use offbd_core::vocabulary::Sample;

/// Loses one message in twenty, always the same ones.
fn one_in_twenty() -> impl FnMut() -> bool {
    let mut state: u64 = 7;
    move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33).is_multiple_of(20)
    }
}

/// Checks that each sample is stored once. Those that came late are at their place of arrival.
async fn is_stored_once(client: &Client, asset: &str, samples: &[Sample]) {
    let mut recording = client.recording(asset, "s").await;
    recording.sort_by_key(|sample| sample.seq);
    assert_eq!(recording, samples, "{asset}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn lost_messages_are_sent_again_and_nothing_is_lost_or_doubled() {
    let (nats, mosquitto) = (Nats::start(), Mosquitto::start());
    let fixture = crate::bus::start_with(|config| {
        config.nats = Some(nats.config());
        config.mqtt = Some(mosquitto.config());
    })
    .await;
    let client = &fixture.client;
    connected(client, "mqtt").await;
    let samples = rig(3000, 3000);
    let secret = device(client, "nats").await;
    let over_nats = BusDevice::nats(nats.port, "nats", ("x", &secret)).await;
    let secret = device(client, "gateway").await;
    let over_gateway = BusDevice::mqtt(nats.mqtt_port, "gateway", Some(("x", &secret))).await;
    client.asset("mosquitto").await;
    let over_mosquitto = BusDevice::mqtt(mosquitto.port, "mosquitto", None).await;
    for (asset, mut device) in
        [("nats", over_nats), ("gateway", over_gateway), ("mosquitto", over_mosquitto)]
    {
        let n_lost = device.send_until_acknowledged(&samples, 10, one_in_twenty()).await;
        assert!(n_lost > 10, "{n_lost}");
        is_stored_once(client, asset, &samples).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_nats_server_that_is_killed_and_started_again_loses_nothing() {
    let mut nats = Nats::start();
    let fixture = with_nats(&nats).await;
    let client = &fixture.client;
    let samples = rig(1000, 1000);
    let secret = device(client, "a").await;
    let mut sender = BusDevice::nats(nats.port, "a", ("a", &secret)).await;
    sender.send_until_acknowledged(&samples[..500], 10, || false).await;
    // Sent, but not answered when the server dies.
    for part in samples[400..600].chunks(10) {
        sender.send(crate::support::bus_device::numbered("x", part)).await;
    }
    nats.kill();
    drop(sender);
    crate::bus::metric(client, "offbd_bus_connected{bus=\"nats\"}", |value| value == 0.0).await;
    nats.restart();
    connected(client, "nats").await;
    let mut sender = BusDevice::nats(nats.port, "a", ("a", &secret)).await;
    // Until the service has subscribed again, questions get no answer.
    let mut answered = false;
    while !answered {
        sender.send(crate::support::bus_device::numbered("x", &samples[590..600])).await;
        let answer = tokio::time::timeout(std::time::Duration::from_secs(2), sender.answer()).await;
        answered = answer.is_ok();
    }
    sender.send_until_acknowledged(&samples[400..], 10, || false).await;
    is_stored_once(client, "a", &samples).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_broker_that_is_killed_and_started_again_loses_nothing() {
    let mut mosquitto = Mosquitto::start();
    let fixture = with_mosquitto(&mosquitto).await;
    let client = &fixture.client;
    client.asset("a").await;
    let samples = rig(1000, 1000);
    let mut sender = BusDevice::mqtt(mosquitto.port, "a", None).await;
    sender.send_until_acknowledged(&samples[..500], 10, || false).await;
    for part in samples[400..600].chunks(10) {
        sender.send(crate::support::bus_device::numbered("x", part)).await;
    }
    mosquitto.kill();
    drop(sender);
    crate::bus::metric(client, "offbd_bus_connected{bus=\"mqtt\"}", |value| value == 0.0).await;
    mosquitto.restart();
    connected(client, "mqtt").await;
    let mut sender = BusDevice::mqtt(mosquitto.port, "a", None).await;
    let mut answered = false;
    while !answered {
        sender.send(crate::support::bus_device::numbered("x", &samples[590..600])).await;
        let answer = tokio::time::timeout(std::time::Duration::from_secs(2), sender.answer()).await;
        answered = answer.is_ok();
    }
    sender.send_until_acknowledged(&samples[400..], 10, || false).await;
    is_stored_once(client, "a", &samples).await;
}
