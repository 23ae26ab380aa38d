//! Samples of a session are partly in the journal and partly folded into chunks. Together they
//! are the recording, after any sequence of folding, reading, ending, kills and upgrades.

use std::path::Path;

use crate::support::process::Process;
use crate::support::{ServiceFixture, connection, rig, url};
use offbd::store::codec::{self, ChunkKey, Packing};
use offbd::store::{
    AssetRow, ChangeSet, Location, SessionEnd, SessionFilter, SessionProgress, SessionRow, Store,
    Write, Writer,
};
use offbd_core::vocabulary::Sample;
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;
use sqlx::Connection;
use sqlx::migrate::Migrator;

const ASSETS: usize = 3;

/// An operation on the store.
#[derive(Clone, Debug)]
enum Step {
    /// A group commit: asset and number of samples of each append.
    Commit(Vec<(usize, usize)>),
    /// Counts a rejected row of an asset.
    Reject(usize),
    /// A group commit with an invalid change, which must not change anything.
    Conflict(usize, usize),
    /// Folds the journal down to this size, bytes.
    Fold(usize),
    /// Reads a session of an asset from an index.
    Read(usize, usize),
    /// Ends the session of an asset and opens another.
    End(usize),
    Delete(usize),
    /// Closes the store and opens it again.
    Stop,
    /// Drops the writer without closing it and opens the store again.
    Kill,
}

fn step() -> impl Strategy<Value = Step> {
    let asset = || 0..ASSETS;
    let few = || (asset(), 0..80usize);
    prop_oneof![
        8 => prop::collection::vec(few(), 1..6).prop_map(Step::Commit),
        1 => (asset(), 900..1200usize).prop_map(|run| Step::Commit(vec![run])),
        1 => (asset(), 7000..20_000usize).prop_map(|run| Step::Commit(vec![run])),
        2 => asset().prop_map(Step::Reject),
        1 => few().prop_map(|(asset, n)| Step::Conflict(asset, n)),
        4 => prop_oneof![Just(0), 100..20_000usize].prop_map(Step::Fold),
        4 => (asset(), 0..2000usize).prop_map(|(asset, at)| Step::Read(asset, at)),
        1 => asset().prop_map(Step::End),
        1 => asset().prop_map(Step::Delete),
        1 => Just(Step::Stop),
        3 => Just(Step::Kill),
    ]
}

/// The expected content of a session.
#[derive(Clone, Default)]
struct ExpectedSession {
    id: String,
    asset: usize,
    samples: Vec<Sample>,
    n_rejected: i64,
}

impl ExpectedSession {
    fn progress(&self) -> SessionProgress {
        SessionProgress {
            n_samples: self.samples.len() as i64,
            n_rejected: self.n_rejected,
            first_t_s: self.samples.first().map(|sample| sample.t_s),
            last_t_s: self.samples.last().map(|sample| sample.t_s),
            last_seq: self.samples.iter().filter_map(|s| s.seq).max().map(|seq| seq as i64),
        }
    }

    /// Returns the change that appends `n` samples.
    fn append(&mut self, n: usize) -> Write {
        let first = self.samples.len();
        self.samples.extend((first..first + n).map(sample));
        Write::Append {
            session: self.id.clone(),
            first_index: first as i64,
            samples: self.samples[first..].to_vec(),
            progress: self.progress(),
        }
    }
}

/// Returns the sample at `index`; some have only a time.
fn sample(index: usize) -> Sample {
    let t_s = index as f64 * 0.01;
    let reading = |value: f64| (!index.is_multiple_of(7)).then_some(value);
    Sample {
        seq: (!index.is_multiple_of(5)).then_some(index as u64),
        t_s,
        cmd_qx_rad: reading(t_s.sin()),
        cmd_qy_rad: None,
        x_m: reading(-t_s),
        y_m: reading(t_s.cos()),
    }
}

fn asset(name: &str) -> AssetRow {
    let (name, document) = (name.to_owned(), "{}".to_owned());
    AssetRow { name, document, revision: 1, created_at: 0, updated_at: 0 }
}

fn session(id: &str, asset: &str) -> SessionRow {
    SessionRow {
        id: id.to_owned(),
        asset: asset.to_owned(),
        name: id.to_owned(),
        state: "open".to_owned(),
        opened_at: 0,
        ended_at: None,
        setup: "{}".to_owned(),
        baseline: "{}".to_owned(),
        ..SessionRow::default()
    }
}

/// A store and its expected content.
struct StoreTest {
    location: Location,
    store: Store,
    writer: Option<Writer>,
    open: Vec<ExpectedSession>,
    ended: Vec<ExpectedSession>,
    n_opened: usize,
}

