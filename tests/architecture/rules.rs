//! The floors and what each may not know.

use std::fmt::Display;

use crate::scan::{Named, Source};

/// Where a module stands.
pub struct Rule {
    pub module: &'static str,
    pub floor: u8,
    /// Modules on the same floor that it may use. A module may use every lower
    /// floor, itself, and nothing else.
    beside: &'static [&'static str],
}

const fn rule(module: &'static str, floor: u8, beside: &'static [&'static str]) -> Rule {
    Rule { module, floor, beside }
}

/// Every top module of `src/`.
pub const FLOORS: [Rule; 15] = [
    rule("vocabulary", 0, &[]),
    rule("maths", 1, &[]),
    rule("plant", 1, &["maths"]),
    rule("scene", 2, &[]),
    rule("diagnosis", 2, &[]),
    rule("engine", 3, &[]),
    rule("wire", 4, &[]),
    rule("store", 4, &[]),
    rule("simulation", 4, &[]),
    rule("service", 4, &["wire", "store"]),
    rule("http", 4, &["wire", "service"]),
    rule("config", 5, &[]),
    rule("server", 5, &["config"]),
    rule("chart", 5, &[]),
    rule("cli", 5, &["chart", "config", "server"]),
];

/// The highest floor that is free of input, output, clocks and chance.
const PURE: u8 = 3;

/// What the pure floors may not name: runtimes, formats, files, clocks, chance,
/// and collections whose order changes from run to run.
const IMPURE: &[&str] = &[
    "anyhow",
    "axum",
    "clap",
    "csv",
    "jiff",
    "metrics",
    "rand",
    "rand_chacha",
    "rand_distr",
    "rayon",
    "reqwest",
    "serde",
    "serde_json",
    "sqlx",
    "tokio",
    "tracing",
    "uuid",
    "std::env",
    "std::fs",
    "std::io",
    "std::net",
    "std::process",
    "std::thread",
    "std::time::Instant",
    "std::time::SystemTime",
];

/// What adapters may not know of each other's trade.
const TRADES: &[(&str, &[&str])] = &[
    ("wire", &["axum", "sqlx", "tokio"]),
    ("store", &["axum", "http", "reqwest", "tower_http"]),
    (
        "simulation",
        &["axum", "rand::rng", "sqlx", "std::time::Instant", "std::time::SystemTime", "tokio"],
    ),
    ("service", &["axum", "sqlx"]),
    ("http", &["sqlx"]),
    ("chart", &["anyhow", "axum", "sqlx", "tokio"]),
];

/// How SQL begins; in capitals, as this code writes it.
const SQL: &[&str] = &["SELECT ", "INSERT ", "UPDATE ", "DELETE FROM ", "CREATE TABLE ", "PRAGMA "];

/// What is wrong with `file` (a path from the root, as `src/engine/admit.rs`).
pub fn violations(file: &str, source: &Source) -> Vec<String> {
    let module = top_module(file);
    if matches!(module, "lib" | "main") {
        return Vec::new();
    }
    let Some(rule) = FLOORS.iter().find(|rule| rule.module == module) else {
        return vec![format!("{file}:1: the module `{module}` has no floor")];
    };
    let mut found = Vec::new();
    let mut report = |line: usize, what: &dyn Display| found.push(format!("{file}:{line}: {what}"));
    for path in source.paths() {
        let full = resolved(file, &path);
        if let Some(wrong) = direction(rule, &full).or_else(|| knowledge(rule, &full)) {
            report(path.line, &wrong);
        }
    }
    if rule.floor <= PURE {
        for word in ["HashMap", "HashSet"] {
            for line in source.lines_with(word) {
                report(line, &format!("`{word}`: its order changes from run to run"));
            }
        }
    }
    if module == "store" {
        for line in source.lines_with("StatusCode") {
            report(line, &"the store knows no status codes");
        }
    }
    if module == "http" {
        for (line, text) in &source.strings {
            if let Some(word) = SQL.iter().find(|&&word| text.contains(word)) {
                report(*line, &format!("SQL (`{}`) outside the store", word.trim()));
            }
        }
    }
    found
}

fn top_module(file: &str) -> &str {
    let inside = file.strip_prefix("src/").unwrap_or(file);
    inside.split('/').next().unwrap_or(inside).trim_end_matches(".rs")
}

/// The path from the crate's root where it leads there, through `super` too.
fn resolved(file: &str, path: &Named) -> Vec<String> {
    let n_supers = path.segments.iter().take_while(|s| *s == "super").count();
    if n_supers == 0 {
        return path.segments.clone();
    }
    let inside = file.strip_prefix("src/").unwrap_or(file).trim_end_matches(".rs");
    let inside = inside.trim_end_matches("/mod");
    let depth = inside.split('/').count() + path.inline_depth;
    if n_supers < depth {
        return path.segments.clone();
    }
    let rest = path.segments[n_supers..].iter().cloned();
    std::iter::once("crate".to_owned()).chain(rest).collect()
}

/// Whether the path leads up or to a sibling that it may not.
fn direction(rule: &Rule, path: &[String]) -> Option<String> {
    let used = match path {
        [first, used, ..] if first == "crate" || first == "offbd" => used.as_str(),
        _ => return None,
    };
    let target = FLOORS.iter().find(|target| target.module == used)?;
    let (module, floor) = (rule.module, rule.floor);
    let allowed = target.floor < floor || used == module || rule.beside.contains(&used);
    (!allowed).then(|| {
        format!("`{module}` (floor {floor}) may not use `{used}` (floor {})", target.floor)
    })
}

/// Whether the path names something that the module may not know.
fn knowledge(rule: &Rule, path: &[String]) -> Option<String> {
    let pure = if rule.floor <= PURE { IMPURE } else { &[] };
    let trade = TRADES.iter().filter(|(module, _)| *module == rule.module).flat_map(|(_, t)| *t);
    let forbidden = pure.iter().chain(trade).find(|forbidden| begins_with(path, forbidden))?;
    Some(format!("`{}` (floor {}) may not know `{forbidden}`", rule.module, rule.floor))
}

fn begins_with(path: &[String], forbidden: &str) -> bool {
    let wanted: Vec<&str> = forbidden.split("::").collect();
    path.len() >= wanted.len() && path.iter().zip(wanted).all(|(segment, word)| segment == word)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The violations of a made-up file.
    fn of(file: &str, text: &str) -> Vec<String> {
        violations(file, &Source::new(text))
    }

    #[test]
    fn up_is_refused_in_every_spelling() {
        for text in [
            "use crate::service::Service;",
            "use crate::{vocabulary::Axis, service::Service};",
            "fn f() -> crate::service::Service { todo!() }",
            "pub(in crate::service) fn f() {}",
            "mod inner { use super::super::super::service::Service; }",
            "use super::super::service::Service;",
        ] {
            let found = of("src/engine/admit.rs", text);
            let wanted =
                "src/engine/admit.rs:1: `engine` (floor 3) may not use `service` (floor 4)";
            assert_eq!(found, [wanted], "{text}");
        }
    }

    #[test]
    fn down_and_within_is_allowed() {
        let text = "use super::rig::Rig;\nuse crate::engine::Setup;\nuse crate::plant::Twin;";
        assert_eq!(of("src/engine/admit.rs", text), Vec::<String>::new());
        let inline = "mod tests { use super::super::rig::Rig; }";
        assert_eq!(of("src/engine/admit.rs", inline), Vec::<String>::new());
    }

    #[test]
    fn siblings_have_one_direction() {
        assert_eq!(of("src/http/mod.rs", "use crate::service::Service;").len(), 0);
        assert_eq!(of("src/service/mod.rs", "use crate::http::App;").len(), 1);
        assert_eq!(of("src/http/mod.rs", "use crate::store::Store;").len(), 1);
        assert_eq!(of("src/plant/rolling.rs", "use crate::maths::RK4;").len(), 0);
        assert_eq!(of("src/maths/fit.rs", "use crate::plant::Twin;").len(), 1);
    }

    #[test]
    fn a_module_without_a_floor_is_named() {
        let found = of("src/utils/mod.rs", "");
        assert_eq!(found, ["src/utils/mod.rs:1: the module `utils` has no floor"]);
        assert_eq!(of("src/helpers.rs", "").len(), 1);
    }

    #[test]
    fn pure_floors_know_no_clock_no_files_no_chance() {
        for text in [
            "use std::time::Instant;",
            "use std::{fmt, time::{Duration, SystemTime}};",
            "fn f() { std::fs::read(\"x\"); }",
            "#[derive(serde::Serialize)]\nstruct S;",
            "use rand::Rng;",
            "fn f(m: std::collections::HashMap<u8, u8>) {}",
        ] {
            for file in ["src/vocabulary/time.rs", "src/engine/mod.rs"] {
                assert_eq!(of(file, text).len(), 1, "{file}: {text}");
            }
        }
        assert_eq!(of("src/engine/mod.rs", "use std::time::Duration;").len(), 0);
        assert_eq!(of("src/service/mod.rs", "use std::time::Instant;").len(), 0);
    }

    #[test]
    fn adapters_keep_to_their_trade() {
        let select = "fn f() {\n    let q = \"SELECT name FROM asset\";\n}";
        let found = of("src/http/assets.rs", select);
        assert_eq!(found, ["src/http/assets.rs:2: SQL (`SELECT`) outside the store"]);
        assert_eq!(of("src/store/read.rs", select).len(), 0);
        assert_eq!(of("src/store/read.rs", "fn f() -> StatusCode {}").len(), 1);
        assert_eq!(of("src/service/mod.rs", "use sqlx::Row;").len(), 1);
    }

    #[test]
    fn comments_and_strings_are_no_code() {
        let text = "//! Not crate::http::App.\n/* use tokio::sync; /* HashMap */ */\n\
            const A: &str = \"crate::http::App\"; const B: &str = r#\"tokio::sync \"quoted\" \"#;\n\
            const C: char = '\"'; const D: char = '\\''; fn f<'a>(x: &'a str) {}\n\
            use std::fs::File;";
        let found = of("src/engine/mod.rs", text);
        assert_eq!(found, ["src/engine/mod.rs:5: `engine` (floor 3) may not know `std::fs`"]);
    }
}
