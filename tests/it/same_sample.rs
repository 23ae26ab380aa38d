//! One rule for "the same sample": the same key with the same values is a duplicate, with
//! other values a conflict; and a clock that slips does not blind a rig.

use std::collections::BTreeMap;

use crate::support::process::Process;
use crate::support::{Client, ServiceFixture, batch, judged, rig};
use offbd_core::vocabulary::Sample;
use proptest::prelude::*;
use serde_json::{Value, json};

fn unnumbered(samples: &[Sample]) -> Vec<Sample> {
    samples.iter().map(|sample| Sample { seq: None, ..*sample }).collect()
}

/// Sends `samples` in batches. Returns how many rows were accepted, duplicates, rejected
/// and late.
async fn send(client: &Client, session: Option<&str>, samples: &[Sample]) -> [u64; 4] {
    let mut sums = [0; 4];
    for part in samples.chunks(200) {
        let ack = client.post("assets/a/telemetry", &batch(session, part)).await.expect(200);
        let n = |key: &str| match &ack[key] {
            Value::Array(rows) => rows.len() as u64,
            number => number.as_u64().unwrap(),
        };
        let counts = ["accepted", "duplicate", "rejected", "late"].map(n);
        (0..4).for_each(|i| sums[i] += counts[i]);
    }
    sums
}

async fn sessions(client: &Client) -> Vec<Value> {
    client.get("sessions?asset=a").await.expect(200)["items"].as_array().unwrap().clone()
}

async fn service() -> ServiceFixture {
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    fixture
}

/// A run of a device that stands idle at first: no ball, no command.
fn idle_then(n_idle: usize, mut samples: Vec<Sample>) -> Vec<Sample> {
    for sample in &mut samples[..n_idle] {
        (sample.cmd_qx_rad, sample.cmd_qy_rad) = (Some(0.0), Some(0.0));
        (sample.x_m, sample.y_m) = (None, None);
    }
    samples
}

fn shifted(samples: Vec<Sample>) -> Vec<Sample> {
    let shift = |v: Option<f64>| v.map(|v| v + 0.002);
    samples.into_iter().map(|s| Sample { x_m: shift(s.x_m), ..s }).collect()
}

#[tokio::test]
async fn a_device_that_starts_again_is_not_taken_for_its_own_past() {
    for numbered in [false, true] {
        for (n_first, n_idle) in [(7000, 0), (7000, 50), (3000, 50), (600, 1)] {
            let fixture = service().await;
            let client = &fixture.client;
            let take = |samples: Vec<Sample>| {
                if numbered { samples } else { unnumbered(&samples) }
            };
            let first = take(idle_then(n_idle, rig(n_first, usize::MAX)));
            let second = take(idle_then(n_idle, shifted(rig(6000, 2000))));
            assert_eq!(send(client, None, &first).await, [n_first as u64, 0, 0, 0]);
            let case = format!("numbered {numbered}, {n_first} rows, {n_idle} of them idle");
            assert_eq!(send(client, None, &second).await, [6000, 0, 0, 0], "{case}");
            let found = sessions(client).await;
            assert_eq!(found.len(), 2, "{case}");
            let name = found[0]["name"].as_str().unwrap();
            let ended = client.end("a", name).await;
            let (hash, faults) = judged("a", &second);
            assert_eq!(faults, ["x_servo"]);
            assert_eq!(ended["verdict"]["verdict_hash"], hash, "{case}");
        }
    }
}

#[tokio::test]
async fn a_clock_that_slips_costs_one_sample() {
    for numbered in [false, true] {
        for (name, step_s, rows) in [
            ("one wrong", 3000.0, 200..201),
            ("one far in the past", -3000.0, 200..201),
            ("set forward", 3000.0, 200..6000),
            ("set back", -1200.0, 200..6000),
            ("year 1970", -1e9, 0..1),
            ("year 2106", 4.3e9, 0..1),
        ] {
            let fixture = service().await;
            let mut samples = rig(6000, 2000);
            samples[rows].iter_mut().for_each(|sample| sample.t_s += step_s);
            if !numbered {
                samples = unnumbered(&samples);
            }
            send(&fixture.client, Some("s"), &samples).await;
            let ended = fixture.client.end("a", "s").await;
            assert_eq!(ended["samples"], 6000, "{name}");
            assert_eq!(ended["verdict"]["faults"], json!(["x_servo"]), "{name}, {numbered}");
        }
    }
}

