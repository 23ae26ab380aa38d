//! Retention: old sessions are deleted, and those with faults are kept longer.

use crate::support::{ServiceFixture, eventually, rig};
use offbd::store::codec::{self, ChunkKey, Packing};
use offbd_core::vocabulary::Sample;
use serde_json::Value;
use sqlx::{AssertSqlSafe, Executor};

const DAY_US: i64 = 86_400_000_000;

/// Records `samples` as a session that ended `days` ago.
async fn record_ended(fixture: &ServiceFixture, name: &str, samples: &[Sample], days: i64) {
    fixture.client.telemetry("a", Some(name), samples).await;
    fixture.client.end("a", name).await;
    let back = days * DAY_US;
    let sql = format!("UPDATE session SET ended_at = ended_at - {back} WHERE name = '{name}'");
    fixture.store().await.execute(AssertSqlSafe(sql)).await.unwrap();
}

async fn names(fixture: &ServiceFixture) -> Vec<String> {
    let page = fixture.client.get("sessions?asset=a").await.expect(200);
    let name = |session: &Value| session["name"].as_str().unwrap().to_owned();
    let mut names: Vec<_> = page["items"].as_array().unwrap().iter().map(name).collect();
    names.sort();
    names
}

async fn wait_for_sessions(fixture: &ServiceFixture, wanted: &[&str]) {
    eventually(|| async { (names(fixture).await == wanted).then_some(()) }).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn old_sessions_are_deleted_and_those_with_faults_are_kept_longer() {
    let fixture = ServiceFixture::start_with(|config| {
        config.retention.days = Some(30);
        config.retention.fault_days = Some(60);
        config.retention.sweep_s = 1;
    })
    .await;
    fixture.client.asset("a").await;
    let (healthy, sick) = (rig(500, 500), rig(1500, 500));
    record_ended(&fixture, "plain 29 days", &healthy, 29).await;
    record_ended(&fixture, "plain 31 days", &healthy, 31).await;
    record_ended(&fixture, "fault 59 days", &sick, 59).await;
    record_ended(&fixture, "fault 61 days", &sick, 61).await;
    fixture.client.telemetry("a", Some("open"), &healthy).await;
    wait_for_sessions(&fixture, &["fault 59 days", "open", "plain 29 days"]).await;
    eventually(|| async {
        let left: i64 = sqlx::query_scalar(
            "SELECT (SELECT COUNT(*) FROM session WHERE expired_at IS NOT NULL) +
             (SELECT COUNT(*) FROM chunk WHERE session NOT IN (SELECT id FROM session))",
        )
        .fetch_one(&mut fixture.store().await)
        .await
        .unwrap();
        (left == 0).then_some(())
    })
    .await;
    assert_eq!(fixture.client.recording("a", "fault 59 days").await, sick);
    assert_eq!(fixture.client.recording("a", "plain 29 days").await, healthy);
    assert_eq!(fixture.client.recording("a", "open").await, healthy);
    let faults = fixture.client.get("assets/a/faults?status=all").await.expect(200);
    assert!(faults.to_string().contains("x_servo"), "the fault memory is kept: {faults}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn above_the_size_limit_the_oldest_sessions_without_faults_are_deleted() {
    let (healthy, sick) = (rig(500, 500), rig(1500, 500));
    // What each takes up in a store: its samples and its row.
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    for (name, samples) in [("healthy", &healthy), ("sick", &sick)] {
        record_ended(&fixture, name, samples, 1).await;
    }
    let sizes: Vec<i64> = sqlx::query_scalar("SELECT n_bytes FROM session ORDER BY name")
        .fetch_all(&mut fixture.store().await)
        .await
        .unwrap();
    let key = ChunkKey { session: "", first_index: 0 };
    let chunk = |samples: &[Sample]| codec::encode(samples, Packing::Compact, key).len() as i64;
    assert!(sizes[0] > chunk(&healthy) + 1000 && sizes[1] > chunk(&sick) + 1000, "{sizes:?}");
    let bytes = (sizes[0] * 5 / 2 + sizes[1]) as usize;
    let fixture = ServiceFixture::start_with(|config| {
        config.retention.bytes_per_asset = Some(bytes);
        config.retention.sweep_s = 1;
    })
    .await;
    fixture.client.asset("a").await;
    for (name, samples, days) in
        [("3", &healthy, 7), ("4", &healthy, 6), ("2", &healthy, 8), ("1", &sick, 9)]
    {
        record_ended(&fixture, name, samples, days).await;
    }
    wait_for_sessions(&fixture, &["1", "3", "4"]).await;
}
