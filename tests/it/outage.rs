//! The database fails under load and recovers: acknowledged samples are stored once, and
//! meanwhile the service reports the reason.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

#[cfg(target_os = "linux")]
use crate::support::calls::FaultySystem;
use crate::support::device::DeviceLoad;
use crate::support::link::{Link, LinkMode};
use crate::support::postgres::Postgres;
use crate::support::process::{Process, ended, program};
use crate::support::{Client, ServiceFixture, batch, connection, eventually, registration, rig};
use futures_util::future::select;
use offbd_core::vocabulary::Sample;
use reqwest::Method;
use serde_json::{Value, json};
use sqlx::Executor;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{UnixListener, UnixStream};
use tokio::time::timeout;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_restarted_database_server_loses_nothing() {
    let mut server = Postgres::new();
    let url = server.database("twin");
    let fixture = ServiceFixture::start_with(|config| {
        config.database = Some(url.clone());
        config.limits.in_flight_samples = 300;
        config.limits.journal_bytes = 5000;
        config.limits.batch_samples = 300;
    })
    .await;
    let client = &fixture.client;
    client.post("assets", &registration("full")).await.expect(201);
    let post = async |session: &str| {
        let batch = batch(Some(session), &rig(300, 300));
        client.post("assets/full/telemetry", &batch).await
    };
    post("before").await.expect(200);
    let load = DeviceLoad::start(8, client, fixture.data.path(), Some(&url));
    for (signal, session) in [("INT", "a"), ("QUIT", "b"), ("INT", "c"), ("QUIT", "d")] {
        load.link.wait_for_samples(500).await;
        server.stop(signal);
        // After this, only samples in flight can be acknowledged.
        let n_acknowledged = load.link.acknowledged();
        let reason = client.readiness(503).await;
        assert!(reason.contains("the database is unavailable"), "{reason}");
        // Of two batches as large as the limit, one is above it.
        let (answer, _) = select(pin!(post(session)), pin!(post(session))).await.factor_first();
        answer.problem(429);
        assert!(load.link.acknowledged() <= n_acknowledged + 300);
        server.start();
        client.readiness(200).await;
    }
    // Every connection to the database is terminated.
    for _ in 0..20 {
        load.link.wait_for_samples(100).await;
        let cut = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
            WHERE pid <> pg_backend_pid() AND datname = current_database()";
        connection(&url).await.execute(cut).await.unwrap();
    }
    load.stop().await;
}

/// What the proxy does with the next commit.
const PASS: usize = 0;
const LOSE_THE_ANSWER: usize = 1;
const LOSE_THE_COMMIT: usize = 2;
const FORGET_THE_CONNECTION: usize = 3;

/// Forwards connections from `listener` to the socket in `to`. As `next_commit` says, it
/// drops the next commit or its answer, and closes the connection, or forgets it: the server
/// is not told.
async fn proxy(listener: UnixListener, to: PathBuf, next_commit: Arc<AtomicUsize>) {
    while let Ok((client, _)) = listener.accept().await {
        let server = UnixStream::connect(to.join(".s.PGSQL.5432")).await.unwrap();
        // Lost connections are intended.
        tokio::spawn({
            let next_commit = next_commit.clone();
            async move { forward(client, server, &next_commit).await }
        });
    }
}

