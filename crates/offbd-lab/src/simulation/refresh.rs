//! How often a sensor looks, beside how often the device logs.

use std::ops::RangeInclusive;

use offbd_core::vocabulary::{Invalid, in_range};

/// When there is a new reading. Between two of them the rows of the log repeat
/// the last one: a zero-order hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refresh {
    /// With every nth row, n from 1 to [`Refresh::MAX_ROWS`]: the
    /// device's loop runs n times for each look of its camera.
    Rows(u32),
    /// So many times a second ([`Refresh::HZ`]), in step with nothing.
    Hz(f64),
}

impl Default for Refresh {
    fn default() -> Self {
        Self::Rows(1)
    }
}

impl Refresh {
    /// A look every ten seconds to ten a plant's step.
    pub const HZ: RangeInclusive<f64> = 0.1..=10_000.0;
    /// Most rows that repeat one reading: a second of the fastest log.
    pub const MAX_ROWS: u32 = 1000;

    pub(super) fn check(self) -> Result<(), Invalid> {
        match self {
            Self::Hz(hz) => in_range("/sensor/refresh_hz", hz, Self::HZ),
            Self::Rows(n) => {
                let most = f64::from(Self::MAX_ROWS);
                in_range("/sensor/hold_rows", f64::from(n), 1.0..=most)
            }
        }
        .map(drop)
    }

    /// Whether there is a look for the row of this number, from 1 on.
    pub(super) const fn with_row(self, n_row: u64) -> bool {
        matches!(self, Self::Rows(n) if (n_row - 1).is_multiple_of(n as u64))
    }

    /// When the look of this number is due, from 0 on, s; never if rows call for it.
    pub(super) fn look_s(self, n_look: u64) -> f64 {
        match self {
            Self::Hz(hz) => n_look as f64 / hz,
            Self::Rows(_) => f64::INFINITY,
        }
    }
}
