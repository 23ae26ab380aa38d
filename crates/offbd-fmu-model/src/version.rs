//! The versions of FMI.

use std::str::FromStr;

/// A version of FMI that the model has an interface of. They do not share a model description,
/// so that an FMU has one of them; the library is the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FmiVersion {
    V2,
    V3,
}

impl FmiVersion {
    /// All versions.
    pub const ALL: [Self; 2] = [Self::V2, Self::V3];

    /// The number of the version, as in the model description.
    #[must_use]
    pub const fn number(self) -> &'static str {
        match self {
            Self::V2 => "2.0",
            Self::V3 => "3.0",
        }
    }
}

impl std::fmt::Display for FmiVersion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.number())
    }
}

impl FromStr for FmiVersion {
    type Err = &'static str;

    /// Reads [`number`](Self::number).
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let version = Self::ALL.into_iter().find(|version| version.number() == text);
        version.ok_or("the versions are 2.0 and 3.0")
    }
}
