//! How many bytes of a compressed file are read once it is decompressed.

use super::SessionFileError;

/// Decompressed bytes that are read of a file, over all its parts, unless the file is long (see
/// [`MAX_EXPANSION`]). Chosen: 2 million samples of 500 bytes; a sample as JSON has 130. A file
/// with more is refused.
const MAX_DECOMPRESSED_BYTES: u64 = 1 << 30;

/// Decompressed bytes for each byte of a long file. Chosen: three times the measured 11 of an
/// MCAP file with the plate and the evidence. A file that expands further is refused.
const MAX_EXPANSION: u64 = 32;

/// The decompressed bytes that may still be read of one file.
#[derive(Debug)]
pub(super) struct ByteBudget {
    what: &'static str,
    limit: u64,
    left: u64,
}

impl ByteBudget {
    /// A budget of `limit` bytes for `what`.
    pub(super) const fn new(what: &'static str, limit: u64) -> Self {
        Self { what, limit, left: limit }
    }

    /// The budget of a file of `n_bytes`.
    pub(super) fn of_file(n_bytes: u64) -> Self {
        Self::new("the file", n_bytes.saturating_mul(MAX_EXPANSION).max(MAX_DECOMPRESSED_BYTES))
    }

    /// Takes `n` bytes from the budget.
    ///
    /// # Errors
    /// [`SessionFileError::Expands`] if fewer are left; then none are left.
    pub(super) fn spend(&mut self, n: u64) -> Result<(), SessionFileError> {
        let left = self.left.checked_sub(n);
        self.left = left.unwrap_or(0);
        left.map(|_| ()).ok_or(SessionFileError::Expands { what: self.what, limit: self.limit })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_shared_by_all_parts_and_grows_with_a_long_file() {
        let mut budget = ByteBudget::of_file(1000);
        assert!(budget.spend(MAX_DECOMPRESSED_BYTES - 1).is_ok());
        assert!(budget.spend(1).is_ok());
        let error = budget.spend(1).unwrap_err();
        assert!(matches!(error, SessionFileError::Expands { limit: MAX_DECOMPRESSED_BYTES, .. }));
        let mut budget = ByteBudget::of_file(MAX_DECOMPRESSED_BYTES);
        assert!(budget.spend(MAX_EXPANSION * MAX_DECOMPRESSED_BYTES).is_ok());
        assert!(budget.spend(u64::MAX).is_err());
        assert!(budget.spend(1).is_err());
    }
}
