//! Fault codes, fault kinds and fault states.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use core::fmt;
use core::str::FromStr;

use serde::{Deserialize, Serialize};

use super::Axis;

/// The error for a word that is not among the expected ones.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{word}` is not one of {expected}")]
pub struct UnknownWord {
    pub word: String,
    pub expected: String,
}

macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $word:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(
            Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize,
        )]
        pub enum $name { $($(#[$vdoc])* $variant),+ }

        impl $name {
            /// All variants in the order of declaration.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The identifier used on the wire, in the store and in logs.
            #[must_use]
            pub const fn as_str(self) -> &'static str {
                match self { $(Self::$variant => $word),+ }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(self.as_str())
            }
        }

        impl FromStr for $name {
            type Err = UnknownWord;
            fn from_str(word: &str) -> Result<Self, UnknownWord> {
                Self::ALL.iter().copied().find(|v| v.as_str() == word).ok_or_else(|| UnknownWord {
                    word: word.to_owned(),
                    expected: Self::ALL.iter().map(|v| v.as_str()).collect::<Vec<_>>().join(", "),
                })
            }
        }
    };
}

words! {
    /// A fault code: the part of the rig that is at fault.
    FaultCode {
        /// The servo that moves the ball along x (it turns qy).
        XServo = "x_servo",
        /// The servo that moves the ball along y (it turns qx).
        YServo = "y_servo",
        /// The ball does not move although it should.
        StuckBall = "stuck_ball",
        /// The position readings cannot be trusted.
        Sensor = "sensor",
    }
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

words! {
    /// The failure mode, where the evidence tells it.
    FaultKind {
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
    }
}

words! {
    /// The state of a fault code; a summary of the ISO 14229 status byte.
    FaultStatus {
        /// The test failed in this operation cycle; not yet confirmed.
        Pending = "pending",
        /// The test failed in as many operation cycles as confirmation requires.
        Confirmed = "confirmed",
        /// Good operation cycles have followed; the fault is still on record.
        Healed = "healed",
        /// Nothing on record: never failed, aged, or cleared by a person.
        Cleared = "cleared",
    }
}