#[tokio::test]
async fn samples_sent_late_are_recorded_however_many() {
    // Every second row live, the others later.
    let fixture = service().await;
    let client = &fixture.client;
    let samples = rig(6000, usize::MAX);
    let (live, late): (Vec<Sample>, Vec<Sample>) =
        samples.iter().partition(|sample| sample.seq.unwrap() % 2 == 0);
    assert_eq!(send(client, Some("s"), &live).await, [3000, 0, 0, 0]);
    let [accepted, duplicate, rejected, n_late] = send(client, Some("s"), &late).await;
    assert_eq!([accepted, duplicate, rejected], [3000, 0, 0]);
    assert!((2990..=3000).contains(&n_late), "all but those in the reorder window: {n_late}");
    assert_eq!(send(client, Some("s"), &late).await, [0, 3000, 0, 0]);
    let mut stored = client.recording("a", "s").await;
    stored.sort_by_key(|sample| sample.seq);
    assert_eq!(stored, samples);
    // A gap of 150 s that is filled 200 s later.
    let samples = unnumbered(&rig(40_000, usize::MAX));
    let (gap, late) = (2000..17_000, |rows: std::ops::Range<usize>| samples[rows].to_vec());
    let live = [late(0..gap.start), late(gap.end..38_000)].concat();
    for session in [Some("t"), None] {
        let fixture = service().await;
        let client = &fixture.client;
        assert_eq!(send(client, session, &live).await, [23_000, 0, 0, 4], "a jump is doubted");
        let [accepted, duplicate, rejected, n_late] =
            send(client, session, &late(gap.clone())).await;
        assert_eq!([accepted, duplicate, rejected], [15_000, 0, 0]);
        assert!(n_late > 14_900, "the last ones may be a clock that was set back: {n_late}");
        assert_eq!(send(client, session, &late(38_000..40_000)).await, [2000, 0, 0, 0]);
        let found = sessions(client).await;
        let mut stored = client.recording("a", found[0]["name"].as_str().unwrap()).await;
        stored.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        assert!(stored == samples, "{session:?}");
    }
}

/// A person ends the session of a device without session names while answers are lost: what
/// it sends again is not recorded a second time, in the next session.
#[tokio::test]
async fn retransmissions_after_the_end_of_a_session_are_duplicates() {
    for samples in [rig(900, usize::MAX), unnumbered(&rig(900, usize::MAX))] {
        let fixture = service().await;
        let client = &fixture.client;
        assert_eq!(send(client, None, &samples[..600]).await, [600, 0, 0, 0]);
        let first = sessions(client).await[0]["name"].as_str().unwrap().to_owned();
        client.end("a", &first).await;
        let ack = client.telemetry("a", None, &samples[400..600]).await;
        assert_eq!((&ack["duplicate"], &ack["session"]), (&json!(200), &json!(first)), "{ack}");
        assert_eq!(sessions(client).await.len(), 1, "no session for duplicates alone");
        // A batch of both, and an older one after the next session has begun.
        assert_eq!(send(client, None, &samples[500..700]).await, [100, 100, 0, 0]);
        assert_eq!(send(client, None, &samples[..600]).await, [0, 600, 0, 0]);
        assert_eq!(send(client, None, &samples[600..]).await, [200, 100, 0, 0]);
        let second = sessions(client).await[0]["name"].as_str().unwrap().to_owned();
        assert_eq!(client.recording("a", &second).await, samples[600..]);
        assert_eq!(client.recording("a", &first).await, samples[..600]);
    }
}

/// A device that restarts sends again, late, what its first run has sent: older than what the
/// engine of the second run remembers, and at times at which that has no sample.
#[tokio::test]
async fn retransmissions_of_an_earlier_run_are_duplicates_however_late() {
    let fixture = service().await;
    let client = &fixture.client;
    let first = unnumbered(&rig(2000, usize::MAX));
    let second: Vec<Sample> = shifted(unnumbered(&rig(1000, usize::MAX)))
        .into_iter()
        .map(|sample| Sample { t_s: sample.t_s + 0.003, ..sample })
        .collect();
    assert_eq!(send(client, None, &first).await, [2000, 0, 0, 0]);
    let [accepted, duplicate, rejected, _] = send(client, None, &second).await;
    assert_eq!([accepted, duplicate, rejected], [1000, 0, 0]);
    let found = sessions(client).await;
    assert_eq!(found.len(), 2);
    let name = |i: usize| found[i]["name"].as_str().unwrap();
    let ack = client.telemetry("a", None, &first[300..310]).await;
    assert_eq!((&ack["accepted"], &ack["duplicate"]), (&json!(0), &json!(10)), "{ack}");
    assert_eq!(ack["session"], name(1));
    // What the second run sends again is still its own, and what is new is taken.
    assert_eq!(send(client, None, &second[300..310]).await, [0, 10, 0, 0]);
    let between = Sample { t_s: second[400].t_s + 0.002, ..second[400] };
    assert_eq!(send(client, None, &[between]).await, [1, 0, 0, 1]);
    assert_eq!(client.recording("a", name(1)).await, first);
    assert_eq!(client.session("a", name(0)).await["samples"], 1001);
}

