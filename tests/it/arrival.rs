//! A recording is stored once and judged the same, however its samples arrive.

use crate::support::{ServiceFixture, batch, judged, rig};
use proptest::prelude::*;
use serde_json::json;

const N: usize = 1500;

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    /// Samples arrive out of order within the reorder window, some of them twice, in arbitrary
    /// batches, with or without sequence numbers.
    #[test]
    fn order_repetition_and_batching_do_not_change_the_verdict(
        swaps in proptest::collection::vec((0..N - 6, 1..6_usize), 0..100),
        twice in proptest::collection::vec(0..N, 0..40),
        cuts in proptest::collection::vec(1..200_usize, 1..20),
        numbered in any::<bool>(),
    ) {
        let mut samples = rig(N, 500);
        if !numbered {
            samples.iter_mut().for_each(|sample| sample.seq = None);
        }
        let mut order: Vec<usize> = (0..N).collect();
        let mut touched = [false; N];
        for (i, by) in swaps {
            // Each sample moves at most once, by at most 6 rows (60 ms).
            if !touched[i] && !touched[i + by] {
                order.swap(i, i + by);
                (touched[i], touched[i + by]) = (true, true);
            }
        }
        let mut arriving: Vec<_> = order.iter().map(|&i| samples[i]).collect();
        for i in twice {
            arriving.insert((i + 40).min(arriving.len()), samples[order[i]]);
        }
        let n_twice = arriving.len() - N;
        let (hash, faults) = judged("a", &samples);
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let fixture = ServiceFixture::start().await;
            fixture.client.asset("a").await;
            let (mut rest, mut cuts, mut n_duplicate) = (&arriving[..], cuts.iter().cycle(), 0);
            while !rest.is_empty() {
                let (part, after) = rest.split_at((*cuts.next().unwrap()).min(rest.len()));
                let ack = fixture.client.post("assets/a/telemetry", &batch(Some("s"), part)).await;
                n_duplicate += ack.expect(200)["duplicate"].as_u64().unwrap();
                rest = after;
            }
            assert_eq!(n_duplicate, n_twice as u64);
            let mut stored = fixture.client.recording("a", "s").await;
            stored.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
            assert_eq!(stored, samples);
            let ended = fixture.client.end("a", "s").await;
            assert_eq!(ended["verdict"]["verdict_hash"], hash);
            assert_eq!(ended["verdict"]["faults"], json!(faults));
        });
    }
}

/// The duration of a session is from its earliest to its latest sample, also if the latest is
/// not the last to arrive.
#[tokio::test(flavor = "multi_thread")]
async fn a_late_last_sample_does_not_shorten_a_session() {
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let mut samples = rig(300, usize::MAX);
    let late = samples.remove(295);
    samples.push(late);
    samples.iter_mut().for_each(|sample| sample.seq = None);
    fixture.client.telemetry("a", Some("s"), &samples).await;
    let open = fixture.client.get("sessions?asset=a").await.expect(200)["items"][0].clone();
    assert_eq!(open["last_t_s"], json!(samples[298].t_s), "{open}");
    let path = format!("sessions/{}/end", open["id"].as_str().unwrap());
    let ended = fixture.client.post(&path, &json!(null)).await.expect(200);
    let seconds = samples[298].t_s - samples[0].t_s;
    assert_eq!(ended["verdict"]["duration_s"], json!(seconds), "{ended}");
}