impl StoreTest {
    async fn begin(data: &Path) -> Self {
        let location = Location::of_url(&url(data)).unwrap();
        let (store, mut writer) = Store::open(&location).await.unwrap();
        let mut made = (0..ASSETS).map(|i| Write::CreateAsset(asset(&i.to_string()))).collect();
        writer.commit(&mut [ChangeSet::unpartitioned(&mut made)]).await.unwrap();
        let open = vec![ExpectedSession::default(); ASSETS];
        let mut this =
            Self { location, store, writer: Some(writer), open, ended: vec![], n_opened: 0 };
        for asset in 0..ASSETS {
            let opened = this.opened(asset);
            this.commit(vec![opened]).await;
        }
        this
    }

    fn opened(&mut self, asset: usize) -> Write {
        let id = format!("session-{}", self.n_opened);
        self.n_opened += 1;
        self.open[asset] = ExpectedSession { id: id.clone(), asset, ..ExpectedSession::default() };
        Write::OpenSession(session(&id, &asset.to_string()))
    }

    fn writer(&mut self) -> &mut Writer {
        self.writer.as_mut().unwrap()
    }

    async fn commit(&mut self, mut set: Vec<Write>) {
        self.writer().commit(&mut [ChangeSet::unpartitioned(&mut set)]).await.unwrap();
    }

    async fn apply(&mut self, step: Step) -> Result<(), TestCaseError> {
        match step {
            Step::Commit(runs) => {
                let set = runs.iter().map(|(asset, n)| self.open[*asset].append(*n)).collect();
                self.commit(set).await;
            }
            Step::Reject(asset) => {
                self.open[asset].n_rejected += 1;
                let set = vec![self.open[asset].append(0)];
                self.commit(set).await;
            }
            Step::Conflict(at, n) => {
                let mut set = vec![self.open[at].clone().append(n), Write::CreateAsset(asset("0"))];
                let error = self
                    .writer()
                    .commit(&mut [ChangeSet::unpartitioned(&mut set)])
                    .await
                    .expect_err("the asset exists");
                assert!(error.is_conflict() && !error.is_outage(), "{error}");
            }
            Step::Fold(above) => self.writer().fold(above).await.unwrap(),
            Step::Read(asset, at) => {
                let wanted = &self.open[asset];
                let from = at.min(wanted.samples.len());
                let read = self.read(&wanted.id, from).await;
                prop_assert_eq!(&read, &wanted.samples[from..]);
            }
            Step::End(asset) => {
                let wanted = self.open[asset].clone();
                let ended = Write::EndSession(SessionEnd {
                    session: wanted.id.clone(),
                    ended_at: 1,
                    verdict: "{}".to_owned(),
                    ..SessionEnd::default()
                });
                let last = self.open[asset].append(3);
                self.ended.push(self.open[asset].clone());
                let opened = self.opened(asset);
                let first = self.open[asset].append(2);
                self.commit(vec![last, ended, opened, first]).await;
            }
            Step::Delete(at) => {
                let last = self.open[at].append(1);
                let given_up = Write::HideAsset { name: at.to_string(), at: 1 };
                let gone = Write::DeleteAsset { name: at.to_string() };
                let again = Write::CreateAsset(asset(&at.to_string()));
                let opened = self.opened(at);
                self.ended.retain(|wanted| wanted.asset != at);
                self.commit(vec![last, given_up, gone, again, opened]).await;
            }
            Step::Stop => self.restart(true).await,
            Step::Kill => self.restart(false).await,
        }
        Ok(())
    }

    async fn restart(&mut self, gracefully: bool) {
        self.store.close().await;
        let writer = self.writer.take().unwrap();
        if gracefully {
            writer.close().await.unwrap()
        } else {
            drop(writer)
        }
        let (store, writer) = Store::open(&self.location).await.unwrap();
        (self.store, self.writer) = (store, Some(writer));
        if gracefully {
            assert_eq!(
                count_rows(&url_of(&self.location), "journal").await,
                0,
                "everything is folded"
            );
        }
    }

    async fn read(&self, session: &str, from: usize) -> Vec<Sample> {
        let mut samples: Vec<Sample> = Vec::new();
        let row = self.store.session(session).await.unwrap().unwrap();
        let mut reader = self.store.recording(&row, i64::try_from(from).unwrap());
        while let Some(part) = reader.next().await.unwrap() {
            assert!(!part.is_empty());
            samples.extend(part);
        }
        samples
    }

    async fn check(&self) -> Result<(), TestCaseError> {
        let rows = self.store.sessions(&SessionFilter::default(), 1000).await.unwrap();
        prop_assert_eq!(rows.len(), self.open.len() + self.ended.len());
        for wanted in self.open.iter().chain(&self.ended) {
            prop_assert_eq!(&self.read(&wanted.id, 0).await, &wanted.samples);
            let row = self.store.session(&wanted.id).await.unwrap().unwrap();
            prop_assert_eq!(row.progress, wanted.progress());
            prop_assert!(rows.contains(&row));
            let Some(last) = wanted.samples.last() else { continue };
            let found = self.store.samples_at(&wanted.id, &[last.t_s], 100).await;
            prop_assert!(found.unwrap().unwrap().contains(last));
            let none = self.store.samples_at(&wanted.id, &[last.t_s + 0.125], 100).await;
            prop_assert_eq!(none.unwrap().unwrap(), []);
        }
        Ok(())
    }
}

