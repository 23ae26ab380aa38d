//! Errors with an exit code of their own: input that cannot be used (3), and
//! arguments that do not fit together (2).

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

/// Arguments that can be read but do not fit each other, or the input.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct BadArgument(pub String);

/// The bytes of the file at `path`.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, Unusable> {
    std::fs::read(path).map_err(|e| Unusable::file(path, e))
}
