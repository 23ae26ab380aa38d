//! Finds in comments, documents, messages and the page the words that `CONTRIBUTING.md` rules out
//! and that can be found without false alarms.

use std::path::{Path, PathBuf};

use super::ROOT;

/// What is read, relative to the root. Migrations are left out: their checksums are stored.
const READ: [&str; 18] = [
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CODE_OF_CONDUCT.md",
    "README.md",
    "SECURITY.md",
    "benches",
    "build.rs",
    "changes",
    "clients",
    "crates",
    "deploy",
    "docs",
    "examples",
    "fuzz",
    "scripts",
    "src",
    "tests",
    "web",
];

/// Endings of the files that are read; scripts have none.
const ENDINGS: [&str; 15] =
    ["", "c", "cpp", "css", "h", "html", "ino", "js", "md", "mjs", "py", "rs", "toml", "ts", "tsx"];

/// Folders of what is not written here, beside hidden ones, such as the caches of tools.
const LEFT_OUT: [&str; 7] =
    ["node_modules", "target", "dist", "generated", "migrations", "corpus", "__pycache__"];

/// Comparatives: "is no longer" is English.
const COMPARED: [&str; 17] = [
    "better", "earlier", "faster", "fewer", "greater", "higher", "larger", "later", "less",
    "longer", "lower", "more", "older", "shorter", "slower", "smaller", "worse",
];

#[test]
fn nothing_is_written_that_the_rules_for_english_rule_out() {
    let mut found = Vec::new();
    for file in READ.into_iter().flat_map(|path| files(Path::new(path))) {
        let text = std::fs::read_to_string(Path::new(ROOT).join(&file)).unwrap();
        found.extend(
            findings(&text).map(|(line, advice)| format!("{}:{line}: {advice}", file.display())),
        );
    }
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

/// Returns the files at and below `path`, relative to the root, without this one.
fn files(path: &Path) -> Vec<PathBuf> {
    let whole = Path::new(ROOT).join(path);
    if whole.is_dir() {
        let names = std::fs::read_dir(whole).unwrap().map(|entry| entry.unwrap().file_name());
        let names = names.map(|name| name.into_string().unwrap());
        let is_read = |name: &String| !name.starts_with('.') && !LEFT_OUT.contains(&&**name);
        return names.filter(is_read).flat_map(|name| files(&path.join(name))).collect();
    }
    let ending = path.extension().map_or("", |ending| ending.to_str().unwrap());
    let is_read = ENDINGS.contains(&ending) && !path.ends_with("architecture/english.rs");
    is_read.then(|| path.to_owned()).into_iter().collect()
}

/// A word in lower case.
struct Word {
    text: String,
    line: usize,
    /// Whether it is the last one before a punctuation mark or the end.
    is_last: bool,
}

/// Returns the lines of `text` with words to replace, and what by.
fn findings(text: &str) -> impl Iterator<Item = (usize, &'static str)> {
    let words = words(text);
    (0..words.len()).filter_map(move |i| Some((words[i].line, advice(&words[..i], &words[i..])?)))
}

/// Returns what to write instead of the first words of `next`.
fn advice(before: &[Word], next: &[Word]) -> Option<&'static str> {
    let word = |i: usize| next.get(i).map_or("", |word| &word.text);
    let is_form_of_be = ["is", "are", "was", "were", "be"].contains(&word(0));
    let follows_there = before.last().is_some_and(|word| word.text == "there" && !word.is_last);
    match (word(0), word(1), word(2)) {
        (_, "no", what)
            if is_form_of_be
                && !next[0].is_last
                && !next[1].is_last
                && !follows_there
                && !COMPARED.contains(&what) =>
        {
            Some("write `is not a`, not `is no`")
        }
        ("without", "a", "word") => Some("write `silently`, not `without a word`"),
        ("anew", ..) => Some("write `again`, not `anew`"),
        ("of", "its" | "their", "own") if next.len() > 2 && next[2].is_last => {
            Some("write `its own X`, not `an X of its own`")
        }
        (_, "waited", "for") if is_form_of_be => {
            Some("write `X waits for Y`, not `Y is waited for`")
        }
        _ => None,
    }
}

/// Returns the words of `text` without the marks of comments, so that a sentence goes on in the
/// next line of its comment.
fn words(text: &str) -> Vec<Word> {
    let mut words: Vec<Word> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.trim_start().trim_start_matches(['/', '!', '#', '*', '-', ' ']);
        for part in line.split_whitespace() {
            let mut rest = part;
            while let Some(start) = rest.find(|c: char| c.is_alphanumeric()) {
                if rest[..start].chars().any(|c| c != '_')
                    && let Some(last) = words.last_mut()
                {
                    last.is_last = true;
                }
                let is_word = |c: char| c.is_alphanumeric() || c == '-';
                let end = rest[start..].find(|c| !is_word(c)).map_or(rest.len(), |n| start + n);
                let text = rest[start..end].to_lowercase();
                words.push(Word { text, line: i + 1, is_last: false });
                rest = &rest[end..];
            }
            if !rest.is_empty()
                && let Some(last) = words.last_mut()
            {
                last.is_last = true;
            }
        }
    }
    if let Some(last) = words.last_mut() {
        last.is_last = true;
    }
    words
}

#[test]
fn words_to_replace_are_found() {
    let lines = |text| findings(text).map(|(line, _)| line).collect::<Vec<_>>();
    for text in [
        "A row that is no sample.",
        "/// Rows that are\n    /// no samples.",
        "error(\"it is no text\")",
        "Packets vanish without a word.",
        "It begins anew.",
        "A thread of its own; it ends.",
        "Formats of their own",
        "fn what_is_no_sample()",
        "A node is waited for that is gone.",
    ] {
        assert_eq!(lines(text), [1], "{text}");
    }
    for text in [
        "There is no session `s`.",
        "error(\"there are no rows below the names\")",
        "It is no longer open.",
        "Yes is no. Rigs follow.",
        "What it is: no value is known.",
        "The rights of its own asset.",
        "fn judged_by_its_own_sessions()",
        "fn sessions_of_its_own_rig()",
        "The service waited for a node.",
    ] {
        assert_eq!(lines(text), [0; 0], "{text}");
    }
    assert_eq!(lines("fn f()\n// one\n// It was no end.\n"), [3]);
}