async fn forward(
    mut client: UnixStream,
    mut server: UnixStream,
    next_commit: &AtomicUsize,
) -> std::io::Result<()> {
    let (mut up, mut down) = (vec![0; 1 << 16], vec![0; 1 << 16]);
    loop {
        tokio::select! {
            n = client.read(&mut up) => {
                let data = &up[..n?];
                let is_commit = data.windows(6).any(|word| word == b"COMMIT");
                match if is_commit { next_commit.swap(PASS, Ordering::SeqCst) } else { PASS } {
                    LOSE_THE_COMMIT => return Ok(()),
                    FORGET_THE_CONNECTION => break,
                    LOSE_THE_ANSWER => {
                        server.write_all(data).await?;
                        let n = server.read(&mut down).await?;
                        assert!(down[..n].starts_with(b"C"), "the commit is complete");
                        return Ok(());
                    }
                    _ if data.is_empty() => return Ok(()),
                    _ => server.write_all(data).await?,
                }
            }
            n = server.read(&mut down) => match n? {
                0 => return Ok(()),
                n => client.write_all(&down[..n]).await?,
            },
        }
    }
    drop(client);
    // For the server the connection is open, and its transaction too.
    while server.read(&mut down).await? > 0 {}
    Ok(())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_commit_with_a_lost_answer_is_neither_lost_nor_repeated() {
    let server = Postgres::new();
    let url = server.database("twin");
    let proxy_directory = tempfile::tempdir().unwrap();
    let next_commit = Arc::new(AtomicUsize::new(PASS));
    // Its file exists before it listens: the service starts only after both.
    let listener = UnixListener::bind(proxy_directory.path().join(".s.PGSQL.5432")).unwrap();
    let proxy = tokio::spawn(proxy(listener, server.directory().to_owned(), next_commit.clone()));
    let through = crate::support::postgres::url(proxy_directory.path(), "twin");
    let fixture = ServiceFixture::start_with(|config| {
        config.database = Some(through);
        config.limits.journal_bytes = 5000;
    })
    .await;
    let load = DeviceLoad::start(3, &fixture.client, fixture.data.path(), Some(&url));
    for i in 0..40 {
        load.link.wait_for_samples(50).await;
        next_commit.store(1 + i % 3, Ordering::SeqCst);
        eventually(|| async { (next_commit.load(Ordering::SeqCst) == PASS).then_some(()) }).await;
    }
    let link = load.link.clone();
    load.stop().await;
    // The service finds out whether a commit was done and retries it if not; no batch is
    // refused, unless it begins a session: that waits for earlier changes, 5 s at most.
    let looks_up = |refusal: &String| refusal.contains("urn:offbd:problem:unavailable");
    let others: Vec<_> = link.refusals().into_iter().filter(|r| !looks_up(r)).collect();
    assert_eq!(others, Vec::<String>::new());
    proxy.abort();
}

/// Changes by which a disk is full for samples, and only for these, and is not any more.
pub(crate) const FULL: &str = "CREATE FUNCTION full_disk() RETURNS trigger AS $$
    BEGIN RAISE EXCEPTION 'could not extend file: No space left on device'
        USING ERRCODE = 'disk_full'; END $$ LANGUAGE plpgsql;
    CREATE TRIGGER full_disk BEFORE INSERT ON journal EXECUTE FUNCTION full_disk()";
pub(crate) const ROOM: &str = "DROP FUNCTION full_disk CASCADE";

/// Waits until commits have failed `n` times, while the service is never ready.
pub(crate) async fn failing_commits(client: &Client, n: f64) {
    eventually(async || {
        assert_eq!(client.get("/readyz").await.status, 503);
        (client.metric("offbd_commit_failures_total").await >= n).then_some(())
    })
    .await;
}

/// What else is written is smaller and may find room, as the probe of the connection does.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_disk_that_is_full_for_samples_alone_is_reported_until_they_find_room() {
    let (server, data) = (Postgres::new(), tempfile::tempdir().unwrap());
    let url = server.database("twin");
    let process = Process::start_with(data.path(), &[("OFFBD_DATABASE", Path::new(&url))]);
    let client = &process.client;
    client.asset("a").await;
    let samples = rig(300, 300);
    client.telemetry("a", Some("s"), &samples[..100]).await;
    let mut store = connection(&url).await;
    let writers = "SELECT pid::bigint FROM pg_locks WHERE locktype = 'advisory'";
    let before: Vec<i64> = sqlx::query_scalar(writers).fetch_all(&mut store).await.unwrap();
    assert!(!before.is_empty());
    for part in [&samples[100..200], &samples[200..300]] {
        let n_bytes = process.log().len();
        store.execute(FULL).await.unwrap();
        send(client, part);
        let reason = client.readiness(503).await;
        assert!(reason.contains("No space left on device"), "{reason}");
        let n = client.metric("offbd_commit_failures_total").await;
        failing_commits(client, n + 8.0).await;
        store.execute(ROOM).await.unwrap();
        client.readiness(200).await;
        let found = failures(&process.log()[n_bytes..]);
        assert_eq!(found.len(), 1, "{found:?}");
    }
    let after: Vec<i64> = sqlx::query_scalar(writers).fetch_all(&mut store).await.unwrap();
    assert_eq!(before, after, "the connection of the writer and its locks are kept");
    eventually(async || (client.session("a", "s").await["samples"] == 300).then_some(())).await;
    assert_eq!(client.recording("a", "s").await, samples);
}

