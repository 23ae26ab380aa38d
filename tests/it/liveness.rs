//! Ingest continues regardless of one device, one deletion or one failing change, and the
//! service shuts down in bounded time.

use crate::support::deletions::{block_deletion, deletions, record_deletions, unblock_deletion};
use crate::support::{Client, DEADLINE, ServiceFixture, batch, eventually, packed, rig};
use futures_util::{SinkExt, StreamExt};
use offbd_core::vocabulary::Sample;
use serde_json::{Value, json};
use sqlx::{AssertSqlSafe, Connection, Executor};
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// Rows per batch, and largest number of samples in flight.
const ROWS: usize = 50;

/// Starts a service in which one batch takes all permits.
async fn service_with_few_permits() -> ServiceFixture {
    ServiceFixture::start_with(|config| {
        config.limits.batch_samples = ROWS;
        config.limits.in_flight_samples = ROWS;
    })
    .await
}

async fn stream(client: &Client, asset: &str) -> Socket {
    let url = format!("ws://{}/api/v1/assets/{asset}/stream", client.address);
    connect_async(url).await.unwrap().0
}

/// Sends `samples` in batches, as MessagePack, without reading.
async fn send_all(socket: &mut Socket, samples: &[Sample]) {
    for part in samples.chunks(ROWS) {
        let document = packed(&batch(Some("s"), part));
        socket.send(Message::binary(document)).await.unwrap();
    }
}

/// Returns the next answer, or `None` if the service ends the stream.
async fn answer(socket: &mut Socket) -> Option<Value> {
    loop {
        let frame = tokio::time::timeout(DEADLINE, socket.next()).await.expect("an answer");
        match frame?.ok()? {
            Message::Text(text) => return serde_json::from_str(&text).unwrap(),
            Message::Close(_) => return None,
            _ => {}
        }
    }
}

/// Reads answers until `n` samples are accepted.
async fn read_until_accepted(socket: &mut Socket, n: usize) {
    let mut accepted = 0;
    while accepted < n as u64 {
        let answer = answer(socket).await.expect("the stream continues");
        accepted += answer["accepted"].as_u64().unwrap_or_else(|| panic!("{answer}"));
    }
}

