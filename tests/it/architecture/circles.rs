//! The files of a crate use each other in one direction: a file that one uses, directly or by
//! others, does not use that one. What a module hands on, or has below it, it may use, and what is
//! below it may use the module.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::{ROOT, crates, files};

/// The path of a module within its crate.
type Module = Vec<String>;

/// The modules of a crate, each with its text.
type Modules = BTreeMap<Module, String>;

#[test]
fn no_files_of_a_crate_use_each_other() {
    let mut n_uses = 0;
    for folder in crates() {
        let modules = modules(&folder);
        let uses = uses(&modules);
        n_uses += uses.values().map(BTreeSet::len).sum::<usize>();
        let circles: Vec<_> = uses.keys().filter_map(|start| circle(&uses, start)).collect();
        assert!(circles.is_empty(), "{folder}: {}", circles.join("\n"));
    }
    assert!(n_uses > 1000, "{n_uses}");
}

/// Returns the modules of the crate in `folder` without its tests.
fn modules(folder: &str) -> Modules {
    let mut modules = Modules::new();
    for file in files(folder) {
        let own = file.strip_prefix(folder).unwrap().trim_start_matches('/');
        let mut module: Module =
            own.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
        if module.iter().any(|name| name == "tests" || name.ends_with("_tests")) {
            continue;
        }
        if matches!(module.last().map(String::as_str), Some("mod" | "lib" | "main")) {
            module.pop();
        }
        let text = std::fs::read_to_string(Path::new(ROOT).join(&file)).unwrap();
        // A crate may be a library and a program.
        modules.entry(module).or_default().push_str(&code(&text));
    }
    modules
}

/// Returns `text` without comments, the tests at its end, and line breaks.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default().trim());
    lines.flat_map(|line| [line, " "]).collect()
}

/// Returns which other modules each module uses, except those above it.
fn uses(modules: &Modules) -> BTreeMap<&Module, BTreeSet<&Module>> {
    let mut uses = BTreeMap::new();
    for (module, text) in modules {
        let used = paths(text).into_iter().filter_map(|path| target(modules, module, &path));
        uses.insert(module, used.filter(|used| !module.starts_with(used)).collect());
    }
    uses
}

/// Returns the paths that begin with `crate`, `self` or `super` in `text`.
fn paths(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for start in ["crate::", "self::", "super::"] {
        for (at, _) in text.match_indices(start) {
            let is_inside = |c: char| c.is_alphanumeric() || "_:$".contains(c);
            if !text[..at].ends_with(is_inside) {
                expand("", &text[at..], &mut found);
            }
        }
    }
    found
}

/// Adds the paths of the use tree that `text` begins with to `found`, each behind `prefix`, and
/// returns what follows the tree.
fn expand<'a>(prefix: &str, text: &'a str, found: &mut Vec<String>) -> &'a str {
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_' && c != ':');
    let (path, mut rest) = text.split_at(end.unwrap_or(text.len()));
    let path = format!("{prefix}{path}");
    let Some(inside) = rest.strip_prefix('{').filter(|_| path.ends_with("::")) else {
        found.push(path);
        return rest;
    };
    rest = inside.trim_start();
    while !rest.is_empty() && !rest.starts_with('}') {
        let before = rest;
        rest = expand(&path, rest, found).trim_start();
        // What a name is used as, and the comma.
        rest = &rest[rest.find([',', '}']).unwrap_or(rest.len())..];
        rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
        assert!(rest.len() < before.len(), "{before}");
    }
    rest.strip_prefix('}').unwrap_or(rest)
}

/// Returns the innermost module that `path` names, which stands in `module`.
fn target<'a>(modules: &'a Modules, module: &Module, path: &str) -> Option<&'a Module> {
    let mut names = path.split("::").peekable();
    let mut at = match names.next()? {
        "crate" => Module::new(),
        "self" => module.clone(),
        _ => module[..module.len().checked_sub(1)?].to_vec(),
    };
    while names.next_if_eq(&"super").is_some() {
        at.pop()?;
    }
    for name in names {
        at.push(name.to_owned());
        if !modules.contains_key(&at) {
            at.pop();
            break;
        }
    }
    modules.get_key_value(&at).map(|(module, _)| module).filter(|found| *found != module)
}

/// Returns the shortest way from `start` back to it, if there is one and `start` is the first of
/// its modules by name.
fn circle(uses: &BTreeMap<&Module, BTreeSet<&Module>>, start: &Module) -> Option<String> {
    let mut ways = vec![vec![start]];
    let mut seen = BTreeSet::new();
    while !ways.is_empty() {
        let mut longer = Vec::new();
        for way in ways {
            for next in &uses[way[way.len() - 1]] {
                if *next == start {
                    let names = way.iter().chain([next]).map(|module| module.join("::"));
                    return Some(names.collect::<Vec<_>>().join(" -> "));
                }
                if *next > start && seen.insert(*next) {
                    longer.push(way.iter().copied().chain([*next]).collect());
                }
            }
        }
        ways = longer;
    }
    None
}

#[test]
fn a_circle_is_found_through_groups_and_parents() {
    let text = [
        ("a", "use super::b::{self, Thing as Other, c::{D, E}}; use std::fmt;"),
        ("b", "use crate::e::F;"),
        ("b/c", "use super::Own; fn f() { super::super::e::g() }"),
        ("e", "mod inner; use self::inner::X; // use crate::a::Y;"),
        ("e/inner", "fn f() { crate::a::h() }"),
    ];
    let modules: Modules = text
        .iter()
        .map(|(path, text)| (path.split('/').map(str::to_owned).collect(), code(text)))
        .collect();
    let uses = uses(&modules);
    let found: Vec<_> = uses.keys().filter_map(|start| circle(&uses, start)).collect();
    assert_eq!(found, ["a -> b -> e -> e::inner -> a"]);
}
