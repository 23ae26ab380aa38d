//! Compiles SQLite's extension against the header of the SQLite that is linked.

use std::env;

/// The SQL function that reserves the bytes for the checksums, see `src/lib.rs`.
const RESERVE: &str = "\"reserve_page_checksums\"";

fn main() {
    println!("cargo::rerun-if-changed=cksumvfs.c");
    println!("cargo::rerun-if-env-changed=DEP_SQLITE3_INCLUDE");
    let mut build = cc::Build::new();
    // `links` of libsqlite3-sys exports the folder of its header.
    build.includes(env::var_os("DEP_SQLITE3_INCLUDE"));
    build
        .file("cksumvfs.c")
        .define("SQLITE_CKSUMVFS_STATIC", None)
        .define("SQLITE_CKSUMVFS_INIT_FUNCNAME", RESERVE)
        // Every page that is read or written passes through it, in all profiles.
        .opt_level(2)
        .warnings(false)
        .compile("cksumvfs");
}
