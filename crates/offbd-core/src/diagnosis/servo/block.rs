//! Averages readings into blocks: a twentieth of a second tells a servo's fault as well
//! as single readings do, at a fraction of the cost.

use crate::vocabulary::CLOCK_RESOLUTION_S;
use serde::{Deserialize, Serialize};

/// Length of a block, s: a tenth of the time in which the plainest fault shows. Slower
/// readings make one block each.
pub(in crate::diagnosis) const BLOCK_S: f64 = 0.05;
/// Time without a block after which a window starts again, s: three readings of a slow
/// sensor.
pub(super) const BREAK_S: f64 = 0.6;

/// The twin's free path along one axis: position (m), velocity (m/s), acceleration
/// (m/s²).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwinPath {
    pub position_m: f64,
    pub velocity_m_s: f64,
    pub acceleration_m_s2: f64,
}

/// Means over a block of readings of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct ReadingBlock {
    pub(super) t: f64,
    pub(super) measured_m: f64,
    pub(super) path: TwinPath,
    pub(super) n: u32,
}

impl ReadingBlock {
    /// Measured − twin's position, m.
    pub(super) fn deviation_m(&self) -> f64 {
        self.measured_m - self.path.position_m
    }
}

/// Averages readings into blocks.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct BlockBuilder {
    since: f64,
    last: Option<f64>,
    sum: ReadingBlock,
}

impl BlockBuilder {
    /// Adds a reading; returns the block that it completes, if any.
    pub(super) fn take(
        &mut self,
        t: f64,
        measured_m: f64,
        path: &TwinPath,
    ) -> Option<ReadingBlock> {
        if self.sum.n == 0 {
            self.since = t;
        }
        // Times relative to the start of the block: sums of absolute times lose digits.
        self.sum.t += t - self.since;
        self.sum.measured_m += measured_m;
        self.sum.path.position_m += path.position_m;
        self.sum.path.velocity_m_s += path.velocity_m_s;
        self.sum.path.acceleration_m_s2 += path.acceleration_m_s2;
        self.sum.n += 1;
        let period_s = self.last.replace(t).map_or(0.0, |last| t - last);
        // Time stamps in milliseconds must not make a block one reading longer.
        (t - self.since + period_s >= BLOCK_S - CLOCK_RESOLUTION_S).then(|| self.close())
    }

    fn close(&mut self) -> ReadingBlock {
        let sum = core::mem::take(&mut self.sum);
        let n = f64::from(sum.n);
        ReadingBlock {
            t: self.since + sum.t / n,
            measured_m: sum.measured_m / n,
            path: TwinPath {
                position_m: sum.path.position_m / n,
                velocity_m_s: sum.path.velocity_m_s / n,
                acceleration_m_s2: sum.path.acceleration_m_s2 / n,
            },
            n: sum.n,
        }
    }

    /// Discards the unfinished block.
    pub(super) fn drop(&mut self) {
        (self.sum, self.last) = (ReadingBlock::default(), None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The blocks of readings `period_s` apart, from 1000 s on.
    fn blocks(period_s: f64) -> Vec<ReadingBlock> {
        let mut builder = BlockBuilder::default();
        let take = |i| {
            let t = 1000.0 + f64::from(i) * period_s;
            let path = TwinPath { position_m: 2.0 * t, ..TwinPath::default() };
            builder.take(t, 3.0 * t, &path)
        };
        (0..60).filter_map(take).collect()
    }

    #[test]
    fn a_block_is_the_mean_of_its_readings() {
        for (period_s, n) in [(0.01, 5), (0.005, 10), (1.0 / 30.0, 2)] {
            let blocks = blocks(period_s);
            assert_eq!(blocks.len(), 60 / n as usize);
            for block in blocks {
                assert_eq!(block.n, n);
                assert!((block.deviation_m() - block.t).abs() < 1e-9, "{block:?}");
            }
        }
    }

    /// Except for the first, whose period is not yet known.
    #[test]
    fn slow_readings_make_a_block_each() {
        assert!(blocks(0.2)[1..].iter().all(|b| b.n == 1));
    }
}
