//! The engine's time.

use core::cmp::Ordering;
use core::ops::{Add, Sub};

/// A moment on a session's clock, in seconds: always finite, totally ordered.
///
/// It comes from the samples (`t_s`); nothing below the adapters reads a clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimTime(f64);

impl SimTime {
    /// The moment `seconds` after the clock's zero; `None` unless finite.
    #[must_use]
    pub fn new(seconds: f64) -> Option<Self> {
        // The total order tells −0 from 0; no clock does.
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
    /// The moment `seconds` later; saturates at the largest finite time.
    fn add(self, seconds: f64) -> Self {
        Self((self.0 + seconds).clamp(f64::MIN, f64::MAX))
    }
}
