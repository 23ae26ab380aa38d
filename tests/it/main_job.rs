//! Telemetry in, durable, faults out: over a real socket.

use crate::support::{Bench, judged, rig};
use serde_json::json;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_dead_servo_is_found_and_stays_found() {
    let mut bench = Bench::start().await;
    let samples = rig(4000, 2000);
    let (hash, faults) = judged("a", &samples);
    assert!(faults.contains(&"x_servo".to_owned()), "{faults:?}");

    bench.client.asset("a").await;
    for part in samples.chunks(100) {
        let ack = bench.client.telemetry("a", Some("first"), part).await;
        assert_eq!(ack["accepted"], part.len());
        assert_eq!(ack["last_seq"], json!(part[part.len() - 1].seq));
    }
    let active = bench.client.get("assets/a/faults").await.expect(200);
    let codes: Vec<_> = active["items"].as_array().unwrap().iter().map(|f| &f["code"]).collect();
    assert!(codes.contains(&&json!("x_servo")), "{active}");

    bench.restart().await;
    assert_eq!(bench.client.get("assets/a/faults").await.expect(200), active);
    let again = bench.client.telemetry("a", Some("first"), &samples[3900..]).await;
    assert_eq!((&again["accepted"], &again["duplicate"]), (&json!(0), &json!(100)));

    let ended = bench.client.end("a", "first").await;
    assert_eq!(ended["verdict"]["verdict_hash"], hash);
    assert_eq!(ended["verdict"]["faults"], json!(faults));
    assert_eq!(bench.client.recording("a", "first").await, samples);
}