/// Waits until `/readyz` has `status`; returns its reason.
async fn readiness(client: &Client, status: u16) -> String {
    eventually(|| async {
        let answer = client.get("/readyz").await;
        (answer.status == status).then(|| answer.json()["detail"].as_str().unwrap_or("").to_owned())
    })
    .await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn streams_that_send_everything_before_reading_are_acknowledged() {
    let fixture = service_with_few_permits().await;
    let samples = rig(40 * ROWS, usize::MAX);
    let mut sockets = Vec::new();
    for asset in ["a", "b"] {
        fixture.client.asset(asset).await;
        sockets.push(stream(&fixture.client, asset).await);
    }
    for part in samples.chunks(10 * ROWS) {
        for socket in &mut sockets {
            send_all(socket, part).await;
        }
    }
    for socket in &mut sockets {
        read_until_accepted(socket, samples.len()).await;
    }
    // All permits are released: a batch that needs all of them is accepted.
    let last = rig(41 * ROWS, usize::MAX).split_off(40 * ROWS);
    fixture.client.telemetry("a", Some("s"), &last).await;
    assert_eq!(fixture.client.recording("b", "s").await, samples);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn streams_continue_when_the_database_is_available_again() {
    let fixture = service_with_few_permits().await;
    let samples = rig(20 * ROWS, usize::MAX);
    let mut sockets = Vec::new();
    for i in 0..6 {
        let asset = format!("a{i}");
        fixture.client.asset(&asset).await;
        sockets.push(stream(&fixture.client, &asset).await);
    }
    let lock = fixture.lock_store().await;
    for socket in &mut sockets {
        send_all(socket, &samples).await;
    }
    let reason = readiness(&fixture.client, 503).await;
    // SQLite reports the lock, PostgreSQL waits.
    let why = if crate::support::on_postgres() { "nothing has been committed" } else { "locked" };
    assert!(reason.contains(why), "{reason}");
    lock.release().await;
    for socket in &mut sockets {
        read_until_accepted(socket, samples.len()).await;
    }
    readiness(&fixture.client, 200).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_shutdown_does_not_wait_for_an_unavailable_database() {
    let mut fixture = service_with_few_permits().await;
    fixture.client.asset("a").await;
    let samples = rig(10 * ROWS, usize::MAX);
    let mut socket = stream(&fixture.client, "a").await;
    send_all(&mut socket, &samples[..ROWS]).await;
    read_until_accepted(&mut socket, ROWS).await;
    let lock = fixture.lock_store().await;
    send_all(&mut socket, &samples[ROWS..]).await;
    readiness(&fixture.client, 503).await;
    fixture.server.take().unwrap().shutdown().await.expect("it stops within the deadline");
    while let Some(answer) = answer(&mut socket).await {
        assert_eq!(answer["type"], "error", "{answer}");
    }
    lock.release().await;
    // The device sends again what was not acknowledged.
    let server = offbd::server::start(crate::support::config(fixture.data.path())).await.unwrap();
    let client = Client::new(server.address.to_string());
    client.telemetry("a", Some("s"), &samples).await;
    assert_eq!(client.recording("a", "s").await, samples);
}

/// Adds `n` chunks and transitions to the session `name` of `asset`.
async fn enlarge(fixture: &ServiceFixture, asset: &str, name: &str, n: usize) {
    let session = fixture.client.session(asset, name).await;
    let id = session["id"].as_str().unwrap();
    let mut store = fixture.store().await;
    for i in 0..n {
        let first = 1_000_000 + i * 10;
        let sql = format!(
            "INSERT INTO chunk VALUES ('{id}', {first}, 1, 0, 0, (SELECT data FROM chunk
             WHERE session = '{id}' ORDER BY first_index LIMIT 1));
             INSERT INTO transition (id, asset, session, ordinal, t_s, code, status, at, document)
             VALUES ({}, '{asset}', '{id}', {first}, 0, 'x_servo', 'pending', 0, '{{}}')",
            10_000_000 + i
        );
        store.execute(AssertSqlSafe(sql)).await.unwrap();
    }
}

/// Returns the number of rows of a table or `FROM` clause.
async fn count(fixture: &ServiceFixture, of: &str) -> i64 {
    let sql = AssertSqlSafe(format!("SELECT COUNT(*) FROM {of}"));
    sqlx::query_scalar(sql).fetch_one(&mut fixture.store().await).await.unwrap()
}

/// Starts a service with an asset `large` and an asset `b`, each with an ended and an open
/// session. The ended one of `large` has more chunks than one transaction deletes.
async fn service_with_large_asset() -> ServiceFixture {
    let fixture = ServiceFixture::start().await;
    let samples = rig(600, usize::MAX);
    for asset in ["large", "b"] {
        fixture.client.asset(asset).await;
        fixture.client.telemetry(asset, Some("first"), &samples).await;
        fixture.client.end(asset, "first").await;
        fixture.client.telemetry(asset, Some("second"), &samples).await;
    }
    enlarge(&fixture, "large", "first", 200).await;
    fixture
}

/// A chunk of [`enlarge`] that is not in the first part of a deletion.
const LATE_CHUNK: i64 = 1_000_500;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_large_asset_is_deleted_in_parts_between_other_commits() {
    let fixture = service_with_large_asset().await;
    record_deletions(fixture.data.path()).await;
    let deleting = tokio::spawn({
        let client = fixture.client.clone();
        async move { client.delete("assets/large").await.expect(204) }
    });
    for (i, part) in rig(3000, usize::MAX)[600..].chunks(20).enumerate() {
        let ack = fixture.client.telemetry("b", Some("second"), part).await;
        assert_eq!(ack["accepted"], 20, "batch {i}");
    }
    deleting.await.unwrap();
    let (deleted, most) = deletions(fixture.data.path()).await;
    assert!(deleted > 200 && most <= 16, "{deleted} chunks, {most} of them in one transaction");
    assert_eq!(count(&fixture, "session WHERE asset = 'large'").await, 0);
    assert_eq!(count(&fixture, "chunk WHERE session NOT IN (SELECT id FROM session)").await, 0);
    assert_eq!(count(&fixture, "transition WHERE asset = 'large'").await, 0);
    fixture.client.get("assets/large").await.problem(404);
    // The name can be used again.
    fixture.client.asset("large").await;
    let page = fixture.client.get("sessions?asset=large").await.expect(200);
    assert_eq!(page["items"], json!([]));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_interrupted_deletion_is_hidden_and_continues_at_the_next_start() {
    let mut fixture = service_with_large_asset().await;
    block_deletion(fixture.data.path(), LATE_CHUNK).await;
    let problem = fixture.client.delete("assets/large").await.problem(503);
    let detail = problem["detail"].as_str().unwrap();
    let session = "SELECT id FROM session WHERE asset = 'large' AND name = 'first'";
    let id: String =
        sqlx::query_scalar(session).fetch_one(&mut fixture.store().await).await.unwrap();
    assert!(detail.contains(&format!("the deletion of session {id}")), "{detail}");
    let left = count(&fixture, &format!("chunk WHERE session = '{id}'")).await;
    assert!((1..=185).contains(&left), "{left} chunks are left");
    for path in ["assets/large", "assets/large/state", "assets/large/faults"] {
        fixture.client.get(path).await.problem(404);
    }
    fixture.client.get(&format!("sessions/{id}")).await.problem(404);
    let assets = fixture.client.get("assets").await.expect(200);
    assert_eq!(assets["items"].as_array().unwrap().len(), 1, "{assets}");
    let sessions = fixture.client.get("sessions").await.expect(200);
    assert_eq!(sessions["items"].as_array().unwrap().len(), 2, "{sessions}");
    fixture.client.delete("assets/large").await.problem(404);
    fixture.client.post("assets", &json!({ "name": "large" })).await.problem(429);
    fixture.client.telemetry("b", Some("second"), &rig(700, usize::MAX)[600..]).await;
    unblock_deletion(fixture.data.path()).await;
    fixture.restart().await;
    eventually(|| async { (count(&fixture, "asset").await == 1).then_some(()) }).await;
    assert_eq!(count(&fixture, "session").await, 2);
    fixture.client.asset("large").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_large_session_is_hidden_at_once_and_deleted_in_parts() {
    let mut fixture = service_with_large_asset().await;
    let path = |session: &Value| format!("sessions/{}", session["id"].as_str().unwrap());
    let first = path(&fixture.client.session("large", "first").await);
    block_deletion(fixture.data.path(), LATE_CHUNK).await;
    fixture.client.delete(&first).await.problem(503);
    fixture.client.get(&first).await.problem(404);
    let second = path(&fixture.client.session("large", "second").await);
    fixture.client.delete(&second).await.expect(204);
    unblock_deletion(fixture.data.path()).await;
    fixture.restart().await;
    eventually(|| async { (count(&fixture, "session").await == 2).then_some(()) }).await;
    fixture.client.telemetry("large", Some("first"), &rig(10, usize::MAX)).await;
}

/// Makes the database fail on an asset `bad`, and on nothing else, as if the disk were full.
async fn fail_for_asset_bad(fixture: &ServiceFixture) {
    let words = if crate::support::on_postgres() {
        "CREATE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS
         'BEGIN RAISE ''full'' USING ERRCODE = ''53100''; END';
         CREATE TRIGGER full_for_one BEFORE INSERT ON asset FOR EACH ROW
         WHEN (NEW.name = 'bad') EXECUTE FUNCTION refuse()"
    } else {
        // The largest key is in use, so the next insertion gives SQLITE_FULL.
        "CREATE TABLE used_up (id INTEGER PRIMARY KEY AUTOINCREMENT);
         INSERT INTO used_up VALUES (9223372036854775807);
         CREATE TRIGGER full_for_one BEFORE INSERT ON asset WHEN NEW.name = 'bad'
         BEGIN INSERT INTO used_up VALUES (NULL); END"
    };
    fixture.store().await.execute(words).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_change_that_always_fails_is_rejected_and_the_others_are_committed() {
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("b").await;
    let samples = rig(300, usize::MAX);
    fixture.client.telemetry("b", Some("s"), &samples[..100]).await;
    fail_for_asset_bad(&fixture).await;
    let mut socket = stream(&fixture.client, "b").await;
    // All changes are in one group commit.
    let lock = fixture.lock_store().await;
    send_all(&mut socket, &samples[100..200]).await;
    let bad = tokio::spawn({
        let client = fixture.client.clone();
        async move { client.post("assets", &json!({ "name": "bad" })).await }
    });
    send_all(&mut socket, &samples[200..]).await;
    lock.release().await;
    read_until_accepted(&mut socket, 200).await;
    let problem = bad.await.unwrap().problem(503);
    assert!(problem["detail"].as_str().unwrap().contains("asset `bad`"), "{problem}");
    readiness(&fixture.client, 200).await;
    fixture.client.asset("good").await;
    assert_eq!(fixture.client.recording("b", "s").await, samples);
}

/// While the database is unavailable for writes, a batch of an asset that must be loaded is answered
/// with 503, and does not hold up the assets that are in memory.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_asset_that_is_not_in_memory_does_not_hold_up_its_shard() {
    let mut fixture = ServiceFixture::start_with(|config| config.workers.shards = 1).await;
    fixture.client.asset("idle").await;
    fixture.client.asset("busy").await;
    fixture.restart().await;
    let client = &fixture.client;
    let samples = rig(200, 200);
    client.telemetry("busy", Some("s"), &samples[..100]).await;
    let lock = fixture.lock_store().await;
    let sending = tokio::spawn({
        let (client, rest) = (client.clone(), samples[100..].to_vec());
        async move { client.telemetry("busy", Some("s"), &rest).await }
    });
    readiness(client, 503).await;
    for _ in 0..3 {
        client.post("assets/idle/telemetry", &batch(None, &[])).await.problem(503);
        client.get("assets/idle/state").await.expect(200);
        let state = client.get("assets/busy/state").await.expect(200);
        assert_eq!(state["samples"], 200, "judged, and not acknowledged yet");
    }
    lock.release().await;
    assert_eq!(sending.await.unwrap()["accepted"], 100);
    readiness(client, 200).await;
    let idle = async || client.post("assets/idle/telemetry", &batch(None, &[])).await;
    eventually(async || (idle().await.status == 200).then_some(())).await;
}

/// Write sets that can wait for the writer, and those that it commits together.
const QUEUED: usize = 1024;
const COMMITTED_TOGETHER: usize = 512;

/// Batches of a stream that can wait for their commit.
const OF_A_STREAM: usize = 32;

/// Returns the number of write sets that wait for the writer.
async fn writer_queue(client: &Client) -> usize {
    let text = client.get("/metrics").await.text;
    let value = text.lines().find_map(|line| line.strip_prefix("offbd_writer_queue "));
    value.unwrap().parse().unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_shard_answers_while_the_writer_has_no_room() {
    let mut fixture = ServiceFixture::start_with(|config| config.workers.shards = 1).await;
    fixture.client.asset("idle").await;
    fixture.restart().await;
    let client = &fixture.client;
    let samples = rig((OF_A_STREAM + 1) * ROWS, usize::MAX);
    let (first, rest) = samples.split_at(ROWS);
    let mut streams = Vec::new();
    for i in 0..(QUEUED + COMMITTED_TOGETHER) / OF_A_STREAM + 2 {
        let name = format!("rig-{i}");
        client.asset(&name).await;
        client.telemetry(&name, Some("s"), first).await;
        streams.push((stream(client, &name).await, name));
    }
    let lock = fixture.lock_store().await;
    for (socket, _) in &mut streams {
        send_all(socket, rest).await;
    }
    eventually(async || (writer_queue(client).await >= QUEUED).then_some(())).await;
    // The shard waits for room for a while, and its queue fills.
    let sent = batch(Some("s"), &rest[..1]);
    let answer = async || client.post("assets/rig-0/telemetry", &sent).await;
    eventually(async || (answer().await.status == 503).then_some(())).await;
    for _ in 0..3 {
        answer().await.problem(503);
        client.get("assets/rig-0/state").await.expect(200);
        client.post("assets/idle/telemetry", &batch(None, &[])).await.problem(503);
        client.get("assets/idle/state").await.expect(200);
    }
    lock.release().await;
    readiness(client, 200).await;
    // The devices send again what was not acknowledged.
    for (_, name) in &streams {
        let path = format!("assets/{name}/telemetry");
        let sent = batch(Some("s"), &samples);
        eventually(async || (client.post(&path, &sent).await.status == 200).then_some(())).await;
        let mut stored = client.recording(name, "s").await;
        stored.sort_by_key(|sample| sample.seq);
        assert_eq!(stored, samples);
    }
}

/// Returns whether this process has a file in `directory` open, other than by a test's own
/// connection.
#[cfg(target_os = "linux")]
fn is_open(directory: &std::path::Path) -> bool {
    let files = std::fs::read_dir("/proc/self/fd").unwrap();
    let mut targets = files.filter_map(|file| std::fs::read_link(file.unwrap().path()).ok());
    targets.any(|target| target.starts_with(directory))
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn of_a_start_that_fails_nothing_is_left_that_could_change_the_store() {
    // Of the first the service learns before its threads are started, of the second after it.
    for table in ["mute", "replay"] {
        let mut fixture = ServiceFixture::start().await;
        fixture.server.take().unwrap().shutdown().await.unwrap();
        let rename = async |from: &str, to: &str| {
            let rename = AssertSqlSafe(format!("ALTER TABLE {from} RENAME TO {to}"));
            let mut store = fixture.store().await;
            store.execute(rename).await.unwrap();
            store.close().await.unwrap();
        };
        rename(table, "renamed").await;
        let error = offbd::server::start(fixture.config.clone()).await.err().expect("it fails");
        assert!(format!("{error:#}").contains(table), "{error:#}");
        eventually(async || (!is_open(fixture.data.path())).then_some(())).await;
        rename("renamed", table).await;
        // In PostgreSQL a writer that is left would still have the lock.
        let server = offbd::server::start(fixture.config.clone()).await.unwrap();
        server.shutdown().await.unwrap();
    }
}
