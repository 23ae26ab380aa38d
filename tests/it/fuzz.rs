//! Every parser on input that is nearly right: files of `tests/it/fuzz/corpus`,
//! changed a little, again and again. Nothing may panic, and what is taken must
//! be what it seems.
//!
//! An input that is answered in a way not seen before joins those that are
//! changed. `FUZZ=1000000 cargo test --test it fuzz` tries as many inputs for each
//! parser; the seed is fixed, `SEED` gives another. An input that fails is kept:
//! put it into the corpus with the repair.

mod change;
mod frames;
mod parsers;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use change::Pool;
use parsers::{PARSERS, Parser};

/// Inputs tried with each parser; FUZZ says otherwise.
const INPUTS: usize = 1500;

fn number(name: &str, otherwise: usize) -> usize {
    std::env::var(name).map_or(otherwise, |n| n.parse().unwrap())
}

fn corpus(name: &str) -> Vec<Vec<u8>> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/fuzz/corpus").join(name);
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&directory).unwrap().map(|file| file.unwrap().path()).collect();
    files.sort();
    assert!(!files.is_empty(), "{}", directory.display());
    files.iter().map(|file| std::fs::read(file).unwrap()).collect()
}

/// Tries `input`; keeps it if it fails.
fn try_out(name: &str, parse: Parser, input: &[u8]) -> String {
    catch_unwind(AssertUnwindSafe(|| parse(input))).unwrap_or_else(|failure| {
        let kept = std::env::temp_dir().join(format!("offbd-fuzz-{name}"));
        std::fs::write(&kept, input).unwrap();
        eprintln!("{name} fails on {}", kept.display());
        std::panic::resume_unwind(failure)
    })
}

#[test]
fn every_parser_bears_what_is_nearly_right() {
    let (n, seed) = (number("FUZZ", INPUTS), number("SEED", 1) as u64);
    let run = |name: &str, parse: Parser| {
        let mut pool = Pool::new(corpus(name), seed);
        for input in pool.given() {
            pool.learn(&input, try_out(name, parse, &input));
        }
        for _ in 0..n {
            let input = pool.next();
            let answer = try_out(name, parse, &input);
            pool.learn(&input, answer);
        }
        assert!(pool.n_answers() > 3, "{name}: {} kinds of answers", pool.n_answers());
        println!("{name}: {n} inputs, {} kinds of answers", pool.n_answers());
    };
    std::thread::scope(|threads| {
        for (name, parse) in PARSERS {
            threads.spawn(move || run(name, parse));
        }
    });
}
