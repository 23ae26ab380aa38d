//! However a recording arrives over the interface, it is stored once and
//! judged the same.

use crate::support::{Bench, batch, judged, rig};
use proptest::prelude::*;
use serde_json::json;

const N: usize = 1500;

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    /// Out of order within the reorder window, sent twice, cut into batches
    /// anyhow, counted or not.
    #[test]
    fn arrival_changes_nothing(
        swaps in proptest::collection::vec((0..N - 6, 1..6_usize), 0..100),
        twice in proptest::collection::vec(0..N, 0..40),
        cuts in proptest::collection::vec(1..200_usize, 1..20),
        counted in any::<bool>(),
    ) {
        let mut samples = rig(N, 500);
        if !counted {
            samples.iter_mut().for_each(|sample| sample.seq = None);
        }
        let mut order: Vec<usize> = (0..N).collect();
        let mut touched = [false; N];
        for (i, by) in swaps {
            // Each moves at most once, by at most 6 rows: 60 ms.
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
            let bench = Bench::start().await;
            bench.client.asset("a").await;
            let (mut rest, mut cuts, mut n_duplicate) = (&arriving[..], cuts.iter().cycle(), 0);
            while !rest.is_empty() {
                let (part, after) = rest.split_at((*cuts.next().unwrap()).min(rest.len()));
                let ack = bench.client.post("assets/a/telemetry", &batch(Some("s"), part)).await;
                n_duplicate += ack.expect(200)["duplicate"].as_u64().unwrap();
                rest = after;
            }
            assert_eq!(n_duplicate, n_twice as u64);
            let mut stored = bench.client.recording("a", "s").await;
            stored.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
            assert_eq!(stored, samples);
            let ended = bench.client.end("a", "s").await;
            assert_eq!(ended["verdict"]["verdict_hash"], hash);
            assert_eq!(ended["verdict"]["faults"], json!(faults));
        });
    }
}

/// A sample that comes late within the reorder window is judged in its place; the
/// session is as long as from its earliest to its latest sample.
#[tokio::test(flavor = "multi_thread")]
async fn a_late_last_sample_does_not_shorten_a_session() {
    let bench = Bench::start().await;
    bench.client.asset("a").await;
    let mut samples = rig(300, usize::MAX);
    let late = samples.remove(295);
    samples.push(late);
    samples.iter_mut().for_each(|sample| sample.seq = None);
    bench.client.telemetry("a", Some("s"), &samples).await;
    let open = bench.client.get("sessions?asset=a").await.expect(200)["items"][0].clone();
    assert_eq!(open["last_t_s"], json!(samples[298].t_s), "{open}");
    let path = format!("sessions/{}/end", open["id"].as_str().unwrap());
    let ended = bench.client.post(&path, &json!(null)).await.expect(200);
    let seconds = samples[298].t_s - samples[0].t_s;
    assert_eq!(ended["verdict"]["duration_s"], json!(seconds), "{ended}");
}
