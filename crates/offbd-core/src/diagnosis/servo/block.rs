//! Readings gathered into blocks: a twentieth of a second tells a servo's
//! fault as well as each of its readings, at a fraction of the cost.

/// Length of a block, s: a tenth of the time in which the plainest fault shows.
/// Slower readings make a block each.
const BLOCK_S: f64 = 0.05;

/// The twin's free path along one axis: position m, velocity m/s,
/// acceleration m/s².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Course {
    pub position_m: f64,
    pub velocity_m_s: f64,
    pub acceleration_m_s2: f64,
}

/// Means over a block of readings of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Block {
    pub(super) t: f64,
    pub(super) measured_m: f64,
    pub(super) course: Course,
    pub(super) n: u32,
}

impl Block {
    /// Measured less the twin's position, m.
    pub(super) fn deviation_m(&self) -> f64 {
        self.measured_m - self.course.position_m
    }
}

/// Gathers readings into blocks.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gatherer {
    since: f64,
    last: Option<f64>,
    sum: Block,
}

impl Gatherer {
    /// Takes a reading; returns the block that it completes.
    pub(super) fn take(&mut self, t: f64, measured_m: f64, course: &Course) -> Option<Block> {
        if self.sum.n == 0 {
            self.since = t;
        }
        // Sums of times since the block began: those of the day lose digits.
        self.sum.t += t - self.since;
        self.sum.measured_m += measured_m;
        self.sum.course.position_m += course.position_m;
        self.sum.course.velocity_m_s += course.velocity_m_s;
        self.sum.course.acceleration_m_s2 += course.acceleration_m_s2;
        self.sum.n += 1;
        let period_s = self.last.replace(t).map_or(0.0, |last| t - last);
        // Time stamps in milliseconds must not make a block a reading longer.
        (t - self.since + period_s >= BLOCK_S - 1e-3).then(|| self.close())
    }

    fn close(&mut self) -> Block {
        let sum = core::mem::take(&mut self.sum);
        let n = f64::from(sum.n);
        Block {
            t: self.since + sum.t / n,
            measured_m: sum.measured_m / n,
            course: Course {
                position_m: sum.course.position_m / n,
                velocity_m_s: sum.course.velocity_m_s / n,
                acceleration_m_s2: sum.course.acceleration_m_s2 / n,
            },
            n: sum.n,
        }
    }

    /// Forgets what has been gathered.
    pub(super) fn drop(&mut self) {
        (self.sum, self.last) = (Block::default(), None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The blocks of readings `period_s` apart, from 1000 s on.
    fn blocks(period_s: f64) -> Vec<Block> {
        let mut gatherer = Gatherer::default();
        let take = |i| {
            let t = 1000.0 + f64::from(i) * period_s;
            let course = Course { position_m: 2.0 * t, ..Course::default() };
            gatherer.take(t, 3.0 * t, &course)
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

    /// But for the first, whose period nobody knows yet.
    #[test]
    fn slow_readings_make_a_block_each() {
        assert!(blocks(0.2)[1..].iter().all(|b| b.n == 1));
    }
}