/// Returns the number of rows of `table`.
async fn count_rows(url: &str, table: &str) -> i64 {
    let mut db = connection(url).await;
    let sql = sqlx::AssertSqlSafe(format!("SELECT COUNT(*) FROM {table}"));
    sqlx::query_scalar(sql).fetch_one(&mut db).await.unwrap()
}

fn url_of(location: &Location) -> String {
    match location {
        Location::File(file) => format!("sqlite://{}", file.display()),
        Location::Server(url) => url.clone(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_order_of_operations_preserves_the_recordings(
        steps in prop::collection::vec(step(), 1..60),
    ) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let data = tempfile::tempdir().unwrap();
            let mut test = StoreTest::begin(data.path()).await;
            for step in steps {
                test.apply(step).await?;
            }
            test.check().await?;
            test.apply(Step::Kill).await?;
            test.check().await?;
            test.apply(Step::Stop).await?;
            test.check().await
        })?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), failure_persistence: None, ..ProptestConfig::default() })]

    /// From one and a half times the limit on, four times as many bytes are folded as arrive,
    /// so the journal stays below twice its limit plus a little more than one group.
    #[test]
    fn the_size_of_the_journal_is_bounded(
        groups in prop::collection::vec(prop::collection::vec((0..ASSETS, 1..80usize), 1..6), 1..100),
        above in 2000..20_000usize,
    ) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let data = tempfile::tempdir().unwrap();
            let mut test = StoreTest::begin(data.path()).await;
            let (mut before, mut largest_group) = (test.writer().journal_bytes(), 0);
            for group in groups {
                test.apply(Step::Commit(group)).await?;
                let n_bytes = test.writer().journal_bytes();
                largest_group = largest_group.max(n_bytes.saturating_sub(before));
                prop_assert!(n_bytes <= above * 15 / 8 + largest_group * 5 / 4, "{n_bytes}");
                test.apply(Step::Fold(above)).await?;
                before = test.writer().journal_bytes();
            }
            Ok(())
        })?;
    }
}

/// Number of cases of each property, unless the environment variable CASES is set.
fn cases() -> u32 {
    std::env::var("CASES").map_or(24, |n| n.parse().unwrap())
}

/// Creates a database of the last version without a journal: its migrations, and a session
/// whose samples are all in small chunks.
async fn create_old_database(data: &Path, samples: &[Sample]) {
    let first = tempfile::tempdir().unwrap();
    for file in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/migrations")).unwrap() {
        let file = file.unwrap();
        if file.file_name().to_str().unwrap() < "0006" {
            std::fs::copy(file.path(), first.path().join(file.file_name())).unwrap();
        }
    }
    let location = url_of(&Location::of_url(&url(data)).unwrap())
        + if crate::support::on_postgres() { "" } else { "?mode=rwc" };
    let mut db = connection(&location).await;
    Migrator::new(first.path()).await.unwrap().run_direct(None, &mut db, false).await.unwrap();
    sqlx::query("INSERT INTO asset VALUES ('0', '{}', 1, 0, 0)").execute(&mut db).await.unwrap();
    sqlx::query(
        "INSERT INTO session (id, asset, name, state, opened_at, setup, baseline, n_samples,
         n_rejected, first_t_s, last_t_s, last_seq)
         VALUES ('old', '0', 'old', 'open', 0, '{}', '{}', $1, 0, $2, $3, $4)",
    )
    .bind(samples.len() as i64)
    .bind(samples[0].t_s)
    .bind(samples[samples.len() - 1].t_s)
    .bind(samples.iter().filter_map(|s| s.seq).max().map(|seq| seq as i64))
    .execute(&mut db)
    .await
    .unwrap();
    for (i, part) in samples.chunks(100).enumerate() {
        sqlx::query("INSERT INTO chunk VALUES ('old', $1, $2, $3, $4, $5)")
            .bind(i as i64 * 100)
            .bind(part.len() as i64)
            .bind(part[0].t_s)
            .bind(part[part.len() - 1].t_s)
            .bind(without_checksum(part))
            .execute(&mut db)
            .await
            .unwrap();
    }
    db.close().await.unwrap();
}

/// The chunk of the first format, which had no checksum.
fn without_checksum(samples: &[Sample]) -> Vec<u8> {
    let key = ChunkKey { session: "old", first_index: 0 };
    let mut chunk = codec::encode(samples, Packing::Plain, key);
    chunk.truncate(chunk.len() - 4);
    chunk[0] = 1;
    chunk
}

