//! Errors with their own exit code: unusable input (3), arguments that do not fit together
//! (2), and a fault where the caller wants none (4).

use std::fmt::Display;
use std::path::Path;

/// An input that cannot be used, and the reason.
#[derive(Debug, thiserror::Error)]
#[error("{input}: {reason}")]
pub struct InputError {
    input: String,
    reason: String,
}

impl InputError {
    pub fn new(input: impl Display, reason: impl Display) -> Self {
        Self { input: input.to_string(), reason: reason.to_string() }
    }

    /// An error of the file at `path`.
    pub fn file(path: &Path, reason: impl Display) -> Self {
        Self::new(path.display(), reason)
    }
}

/// Arguments that are valid on their own, but do not fit together or to the input.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct BadArgument(pub String);

/// Sessions have a fault, and the caller asked to be told by the exit status.
#[derive(Debug, thiserror::Error)]
#[error("a fault was found in {n_faulty} of {n} sessions")]
pub struct FaultFound {
    pub n_faulty: usize,
    pub n: usize,
}

/// Reads the file at `path`.
pub fn read(path: &Path) -> Result<Vec<u8>, InputError> {
    std::fs::read(path).map_err(|e| InputError::file(path, e))
}
