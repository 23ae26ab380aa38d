//! What is permitted as a tag of a rig.

use offbd_core::vocabulary::Invalid;

/// Tags of one rig; a request with more is refused.
pub(super) const MAX_TAGS: usize = 20;

/// Longest tag, bytes; a longer one is refused.
const MAX_TAG: usize = 50;

/// Checks one tag: a plain word of letters, digits, `-`, `_` and `.`, of any script.
///
/// # Errors
/// [`Invalid`] with `pointer`.
pub(super) fn check(pointer: &str, tag: &str) -> Result<(), Invalid> {
    let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.');
    if (1..=MAX_TAG).contains(&tag.len()) && tag.chars().all(is_plain) {
        return Ok(());
    }
    let reason = format!("must be 1 to {MAX_TAG} bytes of letters, digits, `-`, `_` and `.`");
    Err(Invalid::new(pointer, reason))
}

/// Checks the tags of a rig, and returns each once, in alphabetical order.
///
/// # Errors
/// [`Invalid`] with the pointer of the invalid tag, or of the list if it is too long.
pub(super) fn checked(mut tags: Vec<String>) -> Result<Vec<String>, Invalid> {
    if tags.len() > MAX_TAGS {
        return Err(Invalid::new("/tags", format!("must have at most {MAX_TAGS} tags")));
    }
    for (i, tag) in tags.iter().enumerate() {
        check(&format!("/tags/{i}"), tag)?;
    }
    tags.sort();
    tags.dedup();
    Ok(tags)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(tags: &[&str]) -> Result<Vec<String>, String> {
        let tags = tags.iter().map(|&tag| tag.to_owned()).collect();
        checked(tags).map_err(|error| error.to_string())
    }

    #[test]
    fn tags_are_sorted_and_each_is_kept_once() {
        assert_eq!(of(&["lab-2", "Prüfstand", "lab-2"]).unwrap(), ["Prüfstand", "lab-2"]);
        assert_eq!(of(&[]).unwrap(), [] as [&str; 0]);
        assert_eq!(of(&[&"x".repeat(MAX_TAG)]).unwrap().len(), 1);
    }

    #[test]
    fn a_wrong_tag_is_named() {
        for wrong in ["", "two words", "a,b", "a/b", "tab\t", &"x".repeat(MAX_TAG + 1)] {
            let error = of(&["fine", wrong]).unwrap_err();
            assert!(error.contains("/tags/1"), "{wrong}: {error}");
        }
        assert!(of(&["a"; MAX_TAGS + 1]).unwrap_err().contains("at most 20"));
    }
}
