//! How the samples of a rig arrive, compared with what was sent.

use offbd::wire::telemetry::sample_view;
use offbd_core::vocabulary::Sample;
use serde_json::{Value, json};

use crate::support::{ServiceFixture, batch, rig};

/// Samples with an alternating spacing of 12 and 8 ms, and with two gaps.
fn with_gaps() -> Vec<Sample> {
    let all = rig(1000, 1000).into_iter().enumerate();
    let kept = all.filter(|(i, _)| !(300..420).contains(i) && !(700..740).contains(i));
    let delayed = |(i, sample): (usize, Sample)| Sample {
        t_s: sample.t_s + if i % 2 == 1 { 0.002 } else { 0.0 },
        ..sample
    };
    kept.map(delayed).collect()
}

/// Spacings that are not gaps, and gaps, s.
fn intervals(samples: &[Sample]) -> (Vec<f64>, Vec<f64>) {
    let steps = samples.windows(2).map(|pair| pair[1].t_s - pair[0].t_s);
    steps.partition(|step_s| *step_s <= 0.3)
}

fn near(found: &Value, expected: f64) {
    let found = found.as_f64().unwrap();
    assert!((found - expected).abs() < 1e-9, "{found}, not {expected}");
}

#[tokio::test]
async fn the_link_of_a_rig_is_told_as_its_samples_arrived() {
    let mut fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.get("assets/none/link").await.problem(404);
    client.asset("a").await;
    let silent = client.get("assets/a/link").await.expect(200);
    assert_eq!((&silent["session"], &silent["recent"]), (&Value::Null, &Value::Null));
    let samples = with_gaps();
    let batches: Vec<_> = samples.chunks(100).collect();
    for (i, part) in batches.iter().enumerate() {
        let mut body = batch(Some("s"), part);
        if i == 0 {
            body["samples"].as_array_mut().unwrap().insert(0, json!({}));
        }
        client.post("assets/a/telemetry", &body).await.expect(200);
    }
    // The same rows again, other values at the same place, values beyond all reason, rows that
    // are none, and an end that is not new.
    client.telemetry("a", Some("s"), &samples[..50]).await;
    let last = samples[samples.len() - 1];
    let wrong = |x_m, seq| sample_view(&Sample { x_m: Some(x_m), seq: Some(seq), ..last });
    let mut body = batch(Some("s"), &[]);
    body["samples"] = json!([wrong(0.5, 3), wrong(1e9, 5000), wrong(1e9, 5001), {"t_s": "x"}, {}]);
    let ack = client.post("assets/a/telemetry", &body).await.expect(200);
    assert_eq!(ack["rejected"].as_array().unwrap().len(), 5, "{ack}");

    let link = client.get("assets/a/link").await.expect(200);
    let session = client.session("a", "s").await;
    assert_eq!(link["session_id"], session["id"]);
    near(&link["expected_rate_hz"], 100.0);
    near(&link["gap_s"], 0.3);
    let offset_s = link["clock_offset_s"].as_f64().unwrap();
    assert!(offset_s > 1e9, "the device counts from its start: {offset_s}");
    let (spacings, gaps) = intervals(&samples);
    let n = spacings.len() as f64;
    let mean = spacings.iter().sum::<f64>() / n;
    let jitter = (spacings.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    assert!(gaps.len() == 2 && (jitter - 0.002).abs() < 1e-4, "{gaps:?}, {jitter}");
    let found = &link["session"];
    near(&found["rate_hz"], 1.0 / mean);
    near(&found["spacing_s"], mean);
    near(&found["jitter_s"], jitter);
    near(&found["gaps_s"], gaps.iter().sum());
    near(&found["longest_gap_s"], gaps[0].max(gaps[1]));
    let count = |name: &str| found[name].as_u64().unwrap() as usize;
    assert_eq!((count("samples"), count("gaps")), (samples.len(), 2));
    assert_eq!((count("duplicates"), count("unordered")), (50, 0));
    assert_eq!(count("batches"), batches.len() + 2);
    let delays = (found["delay_s"].as_f64().unwrap(), found["longest_delay_s"].as_f64().unwrap());
    assert!(delays.0 > 0.0 && delays.1 >= delays.0, "{delays:?}");
    let row = |reason: &str, rows: u64| json!({ "reason": reason, "rows": rows });
    assert_eq!(found["unjudged"], json!([row("absurd", 2), row("conflict", 1), row("form", 3)]));
    let mut recent = link["recent"].clone();
    recent["from"] = found["from"].clone();
    assert_eq!(&recent, found, "all of the session is recent");

    // Nothing of it is stored.
    fixture.restart().await;
    let after = fixture.client.get("assets/a/link").await.expect(200);
    assert_eq!((&after["session"], &after["recent"]), (&Value::Null, &Value::Null));
}

#[tokio::test]
async fn a_gap_of_a_link_that_is_confirmed_later_is_as_long_as_it_was() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    // One sample per batch: the engine doubts the first ones after the gap.
    let samples: Vec<_> =
        rig(900, 900).into_iter().filter(|s| s.t_s < 2.0 || s.t_s > 8.0).collect();
    for part in samples.chunks(1).skip(150) {
        client.telemetry("a", Some("s"), part).await;
    }
    let link = client.get("assets/a/link").await.expect(200);
    let (spacings, gaps) = intervals(&samples[150..]);
    let found = &link["session"];
    assert_eq!((&found["samples"], &found["gaps"]), (&json!(samples.len() - 150), &json!(1)));
    near(&found["longest_gap_s"], gaps[0]);
    near(&found["spacing_s"], spacings.iter().sum::<f64>() / spacings.len() as f64);
    assert_eq!(found["unjudged"], json!([]), "all were judged in the end");
}
