//! The memory allocator of the C library.

/// Blocks from this size on, bytes, are mapped by themselves and return to the system as soon
/// as they are freed. glibc begins with 128 KiB, and raises it to the largest block that was
/// freed, up to 32 MiB. Then the large blocks that commits need lie between what assets hold,
/// and the space that they leave is not used again: 2.3 KiB for each of 10 000 assets
/// (`docs/benchmarks.md`). 128 KiB saves no more, and each mapped block costs the time in
/// which the system clears it.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const MAPPED_FROM: libc::c_int = 1 << 20;

/// Unused space at the end of a heap, bytes, from which on it returns to the system: twice the
/// size above, as glibc has it where it sets both. Left alone, it stays at 128 KiB once the other
/// is set; each commit then returns what the next one takes and has cleared again, which made
/// requests by 100 samples a tenth slower.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const RETURNED_FROM: libc::c_int = 2 * MAPPED_FROM;

/// Keeps the size from which on blocks are mapped by themselves from rising, for the whole
/// process. Without glibc it does nothing.
pub(super) fn keep_large_blocks_apart() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        #[expect(unsafe_code, reason = "a function of the C library")]
        // SAFETY: may be called at any time, by any thread, with any values (mallopt(3)).
        let accepted = unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, MAPPED_FROM)
                & libc::mallopt(libc::M_TRIM_THRESHOLD, RETURNED_FROM)
        };
        if accepted == 0 {
            tracing::debug!("the allocator does not accept the sizes of blocks it returns");
        }
    }
}

#[cfg(all(test, target_os = "linux", target_env = "gnu"))]
mod tests {
    use super::*;

    #[test]
    fn large_blocks_are_mapped_after_a_larger_one_was_freed() {
        const MIB: usize = 1 << 20;
        // A mapped block begins with a page, of which the allocator takes two words.
        let is_mapped = |block: &Vec<u8>| block.as_ptr().addr() % 4096 == 2 * size_of::<usize>();
        keep_large_blocks_apart();
        drop(Vec::<u8>::with_capacity(16 * MIB));
        // Space that other tests of this process have freed before serves some of the blocks.
        let blocks: Vec<Vec<u8>> = (0..24).map(|_| Vec::with_capacity(2 * MIB)).collect();
        assert!(blocks.iter().filter(|block| is_mapped(block)).count() >= 8);
    }
}
