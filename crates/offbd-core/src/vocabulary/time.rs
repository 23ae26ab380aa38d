//! Time on a session's clock.

use core::cmp::Ordering;
use core::ops::{Add, Sub};
use serde::{Deserialize, Serialize};

/// Resolution of a clock in milliseconds, s.
pub(crate) const CLOCK_RESOLUTION_S: f64 = 1e-3;

/// A time on a session's clock, in seconds: always finite and totally ordered.
///
/// It comes from the samples (`t_s`); the core never reads a clock.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "f64")]
pub struct SimTime(f64);

impl TryFrom<f64> for SimTime {
    type Error = &'static str;

    fn try_from(seconds: f64) -> Result<Self, Self::Error> {
        Self::new(seconds).ok_or("a time is not finite")
    }
}

impl SimTime {
    /// Returns the time `seconds` after the clock's zero; `None` unless it is finite.
    #[must_use]
    pub fn new(seconds: f64) -> Option<Self> {
        // Adding zero turns −0 into 0, which the total order would tell apart.
        seconds.is_finite().then_some(Self(seconds + 0.0))
    }

    /// Seconds since the clock's zero.
    #[must_use]
    pub const fn seconds(self) -> f64 {
        self.0
    }
}

impl Eq for SimTime {}

impl PartialOrd for SimTime {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for SimTime {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl Sub for SimTime {
    type Output = f64;
    /// Seconds from `rhs` to `self`.
    fn sub(self, rhs: Self) -> f64 {
        self.0 - rhs.0
    }
}

impl Add<f64> for SimTime {
    type Output = Self;
    /// Returns the time `seconds` later; saturates at the largest finite time.
    fn add(self, seconds: f64) -> Self {
        Self((self.0 + seconds).clamp(f64::MIN, f64::MAX))
    }
}

/// A range of times on the device's clock, s; both ends are included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeRange {
    pub from_s: f64,
    pub to_s: f64,
}

impl TimeRange {
    /// All times.
    pub const ALL: Self = Self { from_s: f64::NEG_INFINITY, to_s: f64::INFINITY };

    /// Whether `t_s` is in the range.
    #[must_use]
    pub fn contains(&self, t_s: f64) -> bool {
        (self.from_s..=self.to_s).contains(&t_s)
    }
}
