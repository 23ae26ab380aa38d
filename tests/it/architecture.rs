//! The rules of the house that the compiler does not keep: which part of the
//! service knows which, and documents that name only what is there.
//! `ARCHITECTURE.md` says why.

mod documents;

use std::path::{Path, PathBuf};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Documents whose paths must exist.
const DOCUMENTS: [&str; 3] = ["ARCHITECTURE.md", "README.md", "CONTRIBUTING.md"];

/// What may not be named in a folder: the parts of the service above it, and
/// what is another part's trade.
const FORBIDDEN: [(&str, &[&str]); 7] = [
    ("src/wire", &["crate::store", "crate::service", "crate::http", "axum::", "sqlx::", "tokio::"]),
    ("src/store", &["crate::wire", "crate::service", "crate::http", "axum::", "StatusCode"]),
    (
        "src/service",
        &["crate::http", "crate::config", "crate::server", "crate::cli", "axum::", "sqlx::"],
    ),
    (
        "src/http",
        &["crate::store", "crate::config", "crate::server", "crate::cli", "sqlx::", "\"SELECT "],
    ),
    ("src/server", &["crate::cli", "offbd_lab"]),
    (
        "crates/offbd-core/src",
        &[
            "HashMap",
            "HashSet",
            "std::time",
            "std::fs",
            "std::env",
            "std::net",
            "std::io",
            "std::thread",
        ],
    ),
    ("crates/offbd-lab/src/simulation", &["rand::rng", "Instant::now", "SystemTime::now"]),
];

#[test]
fn no_part_names_what_it_must_not_know() {
    let mut found = Vec::new();
    for (folder, words) in FORBIDDEN {
        for file in files(folder) {
            let text = std::fs::read_to_string(Path::new(ROOT).join(&file)).unwrap();
            for (number, word) in named(&text, words) {
                found.push(format!("{file}:{number}: `{word}` in {folder}"));
            }
        }
    }
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

/// Lines of `text`, comments aside, with a word of `words`.
fn named<'a>(text: &'a str, words: &'a [&str]) -> impl Iterator<Item = (usize, &'a str)> {
    let code = |line: &&str| !line.trim_start().starts_with("//");
    let lines = text.lines().enumerate().filter(move |(_, line)| code(line));
    lines.flat_map(move |(i, line)| {
        words.iter().filter(move |word| line.contains(*word)).map(move |word| (i + 1, *word))
    })
}

#[test]
fn a_word_is_found_in_code_and_not_in_comments() {
    let text = "// axum::Router\nuse axum::Router;\n    /// `axum::Router`\n";
    assert_eq!(named(text, &["axum::"]).collect::<Vec<_>>(), [(2, "axum::")]);
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

/// Source files below `folder`, relative to the root.
fn files(folder: &str) -> Vec<String> {
    let (mut found, mut todo) = (Vec::new(), vec![PathBuf::from(folder)]);
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
    assert!(!found.is_empty(), "{folder}: no source file");
    found
}
