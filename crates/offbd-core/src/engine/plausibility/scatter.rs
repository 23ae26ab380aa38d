//! Whether readings scatter less than those of a calibration, from the third differences of
//! successive readings: motion that bends steadily over three samples cancels out, and independent
//! errors of standard deviation σ give a difference of standard deviation √20 σ. Differences are
//! counted, so that a few jumps do not matter.

use serde::{Deserialize, Serialize};

use super::{Count, SCALES};

/// Least number of differences. Chosen: the fraction is then known to within a twentieth.
const LEAST_SCATTER: u32 = 100;
/// Variance of a third difference over that of a reading: 1 + 9 + 9 + 1.
const VARIANCE: f64 = 20.0;
/// Fraction of the differences that must be small. Of those of a normal distribution 99.8 % are
/// within √10 σ and 25 % within σ/√10: this is halfway.
const SMALL_SHARE: f64 = 0.62;

/// The running counts along one axis.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct ReadingScatter {
    /// The last readings, the newest first; those that repeat the one before are left out, as a
    /// sensor slower than its log gives them.
    last: [Option<f64>; 3],
    /// Differences below the root mean square that the calibration expects, over the root of each
    /// of [`SCALES`].
    small: [Count; SCALES.len()],
}

impl ReadingScatter {
    /// Takes the next reading of a rig whose readings scattered by `noise_m` when it was
    /// calibrated; without a reading the differences are interrupted.
    pub(super) fn take(&mut self, reading: Option<f64>, noise_m: f64) {
        let Some(reading) = reading else {
            self.last = [None; 3];
            return;
        };
        let [a, b, c] = self.last;
        if a == Some(reading) {
            return;
        }
        if let (Some(a), Some(b), Some(c)) = (a, b, c) {
            let difference = reading - 3.0 * a + 3.0 * b - c;
            for (small, factor) in self.small.iter_mut().zip(SCALES) {
                small.take(difference * difference < VARIANCE * noise_m * noise_m / factor);
            }
        }
        self.last = [Some(reading), a, b];
    }

    /// Whether the readings scatter rather as much less as `SCALES[scale]` says than as in the
    /// calibration; `None` for too few readings.
    pub(super) fn is_smaller(&self, scale: usize) -> Option<bool> {
        let small = self.small[scale];
        (small.of >= LEAST_SCATTER).then(|| small.exceeds(SMALL_SHARE))
    }
}
