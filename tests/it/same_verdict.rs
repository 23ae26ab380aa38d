//! One session sent over every transport and in every format gives the same recording and the
//! same verdict.

use crate::support::{
    Client, ServiceFixture, batch, columns, csv, judged, learnt, packed, registration, rig,
};
use futures_util::{SinkExt, StreamExt};
use offbd::wire::asset::view;
use offbd_core::vocabulary::Sample;
use serde_json::{Value, json};
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Message;

/// Ends session `s` of `asset` and returns its verdict hash and its recording.
async fn end_session(client: &Client, asset: &str) -> (String, Vec<Sample>) {
    let session = client.end(asset, "s").await;
    let hash = session["verdict"]["verdict_hash"].as_str().unwrap().to_owned();
    (hash, client.recording(asset, "s").await)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_transport_and_format_gives_the_same_recording_and_verdict() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let samples = rig(3000, 1500);
    let (hash, faults) = judged("a", &samples);
    assert!(faults.contains(&"x_servo".to_owned()), "{faults:?}");
    let assets = [
        "ones",
        "hundreds",
        "columns",
        "packed",
        "lines",
        "csv",
        "other-names",
        "mapped",
        "socket",
        "packed-socket",
        "imported",
    ];
    let mapping = "t_s=time,cmd_qx_rad=tilt_x,cmd_qy_rad=tilt_y,x_m='ball x',y_m='ball y'";
    for asset in assets {
        let mut body = registration(asset);
        if asset == "mapped" {
            body["columns"] = json!(mapping);
        }
        client.post("assets", &body).await.expect(201);
    }
    for sample in &samples {
        client.telemetry("ones", Some("s"), std::slice::from_ref(sample)).await;
    }
    for part in samples.chunks(100) {
        client.telemetry("hundreds", Some("s"), part).await;
    }
    for part in samples.chunks(777) {
        let text = client.post("assets/columns/telemetry", &columns("s", part)).await.expect(200);
        let packed = client.post_packed("assets/packed/telemetry", &columns("s", part)).await;
        assert_eq!(without_session_id(packed.expect(200)), without_session_id(text));
        let path = "assets/csv/telemetry?session=s";
        client.post_text(path, "text/csv", csv(part)).await.expect(200);
        let table = with_other_names(part);
        let path = "assets/mapped/telemetry?session=s";
        let ack = client.post_text(path, "text/csv", table.clone()).await.expect(200);
        assert_eq!(ack.get("unknown"), None, "{ack}");
        let path = format!("assets/other-names/telemetry?session=s&columns={}", escaped(mapping));
        client.post_text(&path, "text/csv", table).await.expect(200);
        let path = "assets/lines/telemetry?session=s";
        client.post_text(path, "application/x-ndjson", lines(part)).await.expect(200);
    }
    send_over_websocket(client, "socket", &samples, |frame| Message::text(frame.to_string())).await;
    send_over_websocket(client, "packed-socket", &samples, |frame| Message::binary(packed(frame)))
        .await;
    let path = "assets/imported/sessions/import?name=s";
    let imported = client.post_text(path, "text/csv", csv(&samples)).await.expect(201);
    assert_eq!(imported["accepted"], 3000);
    for asset in assets {
        let (found, recording) = end_session(client, asset).await;
        assert_eq!(found, hash, "{asset}");
        assert_eq!(recording, samples, "{asset}");
    }
    assert_eq!(hash_by_command_line(&samples), hash);
}

/// The samples as CSV with other names, and with a column that is not read.
fn with_other_names(samples: &[Sample]) -> String {
    let (mut text, table) = (String::new(), csv(samples));
    for (i, line) in table.lines().enumerate() {
        text += if i == 0 { "row," } else { "7," };
        text += &match i {
            0 => line
                .replace("t_s", "time")
                .replace("cmd_qx_rad", "tilt_x")
                .replace("cmd_qy_rad", "tilt_y")
                .replace("x_m", "ball x")
                .replace("y_m", "ball y"),
            _ => line.to_owned(),
        };
        text += "\n";
    }
    text
}

/// Escapes a mapping for a query.
fn escaped(mapping: &str) -> String {
    mapping.replace('=', "%3D").replace(' ', "%20").replace(',', "%2C")
}

/// Returns an acknowledgement without the session's id, which differs between assets.
fn without_session_id(mut ack: Value) -> Value {
    ack.as_object_mut().unwrap().remove("session_id");
    ack
}