/// A stop does not wait for room.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_disk_does_not_hold_up_a_stop() {
    let (server, data) = (Postgres::new(), tempfile::tempdir().unwrap());
    let url = server.database("twin");
    let mut process = Process::start_with(data.path(), &[("OFFBD_DATABASE", Path::new(&url))]);
    process.client.asset("a").await;
    connection(&url).await.execute(FULL).await.unwrap();
    send(&process.client, &rig(100, 100));
    process.client.readiness(503).await;
    process.terminate();
    let status = timeout(STOP_TIMEOUT, ended(&mut process.child)).await.expect("it ends in time");
    assert!(status.success(), "{status}");
}

/// Passes connections on to the socket in `to`, and counts those for which nobody listens
/// there.
async fn pass(listener: UnixListener, to: PathBuf, n_refused: Arc<AtomicUsize>) {
    while let Ok((mut client, _)) = listener.accept().await {
        match UnixStream::connect(to.join(".s.PGSQL.5432")).await {
            Ok(mut server) => {
                tokio::spawn(async move {
                    let _ = tokio::io::copy_bidirectional(&mut client, &mut server).await;
                });
            }
            Err(_) => drop(n_refused.fetch_add(1, Ordering::SeqCst)),
        }
    }
}

/// What fails and why, in the lines of `log`, except for connections of the pool, which the
/// library tells of one by one.
fn failures(log: &str) -> Vec<(String, String)> {
    let lines = log.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let of = |line: Value| {
        let reason = line["reason"].as_str().or_else(|| line["error"].as_str())?;
        let what = line["message"].as_str().unwrap();
        let is_ours = what != "ping on idle connection returned error";
        is_ours.then(|| (what.to_owned(), reason.to_owned()))
    };
    lines.filter_map(of).collect()
}

/// Sends samples whose acknowledgement nobody waits for.
fn send(client: &Client, samples: &[Sample]) {
    let request = client.request(Method::POST, "assets/a/telemetry");
    let body = batch(Some("s"), samples).to_string();
    tokio::spawn(request.header("content-type", "application/json").body(body).send());
}

