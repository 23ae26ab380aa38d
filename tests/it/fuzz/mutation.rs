//! Mutations of inputs.

use std::collections::BTreeSet;

use crate::support::device::Random;

/// Largest number of inputs that are mutated.
const MAX_INPUTS: usize = 2000;
/// Longest input, bytes; a longer one is truncated.
const MAX_BYTES: usize = 16 << 10;
/// Largest number of mutations of one input.
const MAX_MUTATIONS: usize = 4;

/// Values that often cause errors in parsers.
const WORDS: [&[u8]; 40] = [
    b"0",
    b"-0",
    b"-1",
    b"1e308",
    b"1e309",
    b"-1e309",
    b"5e-324",
    b"1e-400",
    b"NaN",
    b"-NaN",
    b"Infinity",
    b"-Infinity",
    b"nan",
    b"inf",
    b"9223372036854775807",
    b"9223372036854775808",
    b"18446744073709551615",
    b"18446744073709551616",
    b"0.1",
    b"1.0000000000000002",
    b"null",
    b"true",
    b"\"\"",
    b"\"\\u0000\"",
    b"\"\\ud800\"",
    b"{}",
    b"[]",
    b"[[[[[[[[",
    b"{\"a\":",
    b",",
    b",,",
    b"\n",
    b"\r\n",
    b"\"",
    b"\xef\xbb\xbf",
    b"\xff",
    b"\x00",
    b"\xf0\x9f\x8f\x93",
    b";",
    b"\\",
];

/// Inputs, and the kinds of results they have had.
pub struct InputPool {
    inputs: Vec<Vec<u8>>,
    results: BTreeSet<String>,
    random: Random,
}

impl InputPool {
    pub fn new(inputs: Vec<Vec<u8>>, seed: u64) -> Self {
        Self { inputs, results: BTreeSet::new(), random: Random(seed) }
    }

    /// Returns the present inputs.
    pub fn inputs(&self) -> Vec<Vec<u8>> {
        self.inputs.clone()
    }

    pub fn n_results(&self) -> usize {
        self.results.len()
    }

    /// Records the result of `input`, and adds it to the inputs if the result is new.
    pub fn record(&mut self, input: &[u8], result: String) {
        if self.results.insert(result) && self.inputs.len() < MAX_INPUTS {
            self.inputs.push(input.to_vec());
        }
    }

    /// Returns a mutation of one of the inputs.
    pub fn next(&mut self) -> Vec<u8> {
        let mut bytes = self.any_input();
        for _ in 0..=self.random.below(MAX_MUTATIONS) {
            self.mutate(&mut bytes);
        }
        bytes.truncate(MAX_BYTES);
        bytes
    }

    fn any_input(&mut self) -> Vec<u8> {
        let at = self.random.below(self.inputs.len());
        self.inputs[at].clone()
    }

    fn mutate(&mut self, bytes: &mut Vec<u8>) {
        let at = self.random.below(bytes.len() + 1);
        let end = at + self.random.below(bytes.len() - at + 1).min(64);
        match self.random.below(8) {
            0 if at < bytes.len() => bytes[at] ^= 1 << self.random.below(8),
            1 if at < bytes.len() => bytes[at] = u8::try_from(self.random.below(256)).unwrap(),
            2 => drop(bytes.drain(at..end)),
            3 => {
                let again = bytes[at..end].to_vec();
                bytes.splice(at..at, again);
            }
            4 => bytes.truncate(at),
            5 => {
                let other = self.any_input();
                let from = self.random.below(other.len() + 1);
                let to = from + self.random.below(other.len() - from + 1).min(256);
                bytes.splice(at..end, other[from..to].iter().copied());
            }
            6 => replace_number(bytes, at, self.word()),
            _ => drop(bytes.splice(at..at, self.word().iter().copied())),
        }
    }

    fn word(&mut self) -> &'static [u8] {
        WORDS[self.random.below(WORDS.len())]
    }
}

/// Replaces the first number at or after `at` by `word`.
fn replace_number(bytes: &mut Vec<u8>, at: usize, word: &[u8]) {
    let digit = |b: &u8| b.is_ascii_digit() || b"+-.e".contains(b);
    let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit) else { return };
    let start = at + start;
    let length = bytes[start..].iter().position(|b| !digit(b)).unwrap_or(bytes.len() - start);
    bytes.splice(start..start + length, word.iter().copied());
}
