//! The other operations of the API over a real socket: sessions, faults, events, calibrations,
//! limits, a failing store, a graceful shutdown.

use std::collections::BTreeSet;

use crate::support::{Client, Events, ServiceFixture, batch, csv, read_csv, registration, rig};
use futures_util::{SinkExt, StreamExt};
use offbd_core::vocabulary::Sample;
use reqwest::Method;
use serde_json::{Value, json};
use sqlx::Executor;
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Message;

async fn sessions(client: &Client, asset: &str) -> Vec<Value> {
    let page = client.get(&format!("sessions?asset={asset}")).await.expect(200);
    page["items"].as_array().unwrap().clone()
}

#[tokio::test]
async fn sessions_are_listed_by_state_newest_first() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    for asset in ["a", "b"] {
        client.asset(asset).await;
        for session in ["1", "2", "3"] {
            client.telemetry(asset, Some(session), &rig(10, usize::MAX)).await;
        }
    }
    for (query, wanted) in [
        ("state=open", vec!["b3", "a3"]),
        ("state=ended", vec!["b2", "b1", "a2", "a1"]),
        ("asset=a&state=open", vec!["a3"]),
        ("asset=a&state=ended", vec!["a2", "a1"]),
        ("asset=a", vec!["a3", "a2", "a1"]),
    ] {
        let page = client.get(&format!("sessions?{query}")).await.expect(200);
        let word = |s: &Value, key: &str| s[key].as_str().unwrap().to_owned();
        let name = |s: &Value| word(s, "asset") + &word(s, "name");
        let listed: Vec<_> = page["items"].as_array().unwrap().iter().map(name).collect();
        assert_eq!(listed, wanted, "{query}");
    }
}

/// Waits until the journal is empty.
async fn wait_until_folded(store: &mut sqlx::AnyConnection) {
    loop {
        let left: i64 = sqlx::query_scalar("SELECT count(*) FROM journal")
            .fetch_one(&mut *store)
            .await
            .unwrap();
        if left == 0 {
            return;
        }
        tokio::task::yield_now().await;
    }
}

