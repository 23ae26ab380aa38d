//! The rules of the house, executable: floors, what a floor may not know, and
//! documents that name only what is there. `ARCHITECTURE.md` says why.

#[path = "architecture/documents.rs"]
mod documents;
#[path = "architecture/rules.rs"]
mod rules;
#[path = "architecture/scan.rs"]
mod scan;

use std::path::{Path, PathBuf};

use rules::{FLOORS, violations};
use scan::Source;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Documents whose paths must exist.
const DOCUMENTS: [&str; 3] = ["ARCHITECTURE.md", "README.md", "CONTRIBUTING.md"];

#[test]
fn every_file_keeps_the_rules_of_its_floor() {
    let found: Vec<String> =
        files().iter().flat_map(|file| violations(file, &read(file))).collect();
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

/// A floor for a module that is gone is a rule that nobody keeps.
#[test]
fn every_module_with_a_floor_exists() {
    let gone: Vec<&str> = FLOORS
        .iter()
        .map(|rule| rule.module)
        .filter(|module| {
            let at = Path::new(ROOT).join("src").join(module);
            !at.is_dir() && !at.with_extension("rs").is_file()
        })
        .collect();
    assert!(gone.is_empty(), "no such module in src: {gone:?}");
}

#[test]
fn documents_name_only_what_is_there() {
    let exists = |path: &str| {
        let root = Path::new(ROOT);
        root.join(path).exists() || root.join("src").join(path).exists()
    };
    let missing: Vec<String> = DOCUMENTS
        .iter()
        .flat_map(|name| {
            let text = std::fs::read_to_string(Path::new(ROOT).join(name))
                .unwrap_or_else(|error| panic!("{name}: {error}"));
            documents::missing_paths(name, &text, exists)
        })
        .collect();
    assert!(missing.is_empty(), "\n{}\n", missing.join("\n"));
}

/// Source files, relative to the root, in the order of their names.
fn files() -> Vec<String> {
    let mut found = Vec::new();
    let mut todo = vec![PathBuf::from("src")];
    while let Some(directory) = todo.pop() {
        for entry in std::fs::read_dir(Path::new(ROOT).join(&directory)).unwrap() {
            let entry = entry.unwrap();
            let path = directory.join(entry.file_name());
            if entry.file_type().unwrap().is_dir() {
                todo.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path.to_str().unwrap().replace('\\', "/"));
            }
        }
    }
    found.sort();
    assert!(
        found.len() > 50,
        "only {} files found: the scan looks at the wrong place",
        found.len()
    );
    found
}

fn read(file: &str) -> Source {
    Source::new(&std::fs::read_to_string(Path::new(ROOT).join(file)).unwrap())
}
