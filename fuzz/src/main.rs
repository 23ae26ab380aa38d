//! Coverage-guided fuzzing of the parsers of `tests/it/fuzz/parsers.rs`, with libFuzzer, whose
//! options are the arguments. The environment variable `PARSER` names the parser; without it, the
//! program prints the names of all. `scripts/fuzz` builds and runs it.

#![no_main]

mod heap;
#[path = "../../tests/it/fuzz/parsers.rs"]
mod parsers;
mod support;

use std::process::exit;
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use offbd_wire::session_file::is_guarded;
use parsers::{PARSERS, Parser};

static PARSER: OnceLock<Parser> = OnceLock::new();

fuzz_target!(init: start(), |input: &[u8]| {
    let parse = PARSER.get().expect("`start` has found the parser");
    heap::limited(|| parse(input));
});

/// Finds the parser.
fn start() {
    let Ok(wanted) = std::env::var("PARSER") else {
        PARSERS.iter().for_each(|(name, _)| println!("{name}"));
        exit(0);
    };
    let Some((_, parse)) = PARSERS.iter().find(|(name, _)| *name == wanted) else {
        eprintln!("the parser `{wanted}` is not known");
        exit(2);
    };
    PARSER.get_or_init(|| *parse);
    // A panic of a library that means a damaged file is not a finding.
    let abort = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !is_guarded() {
            abort(panic);
        }
    }));
}
