//! Damaged and missing data are never served as samples, and an import is there or not.

mod bits;
mod pages;

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use crate::support::process::Process;
use crate::support::{Client, ServiceFixture, config, csv, eventually, on_postgres, rig};
use offbd_core::vocabulary::Sample;
use reqwest::Method;
use serde_json::{Value, json};
use sqlx::AnyConnection;

/// Reads a whole response; `None` if it breaks off.
async fn body(client: &Client, path: &str, kind: &str) -> Option<String> {
    let response = client.request(Method::GET, path).header("accept", kind).send().await.unwrap();
    assert!(response.status() == 200 || response.status() == 500, "{}", response.status());
    let is_ok = response.status() == 200;
    response.text().await.ok().filter(|_| is_ok)
}

async fn set_data(db: &mut AnyConnection, first_index: i64, data: &[u8]) {
    sqlx::query("UPDATE chunk SET data = $2 WHERE first_index = $1")
        .bind(first_index)
        .bind(data)
        .execute(db)
        .await
        .unwrap();
}

#[tokio::test]
async fn a_damaged_recording_is_not_served() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let samples = rig(9000, 9000);
    for part in samples.chunks(3000) {
        client.telemetry("a", Some("s"), part).await;
    }
    let id = client.end("a", "s").await["id"].as_str().unwrap().to_owned();
    let path = format!("sessions/{id}/telemetry");
    let exports = async || {
        let mut broken = Vec::new();
        for kind in ["text/csv", "application/json"] {
            broken.push(body(client, &path, kind).await.is_none());
        }
        broken
    };
    assert_eq!(exports().await, [false, false]);
    let mut db = fixture.store().await;
    let (first_index, data): (i64, Vec<u8>) =
        sqlx::query_as("SELECT first_index, data FROM chunk ORDER BY first_index DESC LIMIT 1")
            .fetch_one(&mut db)
            .await
            .unwrap();
    assert!(first_index > 0, "there are several chunks");
    // One bit in each of 64 places.
    for place in 0..64 {
        let mut changed = data.clone();
        let bit = place * 8 * data.len() / 64;
        changed[bit / 8] ^= 1 << (bit % 8);
        set_data(&mut db, first_index, &changed).await;
        assert_eq!(exports().await, [true, true], "bit {bit} of {} bytes", data.len());
    }
    // A replay names the damage, and is not a verdict on a part.
    let replay = client.post(&format!("sessions/{id}/replays"), &json!({})).await.expect(202);
    let replay_path = format!("replays/{}", replay["id"].as_str().unwrap());
    let done = eventually(async || {
        let replay = client.get(&replay_path).await.expect(200);
        (replay["state"] == "failed" || replay["state"] == "done").then_some(replay)
    })
    .await;
    assert_eq!(done["state"], "failed");
    assert!(done["error"].as_str().unwrap().contains("damaged"), "{done}");
    set_data(&mut db, first_index, &data).await;
    assert_eq!(exports().await, [false, false]);
    // A chunk in the wrong place, and a missing one.
    for sql in [
        "UPDATE chunk SET first_index = first_index - 1 WHERE first_index > 0",
        "DELETE FROM chunk WHERE first_index > 0",
    ] {
        sqlx::query(sql).execute(&mut db).await.unwrap();
        assert_eq!(exports().await, [true, true], "{sql}");
    }
}

