//! Partitions and names of nodes, as the database keeps them.

use std::collections::BTreeSet;

use offbd::store::{
    AssetRow, ChangeSet, Location, NodeIdentity, PartitionId, Partitions, SessionProgress,
    SessionRow, Store, StoreError, Write, Writer,
};
use offbd_core::vocabulary::Sample;
use sqlx::{AssertSqlSafe, Executor};

use super::{not_ready, register_rigs};
use crate::support::cluster::Cluster;
use crate::support::postgres::Postgres;
use crate::support::process::Refusal;
use crate::support::{DEADLINE, batch, connection, rig};

const N: u32 = 64;

async fn node(url: &str, id: &str, name: &str) -> Result<Writer, StoreError> {
    let [id, name] = [id, name].map(str::to_owned);
    let (address, version) = ("127.0.0.1:1".to_owned(), "0".to_owned());
    let node = NodeIdentity { id, name, address, version };
    let location = Location::of_url(url).unwrap();
    Ok(Store::open_node(&location, node, Partitions::new(N)).await?.1)
}

/// Returns the number of transactions that have changed the partitions last, and of owners.
async fn transactions_and_owners(url: &str) -> (i64, i64) {
    let count = "SELECT COUNT(DISTINCT CAST(xmin AS TEXT)), COUNT(owner) FROM partition";
    sqlx::query_as(count).fetch_one(&mut connection(url).await).await.unwrap()
}

#[tokio::test]
async fn all_partitions_are_taken_and_released_in_one_transaction() {
    let server = Postgres::new();
    let url = server.database("cluster");
    let mut a = node(&url, "1", "a").await.unwrap();
    let all: Vec<_> = Partitions::new(N).all().collect();
    assert_eq!(a.take(&all).await.unwrap(), all);
    assert_eq!(transactions_and_owners(&url).await, (1, i64::from(N)));
    assert!(a.owned().into_iter().map(|(partition, _)| partition).eq(all.iter().copied()));
    let mut b = node(&url, "2", "b").await.unwrap();
    assert_eq!(b.take(&all).await.unwrap(), [], "each has its owner");
    a.release(&all).await.unwrap();
    assert_eq!(transactions_and_owners(&url).await, (1, 0));
    assert_eq!(b.take(&all).await.unwrap(), all);
}

/// Records ten samples of a new session, alone in a row of the journal.
async fn record(writer: &mut Writer, session: String) {
    try_record(writer, session).await.unwrap();
}

async fn try_record(writer: &mut Writer, session: String) -> Result<(), StoreError> {
    let asset =
        AssetRow { name: session.clone(), document: "{}".to_owned(), ..AssetRow::default() };
    let partition = Partitions::new(N).of(&asset.name);
    let row = SessionRow {
        id: session.clone(),
        asset: session.clone(),
        name: session.clone(),
        state: "open".to_owned(),
        setup: "{}".to_owned(),
        baseline: "{}".to_owned(),
        ..SessionRow::default()
    };
    let samples = (0..10).map(|i| Sample { t_s: f64::from(i), ..Sample::default() }).collect();
    let progress = SessionProgress { n_samples: 10, ..SessionProgress::default() };
    let append = Write::Append { session, first_index: 0, samples, progress };
    let mut writes = vec![Write::CreateAsset(asset), Write::OpenSession(row), append];
    let set = ChangeSet { partition: Some(partition), writes: &mut writes };
    writer.commit(&mut [set]).await.map(drop)
}

/// Locks are not replicated: after a fail-over, or behind a pool of connections, two nodes may have
/// the lock of one partition. The epoch refuses the former owner.
#[tokio::test]
async fn a_node_writes_nothing_to_a_partition_that_another_one_has_taken() {
    let server = Postgres::new();
    let url = server.database("cluster");
    let all: Vec<_> = Partitions::new(N).all().collect();
    let mut a = node(&url, "1", "a").await.unwrap();
    a.take(&all).await.unwrap();
    record(&mut a, "rig-0".to_owned()).await;
    let taken = Partitions::new(N).of("rig-0");
    let rig = |of_taken: bool| {
        let is_wanted = |rig: &String| (Partitions::new(N).of(rig) == taken) == of_taken;
        (1..).map(|i| format!("rig-{i}")).find(is_wanted).unwrap()
    };

    let mut database = connection(&url).await;
    let take = AssertSqlSafe(format!(
        "UPDATE partition SET epoch = epoch + 1, owner = '2' WHERE id = {taken}"
    ));
    assert_eq!(database.execute(take).await.unwrap().rows_affected(), 1);
    let refused = try_record(&mut a, rig(true)).await;
    let Err(StoreError::Overtaken { partitions }) = refused else { panic!("{refused:?}") };
    assert_eq!(partitions, [taken]);
    assert!(a.owned().into_iter().all(|(partition, _)| partition != taken));
    record(&mut a, rig(false)).await;
    let names =
        sqlx::query_scalar("SELECT name FROM asset").fetch_all(&mut database).await.unwrap();
    let names: BTreeSet<String> = names.into_iter().collect();
    assert_eq!(names, BTreeSet::from(["rig-0".to_owned(), rig(false)]));
}

