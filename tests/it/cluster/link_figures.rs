//! How the samples of a rig arrive is told by its owner, through every node.

use reqwest::Method;
use serde_json::Value;

use super::{register_rigs, send_all};
use crate::support::cluster::{Cluster, N_NODES, call};
use crate::support::{Answer, Client, rig};

fn path(name: &str) -> String {
    format!("assets/{name}/link")
}

/// Returns the figures that every node gives for a rig, the same ones.
async fn figures(cluster: &Cluster, name: &str) -> Value {
    let mut told = Vec::new();
    for client in cluster.clients() {
        let (status, link) = call(&client, Method::GET, &path(name), &Value::Null).await;
        assert_eq!((status, &link["asset"]), (200, &name.into()), "{link}");
        told.push(link["session"].clone());
    }
    assert!(told.iter().all(|one| *one == told[0]), "{name}: {told:?}");
    told.swap_remove(0)
}

/// Asks a node for the figures of all rigs at the same time.
async fn ask(client: Client, names: Vec<String>) -> Vec<Answer> {
    let answers = names.iter().map(async |name| client.get(&path(name)).await);
    futures_util::future::join_all(answers).await
}

fn is_refused(answer: &Answer) -> bool {
    let is_refused = answer.status == 503;
    assert!(!is_refused || answer.headers["retry-after"] == "1", "{answer:?}");
    is_refused
}

/// The samples that an answer says have come in the session; null if none have.
fn counted(answer: &Answer) -> Value {
    assert_eq!(answer.status, 200, "{answer:?}");
    answer.json()["session"]["samples"].clone()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_link_of_a_rig_is_told_by_its_owner_or_not_at_all() {
    let (cluster, samples) = (Cluster::start().await, rig(400, 400));
    let names = register_rigs(&cluster).await;
    for (i, part) in samples[..300].chunks(100).enumerate() {
        send_all(&cluster.client(i), &names, part).await;
    }
    for name in &names {
        let found = figures(&cluster, name).await;
        assert_eq!((&found["samples"], &found["batches"]), (&300.into(), &3.into()), "{found}");
        let rate_hz = found["rate_hz"].as_f64().unwrap();
        assert!((rate_hz - 100.0).abs() < 1e-6, "{found}");
    }
    // While the owner does not answer, no other node answers in its place.
    let owned = cluster.owned_by(1, &names).await;
    cluster.signal(1, "-STOP");
    let asked = [0, 2].map(|i| tokio::spawn(ask(cluster.client(i), owned.clone())));
    cluster.taken_over_from(1).await;
    for answers in asked {
        for answer in answers.await.unwrap() {
            // One that was on its way for seconds is answered by the next owner.
            assert!(is_refused(&answer) || counted(&answer).is_null(), "{answer:?}");
        }
    }
    // The next owner counts what it gets.
    send_all(&cluster.client(0), &names, &samples[300..]).await;
    let asked = tokio::spawn(ask(cluster.client(1), owned.clone()));
    cluster.signal(1, "-CONT");
    for answer in asked.await.unwrap() {
        // The node that was paused may own the rig again, and has counted nothing yet.
        let is_told = |samples: &Value| samples.is_null() || *samples == 100;
        assert!(is_refused(&answer) || is_told(&counted(&answer)), "{answer:?}");
    }
    cluster.settled(N_NODES).await;
}
