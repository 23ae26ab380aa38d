//! The files of `changes/`, from which a release makes the change log, have the form that
//! `changes/README.md` describes.

/// The words with which a change begins.
const KINDS: [&str; 5] = ["added", "breaks", "changed", "fixed", "security"];

/// Why a file is not a change, if it is not.
fn fault(text: &str) -> Option<&'static str> {
    let (first, rest) = text.split_once('\n').unwrap_or((text, ""));
    let Some((kind, sentence)) = first.split_once(": ") else {
        return Some("the first line is not `WORD: SENTENCE`");
    };
    let is_kind = |word: &str| KINDS.contains(&word);
    let starts = |line: &str| line.split_once(':').is_some_and(|(word, _)| is_kind(word));
    if !is_kind(kind) {
        Some("the first word is not one of the table in changes/README.md")
    } else if sentence.starts_with(char::is_lowercase) || !sentence.trim_end().ends_with('.') {
        Some("the first line is not a sentence")
    } else if rest.lines().any(starts) {
        Some("a second change needs its own file")
    } else {
        None
    }
}

#[test]
fn each_change_has_the_form_that_a_release_collects() {
    let files = std::fs::read_dir("changes").unwrap().map(|entry| entry.unwrap().path());
    let changes = files.filter(|path| !path.ends_with("README.md"));
    let faults: Vec<_> = changes
        .filter_map(|path| Some((path.clone(), fault(&std::fs::read_to_string(path).unwrap())?)))
        .collect();
    assert!(faults.is_empty(), "{faults:?}");
}

#[test]
fn what_is_not_a_change_is_told() {
    for text in ["added: A sentence.\n", "fixed: `x` works.\n\nMore: of it.\n"] {
        assert_eq!(fault(text), None, "{text}");
    }
    for text in [
        "",
        "A sentence.\n",
        "mended: A sentence.\n",
        "added: a sentence.\n",
        "added: A sentence\n",
        "added: One.\nbreaks: Another.\n",
    ] {
        assert!(fault(text).is_some(), "{text}");
    }
}
