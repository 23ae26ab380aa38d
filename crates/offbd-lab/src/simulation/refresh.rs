//! The refresh rate of a sensor, relative to the rate of the log.

use std::ops::RangeInclusive;

use offbd_core::vocabulary::{Invalid, in_range};

/// When the sensor takes a new reading. In between, the rows of the log repeat the last
/// one (zero-order hold).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refresh {
    /// With every nth row, n from 1 to [`Refresh::MAX_ROWS`]: the device's loop runs n
    /// times for each image of its camera.
    Rows(u32),
    /// At this rate in Hz, within [`Refresh::HZ`], not synchronised with the log.
    Hz(f64),
}

impl Default for Refresh {
    fn default() -> Self {
        Self::Rows(1)
    }
}

impl Refresh {
    /// Range of refresh rates, Hz; chosen: from one reading in ten seconds to ten per step
    /// of the plant.
    pub const HZ: RangeInclusive<f64> = 0.1..=10_000.0;
    /// Maximum number of rows with one reading; chosen: a second of the fastest log.
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

    /// Returns whether the sensor reads with row `n_row`, counted from 1.
    pub(super) const fn with_row(self, n_row: u64) -> bool {
        matches!(self, Self::Rows(n) if (n_row - 1).is_multiple_of(n as u64))
    }

    /// Returns the time of reading `n_look`, counted from 0, s; infinity if readings are
    /// tied to rows.
    pub(super) fn look_s(self, n_look: u64) -> f64 {
        match self {
            Self::Hz(hz) => n_look as f64 / hz,
            Self::Rows(_) => f64::INFINITY,
        }
    }
}