#[tokio::test]
async fn a_database_of_an_earlier_version_can_be_continued() {
    let data = tempfile::tempdir().unwrap();
    let samples: Vec<_> = (0..950).map(sample).collect();
    create_old_database(data.path(), &samples).await;
    let location = Location::of_url(&url(data.path())).unwrap();
    let (store, writer) = Store::open(&location).await.unwrap();
    let open = vec![ExpectedSession { id: "old".to_owned(), asset: 0, samples, n_rejected: 0 }];
    let mut test =
        StoreTest { location, store, writer: Some(writer), open, ended: vec![], n_opened: 0 };
    test.check().await.unwrap();
    for step in [
        Step::Commit(vec![(0, 40)]),
        Step::Kill,
        Step::Commit(vec![(0, 5)]),
        Step::Fold(0),
        Step::Commit(vec![(0, 9000)]),
        Step::End(0),
    ] {
        test.apply(step).await.unwrap();
        test.check().await.unwrap();
    }
}

#[tokio::test]
async fn a_damaged_journal_is_reported_at_open() {
    let data = tempfile::tempdir().unwrap();
    let mut test = StoreTest::begin(data.path()).await;
    test.apply(Step::Commit(vec![(0, 10), (1, 10)])).await.unwrap();
    let mut db = connection(&url(data.path())).await;
    drop(test);
    for damaged in [&b""[..], b"\x91", b"no journal"] {
        sqlx::query("UPDATE journal SET data = $1").bind(damaged).execute(&mut db).await.unwrap();
        let location = Location::of_url(&url(data.path())).unwrap();
        let error = Store::open(&location).await.err().unwrap().to_string();
        assert!(error.contains("journal row"), "{error}");
    }
}

/// One process with a large limit of the journal alternates with one that folds everything;
/// each is killed.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_kill_between_journal_and_chunks_loses_nothing() {
    let data = tempfile::tempdir().unwrap();
    let samples = rig(1600, 1600);
    let start = |bytes: &str| {
        Process::start_with(data.path(), &[("OFFBD_LIMITS__JOURNAL_BYTES", Path::new(bytes))])
    };
    let mut process = start("16000000");
    process.client.asset("a").await;
    let mut n = 0;
    for (i, bytes) in ["1", "16000000"].into_iter().cycle().take(8).enumerate() {
        for part in samples[n..n + 200].chunks(20) {
            process.client.telemetry("a", Some("s"), part).await;
        }
        n += 200;
        assert_eq!(process.client.recording("a", "s").await, samples[..n]);
        drop(process);
        if i == 0 {
            assert_eq!(
                count_rows(&url(data.path()), "chunk").await,
                0,
                "everything is in the journal"
            );
            assert_eq!(count_rows(&url(data.path()), "journal").await, 10);
        }
        process = start(bytes);
        assert_eq!(process.client.recording("a", "s").await, samples[..n]);
        assert_eq!(process.client.session("a", "s").await["samples"], n);
    }
    let session = process.client.end("a", "s").await;
    assert_eq!(session["verdict"]["verdict_hash"], crate::support::judged("a", &samples).0);
    assert_eq!(process.client.recording("a", "s").await, samples);
    assert_eq!(count_rows(&url(data.path()), "chunk").await, 1);
}

/// A reader finds every acknowledged sample while samples are moved from the journal to small
/// chunks and from these to large ones.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_recording_can_be_read_while_it_is_folded() {
    let fixture = ServiceFixture::start_with(|config| config.limits.journal_bytes = 3000).await;
    fixture.client.asset("a").await;
    let samples = rig(9000, 9000);
    fixture.client.telemetry("a", Some("s"), &samples[..30]).await;
    let (sent, acknowledged) = tokio::sync::watch::channel(30);
    let (client, recorded) = (fixture.client.clone(), samples.clone());
    let sending = tokio::spawn(async move {
        for (i, part) in recorded[30..].chunks(30).enumerate() {
            client.telemetry("a", Some("s"), part).await;
            sent.send_replace(60 + i * 30);
        }
    });
    let mut n_read = 0;
    while !sending.is_finished() {
        let n = *acknowledged.borrow();
        let session = fixture.client.session("a", "s").await;
        assert!(session["samples"].as_u64().unwrap() >= n as u64, "{session}");
        let recording = fixture.client.recording("a", "s").await;
        assert!(recording.len() >= n, "{} of {n}", recording.len());
        assert_eq!(recording, samples[..recording.len()]);
        n_read += 1;
    }
    sending.await.unwrap();
    assert!(n_read > 3, "{n_read}");
    assert_eq!(fixture.client.recording("a", "s").await, samples);
}
