//! Content negotiation by the quality values in `Accept` and `Accept-Encoding`
//! (RFC 9110, section 12.4.2).
//!
//! Written by hand because one function serves both headers; available crates parse only
//! one of them.

/// Returns the weight, 0 to 1, of `word` in the list `header`; `None` if the list does not
/// contain it. A weight that is not a number counts as 0.
pub(super) fn weight(header: &str, word: &str) -> Option<f64> {
    header.split(',').find_map(|element| {
        let mut parts = element.split(';').map(str::trim);
        let named = parts.next().is_some_and(|name| name.eq_ignore_ascii_case(word));
        let mut quality =
            || parts.find_map(|part| part.strip_prefix("q=").or(part.strip_prefix("Q=")));
        named.then(|| quality().map_or(1.0, |q| q.parse().unwrap_or(0.0)))
    })
}

/// Returns the weight of the first of `words` that `header` contains, 0 if it contains
/// none. List the most specific word first.
pub(super) fn weight_of_first(header: &str, words: &[&str]) -> f64 {
    words.iter().find_map(|word| weight(header, word)).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of RFC 9110, sections 12.5.1 and 12.5.3.
    #[test]
    fn validate_the_weights_of_the_standards_examples() {
        let audio = "audio/*; q=0.2, audio/basic";
        assert_eq!(weight(audio, "audio/*"), Some(0.2));
        assert_eq!(weight(audio, "audio/basic"), Some(1.0));
        let codings = "gzip;q=1.0, identity; q=0.5, *;q=0";
        assert_eq!(weight(codings, "gzip"), Some(1.0));
        assert_eq!(weight(codings, "identity"), Some(0.5));
        assert_eq!(weight_of_first(codings, &["br", "*"]), 0.0);
        assert_eq!(weight("", "br"), None);
    }

    #[test]
    fn a_weight_that_is_not_a_number_counts_as_0() {
        assert_eq!(weight("br;q=much", "br"), Some(0.0));
        assert_eq!(weight("brotli", "br"), None, "a longer word with the same prefix");
    }
}
