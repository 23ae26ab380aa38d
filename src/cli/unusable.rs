//! Input that cannot be used: the one error with an exit code of its own.

use std::fmt::Display;
use std::path::Path;

/// Which input cannot be used, and why.
#[derive(Debug, thiserror::Error)]
#[error("{what}: {reason}")]
pub(super) struct Unusable {
    what: String,
    reason: String,
}

impl Unusable {
    pub(super) fn new(what: impl Display, reason: impl Display) -> Self {
        Self { what: what.to_string(), reason: reason.to_string() }
    }

    /// The file at `path` cannot be used because of `reason`.
    pub(super) fn file(path: &Path, reason: impl Display) -> Self {
        Self::new(path.display(), reason)
    }
}

/// The bytes of the file at `path`.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, Unusable> {
    std::fs::read(path).map_err(|e| Unusable::file(path, e))
}
