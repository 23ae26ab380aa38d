//! A warm engine takes samples without touching the heap.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use offbd::diagnosis::FaultMemory;
use offbd::engine::{Engine, Input, Rig, Setup};
use offbd::vocabulary::Sample;

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: hands every call on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's contract is the system allocator's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// A ball that swings about the middle, as the commands ask it to.
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
    let mut outputs = Vec::with_capacity(16);
    let mut run = |from: u64, to: u64| {
        for i in from..to {
            engine.handle(Input::Sample(sample(i)), &mut outputs);
            outputs.clear();
        }
    };
    run(0, 2000);
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    run(2000, 12_000);
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed) - before, 0);
    assert!(before > 0, "the counter counts");
}
