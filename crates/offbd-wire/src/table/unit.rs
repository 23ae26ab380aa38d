//! The words by which the names of columns, and a line below them, say a unit or a time.

use super::expression::Dimension;

/// Words of names that say a time; a name is split at signs and at changes from small to capital letters.
pub(super) const TIME_WORDS: [&str; 19] = [
    "t",
    "ts",
    "time",
    "timestamp",
    "zeit",
    "zeitstempel",
    "uhrzeit",
    "datum",
    "clock",
    "date",
    "datetime",
    "sec",
    "seconds",
    "millis",
    "micros",
    "elapsed",
    "ms",
    "us",
    "stamp",
];

/// Words of units as they stand in names and below them, each with the unit of a mapping.
const UNIT_WORDS: [(&str, &str); 24] = [
    ("s", "s"),
    ("sec", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("ms", "ms"),
    ("millis", "ms"),
    ("us", "us"),
    ("µs", "us"),
    ("μs", "us"),
    ("micros", "us"),
    ("ns", "ns"),
    ("m", "m"),
    ("cm", "cm"),
    ("mm", "mm"),
    ("in", "in"),
    ("inch", "in"),
    ("rad", "rad"),
    ("mrad", "mrad"),
    ("deg", "deg"),
    ("°", "deg"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("grad", "deg"),
    ("min", "min"),
];

/// Returns the unit of a mapping that a word names.
fn known_unit(word: &str) -> Option<&'static str> {
    let word = word.trim_matches(|c: char| "[]()".contains(c)).to_lowercase();
    UNIT_WORDS.iter().find(|(known, _)| *known == word).map(|(_, unit)| *unit)
}

/// Whether a word names a unit, or there is none.
pub(super) fn is_unit(word: &str) -> bool {
    word.is_empty() || known_unit(word).is_some()
}

/// Returns the unit that a word names, in the dimension of a quantity.
pub(super) fn unit_of(word: &str, dimension: Dimension) -> Option<&'static str> {
    let unit = known_unit(word)?;
    dimension.units().iter().any(|(known, _)| *known == unit).then_some(unit)
}
