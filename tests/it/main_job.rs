//! The main function of the service, over a real socket: telemetry is stored durably and
//! faults are found.

use crate::support::{ServiceFixture, judged, rig};
use serde_json::json;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_dead_servo_is_found_and_remembered_after_a_restart() {
    let mut fixture = ServiceFixture::start().await;
    let samples = rig(4000, 2000);
    let (hash, faults) = judged("a", &samples);
    assert!(faults.contains(&"x_servo".to_owned()), "{faults:?}");

    fixture.client.asset("a").await;
    for part in samples.chunks(100) {
        let ack = fixture.client.telemetry("a", Some("first"), part).await;
        assert_eq!(ack["accepted"], part.len());
        assert_eq!(ack["last_seq"], json!(part[part.len() - 1].seq));
    }
    let active = fixture.client.get("assets/a/faults").await.expect(200);
    let codes: Vec<_> = active["items"].as_array().unwrap().iter().map(|f| &f["code"]).collect();
    assert!(codes.contains(&&json!("x_servo")), "{active}");

    fixture.restart().await;
    assert_eq!(fixture.client.get("assets/a/faults").await.expect(200), active);
    let again = fixture.client.telemetry("a", Some("first"), &samples[3900..]).await;
    assert_eq!((&again["accepted"], &again["duplicate"]), (&json!(0), &json!(100)));

    let ended = fixture.client.end("a", "first").await;
    assert_eq!(ended["verdict"]["verdict_hash"], hash);
    assert_eq!(ended["verdict"]["faults"], json!(faults));
    assert_eq!(fixture.client.recording("a", "first").await, samples);
}
