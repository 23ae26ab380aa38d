//! Rules of `ARCHITECTURE.md` that the compiler does not check: names that some folders must not
//! use, and that documents name only existing paths and headings.

mod blocks;
mod bounds;
mod changes;
mod circles;
mod documents;
mod english;
mod links;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Documents outside `docs/` whose paths must exist.
const DOCUMENTS: [&str; 3] = ["ARCHITECTURE.md", "README.md", "CONTRIBUTING.md"];

/// The folders of documents.
const DOCUMENT_FOLDERS: [&str; 3] = ["docs", "docs/internals", "docs/operations"];

/// Returns the documents whose paths must exist: `DOCUMENTS` and those in `DOCUMENT_FOLDERS`.
fn pages() -> Vec<String> {
    let in_folders = DOCUMENT_FOLDERS.into_iter().flat_map(documents_in);
    DOCUMENTS.map(str::to_owned).into_iter().chain(in_folders).collect()
}

/// Returns the documents in `folder`, without those in its subfolders.
fn documents_in(folder: &str) -> Vec<String> {
    let entries = std::fs::read_dir(Path::new(ROOT).join(folder)).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let documents = names.filter(|name| name.ends_with(".md"));
    documents.map(|name| format!("{folder}/{name}")).collect()
}

/// Names that must not occur in a folder, beyond what the dependencies of its crate forbid: what
/// makes the same input give another result.
const FORBIDDEN: [(&str, &[&str]); 3] = [
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
    ("crates/offbd-fmu-model/src", &["std::fs", "std::time", "std::ffi", "unsafe"]),
    ("crates/offbd-lab/src/simulation", &["rand::rng", "Instant::now", "SystemTime::now"]),
];

#[test]
fn no_folder_uses_a_name_that_is_forbidden_there() {
    let mut found = Vec::new();
    for (folder, names) in FORBIDDEN {
        for file in files(folder) {
            let text = std::fs::read_to_string(Path::new(ROOT).join(&file)).unwrap();
            for (number, name) in occurrences(&text, names) {
                found.push(format!("{file}:{number}: {folder} must not use `{name}`"));
            }
        }
    }
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

/// Returns the lines of `text` with one of `names`, without comments.
fn occurrences<'a>(text: &'a str, names: &'a [&str]) -> impl Iterator<Item = (usize, &'a str)> {
    let code = |line: &&str| !line.trim_start().starts_with("//");
    let lines = text.lines().enumerate().filter(move |(_, line)| code(line));
    lines.flat_map(move |(i, line)| {
        names.iter().filter(move |name| line.contains(*name)).map(move |name| (i + 1, *name))
    })
}

#[test]
fn a_name_is_found_in_code_but_not_in_comments() {
    let text = "// axum::Router\nuse axum::Router;\n    /// `axum::Router`\n";
    assert_eq!(occurrences(text, &["axum::"]).collect::<Vec<_>>(), [(2, "axum::")]);
}

/// `Traces` is one type with, and another without, the feature `otel`.
const DEFINED_TWICE: [&str; 1] = ["Traces"];

/// Returns the source folders of the crates.
fn crates() -> Vec<String> {
    let crates = std::fs::read_dir(Path::new(ROOT).join("crates")).unwrap();
    let names = crates.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.map(|name| format!("crates/{name}/src")).chain(["src".to_owned()]).collect()
}

#[test]
fn no_type_name_occurs_twice_in_a_crate() {
    let mut found = Vec::new();
    for folder in crates() {
        let mut defined = BTreeMap::<String, Vec<String>>::new();
        for file in files(&folder) {
            let text = std::fs::read_to_string(Path::new(ROOT).join(&file)).unwrap();
            for name in text.lines().filter_map(type_name) {
                defined.entry(name.to_owned()).or_default().push(file.clone());
            }
        }
        defined.retain(|name, files| files.len() > 1 && !DEFINED_TWICE.contains(&name.as_str()));
        found.extend(defined.iter().map(|(name, files)| format!("{name}: {}", files.join(", "))));
    }
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

/// Returns the type that a line defines at the top level of a file.
fn type_name(line: &str) -> Option<&str> {
    const KEYWORDS: [&str; 4] = ["struct", "enum", "trait", "type"];
    let definition = match line.strip_prefix("pub(") {
        Some(restricted) => restricted.split_once(") ")?.1,
        None => line.strip_prefix("pub ").unwrap_or(line),
    };
    let (keyword, rest) = definition.split_once(' ')?;
    let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
    KEYWORDS.contains(&keyword).then_some(&rest[..end])
}

#[test]
fn a_type_is_known_by_its_definition() {
    for line in
        ["pub struct Name {", "pub(in a::b) enum Name<T> {", "type Name = u8;", "trait Name: A {"]
    {
        assert_eq!(type_name(line), Some("Name"), "{line}");
    }
    for line in
        ["    type Name = u8;", "// struct Name", "pub fn name(type_name: u8) {", "use a::Name;"]
    {
        assert_eq!(type_name(line), None, "{line}");
    }
}

#[test]
fn every_path_named_in_a_document_exists() {
    let exists = |path: &str| {
        let root = Path::new(ROOT);
        root.join(path).exists() || root.join("src").join(path).exists()
    };
    let missing: Vec<String> = pages()
        .iter()
        .flat_map(|name| {
            let text = std::fs::read_to_string(Path::new(ROOT).join(name))
                .unwrap_or_else(|error| panic!("{name}: {error}"));
            documents::missing_paths(name, &text, exists)
        })
        .collect();
    assert!(missing.is_empty(), "\n{}\n", missing.join("\n"));
}

#[test]
fn what_the_image_is_built_from_is_sent_to_the_builder() {
    let read = |name: &str| std::fs::read_to_string(Path::new(ROOT).join(name)).unwrap();
    let (image, sent) = (read("Dockerfile"), read(".dockerignore"));
    let copies = image.lines().filter_map(|line| line.strip_prefix("COPY "));
    let mut n_copied = 0;
    for copy in copies.filter(|copy| !copy.starts_with("--from")) {
        let paths: Vec<&str> = copy.split(' ').collect();
        for path in &paths[..paths.len() - 1] {
            assert!(Path::new(ROOT).join(path).exists(), "{path} does not exist");
            assert!(sent.lines().any(|line| line == format!("!{path}")), "{path} is not sent");
            n_copied += 1;
        }
    }
    assert!(n_copied > 5);
}

#[test]
fn the_image_asks_the_service_whether_it_is_ready() {
    let image = std::fs::read_to_string(Path::new(ROOT).join("Dockerfile")).unwrap();
    let check = image.lines().find(|line| line.starts_with("HEALTHCHECK ")).unwrap();
    assert!(check.ends_with(r#" CMD ["offbd", "check", "--health"]"#), "{check}");
}

/// Returns the Rust source files below `folder`, relative to the root.
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