/// One transaction for all that a killed node had in its journal would take so long that it
/// is given up, and with it the partitions.
#[tokio::test]
async fn the_journal_of_another_node_is_folded_by_and_by() {
    let server = Postgres::new();
    let url = server.database("cluster");
    let all: Vec<_> = Partitions::new(N).all().collect();
    let mut a = node(&url, "1", "a").await.unwrap();
    a.take(&all).await.unwrap();
    for i in 0..100 {
        record(&mut a, format!("rig-{i}")).await;
    }
    a.release(&all).await.unwrap();
    let mut b = node(&url, "2", "b").await.unwrap();
    assert_eq!(b.take(&all).await.unwrap(), all);
    let taken = b.journal_bytes();
    b.fold(taken / 3).await.unwrap();
    assert!(b.journal_bytes() > taken / 2, "{} of {taken}", b.journal_bytes());
    while b.journal_bytes() > taken / 3 {
        b.fold(taken / 3).await.unwrap();
    }
}

/// A node that is paused while the server sends it a long answer.
#[tokio::test]
async fn a_node_that_reads_nothing_of_an_answer_loses_its_partitions() {
    let server = Postgres::new();
    let url = server.database("cluster");
    let mut other = node(&url, "2", "b").await.unwrap();
    let (p, key) = (PartitionId(3), i32::from_be_bytes(*b"part"));
    let mut paused = server.unread_client(
        "cluster",
        &[
            &format!("SELECT pg_advisory_lock({key}, 3)"),
            "INSERT INTO node SELECT '1', 'a', '127.0.0.1:1', '0', 0, pid,
             CAST(backend_start AS TEXT) FROM pg_stat_activity WHERE pid = pg_backend_pid()",
            "COPY (SELECT repeat('x', 1000) FROM generate_series(1, 100000)) TO STDOUT",
        ],
    );
    let mut watch = connection(&url).await;
    let unread = "SELECT COUNT(*) FROM pg_stat_activity WHERE wait_event = 'ClientWrite'";
    let blocked = async {
        while sqlx::query_scalar::<_, i64>(unread).fetch_one(&mut watch).await.unwrap() == 0 {}
    };
    tokio::time::timeout(DEADLINE, blocked).await.expect("the pipe is full in time");
    assert_eq!(other.take(&[p]).await.unwrap(), []);
    let taken = async {
        while other.take(&[p]).await.unwrap() != [p] {
            other.observe().await.unwrap();
        }
    };
    tokio::time::timeout(DEADLINE, taken).await.expect("it is taken in time");
    paused.kill().unwrap();
    paused.wait().unwrap();
}

#[tokio::test]
async fn what_is_taken_again_after_a_failed_hand_over_is_free_after_the_next_one() {
    let server = Postgres::new();
    let url = server.database("cluster");
    let (p, q) = (PartitionId(3), PartitionId(4));
    let mut a = node(&url, "1", "a").await.unwrap();
    let mut b = node(&url, "2", "b").await.unwrap();
    assert_eq!(a.take(&[p]).await.unwrap(), [p]);
    let mut again = a.take(&[q, p]).await.unwrap();
    again.sort();
    assert_eq!(again, [p, q], "what it owns, and what is free");
    assert_eq!(b.take(&[p, q]).await.unwrap(), []);
    a.release(&[p, q]).await.unwrap();
    assert_eq!(b.take(&[p, q]).await.unwrap(), [p, q]);
}

