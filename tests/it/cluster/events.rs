//! What the events of a cluster cost its nodes.

use reqwest::Method;

use super::{count, register_rigs, send_all};
use crate::support::cluster::Cluster;
use crate::support::{Events, rig};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_reads_the_events_of_others_only_while_somebody_listens() {
    const READS: &str = "offbd_event_reads_total";
    let cluster = Cluster::start().await;
    let names = register_rigs(&cluster).await;
    let samples = rig(1500, 500);
    let clients = cluster.clients();
    let listen = async |i: usize| {
        let feed = clients[i].request(Method::GET, "events").send().await.unwrap();
        Events::new(feed)
    };
    let mut events = listen(0).await;
    send_all(&clients[1], &names[..6], &samples).await;
    let mut ids = std::collections::BTreeSet::new();
    let mut assets = std::collections::BTreeSet::new();
    while assets.len() < 6 {
        let event = events.next().await;
        assert!(ids.insert(event["id"].as_i64()), "{event}");
        assets.insert(event["asset"].to_string());
    }
    assert!(count(&clients[0], READS).await > 0.0);
    assert_eq!((count(&clients[1], READS).await, count(&clients[2], READS).await), (0.0, 0.0));
    // Who comes later misses nothing of what comes later.
    let mut later = listen(2).await;
    send_all(&clients[1], &names[6..], &samples).await;
    while assets.len() < 12 {
        assets.insert(later.next().await["asset"].to_string());
    }
    assert_eq!(count(&clients[1], READS).await, 0.0);
}
