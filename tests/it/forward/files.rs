//! The files of the spool.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use sqlx::Connection;

use super::set_aside::run;
use super::{Agent, nowhere};
use crate::support::rig;

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
        assert!(files.len() >= 3, "{files:?}");
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_spool_of_a_later_version_is_refused_and_left_as_it_is() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("spool");
    drop(Agent::start(&spool, &nowhere(), &[]));
    let url = format!("sqlite://{}", spool.display());
    let mut file = sqlx::SqliteConnection::connect(&url).await.unwrap();
    let change = "PRAGMA user_version = 1000; ALTER TABLE batch RENAME TO later";
    sqlx::raw_sql(change).execute(&mut file).await.unwrap();
    file.close().await.unwrap();
    let refused = run(&spool, &["list"]);
    let told = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(3), "{told}");
    assert!(told.contains("format 1000") && told.contains("a later version of offbd"), "{told}");
    let mut file = sqlx::SqliteConnection::connect(&url).await.unwrap();
    let tables = "SELECT COUNT(*) FROM sqlite_schema WHERE name = 'batch'";
    let n: i64 = sqlx::query_scalar(tables).fetch_one(&mut file).await.unwrap();
    assert_eq!(n, 0);
}
