//! Compares the lists of bounds in the documents with the code.

use std::collections::BTreeSet;
use std::path::Path;

use super::{ROOT, files};

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
    let manual = read("docs/operations/limits.md") + &read("docs/internals/bounds.md");
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
