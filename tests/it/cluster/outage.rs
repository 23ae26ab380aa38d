//! The database of a cluster fails under load and recovers: acknowledged samples are stored once.

use sqlx::Executor;

use crate::outage::{FULL, ROOM, failing_commits};
use crate::support::cluster::{Cluster, N_NODES, NodeKind};
use crate::support::connection;
use crate::support::device::DeviceLoad;
use crate::support::postgres::Postgres;

/// Ends all connections but this one, or only those with which nodes write.
const END: [&str; 2] = [
    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
     WHERE pid <> pg_backend_pid() AND datname = current_database()",
    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid IN (SELECT pid FROM node)",
];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_restarted_database_server_loses_nothing_of_a_cluster() {
    let mut cluster = Cluster::start().await;
    let (url, clients) = (cluster.url(), cluster.clients());
    let load = DeviceLoad::start(4, &clients[0], cluster.data.path(), Some(&url));
    for (i, signal) in ["INT", "QUIT", "INT", "QUIT"].into_iter().enumerate() {
        load.link.wait_for_samples(200).await;
        cluster.stop_database(signal);
        for client in &clients {
            let reason = client.readiness(503).await;
            assert!(reason.contains("the database is unavailable"), "{reason}");
        }
        cluster.start_database();
        for client in &clients {
            client.readiness(200).await;
        }
        load.link.set_service(&clients[i % N_NODES]);
    }
    for i in 0..12 {
        load.link.wait_for_samples(50).await;
        connection(&url).await.execute(END[i % 2]).await.unwrap();
        load.link.set_service(&clients[i % N_NODES]);
    }
    load.link.wait_for_samples(50).await;
    load.stop().await;
    cluster.settled(N_NODES).await;
}

/// The connections of the writers and their locks are kept while samples find no room, so that no
/// partition changes hands.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_disk_moves_no_partition() {
    let cluster = Cluster::of(Postgres::new(), vec![NodeKind::default(); 2]).await;
    let (url, clients) = (cluster.url(), cluster.clients());
    let load = DeviceLoad::start(8, &clients[0], cluster.data.path(), Some(&url));
    load.link.wait_for_samples(400).await;
    let mut store = connection(&url).await;
    let epochs = "SELECT CAST(SUM(epoch) AS BIGINT) FROM partition";
    let before: i64 = sqlx::query_scalar(epochs).fetch_one(&mut store).await.unwrap();
    store.execute(FULL).await.unwrap();
    for client in &clients {
        client.readiness(503).await;
        let n = client.metric("offbd_commit_failures_total").await;
        // Longer than the server leaves the connection of a node idle.
        failing_commits(client, n + 10.0).await;
    }
    let after: i64 = sqlx::query_scalar(epochs).fetch_one(&mut store).await.unwrap();
    assert_eq!(before, after);
    store.execute(ROOM).await.unwrap();
    for client in &clients {
        client.readiness(200).await;
    }
    load.link.wait_for_samples(400).await;
    load.stop().await;
}
