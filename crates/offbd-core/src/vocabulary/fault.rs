//! Fault codes, fault kinds and fault states.

#[cfg(not(feature = "std"))]
use crate::no_std::*;

use super::Axis;

/// The error for a word that is not among the expected ones.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{word}` is not one of {expected}")]
pub struct UnknownWord {
    pub word: String,
    pub expected: String,
}

impl UnknownWord {
    #[doc(hidden)]
    #[must_use]
    pub fn new(word: &str, expected: &[&str]) -> Self {
        Self { word: word.to_owned(), expected: expected.join(", ") }
    }
}

/// Defines an enum whose variants are words: it can be serialised, printed and parsed.
#[doc(hidden)]
#[macro_export]
macro_rules! words {
    ($(#[$meta:meta])* $name:ident {
        $($(#[$vmeta:meta])* $variant:ident = $word:tt),+ $(,)?
    }) => {
        $(#[$meta])*
        #[derive(
            Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, ::serde::Serialize,
            ::serde::Deserialize,
        )]
        pub enum $name { $($(#[$vmeta])* $variant),+ }

        impl $name {
            /// All variants in the order of declaration.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The word used on the wire, in the store and in logs.
            #[must_use]
            pub const fn as_str(self) -> &'static str {
                match self { $(Self::$variant => $word),+ }
            }
        }

        impl ::core::fmt::Display for $name {
            fn fmt(&self, f: &mut ::core::fmt::Formatter<'_>) -> ::core::fmt::Result {
                f.pad(self.as_str())
            }
        }

        impl ::core::str::FromStr for $name {
            type Err = $crate::vocabulary::UnknownWord;
            fn from_str(word: &str) -> Result<Self, Self::Err> {
                let known = Self::ALL.iter().copied().find(|v| v.as_str() == word);
                known.ok_or_else(|| $crate::vocabulary::UnknownWord::new(word, &[$($word),+]))
            }
        }
    };
}

/// The words of a fault: its codes, its kinds, and its statuses. Defines an enum of them with
/// the given macro, so that a layer above can have its own enum of the same words.
#[doc(hidden)]
#[macro_export]
macro_rules! fault_words {
    (codes, $define:ident! $($head:tt)*) => { $define! { $($head)* {
        /// The servo that moves the ball along x (it turns qy).
        XServo = "x_servo",
        /// The servo that moves the ball along y (it turns qx).
        YServo = "y_servo",
        /// The ball does not move although it should.
        StuckBall = "stuck_ball",
        /// The position readings cannot be trusted.
        Sensor = "sensor",
    } } };
    (kinds, $define:ident! $($head:tt)*) => { $define! { $($head)* {
        /// A servo does not answer at all.
        Dead = "dead",
        /// A servo stays at the angle where it is.
        Held = "held",
        /// A servo answers with a wrong factor.
        Gain = "gain",
        /// A servo answers in the opposite direction.
        Reversed = "reversed",
        /// A servo is off by a constant angle (a slipped horn).
        Offset = "offset",
        /// A servo lags.
        Slow = "slow",
        /// A servo fails intermittently.
        Intermittent = "intermittent",
        /// Readings repeat bit-identically although the ball must be moving.
        Frozen = "frozen",
        /// Readings are missing.
        Dropout = "dropout",
        /// Readings scatter far beyond the calibrated noise.
        Noise = "noise",
        /// Single readings are far off.
        Spikes = "spikes",
        /// The readings jump farther than a ball can move.
        Jump = "jump",
    } } };
    (statuses, $define:ident! $($head:tt)*) => { $define! { $($head)* {
        /// The test failed in this operation cycle; not yet confirmed.
        Pending = "pending",
        /// The test failed in as many operation cycles as confirmation requires.
        Confirmed = "confirmed",
        /// Good operation cycles have followed; the fault is still on record.
        Healed = "healed",
        /// Nothing on record: never failed, aged, or cleared by a person.
        Cleared = "cleared",
    } } };
}

fault_words! { codes, words!
    /// A fault code: the part of the rig that is at fault.
    FaultCode
}

fault_words! { kinds, words!
    /// The failure mode, where the evidence tells it.
    FaultKind
}

fault_words! { statuses, words!
    /// The state of a fault code; a summary of the ISO 14229 status byte.
    FaultStatus
}

impl FaultCode {
    /// Number of codes; code `c` has index `c as usize`.
    pub const COUNT: usize = Self::ALL.len();

    /// The axis of a servo code; `None` for the others.
    #[must_use]
    pub const fn axis(self) -> Option<Axis> {
        match self {
            Self::XServo => Some(Axis::X),
            Self::YServo => Some(Axis::Y),
            Self::StuckBall | Self::Sensor => None,
        }
    }

    /// The code of the servo that drives `axis`.
    #[must_use]
    pub const fn servo(axis: Axis) -> Self {
        match axis {
            Axis::X => Self::XServo,
            Axis::Y => Self::YServo,
        }
    }
}
