//! Ingest goes on whatever one device, one deletion or one change does, and the
//! service stops in bounded time whatever waits.

use crate::support::{Bench, Client, DEADLINE, batch, eventually, packed, rig};
use futures_util::{SinkExt, StreamExt};
use offbd_core::vocabulary::Sample;
use serde_json::{Value, json};
use sqlx::{AssertSqlSafe, Executor};
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// Rows in a batch, and samples that may be in flight: one batch takes all permits.
const ROWS: usize = 50;

/// A server in which one batch takes all permits.
async fn narrow() -> Bench {
    Bench::start_with(|config| {
        config.limits.batch_samples = ROWS;
        config.limits.in_flight_samples = ROWS;
    })
    .await
}

async fn stream(client: &Client, asset: &str) -> Socket {
    let url = format!("ws://{}/api/v1/assets/{asset}/stream", client.address);
    connect_async(url).await.unwrap().0
}

/// Sends `samples` in batches, as MessagePack, and reads nothing.
async fn flood(socket: &mut Socket, samples: &[Sample]) {
    for part in samples.chunks(ROWS) {
        let document = packed(&batch(Some("s"), part));
        socket.send(Message::binary(document)).await.unwrap();
    }
}

/// The next answer; `None` if the service ends the stream.
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
async fn accepted(socket: &mut Socket, n: usize) {
    let mut accepted = 0;
    while accepted < n as u64 {
        let answer = answer(socket).await.expect("the stream goes on");
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
async fn streams_that_send_before_they_read_are_all_acknowledged() {
    let bench = narrow().await;
    let samples = rig(40 * ROWS, usize::MAX);
    let mut sockets = Vec::new();
    for asset in ["a", "b"] {
        bench.client.asset(asset).await;
        sockets.push(stream(&bench.client, asset).await);
    }
    for part in samples.chunks(10 * ROWS) {
        for socket in &mut sockets {
            flood(socket, part).await;
        }
    }
    for socket in &mut sockets {
        accepted(socket, samples.len()).await;
    }
    // All permits are back: a batch that takes all of them is not turned away.
    let last = rig(41 * ROWS, usize::MAX).split_off(40 * ROWS);
    bench.client.telemetry("a", Some("s"), &last).await;
    assert_eq!(bench.client.recording("b", "s").await, samples);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn streams_go_on_when_the_database_is_back() {
    let bench = narrow().await;
    let samples = rig(20 * ROWS, usize::MAX);
    let mut sockets = Vec::new();
    for i in 0..6 {
        let asset = format!("a{i}");
        bench.client.asset(&asset).await;
        sockets.push(stream(&bench.client, &asset).await);
    }
    let hold = bench.hold().await;
    for socket in &mut sockets {
        flood(socket, &samples).await;
    }
    let reason = readiness(&bench.client, 503).await;
    // A file that is locked says so, a server hangs.
    let why = if crate::support::on_postgres() { "nothing has been committed" } else { "locked" };
    assert!(reason.contains(why), "{reason}");
    hold.let_go().await;
    for socket in &mut sockets {
        accepted(socket, samples.len()).await;
    }
    readiness(&bench.client, 200).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stop_does_not_wait_for_a_database_that_is_away() {
    let mut bench = narrow().await;
    bench.client.asset("a").await;
    let samples = rig(10 * ROWS, usize::MAX);
    let mut socket = stream(&bench.client, "a").await;
    flood(&mut socket, &samples[..ROWS]).await;
    accepted(&mut socket, ROWS).await;
    let hold = bench.hold().await;
    flood(&mut socket, &samples[ROWS..]).await;
    readiness(&bench.client, 503).await;
    bench.server.take().unwrap().shutdown().await.expect("it stops in time");
    while let Some(answer) = answer(&mut socket).await {
        assert_eq!(answer["type"], "error", "{answer}");
    }
    hold.let_go().await;
    // What was not acknowledged is sent again.
    let server = offbd::server::start(crate::support::config(bench.data.path())).await.unwrap();
    let client = Client::new(server.address.to_string());
    client.telemetry("a", Some("s"), &samples).await;
    assert_eq!(client.recording("a", "s").await, samples);
}

/// Gives the session `name` of `asset` `n` chunks more, and transitions too.
async fn enlarge(bench: &Bench, asset: &str, name: &str, n: usize) {
    let session = bench.client.session(asset, name).await;
    let id = session["id"].as_str().unwrap();
    let mut store = bench.store().await;
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

async fn count(bench: &Bench, of: &str) -> i64 {
    let sql = AssertSqlSafe(format!("SELECT COUNT(*) FROM {of}"));
    sqlx::query_scalar(sql).fetch_one(&mut bench.store().await).await.unwrap()
}

/// A server with an asset `large` of two sessions, of which one is open, with more
/// chunks than one transaction deletes, and another asset `b`.
async fn with_large() -> Bench {
    let bench = Bench::start().await;
    let samples = rig(600, usize::MAX);
    for asset in ["large", "b"] {
        bench.client.asset(asset).await;
        bench.client.telemetry(asset, Some("first"), &samples).await;
        bench.client.end(asset, "first").await;
        bench.client.telemetry(asset, Some("second"), &samples).await;
    }
    enlarge(&bench, "large", "first", 200).await;
    bench
}

/// A change of the database from which on no chunk beyond the first piece can go.
async fn stuck(bench: &Bench) {
    let words = if crate::support::on_postgres() {
        "CREATE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS
         'BEGIN RAISE ''stuck'' USING ERRCODE = ''23514''; END';
         CREATE TRIGGER stuck BEFORE DELETE ON chunk FOR EACH ROW
         WHEN (OLD.first_index = 1000500) EXECUTE FUNCTION refuse()"
    } else {
        "CREATE TRIGGER stuck BEFORE DELETE ON chunk WHEN OLD.first_index = 1000500
         BEGIN SELECT RAISE(ABORT, 'stuck'); END"
    };
    bench.store().await.execute(words).await.unwrap();
}

async fn loosen(bench: &Bench) {
    let on = if crate::support::on_postgres() { " ON chunk" } else { "" };
    let words = format!("DROP TRIGGER stuck{on}");
    bench.store().await.execute(AssertSqlSafe(words)).await.unwrap();
}

/// A change of the database that notes at which commit each chunk goes.
async fn note_what_goes(bench: &Bench) {
    let note = "INSERT INTO gone SELECT value FROM counter WHERE name = 'commit'";
    let words = if crate::support::on_postgres() {
        format!(
            "CREATE TABLE gone (at BIGINT);
             CREATE FUNCTION note() RETURNS trigger LANGUAGE plpgsql AS
             $$BEGIN {note}; RETURN OLD; END$$;
             CREATE TRIGGER noted BEFORE DELETE ON chunk FOR EACH ROW EXECUTE FUNCTION note()"
        )
    } else {
        format!(
            "CREATE TABLE gone (at BIGINT);
             CREATE TRIGGER noted BEFORE DELETE ON chunk BEGIN {note}; END"
        )
    };
    bench.store().await.execute(AssertSqlSafe(words)).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_large_asset_goes_in_pieces_between_which_others_are_acknowledged() {
    let bench = with_large().await;
    note_what_goes(&bench).await;
    let deleting = tokio::spawn({
        let client = bench.client.clone();
        async move { client.delete("assets/large").await.expect(204) }
    });
    for (i, part) in rig(3000, usize::MAX)[600..].chunks(20).enumerate() {
        let ack = bench.client.telemetry("b", Some("second"), part).await;
        assert_eq!(ack["accepted"], 20, "batch {i}");
    }
    deleting.await.unwrap();
    let most = "(SELECT at FROM gone GROUP BY at HAVING COUNT(*) > 16) large";
    assert!(count(&bench, "gone").await > 200);
    assert_eq!(count(&bench, most).await, 0, "too much in one transaction");
    assert_eq!(count(&bench, "session WHERE asset = 'large'").await, 0);
    assert_eq!(count(&bench, "chunk WHERE session NOT IN (SELECT id FROM session)").await, 0);
    assert_eq!(count(&bench, "transition WHERE asset = 'large'").await, 0);
    bench.client.get("assets/large").await.problem(404);
    // The name is free.
    bench.client.asset("large").await;
    let page = bench.client.get("sessions?asset=large").await.expect(200);
    assert_eq!(page["items"], json!([]));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_deletion_that_was_broken_off_is_hidden_and_goes_on_with_the_next_start() {
    let mut bench = with_large().await;
    stuck(&bench).await;
    let problem = bench.client.delete("assets/large").await.problem(503);
    let detail = problem["detail"].as_str().unwrap();
    let session = "SELECT id FROM session WHERE asset = 'large' AND name = 'first'";
    let id: String = sqlx::query_scalar(session).fetch_one(&mut bench.store().await).await.unwrap();
    assert!(detail.contains(&format!("the deletion of session {id}")), "{detail}");
    let left = count(&bench, &format!("chunk WHERE session = '{id}'")).await;
    assert!((1..=185).contains(&left), "{left} chunks are left");
    for path in ["assets/large", "assets/large/state", "assets/large/faults"] {
        bench.client.get(path).await.problem(404);
    }
    bench.client.get(&format!("sessions/{id}")).await.problem(404);
    let assets = bench.client.get("assets").await.expect(200);
    assert_eq!(assets["items"].as_array().unwrap().len(), 1, "{assets}");
    let sessions = bench.client.get("sessions").await.expect(200);
    assert_eq!(sessions["items"].as_array().unwrap().len(), 2, "{sessions}");
    bench.client.delete("assets/large").await.problem(404);
    bench.client.post("assets", &json!({ "name": "large" })).await.problem(429);
    bench.client.telemetry("b", Some("second"), &rig(700, usize::MAX)[600..]).await;
    loosen(&bench).await;
    bench.restart().await;
    eventually(|| async { (count(&bench, "asset").await == 1).then_some(()) }).await;
    assert_eq!(count(&bench, "session").await, 2);
    bench.client.asset("large").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_large_session_goes_in_pieces_and_is_hidden_at_once() {
    let mut bench = with_large().await;
    let path = |session: &Value| format!("sessions/{}", session["id"].as_str().unwrap());
    let first = path(&bench.client.session("large", "first").await);
    stuck(&bench).await;
    bench.client.delete(&first).await.problem(503);
    bench.client.get(&first).await.problem(404);
    let second = path(&bench.client.session("large", "second").await);
    bench.client.delete(&second).await.expect(204);
    loosen(&bench).await;
    bench.restart().await;
    eventually(|| async { (count(&bench, "session").await == 2).then_some(()) }).await;
    bench.client.telemetry("large", Some("first"), &rig(10, usize::MAX)).await;
}

/// A change of the database that makes it fail on an asset `bad` as if its disk were
/// full, and on nothing else.
async fn full_for_one(bench: &Bench) {
    let words = if crate::support::on_postgres() {
        "CREATE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS
         'BEGIN RAISE ''full'' USING ERRCODE = ''53100''; END';
         CREATE TRIGGER full_for_one BEFORE INSERT ON asset FOR EACH ROW
         WHEN (NEW.name = 'bad') EXECUTE FUNCTION refuse()"
    } else {
        // The largest key is taken, so the next one is SQLITE_FULL.
        "CREATE TABLE used_up (id INTEGER PRIMARY KEY AUTOINCREMENT);
         INSERT INTO used_up VALUES (9223372036854775807);
         CREATE TRIGGER full_for_one BEFORE INSERT ON asset WHEN NEW.name = 'bad'
         BEGIN INSERT INTO used_up VALUES (NULL); END"
    };
    bench.store().await.execute(words).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_change_on_which_the_database_always_fails_is_refused_and_the_others_go_on() {
    let bench = Bench::start().await;
    bench.client.asset("b").await;
    let samples = rig(300, usize::MAX);
    bench.client.telemetry("b", Some("s"), &samples[..100]).await;
    full_for_one(&bench).await;
    let mut socket = stream(&bench.client, "b").await;
    // All of it is in one group.
    let hold = bench.hold().await;
    flood(&mut socket, &samples[100..200]).await;
    let bad = tokio::spawn({
        let client = bench.client.clone();
        async move { client.post("assets", &json!({ "name": "bad" })).await }
    });
    flood(&mut socket, &samples[200..]).await;
    hold.let_go().await;
    accepted(&mut socket, 200).await;
    let problem = bad.await.unwrap().problem(503);
    assert!(problem["detail"].as_str().unwrap().contains("asset `bad`"), "{problem}");
    readiness(&bench.client, 200).await;
    bench.client.asset("good").await;
    assert_eq!(bench.client.recording("b", "s").await, samples);
}
