//! Files of the store: readable by their owner only, and their URLs.

use std::fs::{File, OpenOptions};
use std::path::Path;

use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_encode};

use super::StoreError;

/// Options to write a file that only its owner can read once it is created.
#[must_use]
pub fn private_file() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.write(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

/// Creates `file` if it is missing, readable by its owner only; SQLite gives its other
/// files the same permissions.
pub(super) fn create_private(file: &Path) -> Result<(), StoreError> {
    match private_file().create_new(true).open(file) {
        Err(error) if error.kind() != std::io::ErrorKind::AlreadyExists => {
            Err(StoreError::File { file: file.to_owned(), source: error })
        }
        _ => Ok(()),
    }
}

/// Returns once the names in the directory of `file` are on the disk.
///
/// # Errors
/// [`StoreError::Directory`].
pub(super) fn sync_directory_of(file: &Path) -> Result<(), StoreError> {
    let directory = file.parent().filter(|directory| !directory.as_os_str().is_empty());
    let directory = directory.unwrap_or(Path::new("."));
    // Other systems cannot open a directory as a file.
    let synced = if cfg!(unix) { File::open(directory).and_then(|d| d.sync_all()) } else { Ok(()) };
    synced.map_err(|source| StoreError::Directory { directory: directory.to_owned(), source })
}

/// What is not escaped in a path.
const UNESCAPED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'/').remove(b'-').remove(b'.').remove(b'_');

/// The URL of a file, with the mode `rw`, or `rwc` to create a missing file. Its pages are
/// read with their checksums. Bytes with a meaning in a URL are escaped.
pub(super) fn file_url(file: &Path, mode: &str) -> Result<String, StoreError> {
    let file = std::path::absolute(file).map_err(sqlx::Error::Io)?;
    let path = percent_encode(file.as_os_str().as_encoded_bytes(), UNESCAPED);
    Ok(format!("sqlite://{path}?mode={mode}&vfs={}", sqlite_checksums::VFS))
}
