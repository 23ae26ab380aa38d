//! Assets that are loaded together are as those that are loaded alone.

use proptest::prelude::*;
use tempfile::TempDir;

use super::*;
use crate::start::Workers;
use crate::{Limits, Service};
use offbd_core::engine::Rig;
use offbd_core::vocabulary::Sample;
use offbd_store::{AssetRow, Location, Store, TransitionRow, Write};
use offbd_wire::asset;
use offbd_wire::telemetry::Batch;

const BATCH: usize = 50;

/// What happened to an asset.
#[derive(Clone, Debug)]
struct AssetHistory {
    /// The number of batches of each session. The last one is open.
    sessions: Vec<usize>,
    /// Whether a person erases a fault in the middle of each session.
    clears: bool,
}

fn history() -> impl Strategy<Value = AssetHistory> {
    let sessions = prop::collection::vec(1..12_usize, 0..7);
    (sessions, any::<bool>()).prop_map(|(sessions, clears)| AssetHistory { sessions, clears })
}

/// A service with assets. Its journal is short, so that recordings are in journal and chunks.
struct Rigs {
    service: Service,
    workers: Workers,
    names: Vec<String>,
    _data: TempDir,
}

impl Rigs {
    async fn new(histories: &[AssetHistory]) -> Self {
        let data = tempfile::tempdir().unwrap();
        let location = Location::File(data.path().join("offbd.sqlite"));
        let (store, writer) = Store::open(&location).await.unwrap();
        let mut limits = Limits { snapshot_interval: 100, ..Limits::default() };
        limits.requests.journal_bytes = 10_000;
        let (service, workers) = Service::start(store, writer, limits, None).await.unwrap();
        let names = (0..histories.len()).map(|i| format!("rig-{i}")).collect();
        let this = Self { service, workers, names, _data: data };
        for (name, history) in this.names.iter().zip(histories) {
            let document = views::to_json(&asset::view(&Rig::chapter(name))).unwrap();
            this.service.create_asset(document.as_bytes()).await.unwrap();
            for (number, n_batches) in history.sessions.iter().enumerate() {
                this.record(name, number, *n_batches, history.clears).await;
            }
        }
        this
    }

    async fn record(&self, name: &str, session: usize, n_batches: usize, clears: bool) {
        for k in 0..n_batches {
            if clears && k == n_batches / 2 {
                self.service.clear(name, "x_servo", "somebody".to_owned()).await.unwrap();
            }
            let samples = (k * BATCH..(k + 1) * BATCH).map(|i| Ok(sample(session, i)));
            let session = Some(format!("run {session}"));
            let batch = Batch { session, rows: samples.collect(), ..Batch::default() };
            self.service.submit(name, batch).unwrap().acknowledged().await.unwrap();
        }
        self.note_transitions(name, n_batches).await;
    }

    /// Stores transitions of the open session, of which loading needs the number alone.
    async fn note_transitions(&self, name: &str, n: usize) {
        let handles = &self.service.inner.handles;
        let session = handles.store.open_session(name).await.unwrap().unwrap().id;
        let transition = |ordinal: usize| {
            Write::Transition(TransitionRow {
                id: 0,
                asset: name.to_owned(),
                session: session.clone(),
                ordinal: ordinal as i64,
                t_s: 0.0,
                code: "x_servo".to_owned(),
                status: "pending".to_owned(),
                at: 0,
                document: "{}".to_owned(),
            })
        };
        handles.write(name, (0..n).map(transition).collect()).await.unwrap();
    }

    fn handles(&self) -> Handles {
        self.service.inner.handles.clone()
    }

    async fn finish(self) {
        drop(self.service);
        self.workers.finish().await;
    }
}

fn sample(session: usize, i: usize) -> Sample {
    let t_s = i as f64 * 0.02;
    Sample {
        seq: Some(i as u64),
        t_s,
        cmd_qx_rad: Some(0.05 * (0.7 * t_s).cos()),
        cmd_qy_rad: Some(0.05 * (1.1 * t_s).sin()),
        x_m: Some(0.03 * (1.3 * t_s).sin() + 0.02),
        y_m: Some((session * 1000 + i) as f64 * 1e-8),
    }
}

/// Runs `work` where it may block.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    tokio::task::spawn_blocking(work).await.unwrap()
}

fn read_together(handles: &Handles, names: &[String]) -> Vec<Result<StoredAsset, ServiceError>> {
    let mut stored = read(handles, names);
    read_ahead(handles, stored.iter_mut().flatten()).unwrap();
    stored
}

