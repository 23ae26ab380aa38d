//! A session that has become too long continues in another one.

use crate::support::{Client, ServiceFixture, batch, rig};
use offbd_core::vocabulary::Sample;
use serde_json::{Value, json};

/// Samples of a part.
const PART: usize = 1000;

async fn service() -> ServiceFixture {
    let fixture = ServiceFixture::start_with(|config| config.limits.session_samples = PART).await;
    fixture.client.asset("a").await;
    fixture
}

async fn send(client: &Client, name: Option<&str>, samples: &[Sample]) -> Value {
    client.post("assets/a/telemetry", &batch(name, samples)).await.expect(200)
}

/// The sessions of the asset, the oldest first.
async fn sessions(client: &Client) -> Vec<Value> {
    let mut items = client.get("sessions?asset=a").await.expect(200)["items"].clone();
    let mut items = std::mem::take(items.as_array_mut().unwrap());
    items.reverse();
    items
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_long_session_continues_in_parts_and_every_sample_is_there_once() {
    for name in [None, Some("monday")] {
        for numbered in [false, true] {
            let case = format!("{name:?}, numbered {numbered}");
            let mut fixture = service().await;
            let mut samples = rig(3600, usize::MAX);
            if !numbered {
                samples.iter_mut().for_each(|sample| sample.seq = None);
            }
            let mut before: &[Sample] = &[];
            for (i, part) in samples.chunks(200).enumerate() {
                let ack = send(&fixture.client, name, part).await;
                assert_eq!(ack["accepted"], 200, "{case}: {ack}");
                // What was not acknowledged in time is sent again, also beyond a boundary.
                let ack = send(&fixture.client, name, before).await;
                assert_eq!(ack["duplicate"], before.len(), "{case}: {ack}");
                before = part;
                if i == 10 {
                    fixture.restart().await;
                }
            }
            let parts = sessions(&fixture.client).await;
            let lengths: Vec<_> = parts.iter().map(|part| part["samples"].clone()).collect();
            assert_eq!(lengths, [1000, 1000, 1000, 600], "{case}");
            let mut recorded = Vec::new();
            for (i, part) in parts.iter().enumerate() {
                assert_eq!(part["part"], i + 1, "{case}");
                let first = if i == 0 { Value::Null } else { parts[0]["id"].clone() };
                assert_eq!(part["first_part"], first, "{case}");
                let name = part["name"].as_str().unwrap();
                recorded.extend(fixture.client.recording("a", name).await);
            }
            assert_eq!(recorded, samples, "{case}");
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_may_be_in_a_part_that_is_not_searched_is_not_recorded_again() {
    for numbered in [false, true] {
        let fixture = service().await;
        let mut samples = rig(6400, usize::MAX);
        if !numbered {
            samples.iter_mut().for_each(|sample| sample.seq = None);
        }
        for part in samples.chunks(200) {
            send(&fixture.client, Some("monday"), part).await;
        }
        for _ in ["while the last part is open", "after it has ended"] {
            let ack = send(&fixture.client, Some("monday"), &samples[100..200]).await;
            assert_eq!((&ack["accepted"], &ack["duplicate"]), (&json!(0), &json!(0)), "{ack}");
            let rejected = ack["rejected"].as_array().unwrap();
            assert_eq!(rejected.len(), 100);
            assert!(rejected[0]["reason"].as_str().unwrap().starts_with("too old"), "{ack}");
            let ack = send(&fixture.client, Some("monday"), &samples[4000..4100]).await;
            assert_eq!(ack["duplicate"], 100, "{ack}");
            fixture.client.end("a", "monday (7)").await;
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_device_names_all_parts_alike_also_after_they_have_ended() {
    let fixture = service().await;
    let client = &fixture.client;
    let samples = rig(2400, usize::MAX);
    for part in samples.chunks(200) {
        assert_eq!(send(client, Some("monday"), part).await["accepted"], 200);
    }
    let names: Vec<_> = sessions(client).await.iter().map(|part| part["name"].clone()).collect();
    assert_eq!(names, ["monday", "monday (2)", "monday (3)"]);
    let other = |sample: &Sample| Sample { x_m: sample.x_m.map(|x| x + 0.01), ..*sample };
    let conflicts: Vec<_> = samples[950..1050].iter().map(other).collect();
    let ack = send(client, Some("monday"), &conflicts).await;
    assert_eq!(ack["accepted"], 0);
    let rejected = ack["rejected"].as_array().unwrap();
    assert_eq!(rejected.len(), 100);
    assert!(rejected[0]["reason"].as_str().unwrap().contains("other values"), "{ack}");
    client.end("a", "monday (3)").await;
    let ack = send(client, Some("monday"), &samples[900..1900]).await;
    assert_eq!(ack["duplicate"], 1000);
    let new = Sample { seq: Some(9999), t_s: 99.0, ..samples[0] };
    let post_new = async || client.post("assets/a/telemetry", &batch(Some("monday"), &[new])).await;
    post_new().await.problem(409);
    // Without the part that has the name, the device must not begin another session.
    let first = sessions(client).await[0]["id"].as_str().unwrap().to_owned();
    client.delete(&format!("sessions/{first}")).await.expect(204);
    let ack = send(client, Some("monday"), &samples[1000..2000]).await;
    assert_eq!(ack["duplicate"], 1000);
    post_new().await.problem(409);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_part_does_not_take_the_name_of_another_session() {
    let fixture = service().await;
    let client = &fixture.client;
    let samples = rig(1400, usize::MAX);
    send(client, Some("monday (2)"), &samples[..200]).await;
    for part in samples.chunks(200) {
        send(client, Some("monday"), part).await;
    }
    let parts: Vec<_> =
        sessions(client).await.iter().map(|part| json!([part["name"], part["part"]])).collect();
    assert_eq!(parts, [json!(["monday (2)", 1]), json!(["monday", 1]), json!(["monday (3)", 3])]);
}