/// Valid, invalid, duplicate and late rows get the same acknowledgement in both formats.
#[tokio::test]
async fn json_and_msgpack_batches_get_the_same_acknowledgement() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    for asset in ["text", "packed"] {
        client.asset(asset).await;
    }
    let good = rig(300, 300);
    let row =
        |i: usize| serde_json::to_value(offbd::wire::telemetry::sample_view(&good[i])).unwrap();
    let mut odd: Vec<Value> = (0..200).map(row).collect();
    odd.extend([json!(7), json!({}), json!({ "t_s": "1" }), json!({ "t_s": null }), row(3)]);
    odd.extend([json!({ "t_s": 2.0, "seq": -1 }), json!({ "t_s": 1e300 }), row(290), row(250)]);
    odd.extend([json!({ "t_s": 0.001, "seq": 9000 }), json!({ "t_s": 9e5, "seq": 9001 })]);
    for batch in [
        json!({ "session": "s", "samples": odd }),
        json!({ "session": "s", "samples": [] }),
        json!({ "session": 3, "samples": [] }),
        json!({ "session": "s", "t_s": [0, 1], "x_m": [0] }),
        json!([]),
    ] {
        let text = client.post("assets/text/telemetry", &batch).await;
        let packed = client.post_packed("assets/packed/telemetry", &batch).await;
        assert_eq!(packed.status, text.status, "{}", packed.text);
        let (packed, text) = (packed.json(), text.json());
        if text["status"].is_number() {
            assert_eq!((&packed["type"], &packed["pointer"]), (&text["type"], &text["pointer"]));
        } else {
            assert_eq!(without_session_id(packed), without_session_id(text));
        }
    }
    let (text, packed) = (end_session(client, "text").await, end_session(client, "packed").await);
    assert_eq!(text, packed);
    assert_eq!(text.1.len(), 204);
}

/// Returns the verdict hash that the command line prints for the session as a file.
fn hash_by_command_line(samples: &[Sample]) -> String {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), csv(samples)).unwrap();
    let mut offbd = assert_cmd::Command::new(env!("CARGO_BIN_EXE_offbd"));
    let asset = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(asset.path(), serde_json::to_vec(&view(&learnt("a"))).unwrap()).unwrap();
    let offbd = offbd.args(["replay", "--format", "json", "--asset"]).arg(asset.path());
    let run = offbd.arg(file.path()).assert().success();
    let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    let summary: Value = serde_json::from_str(printed.lines().last().unwrap()).unwrap();
    summary["verdict_hash"].as_str().unwrap().to_owned()
}

fn lines(samples: &[Sample]) -> String {
    let line = |s: &Sample| serde_json::to_string(&offbd::wire::telemetry::sample_view(s)).unwrap();
    samples.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Sends all batches before it reads an answer, then reads all answers.
async fn send_over_websocket(
    client: &Client,
    asset: &str,
    samples: &[Sample],
    frame_of: impl Fn(&Value) -> Message,
) {
    let url = format!("ws://{}/api/v1/assets/{asset}/stream?state=20", client.address);
    let (mut socket, _) = connect_async(url).await.unwrap();
    let parts: Vec<_> = samples.chunks(50).collect();
    for (i, part) in parts.iter().enumerate() {
        let mut frame = batch(Some("s"), part);
        frame["id"] = json!(i);
        socket.send(frame_of(&frame)).await.unwrap();
    }
    socket.send(Message::text("{\"samples\":[")).await.unwrap();
    let (mut next, mut faults, mut states, mut errors) = (0, 0, 0, 0);
    while faults == 0 || states == 0 || errors == 0 {
        let frame = tokio::time::timeout(crate::support::DEADLINE, socket.next()).await.unwrap();
        let Message::Text(text) = frame.unwrap().unwrap() else { continue };
        let frame: Value = serde_json::from_str(&text).unwrap();
        match frame["type"].as_str().unwrap() {
            "ack" => {
                assert_eq!(frame["id"], next.to_string());
                assert_eq!(frame["accepted"], 50);
                next += 1;
            }
            "fault" => faults += 1,
            "state" => states += 1,
            "error" => {
                assert_eq!(frame["problem"]["status"], 400);
                assert_eq!(next, parts.len(), "answers come in order");
                errors += 1;
            }
            other => panic!("{other}: {frame}"),
        }
    }
    socket.close(None).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_replay_with_equal_settings_gives_the_same_verdict() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let samples = rig(3000, 1500);
    client.telemetry("a", Some("s"), &samples[..2500]).await;
    client.delete("assets/a/faults/x_servo?by=me").await.expect(204);
    client.telemetry("a", Some("s"), &samples[2500..]).await;
    let session = client.end("a", "s").await;
    let path = format!("sessions/{}/replays", session["id"].as_str().unwrap());

    let replay = run_replay(client, &path, &Value::Null).await;
    let result = &replay["result"];
    assert_eq!(result["same"], true, "{replay}");
    assert_eq!(result["summary"]["verdict_hash"], session["verdict"]["verdict_hash"]);
    assert_eq!(result["recorded_hash"], session["verdict"]["verdict_hash"]);
    assert_eq!(result["differences"], json!([]));
    assert!(!result["faults"].as_array().unwrap().is_empty());

    let settings = json!({"profile":"textbook","asset":{"ball":{"mass_kg":0.1}}});
    let replay = run_replay(client, &path, &settings).await;
    assert_eq!(replay["result"]["same"], false);
    assert!(!replay["result"]["differences"].as_array().unwrap().is_empty());
    assert_eq!(replay["settings"], settings);
}

/// Starts a replay and waits until it is done.
async fn run_replay(client: &Client, path: &str, settings: &Value) -> Value {
    let answer = client.post(path, settings).await;
    let id = answer.expect(202)["id"].as_str().unwrap().to_owned();
    assert_eq!(answer.headers["location"], format!("/api/v1/replays/{id}"));
    crate::support::eventually(|| async {
        let replay = client.get(&format!("replays/{id}")).await.expect(200);
        assert_ne!(replay["state"], "failed", "{replay}");
        (replay["state"] == "done").then_some(replay)
    })
    .await
}
