//! The database goes away under load and comes back: what is acknowledged is
//! stored, once, and the service says meanwhile what is wrong.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::support::device::{Line, device};
use crate::support::postgres::Postgres;
use crate::support::process::Process;
use crate::support::{Bench, Client, eventually};
use sqlx::Executor;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{UnixListener, UnixStream};

/// Waits until `/readyz` has `status`; returns its reason.
async fn readiness(client: &Client, status: u16) -> String {
    eventually(|| async {
        let answer = client.get("/readyz").await;
        (answer.status == status).then(|| answer.json()["detail"].as_str().unwrap_or("").to_owned())
    })
    .await
}

/// Devices that send until the line is hung up, and how many recordings they
/// have compared then.
struct Load {
    line: Line,
    devices: Vec<tokio::task::JoinHandle<usize>>,
}

impl Load {
    fn begin(n: usize, client: &Client, data: &Path, url: Option<&str>) -> Self {
        let line = Line::to(client);
        let devices =
            (0..n).map(|i| device(&line, &format!("d{i}"), i % 2 == 0, data, url)).collect();
        Self { line, devices }
    }

    async fn end(self) -> usize {
        self.line.hang_up();
        let mut laps = 0;
        for device in self.devices {
            laps += device.await.unwrap();
        }
        laps
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_stops_and_starts() {
    let mut server = Postgres::new();
    let url = server.database("twin");
    let bench = Bench::start_with(|config| {
        config.database = Some(url.clone());
        config.limits.in_flight_samples = 300;
        config.limits.journal_bytes = 5000;
        config.limits.batch_samples = 300;
    })
    .await;
    let load = Load::begin(8, &bench.client, bench.data.path(), Some(&url));
    for signal in ["INT", "QUIT", "INT", "QUIT"] {
        load.line.progress(500).await;
        server.stop(signal);
        // Only what was under way can be heard of after that.
        let (n_full, n_acknowledged) = (load.line.full(), load.line.acknowledged());
        let reason = readiness(&bench.client, 503).await;
        assert!(reason.contains("the database takes nothing now"), "{reason}");
        // What is under way fills the limits; more is turned away.
        eventually(|| async { (load.line.full() > n_full).then_some(()) }).await;
        assert!(load.line.acknowledged() <= n_acknowledged + 300);
        server.start();
        readiness(&bench.client, 200).await;
    }
    // Every connection is cut, in whatever it was doing.
    for _ in 0..20 {
        load.line.progress(100).await;
        let cut = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
            WHERE pid <> pg_backend_pid() AND datname = current_database()";
        crate::support::connection(&url).await.execute(cut).await.unwrap();
    }
    load.end().await;
}

const PASS: usize = 0;
const LOSE_THE_ANSWER: usize = 1;
const LOSE_THE_COMMIT: usize = 2;

/// Passes on what comes to the socket in `from` to that in `to`. When told so it
/// loses the next commit or its answer, and with it the connection.
async fn proxy(from: PathBuf, to: PathBuf, loses: Arc<AtomicUsize>) {
    let listener = UnixListener::bind(from.join(".s.PGSQL.5432")).unwrap();
    while let Ok((client, _)) = listener.accept().await {
        let server = UnixStream::connect(to.join(".s.PGSQL.5432")).await.unwrap();
        // A connection that is lost is what this is about.
        tokio::spawn({
            let loses = loses.clone();
            async move { pass(client, server, &loses).await }
        });
    }
}

async fn pass(
    mut client: UnixStream,
    mut server: UnixStream,
    loses: &AtomicUsize,
) -> std::io::Result<()> {
    let (mut up, mut down) = (vec![0; 1 << 16], vec![0; 1 << 16]);
    loop {
        tokio::select! {
            n = client.read(&mut up) => {
                let said = &up[..n?];
                let is_commit = said.windows(6).any(|word| word == b"COMMIT");
                match if is_commit { loses.swap(PASS, Ordering::SeqCst) } else { PASS } {
                    LOSE_THE_COMMIT => return Ok(()),
                    LOSE_THE_ANSWER => {
                        server.write_all(said).await?;
                        let n = server.read(&mut down).await?;
                        assert!(down[..n].starts_with(b"C"), "the commit is complete");
                        return Ok(());
                    }
                    _ if said.is_empty() => return Ok(()),
                    _ => server.write_all(said).await?,
                }
            }
            n = server.read(&mut down) => match n? {
                0 => return Ok(()),
                n => client.write_all(&down[..n]).await?,
            },
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_commit_whose_outcome_nobody_heard() {
    let server = Postgres::new();
    let url = server.database("twin");
    let between = tempfile::tempdir().unwrap();
    let loses = Arc::new(AtomicUsize::new(PASS));
    let (from, to) = (between.path().to_owned(), server.directory().to_owned());
    let proxy = tokio::spawn(proxy(from, to, loses.clone()));
    eventually(|| async { between.path().join(".s.PGSQL.5432").exists().then_some(()) }).await;
    let through = crate::support::postgres::url(between.path(), "twin");
    let bench = Bench::start_with(|config| {
        config.database = Some(through);
        config.limits.journal_bytes = 5000;
    })
    .await;
    let load = Load::begin(3, &bench.client, bench.data.path(), Some(&url));
    for i in 0..40 {
        load.line.progress(50).await;
        loses.store(1 + i % 2, Ordering::SeqCst);
        eventually(|| async { (loses.load(Ordering::SeqCst) == PASS).then_some(()) }).await;
    }
    // What came through was found out and not tried again, the rest was: no
    // device has noticed.
    assert_eq!(load.line.turned_away(), 0);
    load.end().await;
    proxy.abort();
}

/// The library that lets calls fail, see `faulty.c`.
#[cfg(target_os = "linux")]
fn faulty(directory: &Path) -> PathBuf {
    let library = directory.join("faulty.so");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/support/faulty.c");
    let made = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o"])
        .args([&library, Path::new(source)])
        .args(["-ldl"])
        .status();
    assert!(made.expect("a C compiler as `cc`").success());
    library
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_disk_that_is_full_or_fails() {
    let data = tempfile::tempdir().unwrap();
    let (library, faults) = (faulty(data.path()), data.path().join("faults"));
    let environment = [
        ("LD_PRELOAD", library.as_path()),
        ("FAULTS", faults.as_path()),
        ("OFFBD_LIMITS__JOURNAL_BYTES", Path::new("5000")),
    ];
    let mut process = Process::start_with(data.path(), &environment);
    let load = Load::begin(2, &process.client, data.path(), None);
    // ENOSPC is 28, EIO is 5.
    let kinds = [("write 28", "full"), ("write 5", "I/O"), ("sync 5", "I/O"), ("torn 5", "I/O")];
    for (i, (fault, word)) in kinds.into_iter().cycle().take(12).enumerate() {
        load.line.progress(300).await;
        std::fs::write(&faults, fault).unwrap();
        let reason = readiness(&process.client, 503).await;
        assert!(reason.contains(word), "{fault}: {reason}");
        if i % 3 == 2 {
            // Killed with the disk still failing.
            drop(process);
            std::fs::remove_file(&faults).unwrap();
            process = Process::start_with(data.path(), &environment);
            load.line.moves(&process.client);
        } else {
            std::fs::remove_file(&faults).unwrap();
        }
        readiness(&process.client, 200).await;
    }
    load.end().await;
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_clock_that_steps() {
    let data = tempfile::tempdir().unwrap();
    let (library, faults) = (faulty(data.path()), data.path().join("faults"));
    let environment = [("LD_PRELOAD", library.as_path()), ("FAULTS", faults.as_path())];
    let process = Process::start_with(data.path(), &environment);
    let load = Load::begin(2, &process.client, data.path(), None);
    for step in ["clock -86400", "clock 86400", "clock -1", "clock 0"] {
        load.line.progress(1000).await;
        std::fs::write(&faults, step).unwrap();
    }
    load.line.progress(1000).await;
    readiness(&process.client, 200).await;
    load.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_database_that_another_process_locks() {
    let bench = Bench::start().await;
    let load = Load::begin(2, &bench.client, bench.data.path(), None);
    load.line.progress(500).await;
    let hold = bench.hold().await;
    let reason = readiness(&bench.client, 503).await;
    assert!(reason.contains("locked"), "{reason}");
    hold.let_go().await;
    readiness(&bench.client, 200).await;
    load.end().await;
}
