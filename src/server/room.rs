//! Room on the disk for the next start. After a kill SQLite needs some to open the store, so what
//! a service has stored that was killed on a full disk could not even be read.

use std::fs::File;

use anyhow::Result;

/// Bytes that are kept, on Linux. Chosen: before its first commit a service copies the write-ahead log into
/// the store, and at 16 MiB the log is copied anyway.
#[cfg(target_os = "linux")]
const RESERVE_BYTES: u64 = 32 << 20;

/// Opens the store; if that fails, once more with the room that the file `lock` of the store has
/// kept. Then it keeps room again, as far as there is any.
pub(super) async fn opened<T>(lock: Option<&File>, open: impl AsyncFn() -> Result<T>) -> Result<T> {
    let mut opened = open().await;
    let Some(lock) = lock else { return opened };
    let is_kept = lock.metadata().is_ok_and(|metadata| metadata.len() > 0);
    if opened.is_err() && is_kept && lock.set_len(0).is_ok() {
        opened = open().await;
        if opened.is_ok() {
            tracing::warn!("the store is opened with the room that was kept on a full disk");
        }
    }
    keep(lock);
    opened
}

/// Takes room for the file, or a part of it if there is no more.
#[cfg(target_os = "linux")]
fn keep(file: &File) {
    use rustix::fs::{FallocateFlags, fallocate};
    const SMALLEST: u64 = 64 << 10;
    let mut bytes = RESERVE_BYTES;
    while bytes >= SMALLEST && fallocate(file, FallocateFlags::empty(), 0, bytes).is_err() {
        bytes /= 2;
    }
}

/// Elsewhere no room is kept: it would have to be written.
#[cfg(not(target_os = "linux"))]
fn keep(_file: &File) {}