#[tokio::test]
async fn retransmissions_are_recognised_however_old() {
    let mut fixture = service().await;
    for samples in [rig(9000, usize::MAX), unnumbered(&rig(9000, usize::MAX))] {
        let name = if samples[0].seq.is_some() { "numbered" } else { "unnumbered" };
        send(&fixture.client, Some(name), &samples).await;
        assert_eq!(send(&fixture.client, Some(name), &samples).await, [0, 9000, 0, 0]);
        fixture.restart().await;
        assert_eq!(send(&fixture.client, Some(name), &samples[..4000]).await, [0, 4000, 0, 0]);
        // Twice in one batch, further apart than the engine remembers.
        let more: Vec<Sample> = rig(14_000, usize::MAX)[9000..]
            .iter()
            .map(|sample| Sample { seq: sample.seq.and(samples[0].seq).and(sample.seq), ..*sample })
            .collect();
        let ack = fixture.client.telemetry("a", Some(name), &[&more[..], &more[..]].concat()).await;
        assert_eq!((&ack["accepted"], &ack["duplicate"]), (&json!(5000), &json!(5000)));
        assert_eq!(fixture.client.session("a", name).await["samples"], 14_000);
    }
}

#[tokio::test]
async fn conflicting_samples_are_rejected_by_name() {
    for numbered in [true, false] {
        let fixture = service().await;
        let client = &fixture.client;
        let take = |samples: Vec<Sample>| if numbered { samples } else { unnumbered(&samples) };
        let samples = take(rig(3000, usize::MAX));
        send(client, Some("s"), &samples).await;
        // Another device with the same name, or the same device counting again from zero.
        let other = take(shifted(rig(3000, usize::MAX)));
        assert_eq!(send(client, Some("s"), &other).await, [0, 0, 3000, 0]);
        let ack = client.telemetry("a", Some("s"), &other[7..8]).await;
        let reason = ack["rejected"][0]["reason"].as_str().unwrap();
        let key = if numbered { "this seq" } else { "this t_s" };
        assert!(reason.contains(key) && reason.contains("other values"), "{reason}");
        assert!(client.recording("a", "s").await == samples);
        // The rig counts as not tested, until samples are judged again.
        let fleet = || async { client.get("fleet").await.expect(200)["items"][0].clone() };
        let state = || async { client.get("assets/a/state").await.expect(200) };
        let untested = fleet().await["unjudged"].clone();
        assert_eq!((&untested["samples"], &untested["reason"]), (&json!(3001), &json!(reason)));
        let unjudged = state().await;
        assert_eq!(unjudged["unjudged"], untested);
        let enabled = |state: &Value| {
            state["monitors"].as_array().unwrap().iter().any(|monitor| monitor["enabled"] == true)
        };
        assert!(!enabled(&unjudged));
        assert!(client.get("/metrics").await.text.contains("offbd_assets_untested 1"));
        send(client, Some("s"), &take(rig(3200, usize::MAX))[3000..]).await;
        assert_eq!(fleet().await["unjudged"], Value::Null);
        assert!(enabled(&state().await));
    }
}

#[tokio::test]
async fn a_rig_whose_rows_are_not_samples_is_not_tested_and_not_silent() {
    let data = tempfile::tempdir().unwrap();
    let Process { client, .. } = &Process::start(data.path());
    client.asset("a").await;
    let fleet = || async { client.get("fleet").await.expect(200)["items"][0].clone() };
    let good = rig(1000, usize::MAX);
    // Sends `good` with other rows instead of those that are wanted.
    let send_with = async |samples: &[Sample], is_malformed: &dyn Fn(usize) -> bool| {
        let mut body = batch(Some("s"), samples);
        for row in (0..samples.len()).filter(|&row| is_malformed(row)) {
            body["samples"][row]["t_s"] = json!("now");
        }
        client.post("assets/a/telemetry", &body).await.expect(200)
    };
    let untested = async |n: u64, seen_before: &Value| {
        let rig = fleet().await;
        assert_eq!(rig["unjudged"]["samples"], n, "{rig}");
        assert!(rig["unjudged"]["reason"].as_str().unwrap().contains("not a sample"), "{rig}");
        assert!(rig["last_seen"].is_string() && rig["last_seen"] != *seen_before, "{rig}");
        rig["last_seen"].clone()
    };
    // Before there is a session.
    send_with(&good[..10], &|_| true).await;
    assert_eq!(fleet().await["unjudged"], Value::Null);
    send_with(&good[..2], &|_| true).await;
    let seen = untested(12, &Value::Null).await;
    assert!(fleet().await["lag_s"].is_null() && fleet().await["session"].is_null());
    send(client, Some("s"), &good[..100]).await;
    assert_eq!(fleet().await["unjudged"], Value::Null);
    // One row at a time, and a few of many.
    for row in 0..11 {
        send_with(&good[row..=row], &|_| true).await;
    }
    untested(11, &seen).await;
    send_with(&good[100..200], &|row| row % 10 == 0).await;
    assert_eq!(fleet().await["unjudged"], Value::Null);
    // As many as samples.
    send(client, Some("s"), &good[200..240]).await;
    send_with(&good[240..300], &|row| row % 2 == 1).await;
    untested(30, &seen).await;
    let state = client.get("assets/a/state").await.expect(200);
    assert_eq!(state["unjudged"], fleet().await["unjudged"]);
}

