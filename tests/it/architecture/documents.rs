//! Finds the paths that documents name.

/// Endings by which a name without a folder is recognised as a file of this repository. Data
/// files of the reader have others.
const FILE_ENDINGS: [&str; 5] = [".rs", ".md", ".yaml", ".sql", ".lock"];

/// Endings by which a name with a folder is recognised as a path.
const PATH_ENDINGS: [&str; 11] =
    [".rs", ".md", ".yaml", ".sql", ".lock", ".toml", ".py", ".svg", ".sh", ".html", "/"];

/// Returns a message with line and path for every path in `text` for which `exists` is
/// false. Paths are searched in code spans, not in fenced blocks, which show the reader's own
/// directory.
pub fn missing_paths(document: &str, text: &str, exists: impl Fn(&str) -> bool) -> Vec<String> {
    let mut missing = Vec::new();
    let mut fenced = false;
    for (number, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
            continue;
        }
        if fenced {
            continue;
        }
        let spans = line.split('`').skip(1).step_by(2).filter(|span| is_path(span));
        for path in spans.filter(|path| !exists(path)) {
            missing.push(format!("{document}:{}: `{path}` does not exist", number + 1));
        }
    }
    missing
}

/// Returns whether a code span looks like a path of this repository, and not like an HTTP
/// path, a pattern or a command.
fn is_path(span: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    if span.is_empty() || !span.chars().all(plain) || span.starts_with('/') {
        return false;
    }
    let ends = |endings: &[&str]| endings.iter().any(|ending| span.ends_with(ending));
    if span.contains('/') {
        ends(&PATH_ENDINGS) || is_in_known_folder(span)
    } else {
        ends(&FILE_ENDINGS)
    }
}

fn is_in_known_folder(span: &str) -> bool {
    let folders =
        ["src/", "crates/", "tests/", "examples/", "scripts/", "migrations/", "docs/", ".ci/"];
    folders.iter().any(|folder| span.starts_with(folder))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_path_is_reported_with_its_line() {
        let text = "See `src/engine/admit.rs`.\n\nAnd `src/utils/misc.rs`, `docs/gone.svg`.\n";
        let exists = |path: &str| path == "src/engine/admit.rs";
        assert_eq!(
            missing_paths("A.md", text, exists),
            [
                "A.md:3: `src/utils/misc.rs` does not exist",
                "A.md:3: `docs/gone.svg` does not exist"
            ]
        );
    }

    #[test]
    fn text_that_is_not_a_path_is_ignored() {
        let text = "`/api/v1/assets`, `cargo test`, `offbd_core::engine`, `rig.json`, `m/s`, `w/o`\n\
            ```sh\ncat `src/none.rs`\n```\n[site](https://example.org/a.md) [below](#limits)\n";
        assert_eq!(missing_paths("A.md", text, |_| false), Vec::<String>::new());
    }
}
