//! Paths that documents name.

/// Endings by which a name without a folder is taken for a file of this
/// repository; data files of a reader's own have others.
const FILES: [&str; 5] = [".rs", ".md", ".yaml", ".sql", ".lock"];

/// Endings that make a name with a folder a path.
const ENDINGS: [&str; 11] =
    [".rs", ".md", ".yaml", ".sql", ".lock", ".toml", ".py", ".svg", ".sh", ".html", "/"];

/// `document:line: path` for every path in `text` for which `exists` is false.
/// Paths are looked for in code spans and in the targets of links, not in
/// fenced blocks: those show a reader's own directory.
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
        let links = line.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        let links = links.filter(|link| !link.contains("://") && !link.starts_with('#'));
        let links = links.map(|link| link.split('#').next().unwrap_or(link));
        for path in spans.chain(links).filter(|path| !exists(path)) {
            missing.push(format!("{document}:{}: `{path}` is not there", number + 1));
        }
    }
    missing
}

/// Whether a code span looks like a path of this repository: not an HTTP path,
/// not a pattern, not a command.
fn is_path(span: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    if span.is_empty() || !span.chars().all(plain) || span.starts_with('/') {
        return false;
    }
    let ends = |endings: &[&str]| endings.iter().any(|ending| span.ends_with(ending));
    if span.contains('/') { ends(&ENDINGS) || under_a_folder(span) } else { ends(&FILES) }
}

fn under_a_folder(span: &str) -> bool {
    let folders =
        ["src/", "crates/", "tests/", "examples/", "scripts/", "migrations/", "docs/", ".ci/"];
    folders.iter().any(|folder| span.starts_with(folder))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_that_is_gone_is_named_with_its_line() {
        let text =
            "See `src/engine/admit.rs`.\n\nAnd `src/utils/misc.rs`, [here](docs/gone.svg).\n";
        let exists = |path: &str| path == "src/engine/admit.rs";
        assert_eq!(
            missing_paths("A.md", text, exists),
            ["A.md:3: `src/utils/misc.rs` is not there", "A.md:3: `docs/gone.svg` is not there"]
        );
    }

    #[test]
    fn what_is_no_path_is_left_alone() {
        let text = "`/api/v1/assets`, `cargo test`, `offbd_core::engine`, `rig.json`, `m/s`, `w/o`\n\
            ```sh\ncat `src/none.rs`\n```\n[site](https://example.org/a.md) [below](#limits)\n";
        assert_eq!(missing_paths("A.md", text, |_| false), Vec::<String>::new());
    }
}
