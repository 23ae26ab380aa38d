//! The database lacks commits that were acknowledged: it was replaced by an older copy, or a
//! fail-over to an asynchronous standby has lost them. Nobody goes on as if nothing had happened.

use offbd::store::{PartitionId, Partitions};
use sqlx::{AssertSqlSafe, Executor};

use super::{not_ready, register_rigs, send_all};
use crate::support::cluster::{Cluster, N_PARTITIONS};
use crate::support::postgres::Postgres;
use crate::support::{ServiceFixture, batch, connection, eventually, registration, rig};

/// Where a partition of the second node stands in an older copy.
const OLD: [(&str, &str); 3] = [
    ("a commit is missing", "n_commits = n_commits - 1"),
    ("another node was first", "n_commits = n_commits - 1, epoch = epoch + 1"),
    ("the take-over is missing", "epoch = epoch - 1"),
];

/// Ends the connection with which the second node writes.
const END: &str = "(SELECT pg_terminate_backend(pid) FROM pg_stat_activity
    WHERE pid = (SELECT pid FROM node WHERE name = 'node-1'))";

/// A statement that makes of a partition what it is in an older copy, `when` something is true.
fn turn_back(old: &str, partition: PartitionId, when: &str) -> AssertSqlSafe<String> {
    // The samples of a commit are a row of the journal.
    let is_missing = old.contains("n_commits");
    AssertSqlSafe(format!(
        "WITH now AS MATERIALIZED (SELECT {when} AS is_due),
         missing AS (DELETE FROM journal WHERE {is_missing} AND (SELECT is_due FROM now)
            AND id = (SELECT MAX(id) FROM journal WHERE id >> 48 = {partition}))
         UPDATE partition SET {old} WHERE id = {partition} AND (SELECT is_due FROM now)"
    ))
}

fn partition_of(name: &str) -> PartitionId {
    Partitions::new(u32::try_from(N_PARTITIONS).unwrap()).of(name)
}

const REFUSAL: &str = "the database is not as it was left";

/// Waits until the first and the third node own everything.
async fn taken_over(cluster: &Cluster) {
    for i in [0, 2] {
        let client = cluster.client(i);
        eventually(|| async {
            let view = client.get("cluster").await.expect(200);
            let n = view["nodes"].as_array()?.len();
            (n == 2 && view["unowned"] == 0).then_some(())
        })
        .await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_that_knows_of_more_commits_takes_nothing() {
    for (case, old) in OLD {
        let cluster = Cluster::start().await;
        let (names, samples) = (register_rigs(&cluster).await, rig(900, 300));
        send_all(&cluster.client(0), &names, &samples[..200]).await;
        send_all(&cluster.client(0), &names, &samples[200..300]).await;
        let owned = cluster.owned_by(1, &names).await;
        let fail_over = turn_back(old, partition_of(&owned[0]), END);
        let turned_back = connection(&cluster.url()).await.execute(fail_over).await.unwrap();
        assert_eq!(turned_back.rows_affected(), 1, "{case}");
        not_ready(&cluster.client(1), REFUSAL).await;
        taken_over(&cluster).await;
        // The others go on with what is there, also beyond what the node knows of.
        for part in samples[300..400].chunks(20) {
            send_all(&cluster.client(0), &names, part).await;
        }
        not_ready(&cluster.client(1), REFUSAL).await;
        taken_over(&cluster).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_that_meets_an_older_partition_in_a_commit_takes_nothing_until_it_is_restarted() {
    let mut cluster = Cluster::start().await;
    let (names, samples) = (register_rigs(&cluster).await, rig(900, 300));
    send_all(&cluster.client(0), &names, &samples[..300]).await;
    let owned = cluster.owned_by(1, &names).await;
    let turn_back = turn_back("epoch = epoch - 1", partition_of(&owned[0]), "TRUE");
    connection(&cluster.url()).await.execute(turn_back).await.unwrap();
    let (client, sent) = (cluster.client(1), batch(Some("s"), &samples[300..600]));
    let path = format!("assets/{}/telemetry", owned[0]);
    // It has no answer before the node is restarted.
    let waiting = tokio::spawn(async move {
        let request = client.request(reqwest::Method::POST, &path).json(&sent);
        request.send().await.map(|answer| answer.status().as_u16())
    });
    not_ready(&cluster.client(1), REFUSAL).await;
    taken_over(&cluster).await;
    send_all(&cluster.client(0), &names, &samples[300..600]).await;
    cluster.kill(1);
    assert_ne!(waiting.await.unwrap().ok(), Some(200));
    cluster.restart(1);
    cluster.client(1).readiness(200).await;
    send_all(&cluster.client(1), &names, &samples[600..]).await;
    for name in &names {
        assert_eq!(cluster.client(1).recording(name, "s").await, samples, "{name}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_process_that_works_alone_accepts_nothing_until_it_is_restarted() {
    let (server, samples) = (Postgres::new(), rig(900, 300));
    for (i, (case, old)) in OLD.into_iter().enumerate() {
        let url = server.database(&format!("twin{i}"));
        let mut fixture =
            ServiceFixture::start_with(|config| config.database = Some(url.clone())).await;
        fixture.client.post("assets", &registration("a")).await.expect(201);
        fixture.client.telemetry("a", Some("s"), &samples[..200]).await;
        fixture.client.telemetry("a", Some("s"), &samples[200..300]).await;
        let turn_back = turn_back(old, PartitionId(0), "TRUE");
        connection(&url).await.execute(turn_back).await.unwrap();
        let (client, sent) = (fixture.client.clone(), batch(Some("s"), &samples[300..600]));
        let waiting = tokio::spawn(async move {
            let request = client.request(reqwest::Method::POST, "assets/a/telemetry").json(&sent);
            request.send().await.map(|answer| answer.status().as_u16())
        });
        not_ready(&fixture.client, REFUSAL).await;
        fixture.restart().await;
        assert_ne!(waiting.await.unwrap().ok(), Some(200), "{case}");
        fixture.client.readiness(200).await;
        let kept = if old.contains("n_commits") { 200 } else { 300 };
        assert_eq!(fixture.client.recording("a", "s").await, samples[..kept], "{case}");
        fixture.client.telemetry("a", Some("s"), &samples[kept..]).await;
        assert_eq!(fixture.client.recording("a", "s").await, samples, "{case}");
    }
}
