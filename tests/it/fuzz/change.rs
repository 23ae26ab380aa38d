//! Inputs made from others by small changes.

use std::collections::BTreeSet;

use crate::support::device::Random;

/// Inputs that are kept to be changed; then none joins them.
const MAX_INPUTS: usize = 2000;
/// Longest input, bytes; a longer one is cut.
const MAX_BYTES: usize = 16 << 10;
/// Changes made to one input at most.
const MAX_CHANGES: usize = 4;

/// What parsers are known to stumble over.
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

/// Inputs, and the kinds of answers they have had.
pub struct Pool {
    inputs: Vec<Vec<u8>>,
    answers: BTreeSet<String>,
    random: Random,
}

impl Pool {
    pub fn new(inputs: Vec<Vec<u8>>, seed: u64) -> Self {
        Self { inputs, answers: BTreeSet::new(), random: Random(seed) }
    }

    /// The inputs as they are now.
    pub fn given(&self) -> Vec<Vec<u8>> {
        self.inputs.clone()
    }

    pub fn n_answers(&self) -> usize {
        self.answers.len()
    }

    /// Takes note of how `input` was answered.
    pub fn learn(&mut self, input: &[u8], answer: String) {
        if self.answers.insert(answer) && self.inputs.len() < MAX_INPUTS {
            self.inputs.push(input.to_vec());
        }
    }

    /// The next input.
    pub fn next(&mut self) -> Vec<u8> {
        let mut bytes = self.any();
        for _ in 0..=self.random.below(MAX_CHANGES) {
            self.change(&mut bytes);
        }
        bytes.truncate(MAX_BYTES);
        bytes
    }

    fn any(&mut self) -> Vec<u8> {
        let at = self.random.below(self.inputs.len());
        self.inputs[at].clone()
    }

    fn change(&mut self, bytes: &mut Vec<u8>) {
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
                let other = self.any();
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

/// Puts `word` in the place of the first number from `at` on.
fn replace_number(bytes: &mut Vec<u8>, at: usize, word: &[u8]) {
    let digit = |b: &u8| b.is_ascii_digit() || b"+-.e".contains(b);
    let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit) else { return };
    let start = at + start;
    let length = bytes[start..].iter().position(|b| !digit(b)).unwrap_or(bytes.len() - start);
    bytes.splice(start..start + length, word.iter().copied());
}
