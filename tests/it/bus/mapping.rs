//! Devices with their own topics and formats, by a mapping file.

use crate::bus::{connected, count, metric};
use crate::support::broker::Mosquitto;
use crate::support::{eventually, rig};
use serde_json::json;

const MAPPING: &str = r#"
[[topics]]
pattern = "lab/{asset}/status"
session = "/boot"
seq = "/n"
t = { pointer = "/ms", unit = "ms" }
x = { pointer = "/ball/1", unit = "mm", negate = true }
y = { pointer = "/ball/0", unit = "cm" }
qx = { pointer = "/servo/roll", unit = "deg" }
qy = { pointer = "/servo/pitch", unit = "rad", negate = true }
"#;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn foreign_topics_become_the_same_samples() {
    let mosquitto = Mosquitto::start();
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), MAPPING).unwrap();
    let fixture = crate::bus::start_with(|config| {
        config.mqtt = Some(offbd::config::MqttConfig {
            mapping: Some(file.path().to_owned()),
            ..mosquitto.config()
        });
    })
    .await;
    let client = &fixture.client;
    connected(client, "mqtt").await;
    client.asset("rig").await;
    let samples = rig(200, 200);
    let line = |s: &offbd_core::vocabulary::Sample| {
        let (roll, pitch) = (s.cmd_qx_rad.map(f64::to_degrees), s.cmd_qy_rad.map(|q| -q));
        let ball = json!([s.y_m.map(|y| y * 100.0), s.x_m.map(|x| -x * 1000.0)]);
        let servo = json!({ "roll": roll, "pitch": pitch });
        json!({ "boot": "s", "n": s.seq, "ms": s.t_s * 1000.0, "ball": ball, "servo": servo })
    };
    let lines: String = samples.iter().map(|sample| format!("{}\n", line(sample))).collect();
    let taken = "offbd_bus_messages_total{bus=\"mqtt\",outcome=\"taken\"}";
    let malformed = "offbd_bus_messages_total{bus=\"mqtt\",outcome=\"malformed\"}";
    // The metrics are those of the process, which has other tests.
    let (taken_before, malformed_before) =
        (count(client, taken).await, count(client, malformed).await);
    // With the program of somebody else, at QoS 1, so that none is lost.
    mosquitto.publish_lines(&["-q", "1", "-t", "lab/rig/status"], &lines);
    let n_stored = async || {
        let sessions = client.get("sessions?asset=rig").await.expect(200);
        sessions["items"][0]["samples"].as_u64()
    };
    let n = samples.len() as u64;
    eventually(async || (n_stored().await == Some(n)).then_some(())).await;
    let recording = client.recording("rig", "s").await;
    assert_eq!(recording.len(), samples.len());
    for (found, sent) in recording.iter().zip(&samples) {
        assert_eq!(found.seq, sent.seq);
        let near = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() < 1e-12,
            (a, b) => a == b,
        };
        assert!((found.t_s - sent.t_s).abs() < 1e-9, "{found:?} {sent:?}");
        assert!(near(found.x_m, sent.x_m) && near(found.y_m, sent.y_m), "{found:?} {sent:?}");
        assert!(near(found.cmd_qx_rad, sent.cmd_qx_rad), "{found:?} {sent:?}");
        assert!(near(found.cmd_qy_rad, sent.cmd_qy_rad), "{found:?} {sent:?}");
    }
    mosquitto.publish_lines(&["-t", "lab/rig/status"], "{\"boot\":\"s\"}\nno JSON\n");
    metric(client, malformed, |n| n >= malformed_before + 1.0).await;
    metric(client, taken, |n| n >= taken_before + 201.0).await;
    eventually(async || (client.session("rig", "s").await["rejected"] == 1).then_some(())).await;
}

#[tokio::test]
async fn an_invalid_mapping_is_refused_at_the_start_with_its_key() {
    let data = tempfile::tempdir().unwrap();
    let file = data.path().join("mapping.toml");
    for (from, to, named) in [
        ("/ball/0", "ball/0", "/topics/0/y/pointer"),
        ("unit = \"mm\"", "unit = \"inch\"", "inch"),
        ("lab/{asset}/status", "lab/#", "/topics/0/pattern"),
        ("seq =", "sequence =", "sequence"),
    ] {
        std::fs::write(&file, MAPPING.replace(from, to)).unwrap();
        let mut config = crate::support::config(data.path());
        config.mqtt = Some(offbd::config::MqttConfig {
            mapping: Some(file.clone()),
            ..crate::support::broker::mqtt_config(1)
        });
        let error = format!("{:#}", offbd::server::check(&config).unwrap_err());
        assert!(error.contains("mqtt.mapping") && error.contains(named), "{error}");
    }
}