#[tokio::test]
async fn a_name_belongs_to_one_node_as_long_as_that_is_connected() {
    let server = Postgres::new();
    let url = server.database("cluster");
    let a = node(&url, "1", "a").await.unwrap();
    // The server ends a connection that has sent nothing for too long.
    let mut other = node(&url, "2", "other").await.unwrap();
    other.observe().await.unwrap();
    let (alive, refused) = (tokio::spawn(observe(a)), node(&url, "3", "a").await);
    let error = refused.expect_err("the name is taken").to_string();
    assert!(error.contains("another node of the cluster has the name `a`"), "{error}");
    alive.abort();
    assert!(alive.await.unwrap_err().is_cancelled());
    node(&url, "3", "a").await.unwrap();
}

async fn observe(mut writer: Writer) {
    loop {
        writer.observe().await.unwrap();
        tokio::task::yield_now().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_that_is_paused_has_its_name_again_once_the_other_one_is_gone() {
    let cluster = Cluster::start().await;
    let Err(Refusal { log, .. }) = cluster.try_node(1, &[]) else { panic!("two with one name") };
    assert!(log.contains("another node of the cluster has the name `node-1`"), "{log}");
    let names = register_rigs(&cluster).await;
    let owned = cluster.owned_by(1, &names).await;
    cluster.signal(1, "-STOP");
    let second = cluster.try_node(1, &[]).unwrap_or_else(|Refusal { log, .. }| panic!("{log}"));
    // What it has received while it was paused it refuses as well.
    let samples = batch(Some("s"), &rig(10, usize::MAX));
    let path = format!("assets/{}/telemetry", owned[0]);
    let client = cluster.client(1);
    let early = client.post(&path, &samples);
    let awake = async {
        cluster.signal(1, "-CONT");
        not_ready(&client, "has the name `node-1`").await;
    };
    let (early, ()) = tokio::time::timeout(DEADLINE, async { tokio::join!(early, awake) })
        .await
        .expect("the batch is answered");
    assert_eq!(early.problem(503)["type"], "urn:offbd:problem:moving");
    client.post(&path, &samples).await.problem(503);
    second.client.readiness(200).await;
    drop(second);
    cluster.client(1).readiness(200).await;
    cluster.settled(3).await;
}

#[tokio::test]
async fn a_node_that_the_database_has_forgotten_registers_again() {
    let server = Postgres::new();
    let url = server.database("cluster");
    let mut a = node(&url, "1", "a").await.unwrap();
    assert_eq!(a.observe().await.unwrap().0.len(), 1);
    connection(&url).await.execute("DELETE FROM node").await.unwrap();
    let forgotten = a.observe().await.unwrap_err();
    assert!(matches!(forgotten, StoreError::Forgotten) && forgotten.is_outage(), "{forgotten}");
    a.reconnect().await.unwrap();
    assert_eq!(a.observe().await.unwrap().0.len(), 1);
}

/// Another node begins to forget it, and knows only the connections that there are by then.
#[tokio::test]
async fn a_node_that_connects_again_is_not_forgotten() {
    let server = Postgres::new();
    let url = server.database("cluster");
    let mut a = node(&url, "1", "a").await.unwrap();
    a.disconnect();
    let mut row = connection(&url).await;
    let mut watch = connection(&url).await;
    let n_alive = "SELECT COUNT(*) FROM node JOIN pg_stat_activity USING (pid)";
    while sqlx::query_scalar::<_, i64>(n_alive).fetch_one(&mut watch).await.unwrap() > 0 {}
    row.execute("BEGIN").await.unwrap();
    row.execute("UPDATE node SET leaving = 0").await.unwrap();
    let register = async {
        let blocked = "SELECT COUNT(*) FROM pg_stat_activity
                       WHERE wait_event_type = 'Lock' AND query LIKE 'DELETE%'";
        while sqlx::query_scalar::<_, i64>(blocked).fetch_one(&mut watch).await.unwrap() == 0 {}
        let mut new = connection(&url).await;
        let pid: i32 =
            sqlx::query_scalar("SELECT pg_backend_pid()").fetch_one(&mut new).await.unwrap();
        let registered = "UPDATE node SET pid = $1, started = (SELECT CAST(backend_start AS TEXT)
                          FROM pg_stat_activity WHERE pid = $1)";
        sqlx::query(registered).bind(pid).execute(&mut row).await.unwrap();
        row.execute("COMMIT").await.unwrap();
        new
    };
    let both = async { tokio::join!(node(&url, "2", "b"), register) };
    let (b, _registered) = tokio::time::timeout(DEADLINE, both).await.expect("b opens in time");
    assert_eq!(b.unwrap().observe().await.unwrap().0.len(), 2);
}
