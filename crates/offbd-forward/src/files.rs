//! The files of the spool, which only their owner may read.

use std::ffi::OsString;
use std::fs::{DirBuilder, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

/// What the reserve, and spools of version 0.1, add to the name of the spool.
const ENDINGS: [&str; 4] = ["", "-reserve", "-wal", "-shm"];

/// Options that create a file for its owner only.
pub(super) fn private() -> OpenOptions {
    let mut options = OpenOptions::new();
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

/// `path` with something added to its last part.
pub(super) fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut path = OsString::from(path);
    path.push(ending);
    path.into()
}

/// Creates the spool at `path` with its folder if they are missing, for their owner only, and takes
/// the files from others if they can read them.
pub(super) fn prepare(path: &Path) -> io::Result<()> {
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        let mut builder = DirBuilder::new();
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        builder.recursive(true).create(folder)?;
    }
    private().append(true).create(true).open(path)?;
    #[cfg(unix)]
    for file in ENDINGS.map(|ending| with_ending(path, ending)) {
        use std::os::unix::fs::PermissionsExt;
        let Ok(metadata) = file.metadata() else { continue };
        if metadata.permissions().mode() & 0o077 != 0 {
            // Some file systems have no permissions.
            let owner_only = std::fs::Permissions::from_mode(0o600);
            if let Err(error) = std::fs::set_permissions(&file, owner_only) {
                tracing::warn!(file = %file.display(), %error, "others may read the spool");
            }
        }
    }
    Ok(())
}
