//! A limit of the memory that a parser takes, also of memory that it reserves and does not use,
//! which libFuzzer's limit of resident memory does not find.

use std::alloc::{GlobalAlloc, Layout, System};
use std::backtrace::Backtrace;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Most bytes that a parser may take for one input, which has at most 64 KiB.
const MAX_BYTES: usize = 512 << 20;

/// Bytes that are allocated.
static USED: AtomicUsize = AtomicUsize::new(0);

/// Allocated bytes at which the program ends.
static LIMIT: AtomicUsize = AtomicUsize::new(usize::MAX);

/// Ends the program, as a finding, if `parse` takes more than [`MAX_BYTES`].
pub fn limited<T>(parse: impl FnOnce() -> T) {
    LIMIT.store(USED.load(Relaxed) + MAX_BYTES, Relaxed);
    parse();
    LIMIT.store(usize::MAX, Relaxed);
}

struct CountedHeap;

#[global_allocator]
static HEAP: CountedHeap = CountedHeap;

fn count(bytes: usize) {
    if USED.fetch_add(bytes, Relaxed).saturating_add(bytes) > LIMIT.load(Relaxed) {
        LIMIT.store(usize::MAX, Relaxed);
        eprintln!("the parser takes more than {} MiB", MAX_BYTES >> 20);
        eprintln!("{}", Backtrace::force_capture());
        std::process::abort();
    }
}

// SAFETY: each call is that of the system's allocator.
unsafe impl GlobalAlloc for CountedHeap {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        USED.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size);
        USED.fetch_sub(layout.size(), Relaxed);
        unsafe { System.realloc(memory, layout, size) }
    }
}
