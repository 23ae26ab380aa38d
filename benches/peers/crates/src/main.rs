//! Runs one Rust crate on the scenes and prints its records as JSON.
//!
//! `offbd-peers ENGINE TRUTH_FOLDER [--quick]`

mod by_diffsol;
mod by_ode_solvers;
mod by_rapier;
mod equations;
mod measure;
mod scene;

use std::path::Path;

use anyhow::{Context, Result, bail};
use measure::{Bench, Case};
use serde_json::json;

const LOCK: &str = include_str!("../Cargo.lock");

/// Name, package, and what measures it.
type Engine = (&'static str, &'static str, fn(&mut Case));

const ENGINES: [Engine; 3] = [
    ("diffsol", "diffsol", by_diffsol::scan),
    ("ode_solvers", "ode_solvers", by_ode_solvers::scan),
    ("rapier", "rapier3d-f64", by_rapier::scan),
];

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (engine, folder, quick) = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..]
    {
        [engine, folder] => (engine, folder, false),
        [engine, folder, "--quick"] => (engine, folder, true),
        _ => bail!("usage: offbd-peers ENGINE TRUTH_FOLDER [--quick]"),
    };
    let found = ENGINES.into_iter().find(|(name, ..)| *name == engine);
    let (name, package, scan) = found.with_context(|| format!("no engine {engine}"))?;
    let mut bench = Bench::new(name, Path::new(folder), quick)?;
    bench.each_scene(scan);
    println!("{}", json!({ "versions": { package: version(package) }, "records": bench.records }));
    Ok(())
}

/// The version of a package that Cargo.lock names.
fn version(package: &str) -> Option<&'static str> {
    let mut lines = LOCK.lines().skip_while(|line| *line != format!("name = \"{package}\""));
    lines.nth(1)?.strip_prefix("version = \"")?.strip_suffix('"')
}
