//! Checks the relative links between documents: each file and each heading that they name exists.

use std::collections::BTreeSet;
use std::path::Path;

use super::{ROOT, pages};

/// Documents of parts of the repository, whose links are checked too.
const PARTS: [&str; 4] = [
    "benches/peers/README.md",
    "clients/arduino/README.md",
    "crates/offbd-python/README.md",
    "examples/ros2/README.md",
];

#[test]
fn every_link_between_documents_leads_somewhere() {
    let mut dead = Vec::new();
    for document in pages().into_iter().chain(PARTS.map(str::to_owned)) {
        let file = Path::new(ROOT).join(&document);
        let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{document}: {e}"));
        let folder = file.parent().unwrap();
        dead.extend(dead_links(&document, &text, |path| anchors_of(&folder.join(path))));
    }
    assert!(dead.is_empty(), "\n{}\n", dead.join("\n"));
}

#[test]
fn every_document_is_a_chapter_of_the_book() {
    let docs = Path::new(ROOT).join("docs");
    let summary = std::fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
    let resolve = |path: &Path| std::fs::canonicalize(path).unwrap();
    let chapters: Vec<_> =
        links(&summary).iter().map(|(_, link)| resolve(&docs.join(link))).collect();
    let all = pages().into_iter().chain(PARTS.map(str::to_owned));
    for document in all.filter(|document| document != "docs/SUMMARY.md") {
        let n = chapters
            .iter()
            .filter(|&chapter| *chapter == resolve(&Path::new(ROOT).join(&document)));
        assert_eq!(n.count(), 1, "{document} in docs/SUMMARY.md");
    }
}

/// Returns the anchors of a file, which has none if it is not a document; `None` if it does not
/// exist.
fn anchors_of(path: &Path) -> Option<BTreeSet<String>> {
    let is_document = path.extension().is_some_and(|extension| extension == "md");
    match path.exists() {
        false => None,
        true if is_document => Some(anchors(&std::fs::read_to_string(path).unwrap())),
        true => Some(BTreeSet::new()),
    }
}

/// Returns a message with line and link for every relative link in `text` whose file or heading
/// does not exist. `anchors_of` returns the anchors of a file by its path relative to the document.
fn dead_links(
    document: &str,
    text: &str,
    anchors_of: impl Fn(&str) -> Option<BTreeSet<String>>,
) -> Vec<String> {
    let mut dead = Vec::new();
    for (number, link) in links(text) {
        let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
        let target = if path.is_empty() { Some(anchors(text)) } else { anchors_of(path) };
        let missing = match target {
            None => "file",
            Some(headings) if !anchor.is_empty() && !headings.contains(anchor) => "heading",
            Some(_) => continue,
        };
        dead.push(format!("{document}:{number}: `{link}`: the {missing} does not exist"));
    }
    dead
}

/// Returns the relative links in `text`, each with the number of its line.
fn links(text: &str) -> Vec<(usize, &str)> {
    let mut links = Vec::new();
    for (number, line) in prose(text) {
        let targets = line.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        let relative = targets.filter(|target| !target.contains(':'));
        links.extend(relative.map(|target| (number, target)));
    }
    links
}

/// Returns the anchors of the headings in `text`, by GitHub's rules: those of equal headings are
/// numbered from the second one on.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut anchors = BTreeSet::new();
    for (_, line) in prose(text) {
        let Some(heading) = line.strip_prefix('#') else { continue };
        let Some(heading) = heading.trim_start_matches('#').strip_prefix(' ') else { continue };
        let slug = slug(heading);
        let mut n_equal = 0;
        let mut anchor = slug.clone();
        while !anchors.insert(anchor) {
            n_equal += 1;
            anchor = format!("{slug}-{n_equal}");
        }
    }
    anchors
}

/// Returns the anchor of a heading that occurs once.
fn slug(heading: &str) -> String {
    let is_kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
    let kept = heading.to_lowercase().chars().filter(is_kept).collect::<String>();
    kept.replace(' ', "-")
}

/// Returns the lines of `text` outside fenced blocks, each with its number.
fn prose(text: &str) -> Vec<(usize, &str)> {
    let mut is_fenced = false;
    let mut lines = Vec::new();
    for (i, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            is_fenced = !is_fenced;
        } else if !is_fenced {
            lines.push((i + 1, line));
        }
    }
    lines
}

#[test]
fn a_dead_link_is_reported_with_its_line() {
    let text =
        "# One\n\n[a](gone.md), [b](two.md#here), [c](two.md#there)\n[d](#one), [e](#none)\n";
    let anchors_of = |path: &str| (path == "two.md").then(|| anchors("## Here\n"));
    assert_eq!(
        dead_links("A.md", text, anchors_of),
        [
            "A.md:3: `gone.md`: the file does not exist",
            "A.md:3: `two.md#there`: the heading does not exist",
            "A.md:4: `#none`: the heading does not exist"
        ]
    );
}

#[test]
fn addresses_and_fenced_blocks_have_no_relative_links() {
    let text = "[site](https://example.org/a.md#b)\n```sh\n[x](gone.md)\n```\n![y](y.svg)\n";
    assert_eq!(links(text), [(5, "y.svg")]);
}

#[test]
fn headings_have_the_anchors_that_github_gives_them() {
    let text =
        "# What is *unfair*, and to whom?\n## Limits\n```sh\n# Stop\n```\n### Limits\n#3 is none\n";
    let found = anchors(text).into_iter().collect::<Vec<_>>();
    assert_eq!(found, ["limits", "limits-1", "what-is-unfair-and-to-whom"]);
}
