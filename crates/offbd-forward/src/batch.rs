//! What a spool takes, and why it may not.

use std::io;

/// Version of the format. Version 1 was a database of SQLite.
pub(super) const VERSION: u32 = 2;

/// Why a spool cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SpoolError {
    /// Nothing of the batch was taken.
    #[error("the spool is full: {used} of {limit} bytes wait for the service")]
    Full { used: u64, limit: u64 },
    /// Nothing of the batch was taken.
    #[error("the disk is full")]
    DiskFull,
    #[error("the spool is locked by an agent that is running")]
    Locked,
    /// Nothing was changed.
    #[error("no batch {0} is set aside")]
    NotSetAside(i64),
    /// Nothing was changed.
    #[error("batch {0} is damaged and cannot be sent; remove it")]
    Damaged(i64),
    #[error("the spool has the format {0} of a later version of offbd; this one knows {current}", current = VERSION)]
    Later(i64),
    /// Nothing was changed.
    #[error("the file is not a spool")]
    Foreign,
    #[error("the spool cannot be used: {0}")]
    File(#[from] io::Error),
    #[error("the spool of an earlier version cannot be read: {0}")]
    Sql(#[from] sqlx::Error),
}

impl SpoolError {
    pub(super) fn is_of_full_disk(&self) -> bool {
        use io::ErrorKind::{QuotaExceeded, StorageFull};
        matches!(self, Self::File(error) if matches!(error.kind(), StorageFull | QuotaExceeded))
    }
}

/// A batch as a device has sent it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewBatch {
    pub asset: String,
    /// The query of the request, without the question mark.
    pub query: String,
    pub media_type: String,
    pub body: Vec<u8>,
}
