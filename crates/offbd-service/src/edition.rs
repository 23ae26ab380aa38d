//! Editions of what people edit: a request may name the edition that it replaces, so that nobody
//! overwrites a change that they have not seen.

use std::fmt;

use data_encoding::HEXLOWER;
use serde::{Serialize, Serializer};
use sha2::{Digest, Sha256};

use super::{ServiceError, views};

/// Bytes of the digest in an entity tag. Chosen: by chance two editions never have the same.
const TAG_BYTES: usize = 16;

/// Tells one edition of a resource from all others: 32 hexadecimal digits, which depend on its
/// content alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EntityTag(String);

impl EntityTag {
    /// Returns the tag of a resource with this content.
    ///
    /// # Errors
    /// [`ServiceError::Corrupt`] if the content is not JSON.
    pub fn of<T: Serialize + ?Sized>(content: &T) -> Result<Self, ServiceError> {
        let digest = Sha256::digest(views::to_json(&content)?);
        Ok(Self(HEXLOWER.encode(digest.get(..TAG_BYTES).unwrap_or_default())))
    }

    /// Returns the tag without quotes.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for EntityTag {
    /// Writes the tag with its quotes, as in a header.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{}\"", self.0)
    }
}

impl Serialize for EntityTag {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Which edition a request may replace (`If-Match`, `If-None-Match`).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Expected {
    /// Any, also none.
    #[default]
    Anything,
    /// Any that exists.
    Existing,
    /// None: the request creates it.
    Nothing,
    /// One with one of these tags, without quotes.
    OneOf(Vec<String>),
}

impl Expected {
    /// Checks that the request may replace the edition `found`; `None` if there is none.
    ///
    /// # Errors
    /// [`ServiceError::Changed`].
    pub(super) fn check(&self, found: Option<&EntityTag>) -> Result<(), ServiceError> {
        let is_met = match (self, found) {
            (Self::Anything, _) | (Self::Existing, Some(_)) | (Self::Nothing, None) => true,
            (Self::OneOf(tags), Some(found)) => tags.iter().any(|tag| tag == found.as_str()),
            (Self::Existing | Self::OneOf(_), None) | (Self::Nothing, Some(_)) => false,
        };
        if is_met { Ok(()) } else { Err(ServiceError::Changed { now: found.cloned() }) }
    }

    /// Whether the edition matters that is replaced.
    pub(super) const fn is_particular(&self) -> bool {
        matches!(self, Self::OneOf(_) | Self::Nothing)
    }
}

/// A resource with the tag of its edition.
#[derive(Clone, Debug)]
pub struct Edition<T> {
    pub value: T,
    pub tag: EntityTag,
}

impl<T: Serialize> Edition<T> {
    /// Returns a resource all of whose content is edited.
    pub(super) fn of(value: T) -> Result<Self, ServiceError> {
        let tag = EntityTag::of(&value)?;
        Ok(Self { value, tag })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_request_replaces_only_the_edition_that_it_names() {
        let (old, new) = (EntityTag::of("old").unwrap(), EntityTag::of("new").unwrap());
        let of = |tags: &[&EntityTag]| {
            Expected::OneOf(tags.iter().map(|tag| tag.as_str().to_owned()).collect())
        };
        for (expected, found, is_met) in [
            (Expected::Anything, None, true),
            (Expected::Anything, Some(&new), true),
            (Expected::Existing, None, false),
            (Expected::Existing, Some(&new), true),
            (Expected::Nothing, None, true),
            (Expected::Nothing, Some(&new), false),
            (of(&[&old]), Some(&new), false),
            (of(&[&old, &new]), Some(&new), true),
            (of(&[&new]), None, false),
            (of(&[]), Some(&new), false),
        ] {
            match expected.check(found) {
                Ok(()) => assert!(is_met, "{expected:?}, {found:?}"),
                Err(ServiceError::Changed { now }) => {
                    assert!(!is_met, "{expected:?}, {found:?}");
                    assert_eq!(now.as_ref(), found);
                }
                Err(error) => panic!("{error}"),
            }
        }
    }

    proptest! {
        #[test]
        fn two_tags_are_equal_exactly_if_the_contents_are(
            a in proptest::collection::vec("[ab]{0,2}", 0..3),
            b in proptest::collection::vec("[ab]{0,2}", 0..3),
        ) {
            let tags = (EntityTag::of(&a).unwrap(), EntityTag::of(&b).unwrap());
            prop_assert_eq!(tags.0 == tags.1, a == b);
            prop_assert!(tags.0.as_str().bytes().all(|byte| byte.is_ascii_hexdigit()));
        }
    }
}
