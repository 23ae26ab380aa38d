//! The files of the spool.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use serde_json::json;
use sqlx::Connection;

use super::set_aside::run;
use super::{Agent, nowhere};
use crate::support::{ServiceFixture, batch, rig};

/// The permissions of the files and folders at `path`.
fn mode(path: &Path) -> u32 {
    path.metadata().unwrap().permissions().mode() & 0o777
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn only_its_owner_reads_the_spool() {
    let directory = tempfile::tempdir().unwrap();
    let folder = directory.path().join("rig/1");
    let spool = folder.join("spool");
    for n in 1..=2 {
        let agent = Agent::start(&spool, &nowhere(), &[]);
        agent.client.telemetry("a", Some("s"), &rig(10, usize::MAX)).await;
        assert_eq!((mode(&folder), mode(folder.parent().unwrap())), (0o700, 0o700));
        let files: Vec<_> =
            std::fs::read_dir(&folder).unwrap().map(|file| file.unwrap().path()).collect();
        assert_eq!(files.len(), 2, "{files:?}");
        for file in &files {
            assert_eq!(mode(file), 0o600, "{}", file.display());
        }
        assert_eq!(agent.status().await["waiting_batches"], n);
        // As an agent has left them that did not take care.
        drop(agent);
        for file in files {
            std::fs::set_permissions(file, Permissions::from_mode(0o644)).unwrap();
        }
    }
}

/// A spool as version 0.1 has left it.
async fn database(spool: &Path, version: i64) -> sqlx::SqliteConnection {
    let url = format!("sqlite://{}?mode=rwc", spool.display());
    let mut file = sqlx::SqliteConnection::connect(&url).await.unwrap();
    let schema = format!(
        "PRAGMA journal_mode = WAL;
        PRAGMA user_version = {version};
        CREATE TABLE batch (
            id INTEGER PRIMARY KEY AUTOINCREMENT,
            asset TEXT NOT NULL,
            query TEXT NOT NULL,
            media_type TEXT NOT NULL,
            body BLOB NOT NULL,
            refusal TEXT
        )"
    );
    sqlx::raw_sql(sqlx::AssertSqlSafe(schema)).execute(&mut file).await.unwrap();
    file
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_spool_of_version_0_1_is_sent_and_keeps_what_is_set_aside() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("spool");
    let samples = rig(40, usize::MAX);
    let mut file = database(&spool, 1).await;
    for (i, part) in samples.chunks(10).enumerate() {
        let insert = "INSERT INTO batch (id, asset, query, media_type, body, refusal)
            VALUES ($1, 'a', '', 'application/json', $2, $3)";
        let body = batch(Some("s"), part).to_string().into_bytes();
        let refusal = (i == 1).then_some("of no use");
        let insert = sqlx::query(insert).bind(10 + i as i64).bind(body).bind(refusal);
        insert.execute(&mut file).await.unwrap();
    }
    // Killed, so that its log stays.
    drop(file);
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let to = format!("http://{}", fixture.client.address);
    let agent = Agent::start(&spool, &to, &[]);
    let refused = agent.drained().await["refused"].clone();
    assert_eq!((&refused[0]["id"], &refused[0]["reason"]), (&json!(11), &json!("of no use")));
    assert_eq!(refused.as_array().unwrap().len(), 1);
    let sent = [&samples[..10], &samples[20..]].concat();
    assert_eq!(fixture.client.recording("a", "s").await, sent);
    drop(agent);
    let left: Vec<_> = std::fs::read_dir(directory.path())
        .unwrap()
        .map(|file| file.unwrap().file_name())
        .collect();
    assert!(left.iter().all(|name| ["spool", "spool-reserve"].contains(&name.to_str().unwrap())));
    assert!(run(&spool, &["send-again", "11"]).status.success());
    let agent = Agent::start(&spool, &to, &[]);
    agent.drained().await;
    assert_eq!(fixture.client.recording("a", "s").await.len(), 40);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_spool_of_a_later_version_and_other_files_are_refused_and_left_as_they_are() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name| directory.path().join(name);
    drop(Agent::start(&path("later"), &nowhere(), &[]));
    let mut bytes = std::fs::read(path("later")).unwrap();
    for copy in [0, 512] {
        bytes[copy + 16..copy + 20].copy_from_slice(&1000_u32.to_le_bytes());
        let checksum = crc32fast::hash(&bytes[copy..copy + 28]);
        bytes[copy + 28..copy + 32].copy_from_slice(&checksum.to_le_bytes());
    }
    std::fs::write(path("later"), bytes).unwrap();
    database(&path("database"), 1000).await.close().await.unwrap();
    std::fs::write(path("other"), "a file of somebody else").unwrap();
    for (name, reason) in [
        ("later", "the format 1000 of a later version of offbd"),
        ("database", "the format 1000 of a later version of offbd"),
        ("other", "not a spool"),
    ] {
        let before = std::fs::read(path(name)).unwrap();
        let refused = run(&path(name), &["list"]);
        let told = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(3), "{told}");
        assert!(told.contains(reason), "{told}");
        assert!(std::fs::read(path(name)).unwrap() == before, "{name} has changed");
    }
}
