//! Compares the lists of bounds and of their keys in the operations manual with the code.

use std::collections::BTreeSet;
use std::path::Path;

use super::{ROOT, files};
use offbd::config::RatesConfig;
use offbd_service::{CommunicationSettings, RequestLimits, WorkerLimits};

/// The folders whose constants are bounds of the service.
const FOLDERS: [&str; 8] = [
    "src/server",
    "crates/offbd-bus/src",
    "crates/offbd-forward/src",
    "crates/offbd-http/src",
    "crates/offbd-net/src",
    "crates/offbd-service/src",
    "crates/offbd-store/src",
    "crates/offbd-wire/src/session_file",
];

/// The sections of the configuration whose keys are bounds.
const SECTIONS: [&[&str]; 4] =
    [RequestLimits::KEYS, RatesConfig::KEYS, WorkerLimits::KEYS, CommunicationSettings::KEYS];

fn read(path: &str) -> String {
    std::fs::read_to_string(Path::new(ROOT).join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Returns name and value of a constant that is a bound, if `line` defines one.
fn bound(line: &str) -> Option<String> {
    let (_, definition) = line.split_once("const ").filter(|(before, _)| is_visibility(before))?;
    let (name, rest) = definition.split_once(": ")?;
    let is_bound = ["MAX_", "LONGEST_"].iter().any(|start| name.starts_with(start));
    let (_, value) = rest.split_once(" = ").filter(|_| is_bound || name.ends_with("TIMEOUT"))?;
    Some(format!("{name} = {}", value.strip_suffix(';')?))
}

fn is_visibility(text: &str) -> bool {
    text.is_empty() || text.starts_with("pub") && !text.contains("fn")
}

fn bounds_in_code() -> BTreeSet<String> {
    let of_file = |file: String| {
        let text = read(&file);
        let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
        let bounds = code.lines().filter_map(bound);
        bounds.map(|bound| format!("`{file}`: `{bound}`")).collect::<Vec<_>>()
    };
    let is_shipped = |file: &String| !file.contains("_tests/") && !file.ends_with("tests.rs");
    let files = FOLDERS.iter().flat_map(|folder| files(folder)).filter(is_shipped);
    files.flat_map(of_file).collect()
}

/// How the manual names a file.
const STARTS: [&str; 2] = ["`src/", "`crates/"];

fn bounds_in_manual() -> BTreeSet<String> {
    let manual = read("docs/operations/limits.md");
    let rows = manual
        .lines()
        .filter(|line| line.starts_with("| ") && STARTS.iter().any(|s| line.contains(s)));
    let entries = rows.filter_map(|row| row.trim_end_matches(" |").rsplit(" | ").next());
    let one_a_line = |cell: &str| {
        STARTS.iter().fold(cell.to_owned(), |text, start| {
            text.replace(&format!(", {start}"), &format!("\n{start}"))
        })
    };
    let entries = entries.map(one_a_line).collect::<Vec<_>>();
    entries.iter().flat_map(|cell| cell.lines()).map(str::to_owned).collect()
}

#[test]
fn the_manual_lists_every_bound_of_the_code_with_its_value() {
    let (code, manual) = (bounds_in_code(), bounds_in_manual());
    assert!(code.len() > 50, "{}", code.len());
    let missing: Vec<_> = code.difference(&manual).collect();
    let wrong: Vec<_> = manual.difference(&code).collect();
    assert!(missing.is_empty() && wrong.is_empty(), "missing {missing:#?}, wrong {wrong:#?}");
}

#[test]
fn the_manual_lists_every_bound_of_the_configuration() {
    let config = read("src/config.rs");
    let manual = read("docs/operations/limits.md") + &read("docs/operations/configuration.md");
    let (_, rest) = config.split_once("pub struct RetentionConfig {").unwrap();
    let (body, _) = rest.split_once("\n}").unwrap();
    let fields =
        body.lines().filter_map(|line| line.trim().strip_prefix("pub ")?.split(':').next());
    let retention = fields.map(|field| format!("retention.{field}"));
    let others = SECTIONS.iter().copied().flatten().map(|key| (*key).to_owned());
    for key in others.chain(retention) {
        let is_listed = manual.contains(&format!("`{key}`"));
        assert!(is_listed, "{key} is neither in limits.md nor in configuration.md");
    }
}