fn load_alone(handles: &Handles, name: &String) -> Result<Asset, ServiceError> {
    read(handles, from_ref(name)).remove(0)?.catch_up(handles)
}

/// All that is known of an asset.
fn contents(asset: &Asset) -> String {
    let Asset { row, memory, provenance, ended, learning, snapshots, open, .. } = asset;
    let open = open.as_ref().map(|open| {
        let state = snapshots::state(&open.judging, open.motion.as_ref()).unwrap();
        (
            &open.id,
            &open.name,
            &open.part,
            open.progress,
            open.n_transitions,
            open.snapshot_at,
            state,
        )
    });
    format!("{:?}", (row, memory, provenance, ended, learning, snapshots, open))
}

/// Loads all assets in both ways.
async fn compare(histories: Vec<AssetHistory>) {
    let rigs = Rigs::new(&histories).await;
    let (handles, names) = (rigs.handles(), rigs.names.clone());
    let compared = blocking(move || {
        handles.barrier().unwrap();
        let together = read_together(&handles, &names);
        for ((name, stored), history) in names.iter().zip(together).zip(histories) {
            let asset = stored.unwrap().catch_up(&handles).unwrap();
            let alone = load_alone(&handles, name).unwrap();
            assert_eq!(contents(&asset), contents(&alone), "{name}");
            let found = asset.open.map(|open| (open.progress.n_samples, open.n_transitions));
            let recorded = |n: &usize| ((n * BATCH) as i64, *n as i64);
            assert_eq!(found, history.sessions.last().map(recorded), "{name}");
        }
    });
    compared.await;
    rigs.finish().await;
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    #[test]
    fn assets_loaded_together_are_as_those_loaded_alone(
        histories in prop::collection::vec(history(), 1..8)
    ) {
        tokio::runtime::Runtime::new().unwrap().block_on(compare(histories));
    }
}

fn histories(n: usize) -> Vec<AssetHistory> {
    let history = |i| AssetHistory { sessions: vec![i % 5 + 1, 9 - i % 3], clears: i % 2 == 0 };
    (0..n).map(history).collect()
}

/// However many assets a group has, the number of queries is the same.
#[tokio::test(flavor = "multi_thread")]
async fn nothing_more_is_read_for_an_asset_of_a_group() {
    let rigs = Rigs::new(&histories(6)).await;
    let (handles, names) = (rigs.handles(), rigs.names.clone());
    let stored = blocking({
        let handles = handles.clone();
        move || {
            handles.barrier().unwrap();
            read_together(&handles, &names)
        }
    });
    let stored = stored.await;
    handles.store.close().await;
    let n_samples = blocking(move || {
        let caught_up =
            |stored: Result<StoredAsset, _>| stored.unwrap().catch_up(&handles).unwrap();
        let assets = stored.into_iter().map(caught_up);
        let open = assets.map(|asset| asset.open.unwrap().progress.n_samples);
        open.collect::<Vec<_>>()
    });
    assert_eq!(n_samples.await, [450, 400, 350, 450, 400, 350]);
    rigs.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_asset_that_cannot_be_loaded_fails_alone() {
    let rigs = Rigs::new(&histories(4)).await;
    let (handles, mut names) = (rigs.handles(), rigs.names.clone());
    let row = handles.store.asset(&names[1]).await.unwrap().unwrap();
    let corrupt = AssetRow { document: "{".to_owned(), ..row };
    handles.write(&names[1], vec![Write::UpdateAsset(corrupt)]).await.unwrap();
    names.insert(2, "unknown".to_owned());
    let loaded = blocking(move || {
        let together = read_together(&handles, &names);
        let caught_up = |stored: Result<StoredAsset, ServiceError>| stored?.catch_up(&handles);
        let together: Vec<_> = together.into_iter().map(caught_up).collect();
        for (name, asset) in names.iter().zip(&together) {
            match (asset, load_alone(&handles, name)) {
                (Ok(asset), Ok(alone)) => assert_eq!(contents(asset), contents(&alone)),
                (Err(error), Err(alone)) => assert_eq!(error.to_string(), alone.to_string()),
                _ => panic!("{name} is loaded in one of the ways only"),
            }
        }
        together.iter().map(Result::is_ok).collect::<Vec<_>>()
    });
    assert_eq!(loaded.await, [true, false, false, true, true]);
    rigs.finish().await;
}
