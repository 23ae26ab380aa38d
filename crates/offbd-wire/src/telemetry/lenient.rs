//! Tolerates `NaN`, `Infinity` and `1e999`, which some devices send in place of a number.
//!
//! They are invalid in JSON and would invalidate the whole batch. Only if a document cannot
//! be parsed, they are replaced by marker strings, so that only their rows are rejected.

/// Name of such a value in messages.
pub(super) const NOT_FINITE: &str = "not finite";

/// The string that stands for such a value.
const MARKER: &str = "\u{1}not finite";

/// Returns whether a string stands for such a value.
pub(super) fn is_marker(text: &str) -> bool {
    text == MARKER
}

/// Returns the document with such values replaced by the marker, or `None` if it has none.
pub(super) fn quote_non_finite(document: &[u8]) -> Option<Vec<u8>> {
    replace_non_finite(document, |_| br#""\u0001not finite""#.to_vec())
}

/// Returns the document with such values as strings, or `None` if it has none.
pub(crate) fn with_quotes(document: &[u8]) -> Option<Vec<u8>> {
    replace_non_finite(document, |token| [b"\"", token, b"\""].concat())
}

fn replace_non_finite(document: &[u8], replacement: impl Fn(&[u8]) -> Vec<u8>) -> Option<Vec<u8>> {
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
            quoted.extend(replacement(token));
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

/// Returns the length of the string literal at the start of `text`, quotes included.
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

/// Returns whether Rust parses the token as a number that is not finite: `NaN`, `inf`,
/// `-Infinity`, `1e999`.
fn is_non_finite(token: &[u8]) -> bool {
    let text = std::str::from_utf8(token).unwrap_or_default();
    text.parse::<f64>().is_ok_and(|value| !value.is_finite())
}