/// Returns the SQL that makes the store reject chunks of the session `id`.
fn reject_chunks_sql(id: &str) -> String {
    if crate::support::on_postgres() {
        let rule = format!("CHECK (session <> '{id}') NOT VALID");
        return format!("ALTER TABLE chunk ADD CONSTRAINT broken {rule}");
    }
    format!(
        "CREATE TRIGGER broken BEFORE INSERT ON chunk WHEN NEW.session = '{id}'
         BEGIN SELECT RAISE(ABORT, 'broken on purpose'); END"
    )
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn samples_that_the_store_rejects_are_not_acknowledged() {
    let fixture = ServiceFixture::start_with(|config| config.limits.journal_bytes = 1).await;
    let client = &fixture.client;
    client.asset("a").await;
    client.asset("b").await;
    let samples = rig(1000, 300);
    client.telemetry("a", Some("s"), &samples[..500]).await;
    let mut store = fixture.store().await;
    wait_until_folded(&mut store).await;
    let session = client.session("a", "s").await;
    let id = session["id"].as_str().unwrap();
    store.execute(sqlx::AssertSqlSafe(reject_chunks_sql(id))).await.unwrap();
    // One batch is accepted into the journal. Since the journal cannot be folded, it is the
    // last.
    assert_eq!(client.telemetry("a", Some("s"), &samples[500..600]).await["accepted"], 100);
    client.telemetry("b", Some("s"), &samples[..100]).await;
    let known = client.get("assets/a/faults?status=all").await.expect(200);
    for part in samples[600..].chunks(100) {
        let answer = client.post("assets/a/telemetry", &batch(Some("s"), part)).await;
        answer.problem(503);
        assert_eq!(answer.headers["retry-after"], "1");
    }
    // Loads the engine, whose monitors are known again then.
    client.load("a").await;
    assert_eq!(client.get("assets/a/faults?status=all").await.expect(200), known);
    client.telemetry("b", Some("s"), &samples[100..200]).await;
    assert_eq!(client.recording("a", "s").await, samples[..600]);
    let mended = if crate::support::on_postgres() {
        "ALTER TABLE chunk DROP CONSTRAINT broken"
    } else {
        "DROP TRIGGER broken"
    };
    store.execute(mended).await.unwrap();
    for part in samples[600..].chunks(100) {
        assert_eq!(client.telemetry("a", Some("s"), part).await["accepted"], 100);
    }
    assert_eq!(client.recording("a", "s").await, samples);
    let ended = client.end("a", "s").await;
    assert_eq!(ended["verdict"]["verdict_hash"], crate::support::judged("a", &samples).0);
}

#[tokio::test]
async fn small_batches_are_merged_into_few_chunks() {
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let samples = rig(9_000, 9_000);
    for part in samples.chunks(3) {
        fixture.client.telemetry("a", Some("s"), part).await;
    }
    let mut store = fixture.store().await;
    let mut chunks = async || -> i64 {
        sqlx::query_scalar("SELECT COUNT(*) FROM chunk").fetch_one(&mut store).await.unwrap()
    };
    let most = i64::try_from(offbd::store::MAX_TAIL_CHUNKS).unwrap();
    assert!(chunks().await <= most + 1, "{}", chunks().await);
    assert_eq!(fixture.client.recording("a", "s").await, samples);
    fixture.client.end("a", "s").await;
    assert_eq!(chunks().await, 2);
    assert_eq!(fixture.client.recording("a", "s").await, samples);
}

#[tokio::test]
async fn a_second_service_cannot_open_the_store() {
    let fixture = ServiceFixture::start().await;
    let second = offbd::server::start(crate::support::config(fixture.data.path())).await;
    let error = format!("{:#}", second.err().expect("the store is locked"));
    assert!(error.contains("another process"), "{error}");
}

/// The lock is that of the file, and nobody else can read it.
#[cfg(unix)]
#[tokio::test]
async fn two_stores_in_one_directory_do_not_lock_each_other() {
    use std::os::unix::fs::PermissionsExt;
    let data = tempfile::tempdir().unwrap();
    let start = async |name: &str| {
        let mut config =
            offbd::config::Config { data: data.path().to_owned(), ..Default::default() };
        config.database = Some(format!("sqlite:{}", data.path().join(name).display()));
        config.listen.set_port(0);
        offbd::server::start(config).await.unwrap()
    };
    let servers = [start("a.db").await, start("a.sqlite").await];
    let lock = std::fs::metadata(data.path().join("a.db.lock")).unwrap();
    assert_eq!(lock.permissions().mode() & 0o777, 0o600);
    for server in servers {
        server.shutdown().await.unwrap();
    }
}

/// The store has no error to tell of then.
#[tokio::test]
async fn a_replay_of_a_session_that_is_deleted_meanwhile_is_not_stored() {
    use offbd::store::{ChangeSet, Location, ReplayRow, Store, Write};
    let data = tempfile::tempdir().unwrap();
    let location = Location::of_url(&crate::support::url(data.path())).unwrap();
    let (store, mut writer) = Store::open(&location).await.unwrap();
    let replay = ReplayRow {
        id: "replay".to_owned(),
        session: "gone".to_owned(),
        state: "queued".to_owned(),
        settings: "{}".to_owned(),
        created_at: 1,
        finished_at: None,
        result: None,
        error: None,
    };
    let mut set = vec![Write::PutReplay(replay)];
    writer.commit(&mut [ChangeSet::unpartitioned(&mut set)]).await.unwrap();
    assert!(store.replay("replay").await.unwrap().is_none());
    writer.close().await.unwrap();
}

#[tokio::test]
async fn an_auxiliary_writer_can_write_while_the_service_runs() {
    use offbd::store::{ChangeSet, Location, Store, Write};
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let location = Location::of_url(&crate::support::url(fixture.data.path())).unwrap();
    let (store, mut writer) = Store::open_auxiliary(&location).await.unwrap();
    let mut row = store.asset("a").await.unwrap().unwrap();
    row.name = "b".to_owned();
    for _ in 0..2 {
        let name = row.name.clone();
        let mut set = vec![
            Write::CreateAsset(row.clone()),
            Write::HideAsset { name: name.clone(), at: 1 },
            Write::DeleteAsset { name },
        ];
        writer.commit(&mut [ChangeSet::unpartitioned(&mut set)]).await.unwrap();
        fixture.client.telemetry("a", None, &rig(10, 10)).await;
    }
    writer.close().await.unwrap();
    fixture.client.get("/readyz").await.expect(200);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn batches_above_the_limit_in_flight_get_429_and_nothing_is_lost() {
    let fixture = ServiceFixture::start_with(|config| {
        config.limits.batch_samples = 50;
        config.limits.in_flight_samples = 100;
    })
    .await;
    let client = fixture.client.clone();
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(1, 1)).await;
    let samples = rig(400, 400);
    let lock = fixture.lock_store().await;
    let send = |part: &[Sample]| {
        let (client, body) = (client.clone(), batch(Some("s"), part));
        tokio::spawn(async move { client.post("assets/a/telemetry", &body).await })
    };
    let mut sent: Vec<_> = samples.chunks(50).map(send).collect();
    // The store is locked, so no batch is acknowledged: six of the eight batches must be
    // rejected at once, and the two in flight wait.
    let mut rejected = 0;
    while rejected < 6 {
        let (answer, _, rest) = futures_util::future::select_all(sent).await;
        let answer = answer.unwrap();
        let problem = answer.problem(429);
        assert_eq!(problem["type"], "urn:offbd:problem:busy");
        assert_eq!(answer.headers["retry-after"], "1");
        (sent, rejected) = (rest, rejected + 1);
    }
    lock.release().await;
    for waiting in sent {
        waiting.await.unwrap().expect(200);
    }
    for part in samples.chunks(50) {
        client.telemetry("a", Some("s"), part).await;
    }
    let recorded: BTreeSet<u64> =
        client.recording("a", "s").await.iter().filter_map(|s| s.seq).collect();
    assert_eq!(recorded.len(), 400);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_shutdown_completes_batches_in_flight() {
    let mut fixture = ServiceFixture::start().await;
    let client = fixture.client.clone();
    client.asset("a").await;
    let samples = rig(200, 200);
    client.telemetry("a", Some("s"), &samples[..100]).await;
    let events = client.request(Method::GET, "events").send().await.unwrap();
    let url = format!("ws://{}/api/v1/assets/a/stream", client.address);
    let (mut socket, _) = connect_async(url).await.unwrap();
    let lock = fixture.lock_store().await;
    socket.send(Message::text(batch(Some("s"), &samples[100..]).to_string())).await.unwrap();
    // The batch has been judged but not stored.
    crate::support::eventually(|| async {
        let state = client.get("assets/a/state").await;
        (state.status == 200 && state.json()["samples"] == 200).then_some(())
    })
    .await;
    let stopping = tokio::spawn(fixture.server.take().unwrap().shutdown());
    lock.release().await;
    let mut acknowledged = false;
    while let Some(Ok(frame)) = socket.next().await {
        match frame {
            Message::Text(text) => acknowledged |= text.contains("\"accepted\":100"),
            Message::Close(_) => break,
            _ => {}
        }
    }
    assert!(acknowledged);
    stopping.await.unwrap().unwrap();
    assert!(events.text().await.is_ok(), "the stream of events ends without an error");
    let server = offbd::server::start(crate::support::config(fixture.data.path())).await.unwrap();
    let client = Client::new(server.address.to_string());
    assert_eq!(client.recording("a", "s").await, samples);
    server.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn missed_events_are_sent_first_and_each_event_once() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    client.asset("b").await;
    let samples = rig(2000, 300);
    let all = client.request(Method::GET, "events?after=0").send().await.unwrap();
    assert_eq!(all.headers()["content-type"], "text/event-stream");
    let mut live = Events::new(all);
    client.telemetry("a", Some("s"), &samples[..1000]).await;
    client.telemetry("b", Some("s"), &samples[..1000]).await;
    client.end("a", "s").await;
    client.end("b", "s").await;
    assert_eq!(live.any().await, ("begin".to_owned(), json!({"id":0})));
    let first = live.next().await;
    let id = first["id"].as_i64().unwrap();
    let request = client.request(Method::GET, "events?asset=b").header("last-event-id", id);
    let mut caught_up = Events::new(request.send().await.unwrap());
    assert_eq!(
        caught_up.any().await,
        ("begin".to_owned(), json!({"id":id})),
        "the event after which the stream continues"
    );
    let of_b = caught_up.next().await;
    assert_eq!((&of_b["asset"], &of_b["type"]), (&json!("b"), &json!("fault")));
    let mut ids = vec![id];
    loop {
        let event = live.next().await;
        ids.push(event["id"].as_i64().unwrap());
        if event["id"] == of_b["id"] {
            assert_eq!(event, of_b, "live and missed events are equal");
            break;
        }
    }
    assert!(ids.windows(2).all(|pair| pair[0] < pair[1]), "{ids:?}");
    client.telemetry("b", Some("t"), &samples).await;
    let mut last = of_b["id"].as_i64().unwrap();
    for _ in 0..2 {
        let event = caught_up.next().await;
        assert_eq!(event["asset"], "b");
        assert!(event["id"].as_i64().unwrap() > last);
        last = event["id"].as_i64().unwrap();
    }
}

fn without_seq(samples: &[Sample], shift_s: f64) -> Vec<Sample> {
    samples.iter().map(|s| Sample { seq: None, t_s: s.t_s + shift_s, ..*s }).collect()
}

#[tokio::test]
async fn samples_without_a_session_name_are_assigned_to_a_session() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let samples = rig(3000, 3000);
    let first = client.telemetry("a", None, &samples[..2000]).await;
    let second = client.telemetry("a", None, &samples[2000..]).await;
    assert_eq!(first["session_id"], second["session_id"]);
    let again = client.telemetry("a", None, &samples[..1000]).await;
    assert_eq!(again["duplicate"], 1000, "a repeated batch does not open a session");
    let mut restarted = rig(500, 500);
    restarted.iter_mut().for_each(|s| s.x_m = s.x_m.map(|x| x + 0.001));
    let ack = client.telemetry("a", None, &restarted).await;
    assert_eq!((&ack["accepted"], &ack["late"]), (&json!(500), &json!([])));
    assert_ne!(ack["session_id"], first["session_id"]);
    let found = sessions(client, "a").await;
    let states: Vec<_> = found.iter().map(|s| s["state"].as_str().unwrap()).collect();
    assert_eq!(states, ["open", "ended"]);
    assert_eq!(found[1]["samples"], 3000);
}

#[tokio::test]
async fn a_restarted_device_without_sequence_numbers_gets_a_new_session() {
    let mut fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let samples = rig(3000, 3000);
    fixture.client.telemetry("a", None, &without_seq(&samples, 100.0)).await;
    // A single sample with a wrong time does not count as a restart of the device.
    fixture.client.telemetry("a", None, &without_seq(&samples[..1], 0.0)).await;
    fixture.client.telemetry("a", None, &without_seq(&samples[..1], 130.0)).await;
    assert_eq!(sessions(&fixture.client, "a").await.len(), 1);
    fixture.client.telemetry("a", None, &without_seq(&samples[10..11], 0.0)).await;
    fixture.restart().await;
    let ack = fixture.client.telemetry("a", None, &without_seq(&samples[11..500], 0.0)).await;
    assert_eq!((&ack["accepted"], &ack["late"]), (&json!(489), &json!([])), "{ack}");
    assert_eq!(sessions(&fixture.client, "a").await.len(), 2);
}

#[tokio::test]
async fn faults_can_be_listed_acknowledged_and_cleared() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let samples = rig(2000, 300);
    for asset in ["a", "b", "c"] {
        client.asset(asset).await;
        client.telemetry(asset, Some("s"), &samples).await;
    }
    let fault = client.get("assets/a/faults/x_servo").await.expect(200);
    assert_eq!((&fault["status"], &fault["acknowledged"]), (&json!("confirmed"), &json!(false)));
    assert!(fault["freeze_frame"].is_object() && fault["onset_s"].is_number(), "{fault}");
    let path = "assets/a/faults/x_servo/acknowledge?by=ann";
    assert_eq!(client.post(path, &Value::Null).await.expect(200)["acknowledged"], true);
    let open = client.get("faults?code=x_servo&acknowledged=false&sort=asset").await.expect(200);
    let assets = |page: &Value| -> Vec<String> {
        let items = page["items"].as_array().unwrap();
        items.iter().map(|f| f["asset"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(assets(&open), ["b", "c"]);
    let mut seen = Vec::new();
    let mut cursor = String::new();
    loop {
        let page = client.get(&format!("faults?code=x_servo&limit=1{cursor}")).await.expect(200);
        seen.extend(assets(&page));
        let Some(next) = page["next"].as_str() else { break };
        cursor = format!("&cursor={next}");
    }
    assert_eq!(seen.len(), 3);
    assert_eq!(seen.iter().collect::<BTreeSet<_>>().len(), 3);
    client.delete("assets/a/faults/x_servo?by=ann").await.expect(204);
    let cleared = client.get("assets/a/faults/x_servo").await.expect(200);
    assert_eq!((&cleared["status"], &cleared["occurrences"]), (&json!("cleared"), &json!(0)));
    assert_eq!(client.get("assets/c/faults?status=all").await.expect(200)["next"], Value::Null);
    assert_eq!(client.get("assets/a/faults/sensor").await.expect(200)["status"], "cleared");
}

#[tokio::test]
async fn a_cleared_fault_stays_cleared_after_a_restart() {
    let mut fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    fixture.client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    fixture.client.delete("assets/a/faults/x_servo").await.expect(204);
    let before = fixture.client.get("assets/a/faults?status=all").await.expect(200);
    let state = fixture.client.get("assets/a/state").await.expect(200);
    fixture.restart().await;
    fixture.client.load("a").await;
    assert_eq!(fixture.client.get("assets/a/state").await.expect(200), state);
    assert_eq!(fixture.client.get("assets/a/faults?status=all").await.expect(200), before);
    fixture.client.telemetry("a", Some("t"), &rig(2000, 300)).await;
    fixture.client.end("a", "t").await;
    assert!(
        !fixture.client.get("assets/a/faults").await.expect(200)["items"]
            .as_array()
            .unwrap()
            .is_empty()
    );
    for code in ["x_servo", "y_servo", "stuck_ball", "sensor"] {
        fixture.client.delete(&format!("assets/a/faults/{code}")).await.expect(204);
    }
    fixture.restart().await;
    assert_eq!(fixture.client.get("assets/a/faults").await.expect(200)["items"], json!([]));
}

#[tokio::test]
async fn assets_can_be_created_changed_and_deleted() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let new = client.put("assets/a", &json!({"name":"a"})).await.expect(201);
    assert_eq!(new["sample_rate_hz"], 100.0);
    client.telemetry("a", Some("one"), &rig(100, 100)).await;
    let heavy = json!({"name":"a","ball":{"mass_kg":0.2}});
    client.put("assets/a", &heavy).await.expect(200);
    assert_eq!(client.get("assets/a").await.expect(200)["ball"]["mass_kg"], 0.2);
    let session = client.session("a", "one").await;
    assert_eq!(session["state"], "open", "an open session continues");
    for name in ["b", "c", "d"] {
        client.asset(name).await;
    }
    let page = client.get("assets?limit=2").await.expect(200);
    let next = page["next"].as_str().unwrap();
    let rest = client.get(&format!("assets?limit=2&cursor={next}")).await.expect(200);
    assert_eq!((&rest["items"][0]["name"], &rest["next"]), (&json!("c"), &Value::Null));
    client.delete("assets/a").await.expect(204);
    client.get("assets/a").await.problem(404);
    client.get(&format!("sessions/{}", session["id"].as_str().unwrap())).await.problem(404);
    client.post("assets/a/telemetry", &batch(None, &rig(1, 1))).await.problem(404);
    client.asset("a").await;
    let ack = client.telemetry("a", Some("one"), &rig(100, 100)).await;
    assert_eq!(ack["accepted"], 100, "a new asset of the same name has no data of the old one");
}

#[tokio::test]
async fn sessions_can_be_opened_ended_exported_and_deleted() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let opened = client.post("assets/a/sessions", &json!({"name":"Mäandern 1"})).await;
    let session = opened.expect(201);
    let at = format!("sessions/{}", session["id"].as_str().unwrap());
    assert_eq!(opened.headers["location"], format!("/api/v1/{at}"));
    let samples = rig(20_000, 20_000);
    for part in samples.chunks(9_000) {
        client.telemetry("a", None, part).await;
    }
    assert_eq!(client.get(&at).await.expect(200)["samples"], 20_000);
    assert_eq!(client.recording("a", "Mäandern 1").await, samples);
    let packed = client.request(Method::GET, &format!("{at}/telemetry"));
    let packed = packed.header("accept-encoding", "gzip").send().await.unwrap();
    assert_eq!(packed.headers()["content-encoding"], "gzip");
    assert!(packed.bytes().await.is_ok(), "a compressed response is complete");
    let request = client.request(Method::GET, &format!("{at}/telemetry"));
    let exported = client.send(request.header("accept", "application/json")).await.expect(200);
    assert_eq!(exported["session"], "Mäandern 1");
    assert_eq!(exported["samples"].as_array().unwrap().len(), 20_000);
    // An export can be sent again unchanged.
    let again =
        json!({"session":"Mäandern 1","samples":&exported["samples"].as_array().unwrap()[..500]});
    assert_eq!(client.post("assets/a/telemetry", &again).await.expect(200)["duplicate"], 500);
    let ended = client.post(&format!("{at}/end"), &Value::Null).await.expect(200);
    assert_eq!(client.post(&format!("{at}/end"), &Value::Null).await.expect(200), ended);
    client.delete(&at).await.expect(204);
    client.get(&at).await.problem(404);
    client.get(&format!("{at}/telemetry")).await.problem(404);
    client.post("assets/a/sessions", &json!({"name":"Mäandern 1"})).await.expect(201);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn many_concurrent_streams_lose_nothing() {
    let fixture = ServiceFixture::start().await;
    let samples = rig(2000, 2000);
    let mut streams = tokio::task::JoinSet::new();
    for i in 0..8 {
        let asset = format!("rig{i}");
        fixture.client.asset(&asset).await;
        let (address, samples) = (fixture.client.address.clone(), samples.clone());
        streams.spawn(async move {
            let url = format!("ws://{address}/api/v1/assets/{asset}/stream");
            let (socket, _) = connect_async(url).await.unwrap();
            let (mut up, mut down) = socket.split();
            let sending = tokio::spawn(async move {
                for part in samples.chunks(5) {
                    up.send(Message::text(batch(Some("s"), part).to_string())).await.unwrap();
                }
                up
            });
            let mut accepted = 0;
            while accepted < 2000 {
                let Message::Text(text) = down.next().await.unwrap().unwrap() else { continue };
                let frame: Value = serde_json::from_str(&text).unwrap();
                accepted += frame["accepted"].as_u64().unwrap_or(0);
            }
            drop(sending.await.unwrap());
        });
    }
    while let Some(done) = streams.join_next().await {
        done.unwrap();
    }
    for i in 0..8 {
        assert_eq!(fixture.client.recording(&format!("rig{i}"), "s").await, samples);
    }
}

#[tokio::test]
async fn a_frame_that_is_too_long_ends_only_its_stream() {
    let fixture = ServiceFixture::start_with(|config| config.limits.batch_bytes = 10_000).await;
    fixture.client.asset("a").await;
    let url = format!("ws://{}/api/v1/assets/a/stream", fixture.client.address);
    let (mut socket, _) = connect_async(url).await.unwrap();
    socket.send(Message::text("x".repeat(5_000))).await.unwrap();
    let text = loop {
        if let Message::Text(text) = socket.next().await.unwrap().unwrap() {
            break text;
        }
    };
    assert_eq!(serde_json::from_str::<Value>(&text).unwrap()["type"], "error");
    let _ = socket.send(Message::text("x".repeat(20_000))).await;
    while let Some(Ok(frame)) = socket.next().await {
        if let Message::Close(Some(frame)) = frame {
            assert_eq!(u16::from(frame.code), 1009);
        }
    }
    fixture.client.telemetry("a", None, &rig(10, 10)).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rig_can_be_calibrated_from_its_sessions() {
    let mut fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let import = |name: &str| format!("assets/a/sessions/import?name={name}");
    let good = csv(&rig(9000, 9000));
    fixture.client.post_text(&import("good"), "text/csv", good).await.expect(201);
    fixture.client.post_text(&import("short"), "text/csv", csv(&rig(50, 50))).await.expect(201);
    let mut ids = Vec::new();
    for name in ["good", "short"] {
        let session = fixture.client.session("a", name).await;
        let wanted = json!({ "sessions": [session["id"]] });
        let answer = fixture.client.post("assets/a/calibrations?by=ann", &wanted).await;
        let id = answer.expect(202)["id"].as_str().unwrap().to_owned();
        assert_eq!(answer.headers["location"], format!("/api/v1/assets/a/calibrations/{id}"));
        ids.push(format!("assets/a/calibrations/{id}"));
    }
    fixture.restart().await;
    let client = &fixture.client;
    let mut jobs = Vec::new();
    for path in &ids {
        jobs.push(
            crate::support::eventually(|| async {
                let job = client.get(path).await.expect(200);
                let state = job["state"].as_str().unwrap();
                (state == "done" || state == "failed").then_some(job)
            })
            .await,
        );
    }
    assert_eq!(jobs[0]["state"], "done", "{}", jobs[0]);
    assert_eq!(jobs[1]["state"], "failed");
    assert!(jobs[1]["error"].as_str().unwrap().contains("are needed"), "{}", jobs[1]);
    client.post(&format!("{}/activate", ids[1]), &Value::Null).await.problem(409);
    let activate = format!("{}/activate?by=bob", ids[0]);
    let active = client.post(&activate, &Value::Null).await.expect(200);
    assert_eq!(active["active"], true);
    assert_eq!((&active["made_by"], &active["activated_by"]), (&json!("ann"), &json!("bob")));
    assert!(active["activated_at"].as_str() >= active["made_at"].as_str(), "{active}");
    let asset = client.get("assets/a").await.expect(200);
    let learnt = &asset["calibration"];
    assert_eq!(learnt["data_sha256"], active["calibration"]["data_sha256"]);
    let page = client.get("assets/a/calibrations").await.expect(200);
    assert_eq!(page["items"].as_array().unwrap().len(), 2);
    assert_eq!(page["items"][1], active);
    assert_eq!(page["items"][0]["activated_by"], Value::Null);
    client.put("assets/a", &json!({"name":"a"})).await.expect(200);
    let replaced = client.get(&ids[0]).await.expect(200);
    assert_eq!((&replaced["active"], &replaced["activated_by"]), (&json!(false), &json!("bob")));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_session_keeps_the_calibration_of_its_start() {
    let mut fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    fixture.client.telemetry("a", Some("learnt"), &rig(100, 100)).await;
    let learnt = registration("a")["calibration"].clone();
    // From now on the rig is not learnt; the open session is judged as before.
    fixture.client.put("assets/a", &json!({ "name": "a" })).await.expect(200);
    fixture.restart().await;
    let client = &fixture.client;
    let of = async |name: &str| {
        let id = client.session("a", name).await["id"].as_str().unwrap().to_owned();
        client.get(&format!("sessions/{id}/calibration")).await.expect(200)["calibration"].clone()
    };
    let kept = of("learnt").await;
    assert_eq!((&kept["id"], &kept["certificate"]), (&learnt["id"], &learnt["certificate"]));
    client.telemetry("a", Some("later"), &rig(100, 100)).await;
    assert_eq!((of("later").await, of("learnt").await), (Value::Null, kept));
    client.get("sessions/nonsense/calibration").await.problem(404);
}

#[tokio::test]
async fn health_metrics_description_and_pages_are_served() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    client.telemetry("a", None, &rig(10, 10)).await;
    let health = client.get("/healthz").await.expect(200);
    assert_eq!(health["status"], "ok");
    let has = |name: &str| health["features"].as_array().unwrap().iter().any(|each| each == name);
    assert_eq!(has("email"), cfg!(feature = "email"), "{health}");
    assert_eq!(has("parquet"), cfg!(feature = "parquet"), "{health}");
    assert_eq!(client.get("/readyz").await.expect(200)["status"], "ok");
    let metrics = client.get("/metrics").await.text;
    assert!(metrics.contains("offbd_samples_total{outcome=\"accepted\"}"), "{metrics}");
    assert!(metrics.contains("path=\"/api/v1/assets/{asset}/telemetry\""), "{metrics}");
    let yaml = client.get("/openapi.yaml").await;
    assert_eq!(yaml.text, offbd::http::openapi_yaml());
    let schema = client.get("/asset.schema.json").await;
    assert_eq!(schema.headers["content-type"], "application/schema+json");
    assert_eq!(schema.text, offbd::http::asset_schema());
    let docs = client.get("/docs/").await;
    assert!(docs.status == 200 && docs.text.contains("swagger"), "{docs:?}");
    let page = client.get("/").await;
    assert!(page.headers["content-type"].to_str().unwrap().starts_with("text/html"));
    assert!(
        !page.text.contains("http://") && !page.text.contains("https://"),
        "the page loads nothing from other hosts"
    );
    let request = client.request(Method::GET, "/openapi.yaml").header("accept-encoding", "gzip");
    assert_eq!(request.send().await.unwrap().headers()["content-encoding"], "gzip");
    let request = client.request(Method::GET, "/healthz").header("x-request-id", "mine");
    assert_eq!(request.send().await.unwrap().headers()["x-request-id"], "mine");
}

/// Replays the session `id` with `settings` and returns the result.
async fn run_replay(client: &Client, id: &str, settings: Value) -> Value {
    let answer = client.post(&format!("sessions/{id}/replays"), &settings).await.expect(202);
    let path = format!("replays/{}", answer["id"].as_str().unwrap());
    crate::support::eventually(|| async {
        let replay = client.get(&path).await.expect(200);
        assert_ne!(replay["state"], "failed", "{replay}");
        (replay["state"] == "done").then(|| replay["result"].clone())
    })
    .await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_replay_reports_the_differences_caused_by_other_settings() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let import = |name: &str| format!("assets/a/sessions/import?name={name}");
    client.post_text(&import("good"), "text/csv", csv(&rig(9000, 9000))).await.expect(201);
    client.post_text(&import("sick"), "text/csv", csv(&rig(3000, 1500))).await.expect(201);
    let good = client.session("a", "good").await["id"].clone();
    let learning = client.post("assets/a/calibrations", &json!({ "sessions": [good] })).await;
    let path = format!("assets/a/calibrations/{}", learning.expect(202)["id"].as_str().unwrap());
    let learnt = crate::support::eventually(|| async {
        let job = client.get(&path).await.expect(200);
        (job["state"] == "done").then_some(job)
    })
    .await;
    let sick = client.session("a", "sick").await["id"].as_str().unwrap().to_owned();
    let recorded = client.get("assets/a/faults/x_servo").await.expect(200);

    let same = run_replay(client, &sick, json!({})).await;
    let n_faults = same["faults"].as_array().unwrap().len();
    assert_eq!(same["tally"]["same"], n_faults);
    assert_eq!(same["transitions"].as_array().unwrap().len(), n_faults);
    assert_eq!((&same["same"], &same["differences"]), (&json!(true), &json!([])));
    assert_eq!(same["settings_id"], recorded["last_occurrence"]["settings_id"]);

    let slow = run_replay(client, &sick, json!({ "debounce_s": 1.1 })).await;
    let failed = slow["transitions"].as_array().unwrap();
    let failed = failed.iter().find(|t| t["code"] == "x_servo").unwrap();
    assert_eq!(failed["change"], "moved", "{failed}");
    assert!(failed["moved_s"].as_f64().unwrap() > 0.3, "{failed}");
    assert_ne!(slow["settings_id"], same["settings_id"]);
    let lines = slow["differences"].as_array().unwrap();
    let line = lines.iter().find(|d| d["recorded"]["code"] == "x_servo").unwrap();
    assert_eq!((&line["change"], &line["moved_s"]), (&failed["change"], &failed["moved_s"]));
    assert_eq!(line["replayed"]["t_s"], failed["replayed_t_s"]);

    for id in [&learnt["id"], &learnt["calibration"]["id"]] {
        let on_learnt = run_replay(client, &sick, json!({ "calibration": id })).await;
        assert_eq!(on_learnt["calibration_id"], learnt["calibration"]["id"]);
        assert_ne!(on_learnt["faults"][0]["evidence"], same["faults"][0]["evidence"]);
        assert_eq!(on_learnt["faults"][0]["calibration_id"], learnt["calibration"]["id"]);
    }
    for (settings, pointer) in [
        (json!({ "calibration": "none such" }), "/calibration"),
        (json!({ "debounce_s": -1 }), "/debounce_s"),
        (json!({ "false_alarms_per_rig_year": 0 }), "/false_alarms_per_rig_year"),
        (json!({ "asset": { "ball": { "mass_kg": -1 } } }), "/asset/ball/mass_kg"),
    ] {
        let answer = client.post(&format!("sessions/{sick}/replays"), &settings).await;
        assert_eq!(answer.problem(422)["pointer"], pointer);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_learnt_rig_has_a_drive_cycle() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.post("assets", &registration("a")).await.expect(201);
    let cycle = client.get("assets/a/drive-cycle").await.expect(200);
    assert_eq!((&cycle["asset"], cycle["faults"].as_array().unwrap().len()), (&json!("a"), 9));
    let times = cycle["rows"]["t_s"].as_array().unwrap();
    assert!(times.last().unwrap().as_f64() >= cycle["duration_s"].as_f64());

    let request = client.request(Method::GET, "assets/a/drive-cycle").header("accept", "text/csv");
    let answer = client.send(request).await;
    let name = "attachment; filename=\"a-drive-cycle.csv\"";
    assert_eq!(
        (answer.status.as_u16(), &answer.headers["content-disposition"]),
        (200, &name.parse().unwrap())
    );
    let rows = read_csv(&answer.text);
    assert_eq!(rows.len(), times.len());
    assert_eq!(json!(rows[7].cmd_qy_rad), cycle["rows"]["cmd_qy_rad"][7]);

    client.post("assets", &json!({ "name": "new" })).await.expect(201);
    let problem = client.get("assets/new/drive-cycle").await.problem(409);
    assert!(problem["detail"].as_str().unwrap().contains("not calibrated"), "{problem}");
    assert_eq!(problem["type"], "urn:offbd:problem:no-drive-cycle");
    client.get("assets/nobody/drive-cycle").await.problem(404);
}
