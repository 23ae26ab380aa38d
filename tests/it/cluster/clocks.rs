//! Nodes whose clock differs from that of the database.

use super::count;
use crate::support::calls::FaultySystem;
use crate::support::cluster::{Cluster, NodeKind};
use crate::support::eventually;
use crate::support::postgres::Postgres;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_with_a_wrong_clock_says_so_once() {
    let directory = tempfile::tempdir().unwrap();
    let system = FaultySystem::new(directory.path());
    system.set("clock 3600");
    let mut kinds = vec![NodeKind::default(); 2];
    let environment = system.environment().into_iter();
    kinds[1]
        .environment
        .extend(environment.map(|(name, value)| (name, value.to_str().unwrap().to_owned())));
    let cluster = Cluster::of(Postgres::new(), kinds).await;
    let offset = |i| {
        let client = cluster.client(i);
        async move { count(&client, "offbd_node_clock_offset_seconds").await }
    };
    eventually(|| async { ((offset(1).await - 3600.0).abs() < 10.0).then_some(()) }).await;
    assert!(offset(0).await.abs() < 10.0);
    // Each look finds it; the other node has looked several times before it got its share.
    let n_told = |i: usize| {
        let log = cluster.nodes[i].as_ref().unwrap().log();
        log.matches("the clock of this node is not that of the database").count()
    };
    assert_eq!((n_told(0), n_told(1)), (0, 1));
}
