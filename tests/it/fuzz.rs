//! Fuzzing of every parser with mutations of the files in `tests/it/fuzz/corpus`. No parser
//! may panic, and accepted input must be consistent.
//!
//! An input with a new kind of result joins the inputs that are mutated. The environment
//! variable `FUZZ` sets the number of inputs per parser
//! (`FUZZ=1000000 cargo test --test it fuzz`), `SEED` the seed. A failing input is written to
//! a file; add it to the corpus with the repair.

mod frames;
mod mutation;
mod parsers;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use mutation::InputPool;
use parsers::{PARSERS, Parser};

/// Number of inputs per parser, unless FUZZ is set.
const INPUTS: usize = 1500;

/// Returns the number in an environment variable, or `default`.
fn env_number(name: &str, default: usize) -> usize {
    std::env::var(name).map_or(default, |n| n.parse().unwrap())
}

fn corpus(name: &str) -> Vec<Vec<u8>> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/fuzz/corpus").join(name);
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&directory).unwrap().map(|file| file.unwrap().path()).collect();
    files.sort();
    assert!(!files.is_empty(), "{}", directory.display());
    files.iter().map(|file| std::fs::read(file).unwrap()).collect()
}

/// Runs the parser on `input` and returns the kind of its result; writes the input to a file
/// if the parser panics.
fn run_parser(name: &str, parse: Parser, input: &[u8]) -> String {
    catch_unwind(AssertUnwindSafe(|| parse(input))).unwrap_or_else(|failure| {
        let kept = std::env::temp_dir().join(format!("offbd-fuzz-{name}"));
        std::fs::write(&kept, input).unwrap();
        eprintln!("{name} fails on {}", kept.display());
        std::panic::resume_unwind(failure)
    })
}

#[test]
fn no_parser_panics_on_mutated_inputs() {
    let (n, seed) = (env_number("FUZZ", INPUTS), env_number("SEED", 1) as u64);
    let run = |name: &str, parse: Parser| {
        let mut pool = InputPool::new(corpus(name), seed);
        for input in pool.inputs() {
            pool.record(&input, run_parser(name, parse, &input));
        }
        for _ in 0..n {
            let input = pool.next();
            let result = run_parser(name, parse, &input);
            pool.record(&input, result);
        }
        assert!(pool.n_results() > 3, "{name}: {} kinds of results", pool.n_results());
        println!("{name}: {n} inputs, {} kinds of results", pool.n_results());
    };
    std::thread::scope(|threads| {
        for (name, parse) in PARSERS {
            threads.spawn(move || run(name, *parse));
        }
    });
}
