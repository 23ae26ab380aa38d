//! Space that is kept on the disk for what must be written when it is full.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use tokio::time::Instant;

/// Size of the reserve, bytes. Chosen: a batch of 4 MiB is written again when it is set aside, and
/// after a stop signal what was read of a pipe.
pub(super) const RESERVE_BYTES: u64 = 16 << 20;

/// Pause before the reserve is filled again. Chosen: a disk that has just been full may need room
/// for others first.
const PAUSE: Duration = Duration::from_secs(30);

/// A file of [`RESERVE_BYTES`] beside the spool, which is deleted when a full disk prevents
/// that a batch is set aside.
#[derive(Debug)]
pub(super) struct Reserve {
    path: PathBuf,
    is_kept: bool,
    /// When it was last released, or could not be kept.
    since: Instant,
}

impl Reserve {
    /// The reserve of the spool at `spool`, which is not kept yet.
    pub(super) fn of(spool: &Path) -> Self {
        Self { path: super::files::with_ending(spool, "-reserve"), is_kept: false, since: now() }
    }

    pub(super) const fn is_kept(&self) -> bool {
        self.is_kept
    }

    /// Whether it is time to try to keep it again.
    pub(super) fn is_due(&self) -> bool {
        now() >= self.since + PAUSE
    }

    /// Fills the file, or deletes it if the disk has no room for it.
    pub(super) fn keep(&mut self) -> io::Result<()> {
        let filled = fill(&self.path);
        (self.is_kept, self.since) = (filled.is_ok(), now());
        if filled.is_err() {
            // Not to be in the way of others. May not be there at all.
            let _ = std::fs::remove_file(&self.path);
        }
        filled
    }

    /// Makes room; returns whether it could.
    pub(super) fn release(&mut self) -> bool {
        let was_kept = std::mem::replace(&mut self.is_kept, false);
        self.since = now();
        was_kept && std::fs::remove_file(&self.path).is_ok()
    }
}

fn fill(path: &Path) -> io::Result<()> {
    let mut file = super::files::private().append(true).create(true).open(path)?;
    let block = [0; 64 << 10];
    let mut n = file.metadata()?.len();
    while n < RESERVE_BYTES {
        file.write_all(&block)?;
        n += block.len() as u64;
    }
    file.sync_all()
}

#[expect(clippy::disallowed_methods, reason = "a pause between attempts")]
fn now() -> Instant {
    Instant::now()
}
