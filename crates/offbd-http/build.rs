//! Builds the page under `web/` where Node is there. Without Node the service
//! is built all the same, and its `/` says how to get the page. The published crate has no
//! `web/`, but the built page.

use std::env;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What the page is made of; a change of anything else rebuilds nothing.
const SOURCES: [&str; 7] = [
    "../../web/src",
    "../../web/public",
    "../../web/index.html",
    "../../web/package-lock.json",
    "../../web/tsconfig.json",
    "../../web/vite.config.ts",
    // What a device runs stands on the page too.
    "../offbd-wire/src/drive_cycle/run.py",
];

/// The built page in the published crate. `docs/operations/install.md` says how it gets there.
const PUBLISHED: &str = "page";

/// The oldest Node that the page's tools run on, as `web/package.json` has it.
const NODE: (u32, u32) = (18, 19);

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var("OUT_DIR")?).join("page");
    if !Path::new("../../web/package.json").exists() && Path::new(PUBLISHED).exists() {
        return Ok(copy(Path::new(PUBLISHED), &out)?);
    }
    for source in SOURCES {
        println!("cargo::rerun-if-changed={source}");
    }
    page(&out)
}

/// Copies a folder with all that it contains.
fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let (path, target) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy(&path, &target)?;
        } else {
            fs::copy(&path, &target)?;
        }
    }
    Ok(())
}

/// Leaves the page in `out`, or `out` empty where it cannot be built here.
/// What is wrong with the page itself is an error, what is missing is not.
fn page(out: &Path) -> Result<(), Box<dyn Error>> {
    if out.exists() {
        fs::remove_dir_all(out)?;
    }
    fs::create_dir_all(out)?;
    if let Err(missing) = tools() {
        println!("cargo::warning=built without the dashboard: {missing}");
        // What is not there counts as changed: the next build looks for Node again.
        println!("cargo::rerun-if-changed={}", out.join("index.html").display());
        return Ok(());
    }
    let built = npm(&["run", "--silent", "build", "--", "--outDir"]).arg(out).output()?;
    if built.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&built.stderr).into_owned();
    Err(format!("the page under web/ cannot be built:\n{said}").into())
}

/// Node, and what the lockfile names under `web/node_modules`.
fn tools() -> Result<(), String> {
    let said = Command::new("node").arg("--version").output();
    let said = said.map_err(|_| "there is no Node on the path".to_owned())?;
    let version = String::from_utf8_lossy(&said.stdout).trim().to_owned();
    let mut parts = version.trim_start_matches('v').split('.').map(str::parse::<u32>);
    let found = (parts.next().and_then(Result::ok), parts.next().and_then(Result::ok));
    if !matches!(found, (Some(major), Some(minor)) if (major, minor) >= NODE) {
        return Err(format!("Node {version} is older than {}.{}", NODE.0, NODE.1));
    }
    let (lock, installed) =
        ("../../web/package-lock.json", "../../web/node_modules/.package-lock.json");
    let changed = |path: &str| fs::metadata(path).and_then(|m| m.modified());
    if matches!((changed(lock), changed(installed)), (Ok(l), Ok(i)) if l <= i) {
        return Ok(());
    }
    let done = npm(&["ci", "--no-audit", "--no-fund"]).stdout(Stdio::null()).status();
    match done {
        Ok(status) if status.success() => Ok(()),
        _ => Err("`npm ci` in web/ failed; is the network there?".to_owned()),
    }
}

fn npm(arguments: &[&str]) -> Command {
    let mut npm = Command::new(if cfg!(windows) { "npm.cmd" } else { "npm" });
    npm.args(arguments).current_dir("../../web");
    npm
}