/// Longest duration of a stop, `limits.shutdown_s`.
const STOP_TIMEOUT: Duration = Duration::from_secs(20);

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_outage_is_logged_once_and_does_not_hold_up_a_stop() {
    let mut server = Postgres::new();
    let direct = server.database("twin");
    let (data, socket) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let listener = UnixListener::bind(socket.path().join(".s.PGSQL.5432")).unwrap();
    let n_refused = Arc::<AtomicUsize>::default();
    let passing = tokio::spawn(pass(listener, server.directory().to_owned(), n_refused.clone()));
    let through = crate::support::postgres::url(socket.path(), "twin");
    let mut process = Process::start_with(data.path(), &[("OFFBD_DATABASE", Path::new(&through))]);
    process.client.asset("a").await;
    let samples = rig(400, 400);
    process.client.telemetry("a", Some("s"), &samples[..100]).await;
    for part in [&samples[100..200], &samples[200..300]] {
        let n_bytes = process.log().len();
        server.stop("QUIT");
        send(&process.client, part);
        process.client.readiness(503).await;
        n_refused.store(0, Ordering::SeqCst);
        eventually(async || (n_refused.load(Ordering::SeqCst) >= 8).then_some(())).await;
        server.start();
        process.client.readiness(200).await;
        let found = failures(&process.log()[n_bytes..]);
        let different: BTreeSet<_> = found.iter().collect();
        assert!(found.iter().any(|(what, _)| what == "the database is unavailable; retrying"));
        assert_eq!(found.len(), different.len(), "{found:?}");
    }
    server.stop("QUIT");
    send(&process.client, &samples[300..]);
    process.client.readiness(503).await;
    process.terminate();
    let status = timeout(STOP_TIMEOUT, ended(&mut process.child)).await.expect("it ends in time");
    assert!(status.success(), "{status}");
    server.start();
    let process = Process::start_with(data.path(), &[("OFFBD_DATABASE", Path::new(&direct))]);
    let ack = process.client.telemetry("a", Some("s"), &samples).await;
    // What was not acknowledged may be there as well.
    assert!(ack["duplicate"].as_u64().unwrap() >= 100, "{ack}");
    assert_eq!(process.client.recording("a", "s").await, samples);
    passing.abort();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn sigterm_while_the_start_waits_for_the_database_ends_the_service() {
    let (data, socket) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let listener = UnixListener::bind(socket.path().join(".s.PGSQL.5432")).unwrap();
    let silent = crate::support::postgres::url(socket.path(), "twin");
    let environment = [("OFFBD_DATABASE", Path::new(&silent))];
    let starting = Process::begin(&program(), data.path(), &environment);
    let _held = listener.accept().await.unwrap();
    let status = timeout(STOP_TIMEOUT, starting.stop()).await.expect("it ends in time");
    assert!(status.success(), "{status}");
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_or_failing_disk_loses_nothing() {
    let data = tempfile::tempdir().unwrap();
    let system = FaultySystem::new(data.path());
    let mut environment = system.environment().to_vec();
    environment.push(("OFFBD_LIMITS__JOURNAL_BYTES", Path::new("5000")));
    let mut process = Process::start_with(data.path(), &environment);
    let load = DeviceLoad::start(2, &process.client, data.path(), None);
    // ENOSPC is 28, EIO is 5.
    let kinds = [("write 28", "full"), ("write 5", "I/O"), ("sync 5", "I/O"), ("torn 5", "I/O")];
    for (i, (fault, word)) in kinds.into_iter().cycle().take(12).enumerate() {
        load.link.wait_for_samples(300).await;
        system.set(fault);
        let reason = process.client.readiness(503).await;
        assert!(reason.contains(word), "{fault}: {reason}");
        if i % 3 == 2 {
            // Killed while the disk fails.
            drop(process);
            system.clear();
            process = Process::start_with(data.path(), &environment);
            load.link.set_service(&process.client);
        } else {
            system.clear();
        }
        process.client.readiness(200).await;
    }
    load.stop().await;
}

/// What the store has on the disk, bytes.
#[cfg(target_os = "linux")]
fn used(data: &Path) -> u64 {
    let files = std::fs::read_dir(data).unwrap().map(Result::unwrap);
    let of_store =
        files.filter(|file| file.file_name().to_str().unwrap().starts_with("offbd.sqlite"));
    of_store.map(|file| file.metadata().unwrap().len()).sum()
}

/// Writes to the store for ever: its log may have room for a while although the disk has none.
#[cfg(target_os = "linux")]
async fn fill(client: &Client, round: &str) {
    for i in 0.. {
        let asset = json!({ "name": format!("{round}-{i}") });
        let request = client.request(Method::POST, "assets");
        let _ =
            request.header("content-type", "application/json").body(asset.to_string()).send().await;
    }
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_service_that_is_killed_on_a_full_disk_is_read_after_the_next_start() {
    let data = tempfile::tempdir().unwrap();
    let system = FaultySystem::new(data.path());
    let mut process = Process::start_with(data.path(), &system.environment());
    process.client.asset("a").await;
    let samples = rig(42_000, usize::MAX);
    // The log is longer than what the store has.
    for part in samples[..40_000].chunks(10_000) {
        process.client.telemetry("a", Some("s"), part).await;
    }
    for round in ["first", "second"] {
        system.set(&format!("room {}", used(data.path())));
        send(&process.client, &samples[40_000..]);
        tokio::select! {
            _ = process.client.readiness(503) => {}
            () = fill(&process.client, round) => {}
        }
        drop(process);
        // Others take what it has not kept.
        let index = data.path().join("offbd.sqlite-shm");
        std::fs::remove_file(index).unwrap();
        system.set(&format!("room {}", used(data.path())));
        process = Process::start_with(data.path(), &system.environment());
        let stored = process.client.recording("a", "s").await;
        assert!(stored.len() >= 40_000 && stored == samples[..stored.len()], "{}", stored.len());
    }
    system.clear();
    process.client.readiness(200).await;
    process.client.telemetry("a", Some("s"), &samples[40_000..]).await;
    assert!(process.client.recording("a", "s").await == samples);
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_step_of_the_wall_clock_loses_nothing() {
    let data = tempfile::tempdir().unwrap();
    let system = FaultySystem::new(data.path());
    let process = Process::start_with(data.path(), &system.environment());
    let load = DeviceLoad::start(2, &process.client, data.path(), None);
    for step in ["clock -86400", "clock 86400", "clock -1", "clock 0"] {
        load.link.wait_for_samples(1000).await;
        system.set(step);
    }
    load.link.wait_for_samples(1000).await;
    process.client.readiness(200).await;
    load.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_database_locked_by_another_process_loses_nothing() {
    let fixture = ServiceFixture::start().await;
    let load = DeviceLoad::start(2, &fixture.client, fixture.data.path(), None);
    load.link.wait_for_samples(500).await;
    let lock = fixture.lock_store().await;
    let reason = fixture.client.readiness(503).await;
    assert!(reason.contains("locked"), "{reason}");
    lock.release().await;
    fixture.client.readiness(200).await;
    load.stop().await;
}

/// Reads at the same time, more than there are connections for reading.
const READS: usize = 8;

/// Asks for faults, as often as that is at the same time.
fn read_faults(
    client: &Client,
) -> Vec<tokio::task::JoinHandle<reqwest::Result<reqwest::Response>>> {
    (0..READS).map(|_| tokio::spawn(client.request(Method::GET, "faults").send())).collect()
}

/// A firewall that forgets connections, or a cut in one direction, tells neither side.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn reads_whose_answers_are_lost_do_not_hold_up_later_ones() {
    let (server, data) = (Postgres::new(), tempfile::tempdir().unwrap());
    server.database("twin");
    let (link, directory) = Link::to_database(server.directory());
    let url = crate::support::postgres::url(directory.path(), "twin");
    let process = Process::start_with(data.path(), &[("OFFBD_DATABASE", Path::new(&url))]);
    // All connections for reading are made.
    link.set(LinkMode::Delay(Duration::from_millis(50)), LinkMode::Pass);
    for read in read_faults(&process.client) {
        assert_eq!(read.await.unwrap().unwrap().status(), 200);
    }
    link.set(LinkMode::Pass, LinkMode::Drop);
    let reads = read_faults(&process.client);
    link.has_lost(4).await;
    reads.iter().for_each(tokio::task::JoinHandle::abort);
    link.set(LinkMode::Pass, LinkMode::Pass);
    eventually(|| async { (process.client.get("faults").await.status == 200).then_some(()) }).await;
}
