//! Code that runs for every sample or step does not allocate memory.

#![expect(unsafe_code, reason = "implementing an allocator requires it")]
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use offbd::store::{
    AssetRow, ChangeSet, Location, SessionFilter, SessionProgress, SessionRow, Store, Write,
};
use offbd::wire::judging::Judging;
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Engine, Input, Rig, Setup};
use offbd_core::plant::{Ball, Contact, Motion, Plate};
use offbd_core::vocabulary::Sample;
use offbd_lab::scene::{
    Configuration, Law, Laws, Method, Model, Pace, Samples, Scene, Subject, Term, run,
};

struct CountingAllocator;

thread_local! {
    /// Number of allocations of this thread; other threads run other tests.
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
    /// Bytes that this thread has allocated and not freed.
    static HELD: Cell<isize> = const { Cell::new(0) };
    /// Largest value of [`HELD`].
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

fn hold(bytes: isize) {
    HELD.set(HELD.get() + bytes);
    PEAK.set(PEAK.get().max(HELD.get()));
}

// SAFETY: passes every call on to the system allocator unchanged.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        hold(layout.size() as isize);
        // SAFETY: the caller fulfils the contract of the system allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        hold(-(layout.size() as isize));
        // SAFETY: as above.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Sample `i` of a ball that oscillates about the middle as commanded.
fn sample(i: u64) -> Sample {
    let t_s = i as f64 * 0.01;
    let (swing, gravity) = ((2.0 * t_s).sin(), 5.0 / 7.0 * 9.81);
    Sample {
        seq: Some(i),
        t_s,
        cmd_qx_rad: Some(0.02 * swing),
        cmd_qy_rad: Some(0.03 * swing),
        x_m: Some(-0.03 * gravity / 4.0 * (2.0 * (t_s - 0.1)).sin()),
        y_m: Some(0.02 * gravity / 4.0 * (2.0 * (t_s - 0.1)).sin()),
    }
}

#[test]
fn a_warm_engine_does_not_allocate() {
    let setup = Setup::new(Rig::chapter("a"), None).unwrap();
    let mut engine = Engine::new(setup, FaultMemory::default());
    let mut transitions = Vec::with_capacity(16);
    let mut run = |from: u64, to: u64| {
        for i in from..to {
            engine.handle(Input::Sample(sample(i)), &mut transitions);
            transitions.clear();
        }
    };
    run(0, 2000);
    let before = ALLOCATIONS.get();
    run(2000, 12_000);
    assert_eq!(ALLOCATIONS.get() - before, 0);
    assert!(before > 0, "the counter counts");
}

/// Ten thousand rigs must fit into the memory of a small machine.
#[test]
fn an_engine_is_small() {
    let before = HELD.get();
    let setup = Setup::new(Rig::chapter("a"), None).unwrap();
    let mut engine = Box::new(Engine::new(setup, FaultMemory::default()));
    let mut transitions = Vec::new();
    for i in 0..6000 {
        engine.handle(Input::Sample(sample(i)), &mut transitions);
        transitions.clear();
    }
    let held = HELD.get() - before;
    assert!((1..15 << 10).contains(&held), "{held} bytes");
}

/// So must the rest of what their sessions need.
#[test]
fn a_session_that_is_judged_is_small() {
    let before = HELD.get();
    let setup = Setup::new(Rig::chapter("a"), None).unwrap();
    let mut judging = Box::new(Judging::new(setup, FaultMemory::default()));
    for i in 0..6000 {
        judging.sample(sample(i));
    }
    let held = HELD.get() - before;
    assert!((1..18 << 10).contains(&held), "{held} bytes");
}

#[test]
fn an_announced_array_length_reserves_little_memory() {
    use offbd::wire::telemetry::msgpack;
    const ARRAY: u8 = 0xdd;
    const STRING: u8 = 0xdb;
    const BYTES: u8 = 0xc6;
    const MAP: u8 = 0xdf;
    for (name, marker) in [
        ("samples", ARRAY),
        ("t_s", ARRAY),
        ("id", STRING),
        ("session", STRING),
        ("note", BYTES),
        ("note", ARRAY),
        ("samples", MAP),
    ] {
        let key = [&[0x81, 0xa0 | name.len() as u8], name.as_bytes()].concat();
        let document = [&key[..], &[marker, 0xff, 0xff, 0xff, 0xff, 0xc0]].concat();
        let before = HELD.get();
        PEAK.set(before);
        assert!(msgpack(&document, 1 << 20).is_err(), "{name}");
        let peak = PEAK.get() - before;
        assert!((1..32 << 10).contains(&peak), "{name}: {peak} bytes");
    }
}

/// A scene of one second: the plate oscillates about x, and about y it tilts once.
fn swinging() -> (Scene, Laws) {
    let sine = Term::Sine { amplitude: 0.05, frequency: 0.7, phase: 0.3 };
    let step = Term::Smoothstep { to: 0.1, start: 0.3, duration: 0.2 };
    let laws = Laws::new(Law::new(&[sine]), Law::new(&[step, Term::Constant(0.01)]), Vec::new());
    let ball = Subject::Ball(Ball::default());
    (Scene::new(ball, Plate::default(), Contact::CHAPTER, 1.0).expect("a valid scene"), laws)
}

/// Every model with every method, with sampled output.
#[test]
fn a_run_of_a_scene_does_not_allocate() {
    let before = ALLOCATIONS.get();
    let (scene, mut laws) = swinging();
    assert!(ALLOCATIONS.get() > before, "the counter counts");
    for model in Model::ALL {
        for &method in model.methods() {
            let pace = if method.adapts() { Pace::Tolerance(1e-3) } else { Pace::Step(1e-3) };
            let pace = match (model, method) {
                (Model::Compliant, Method::Dopri5) => Pace::Step(1e-3),
                _ => pace,
            };
            let configuration = Configuration::new(model, method, pace).unwrap();
            let (mut sum, start) = (0.0, ALLOCATIONS.get());
            let mut sink = |_: f64, at: &Motion| sum += at.position.x;
            // An explicit method may diverge with such a step; that must not allocate either.
            let _ =
                run(&scene, &mut laws, &configuration, Some(&mut Samples::new(0.01, &mut sink)));
            // The sliding model allocates its list of events, which has one: it rolls.
            let expected = usize::from(model == Model::Sliding);
            assert_eq!(ALLOCATIONS.get() - start, expected, "{model} by {method}");
        }
    }
}

/// The number of allocations of a query for the session of one asset, of `n` whose last
/// samples are in the journal.
async fn allocations_of_a_query(n: usize) -> usize {
    let folder = tempfile::tempdir().unwrap();
    let location = Location::File(folder.path().join("offbd.sqlite"));
    let (store, mut writer) = Store::open(&location).await.unwrap();
    let of_asset = |i: usize| {
        let (asset, id) = (format!("rig-{i}"), format!("session-{i}"));
        let row = AssetRow { name: asset.clone(), document: "{}".into(), ..AssetRow::default() };
        let progress = SessionProgress { n_samples: 1, ..SessionProgress::default() };
        let session =
            SessionRow { id: id.clone(), asset, state: "open".into(), ..SessionRow::default() };
        let samples = vec![sample(0)];
        [
            Write::CreateAsset(row),
            Write::OpenSession(session),
            Write::Append { session: id, first_index: 0, samples, progress },
        ]
    };
    let mut writes: Vec<Write> = (0..n).flat_map(of_asset).collect();
    writer.commit(&mut [ChangeSet::unpartitioned(&mut writes)]).await.unwrap();
    let filter = SessionFilter { asset: Some("rig-0".into()), ..SessionFilter::default() };
    let query = async || {
        let found = store.sessions(&filter, 4).await.unwrap();
        assert_eq!(found[0].progress.n_samples, 1);
    };
    query().await;
    let before = ALLOCATIONS.get();
    query().await;
    let n_allocations = ALLOCATIONS.get() - before;
    writer.close().await.unwrap();
    n_allocations
}

#[tokio::test]
async fn a_query_for_one_asset_does_not_copy_the_journal_of_all() {
    let (few, many) = (allocations_of_a_query(2).await, allocations_of_a_query(2000).await);
    assert!(few > 0, "the counter counts");
    assert!(many < few + 200, "{many} allocations instead of {few}");
}
