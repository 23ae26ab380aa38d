//! A checksum on each page of an SQLite database, verified whenever the page is read from
//! the file. A damaged page is an error, `SQLITE_IOERR_DATA`, and is not served.
//!
//! This is SQLite's own extension, a layer below SQLite's file access
//! (<https://www.sqlite.org/cksumvfs.html>). The checksum is in the last 8 bytes of each
//! page, which a database must have reserved before its first page is written. Databases
//! without reserved bytes work as before, without checksums.
//!
//! The extension also adds SQL to every connection that is opened after [`register`]:
//!
//! - `SELECT reserve_page_checksums('main')` reserves the bytes, in an empty database;
//! - `PRAGMA checksum_verification` answers 1 if checksums are verified, otherwise 0.
//!
//! # Provenance
//!
//! `cksumvfs.c` is `ext/misc/cksumvfs.c` of SQLite 3.53.4, unchanged, in the public domain
//! (SHA-256 `d1ed8e8ec31ab568cd5dcf257aed74e737deaf04e7cca860b70c2f701191360b`). Do not take an
//! older one, such as that of 3.46.1: a newer SQLite may read a part of a page, which avoids the
//! check unless the extension forbids it.

use std::ffi::{c_char, c_int};
use std::ptr;
use std::sync::OnceLock;

// Links SQLite, which the extension calls.
use libsqlite3_sys::SQLITE_OK;

/// The name of the layer, for the parameter `vfs` of a connection.
pub const VFS: &str = "cksmvfs";

/// The error code of a page with a wrong checksum.
pub const DAMAGED_PAGE: c_int = libsqlite3_sys::SQLITE_IOERR_DATA;

/// SQLite has refused the extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotRegistered {
    /// SQLite's error code.
    pub code: c_int,
}

#[expect(unsafe_code, reason = "the extension is written in C")]
mod extension {
    use super::{c_char, c_int};

    unsafe extern "C" {
        pub(super) fn sqlite3_register_cksumvfs(not_used: *const c_char) -> c_int;
    }
}

/// Makes the layer known to SQLite, and the default for connections that name none. Only
/// the first call has an effect. Connections that are open already do not use it.
///
/// # Errors
/// [`NotRegistered`] if SQLite cannot be initialised, or is without memory.
pub fn register() -> Result<(), NotRegistered> {
    static CODE: OnceLock<c_int> = OnceLock::new();
    #[expect(unsafe_code, reason = "the extension is written in C")]
    let code = *CODE.get_or_init(|| {
        // SAFETY: the argument is not used. The function writes to a static variable of the
        // extension, which nothing else writes to: `get_or_init` calls it once, and its other
        // callers wait for it. All else that it calls is SQLite's interface for any thread.
        unsafe { extension::sqlite3_register_cksumvfs(ptr::null()) }
    });
    if code == SQLITE_OK { Ok(()) } else { Err(NotRegistered { code }) }
}

impl std::fmt::Display for NotRegistered {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "SQLite does not accept its extension for checksums: error {}", self.code)
    }
}

impl std::error::Error for NotRegistered {}