#[tokio::test]
async fn two_devices_that_take_turns_under_one_name_are_not_tested() {
    let data = tempfile::tempdir().unwrap();
    let Process { client, .. } = &Process::start(data.path());
    client.asset("a").await;
    let (one, other) = (rig(300, usize::MAX), shifted(rig(300, usize::MAX)));
    for (turn, (one, other)) in one.chunks(5).zip(other.chunks(5)).enumerate() {
        for (half, device) in [one, other].into_iter().enumerate() {
            send(client, Some("s"), device).await;
            let unjudged = client.get("fleet").await.expect(200)["items"][0]["unjudged"].clone();
            // From the third turn of the other device on.
            assert_eq!(unjudged.is_object(), (turn, half) >= (2, 1), "turn {turn}: {unjudged}");
        }
    }
}

#[tokio::test]
async fn invalid_rows_do_not_show_a_restart() {
    let fixture = service().await;
    let mut samples = rig(2000, usize::MAX);
    send(&fixture.client, None, &samples).await;
    samples[1900..1910].iter_mut().for_each(|sample| sample.x_m = Some(1e9));
    assert_eq!(send(&fixture.client, None, &samples[1800..]).await, [0, 190, 10, 0]);
    assert_eq!(sessions(&fixture.client).await.len(), 1);
}

#[tokio::test]
async fn a_rig_with_one_sample_a_minute_is_judged() {
    let fixture = service().await;
    let at = |i: usize| i as f64 * 60.0 + if i >= 100 { 7200.0 } else { 0.0 };
    let samples: Vec<Sample> = rig(300, 300)
        .iter()
        .enumerate()
        .map(|(i, s)| Sample { seq: None, t_s: at(i), ..*s })
        .collect();
    let [accepted, _, _, n_late] = send(&fixture.client, None, &samples).await;
    assert!(accepted == 300 && n_late < 10, "{n_late} were doubted at first");
    let state = fixture.client.get("assets/a/state").await.expect(200);
    assert_eq!(state["unjudged"], Value::Null);
    assert!(state["judged"].as_u64().unwrap() >= 295, "{}", state["judged"]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, failure_persistence: None, ..ProptestConfig::default() })]

    /// A device that sends stretches of its samples in any order, again and with other
    /// values: each row is told the truth.
    #[test]
    fn each_row_is_told_the_truth(
        numbered in any::<bool>(),
        sends in proptest::collection::vec(
            (0..4000_usize, 1..600_usize, 1..4_usize, prop::bool::weighted(0.2)), 1..30,
        ),
    ) {
        let samples = if numbered { rig(4000, 4000) } else { unnumbered(&rig(4000, 4000)) };
        let other = shifted(samples.clone());
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let fixture = service().await;
            let mut truth: BTreeMap<usize, Sample> = BTreeMap::new();
            for (start, n, every, is_other) in sends {
                let from = if is_other { &other } else { &samples };
                let rows: Vec<usize> = (start..4000).step_by(every).take(n).collect();
                let part: Vec<Sample> = rows.iter().map(|&i| from[i]).collect();
                let mut expected = [0, 0, 0];
                for (&i, sample) in rows.iter().zip(&part) {
                    match truth.get(&i) {
                        None => { truth.insert(i, *sample); expected[0] += 1; }
                        Some(known) if known == sample => expected[1] += 1,
                        Some(_) => expected[2] += 1,
                    }
                }
                let told = send(&fixture.client, Some("s"), &part).await;
                assert_eq!(told[..3], expected);
            }
            let mut stored = fixture.client.recording("a", "s").await;
            stored.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
            assert_eq!(stored, truth.into_values().collect::<Vec<_>>());
        });
    }
}