/// Imports `n` samples; returns the id of the session.
async fn import(client: &Client, n: usize) -> String {
    let path = "assets/a/sessions/import?name=long";
    let view = client.post_text(path, "text/csv", csv(&rig(n, n))).await.expect(201);
    view["session"]["id"].as_str().unwrap().to_owned()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_export_of_a_session_that_is_deleted_breaks_off() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    for (kind, is_deleted) in [("text/csv", false), ("text/csv", true), ("application/json", true)]
    {
        let id = import(client, 200_000).await;
        let request = client.request(Method::GET, &format!("sessions/{id}/telemetry"));
        let mut response = request.header("accept", kind).send().await.unwrap();
        assert_eq!(response.status(), 200);
        let first = response.chunk().await.unwrap().unwrap();
        assert!(!first.is_empty());
        if is_deleted {
            client.delete(&format!("sessions/{id}")).await.expect(204);
        }
        let outcome = loop {
            match response.chunk().await {
                Ok(Some(_)) => {}
                Ok(None) => break "complete",
                Err(_) => break "broken off",
            }
        };
        assert_eq!(outcome, if is_deleted { "broken off" } else { "complete" }, "{kind}");
        client.delete(&format!("sessions/{id}")).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_import_that_is_killed_leaves_nothing() {
    let data = tempfile::tempdir().unwrap();
    let mut process = Process::start(data.path());
    process.client.asset("a").await;
    let before: Vec<Sample> = rig(300, 300);
    process.client.telemetry("a", Some("before"), &before).await;
    let samples = rig(400_000, 2000);
    let path = "assets/a/sessions/import?name=monday";
    let sending = tokio::spawn({
        let (client, body) = (process.client.clone(), csv(&samples));
        async move {
            let request = client.request(Method::POST, path).header("content-type", "text/csv");
            request.body(body).send().await.map(|response| response.status())
        }
    });
    let sessions = async |client: &Client| -> Vec<Value> {
        client.get("sessions?asset=a").await.expect(200)["items"].as_array().unwrap().clone()
    };
    eventually(async || {
        let first = sessions(&process.client).await[0].clone();
        (first["name"] == "monday" && first["samples"].as_u64() > Some(10_000)).then_some(())
    })
    .await;
    drop(process);
    assert!(sending.await.unwrap().is_err(), "the import was interrupted");
    process = Process::start(data.path());
    let client = &process.client;
    let names =
        |found: &[Value]| -> Vec<Value> { found.iter().map(|s| s["name"].clone()).collect() };
    assert_eq!(names(&sessions(client).await), ["before"]);
    let faults = client.get("assets/a/faults?status=all").await.expect(200);
    let statuses = faults["items"].as_array().unwrap().iter().map(|fault| &fault["status"]);
    assert!(
        statuses.into_iter().all(|status| status == "healed" || status == "cleared"),
        "{faults}"
    );
    // Live samples have their own session, and the file can be imported again.
    client.telemetry("a", Some("live"), &before).await;
    let short = csv(&samples[..6000]);
    let again = eventually(async || {
        let answer = client.post_text(path, "text/csv", short.clone()).await;
        (answer.status == 201).then_some(answer)
    });
    let again = tokio::time::timeout(Duration::from_secs(30), again).await.unwrap();
    assert_eq!(again.json()["accepted"], 6000);
    assert_eq!(names(&sessions(client).await), ["monday", "live", "before"]);
    let fault = client.get("assets/a/faults/x_servo").await.expect(200);
    assert_eq!(fault["status"], "confirmed", "{fault}");
}

/// Runs `offbd check` on the store in `data`; returns its exit status and what it prints.
fn check(data: &Path) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_offbd"));
    command.arg("check").arg("--data").arg(data);
    command.args(config(data).database.iter().flat_map(|url| ["--database", url]));
    let output = command.output().unwrap();
    (output.status.code(), String::from_utf8(output.stdout).unwrap())
}

#[tokio::test]
async fn a_check_of_the_store_names_what_is_damaged() {
    let mut fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let samples = rig(9000, 2000);
    for part in samples.chunks(3000) {
        client.telemetry("a", Some("s"), part).await;
    }
    let ended = client.end("a", "s").await["id"].as_str().unwrap().to_owned();
    client.telemetry("a", Some("open"), &samples[..500]).await;
    let open = client.session("a", "open").await["id"].as_str().unwrap().to_owned();
    let data = fixture.data.path().to_owned();
    // While the service runs; 500 samples are in the journal.
    let (status, printed) = check(&data);
    assert_eq!(status, Some(0), "{printed}");
    assert!(printed.contains("2 sessions, 9500 samples"), "{printed}");
    let mut db = fixture.store().await;
    let (journal,): (Vec<u8>,) =
        sqlx::query_as("SELECT data FROM journal ORDER BY id DESC LIMIT 1")
            .fetch_one(&mut db)
            .await
            .unwrap();
    let flip = |data: &[u8]| {
        let mut data = data.to_vec();
        let middle = data.len() / 2;
        data[middle] ^= 4;
        data
    };
    let (chunk,): (Vec<u8>,) = sqlx::query_as("SELECT data FROM chunk WHERE first_index = 0")
        .fetch_one(&mut db)
        .await
        .unwrap();
    let set = "UPDATE chunk SET data = $1 WHERE first_index = 0";
    let set_journal = "UPDATE journal SET data = $1 WHERE id = (SELECT MAX(id) FROM journal)";
    for (sql, good, name) in [(set, &chunk, &ended), (set_journal, &journal, &open)] {
        sqlx::query(sql).bind(flip(good)).execute(&mut db).await.unwrap();
        let (status, printed) = check(&data);
        assert_eq!(status, Some(1), "{printed}");
        assert!(printed.contains("damaged"), "{printed}");
        assert!(sql == set_journal || printed.contains(name.as_str()), "{printed}");
        sqlx::query(sql).bind(good).execute(&mut db).await.unwrap();
        assert_eq!(check(&data).0, Some(0));
    }
    // Each of these is one finding, by its name.
    for (damage, repair, finding) in [
        (
            "UPDATE chunk SET first_index = 5999 WHERE first_index = 6000",
            "UPDATE chunk SET first_index = 6000 WHERE first_index = 5999",
            "chunk 5999 of session",
        ),
        (
            "UPDATE chunk SET min_t_s = min_t_s - 1 WHERE first_index = 6000",
            "UPDATE chunk SET min_t_s = min_t_s + 1 WHERE first_index = 6000",
            "its row is damaged",
        ),
        (
            "UPDATE session SET n_samples = 9001 WHERE name = 's'",
            "UPDATE session SET n_samples = 9000 WHERE name = 's'",
            "9000 of 9001 samples are there",
        ),
        (
            "UPDATE asset SET document = '!' || document",
            "UPDATE asset SET document = SUBSTR(document, 2)",
            "asset file of a",
        ),
    ] {
        sqlx::query(damage).execute(&mut db).await.unwrap();
        let (status, printed) = check(&data);
        assert_eq!(status, Some(1), "{damage}: {printed}");
        assert!(printed.contains(finding), "{damage}: {printed}");
        sqlx::query(repair).execute(&mut db).await.unwrap();
    }
    assert_eq!(check(&data).0, Some(0));
    // A damaged store is not copied as if it were whole.
    if !on_postgres() {
        sqlx::query(set).bind(flip(&chunk)).execute(&mut db).await.unwrap();
        let copy = data.join("copy.sqlite");
        let backup = Command::new(env!("CARGO_BIN_EXE_offbd"))
            .args(["backup", "--data"])
            .args([&data, &copy])
            .output()
            .unwrap();
        assert_eq!(backup.status.code(), Some(1));
        assert!(String::from_utf8(backup.stderr).unwrap().contains("damaged"));
        assert!(!copy.exists());
    }
    fixture.restart().await;
}
