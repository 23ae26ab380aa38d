//! What devices send in the place of a number: `NaN`, `Infinity`, `1e999`.
//!
//! JSON has none of these, and one would spoil the whole batch. Looked for only
//! once a document has failed: they become strings, which spoil their row.

/// What such a string means to a reader.
pub(super) const MEANING: &str = "not finite";

const MARK: &str = "\u{1}not finite";

/// Whether a string stands for such a number.
pub(super) fn is_mark(text: &str) -> bool {
    text == MARK
}

/// The document with such numbers as strings; none if it has none.
pub(super) fn quote_non_finite(document: &[u8]) -> Option<Vec<u8>> {
    let mut quoted = Vec::with_capacity(document.len());
    let mut found = false;
    let mut rest = document;
    while let Some(&first) = rest.first() {
        let n = match first {
            b'"' => string_length(rest),
            b if is_word(b) => rest.iter().take_while(|b| is_word(**b)).count(),
            _ => 1,
        };
        let (token, after) = rest.split_at(n);
        if is_non_finite(token) {
            found = true;
            quoted.extend_from_slice(br#""\u0001not finite""#);
        } else {
            quoted.extend_from_slice(token);
        }
        rest = after;
    }
    found.then_some(quoted)
}

const fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-' | b'.')
}

/// Length of the string at the start of `text`, quotes included.
fn string_length(text: &[u8]) -> usize {
    let mut at = 1;
    while let Some(&byte) = text.get(at) {
        match byte {
            b'"' => return at + 1,
            b'\\' => at += 2,
            _ => at += 1,
        }
    }
    text.len()
}

/// Whether Rust reads the token as a number, but not as a finite one: `NaN`,
/// `inf`, `-Infinity`, `1e999`.
fn is_non_finite(token: &[u8]) -> bool {
    let text = std::str::from_utf8(token).unwrap_or_default();
    text.parse::<f64>().is_ok_and(|value| !value.is_finite())
}
