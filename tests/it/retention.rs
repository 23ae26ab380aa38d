//! What is old or too much goes, what is around a fault stays for longer.

use crate::support::{Bench, eventually, rig};
use offbd::store::codec::{self, Stay};
use offbd_core::vocabulary::Sample;
use serde_json::Value;
use sqlx::{AssertSqlSafe, Executor};

const DAY_US: i64 = 86_400_000_000;

/// Records `samples` as a session that has ended `days` ago.
async fn ended(bench: &Bench, name: &str, samples: &[Sample], days: i64) {
    bench.client.telemetry("a", Some(name), samples).await;
    bench.client.end("a", name).await;
    let back = days * DAY_US;
    let sql = format!("UPDATE session SET ended_at = ended_at - {back} WHERE name = '{name}'");
    bench.store().await.execute(AssertSqlSafe(sql)).await.unwrap();
}

async fn names(bench: &Bench) -> Vec<String> {
    let page = bench.client.get("sessions?asset=a").await.expect(200);
    let name = |session: &Value| session["name"].as_str().unwrap().to_owned();
    let mut names: Vec<_> = page["items"].as_array().unwrap().iter().map(name).collect();
    names.sort();
    names
}

async fn come_to(bench: &Bench, wanted: &[&str]) {
    eventually(|| async { (names(bench).await == wanted).then_some(()) }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_old_goes_and_what_is_around_a_fault_later() {
    let bench = Bench::start_with(|config| {
        config.retention.days = Some(30);
        config.retention.fault_days = Some(60);
        config.retention.sweep_s = 1;
    })
    .await;
    bench.client.asset("a").await;
    let (healthy, sick) = (rig(500, 500), rig(1500, 500));
    ended(&bench, "plain 29 days", &healthy, 29).await;
    ended(&bench, "plain 31 days", &healthy, 31).await;
    ended(&bench, "fault 59 days", &sick, 59).await;
    ended(&bench, "fault 61 days", &sick, 61).await;
    bench.client.telemetry("a", Some("open"), &healthy).await;
    come_to(&bench, &["fault 59 days", "open", "plain 29 days"]).await;
    eventually(|| async {
        let left: i64 = sqlx::query_scalar(
            "SELECT (SELECT COUNT(*) FROM session WHERE expired_at IS NOT NULL) +
             (SELECT COUNT(*) FROM chunk WHERE session NOT IN (SELECT id FROM session))",
        )
        .fetch_one(&mut bench.store().await)
        .await
        .unwrap();
        (left == 0).then_some(())
    })
    .await;
    assert_eq!(bench.client.recording("a", "fault 59 days").await, sick);
    assert_eq!(bench.client.recording("a", "plain 29 days").await, healthy);
    assert_eq!(bench.client.recording("a", "open").await, healthy);
    let faults = bench.client.get("assets/a/faults?status=all").await.expect(200);
    assert!(faults.to_string().contains("x_servo"), "the fault memory stays: {faults}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn too_much_goes_from_its_oldest_end() {
    let (healthy, sick) = (rig(500, 500), rig(1500, 500));
    let size = |samples: &[Sample]| codec::encode(samples, Stay::Long).len();
    let bytes = size(&healthy) * 2 + size(&sick) + 10;
    let bench = Bench::start_with(|config| {
        config.retention.bytes_per_asset = Some(bytes);
        config.retention.sweep_s = 1;
    })
    .await;
    bench.client.asset("a").await;
    for (name, samples, days) in
        [("3", &healthy, 7), ("4", &healthy, 6), ("2", &healthy, 8), ("1", &sick, 9)]
    {
        ended(&bench, name, samples, days).await;
    }
    come_to(&bench, &["1", "3", "4"]).await;
}
