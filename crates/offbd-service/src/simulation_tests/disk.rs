//! What a power cut leaves of SQLite's write-ahead log.

use std::path::{Path, PathBuf};

/// Bytes that a disk writes as a whole. Disks of 4096 bytes leave fewer mixtures.
const SECTOR: usize = 512;

/// Returns the path of the log of the database `file`.
pub(super) fn log(file: &Path) -> PathBuf {
    file.with_extension("sqlite-wal")
}

/// Reads the log of the database `file`; it is empty if there is none.
pub(super) fn log_of(file: &Path) -> Vec<u8> {
    std::fs::read(log(file)).unwrap_or_default()
}

/// How much of a log is on the disk.
#[derive(Clone, Copy, Debug)]
pub(super) struct PowerCut {
    /// Where the log ends that was written: a fraction of what was changed, in 65 535ths.
    pub(super) end: u16,
    /// Which sectors before that were written, by their number modulo 64.
    pub(super) written: u64,
}

impl PowerCut {
    /// Returns what is left of the log `after`, of which `before` was synced and the rest was
    /// not.
    pub(super) fn apply(self, before: &[u8], after: &[u8]) -> Vec<u8> {
        let pairs = || before.iter().zip(after);
        let from = pairs().take_while(|(old, new)| old == new).count();
        let to = match after.len() > before.len() {
            true => after.len(),
            false => pairs().rposition(|(old, new)| old != new).map_or(from, |last| last + 1),
        };
        let end = from + (to - from) * usize::from(self.end) / 65_535;
        let mut left = before.to_vec();
        left.resize(before.len().max(end), 0);
        for (i, sector) in after[..end.min(after.len())].chunks(SECTOR).enumerate() {
            if self.written >> (i % 64) & 1 == 1 {
                left[i * SECTOR..][..sector.len()].copy_from_slice(sector);
            }
        }
        left
    }
}
