//! Which command the ball's motion along an axis responds to, and with which sign.
//!
//! Readings and commands are averaged over blocks of time. The second difference of three
//! positions is the acceleration seen through a triangular window, so it is correlated
//! with earlier commands through the same window. A controlled ball correlates with much:
//! a response must explain half of the motion and twice as much as anything else.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use alloc::collections::VecDeque;
use serde::{Deserialize, Serialize};

use crate::engine::frame::Moment;
use crate::vocabulary::{Axis, PerAxis};

/// Length of a block, s, if it holds enough samples: a delay of 80 to 300 ms from command
/// to acceleration, as seen on real rigs, is at most three blocks.
const RESPONSE_BLOCK_S: f64 = 0.1;
/// Least samples in a block. Chosen.
const BLOCK_SAMPLES: f64 = 2.0;
/// Blocks between the positions of a second difference. Chosen.
const SPAN: usize = 3;
/// Number of delays that are tried: 0 to 3 blocks.
const DELAYS: usize = 4;
/// Blocks that are kept: two spans and the middle one for a difference; half a triangle
/// and the longest delay before the middle for the earliest command.
const HELD: usize = 2 * SPAN + DELAYS - 1;
/// Least number of differences for a correlation to count: fifteen seconds of blocks.
/// Chosen.
const LEAST_DIFFERENCES: f64 = 150.0;
/// Fraction of the motion that a command must explain. Chosen.
const CLEAR_SHARE: f64 = 0.5;
/// Largest fraction of the best explanation that any other may explain. Chosen.
const RIVAL_SHARE: f64 = 0.5;

/// The command that the motion along an axis responds to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum AxisResponse {
    /// Its own command.
    Own,
    /// Its own command, in the opposite direction.
    Against,
    /// The other axis' command, in either direction.
    Other,
    /// No clear response.
    Unclear,
}

/// A running mean.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct RunningMean {
    n: u32,
    sum: f64,
}

impl RunningMean {
    fn take(&mut self, value: Option<f64>) {
        if let Some(value) = value {
            self.n += 1;
            self.sum += value;
        }
    }

    fn value(self) -> Option<f64> {
        (self.n > 0).then(|| self.sum / f64::from(self.n))
    }
}

/// One block: mean positions and commands.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct ResponseBlock {
    position: PerAxis<RunningMean>,
    command: PerAxis<RunningMean>,
}

/// A running correlation.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Correlation {
    n: f64,
    sums: [f64; 2],
    squares: [f64; 2],
    products: f64,
}

impl Correlation {
    fn take(&mut self, a: f64, b: f64) {
        self.n += 1.0;
        self.sums = [self.sums[0] + a, self.sums[1] + b];
        self.squares = [self.squares[0] + a * a, self.squares[1] + b * b];
        self.products += a * b;
    }

    /// The correlation, in [−1, 1]; zero for too few differences.
    fn value(&self) -> f64 {
        let [a, b] = self.sums;
        let spread = |i: usize| self.squares[i] - self.sums[i] * self.sums[i] / self.n;
        let value = (self.products - a * b / self.n) / (spread(0) * spread(1)).sqrt();
        if self.n >= LEAST_DIFFERENCES && value.is_finite() { value } else { 0.0 }
    }

    /// The first variable per unit of the second, by least squares.
    fn slope(&self) -> f64 {
        let [a, b] = self.sums;
        (self.products - a * b / self.n) / (self.squares[1] - b * b / self.n)
    }
}

/// Correlations of the motion along one axis with both commands, for each delay.
type AxisCorrelations = PerAxis<[Correlation; DELAYS]>;

/// Correlates the motion along both axes with both commands.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct ResponseCorrelator {
    block_s: f64,
    /// Number of the current block.
    number: f64,
    filling: ResponseBlock,
    held: VecDeque<ResponseBlock>,
    tried: PerAxis<AxisCorrelations>,
}

impl ResponseCorrelator {
    pub(super) fn new(sample_rate_hz: f64) -> Self {
        Self {
            block_s: RESPONSE_BLOCK_S.max(BLOCK_SAMPLES / sample_rate_hz),
            number: f64::NAN,
            filling: ResponseBlock::default(),
            held: VecDeque::with_capacity(HELD),
            tried: PerAxis::default(),
        }
    }

    /// Takes a moment; one later than the end of its block is ignored.
    pub(super) fn take(&mut self, moment: &Moment) {
        let number = (moment.at.seconds() / self.block_s).floor();
        if number < self.number {
            return;
        }
        if number != self.number {
            self.close(number == self.number + 1.0);
            self.number = number;
        }
        for axis in Axis::ALL {
            self.filling.position[axis].take(moment.position[axis]);
            self.filling.command[axis].take(moment.command[axis]);
        }
    }

    /// Ends the current block; unless the next one `follows` it directly, earlier blocks
    /// are dropped.
    fn close(&mut self, follows: bool) {
        let block = core::mem::take(&mut self.filling);
        if !follows {
            self.held.clear();
            return;
        }
        if self.held.len() == HELD {
            self.held.pop_front();
        }
        self.held.push_back(block);
        if self.held.len() == HELD {
            self.correlate();
        }
    }

    fn correlate(&mut self) {
        let bends = PerAxis::from_fn(|axis| self.bend(axis));
        for of in Axis::ALL {
            for delay in 0..DELAYS {
                let Some(command) = self.command(of, delay) else { continue };
                for axis in Axis::ALL {
                    if let Some(bend) = bends[axis] {
                        self.tried[axis][of][delay].take(bend, command);
                    }
                }
            }
        }
    }

    /// The second difference of the newest positions.
    fn bend(&self, axis: Axis) -> Option<f64> {
        let at = |i: usize| self.held[i].position[axis].value();
        let last = HELD - 1;
        Some(at(last)? - 2.0 * at(last - SPAN)? + at(last - 2 * SPAN)?)
    }

    /// The command through the same window, `delay` blocks earlier.
    fn command(&self, axis: Axis, delay: usize) -> Option<f64> {
        let middle = HELD - 1 - SPAN - delay;
        let mut sum = 0.0;
        for offset in 0..2 * SPAN - 1 {
            let value = self.held[middle + offset + 1 - SPAN].command[axis].value()?;
            sum += value * (SPAN - offset.abs_diff(SPAN - 1)) as f64;
        }
        Some(sum)
    }

    /// The correlation of the motion along `axis` with the command of `of`, with the delay that
    /// explains most.
    fn best(&self, axis: Axis, of: Axis) -> &Correlation {
        let tried = &self.tried[axis][of];
        tried
            .iter()
            .fold(&tried[0], |best, c| if c.value().abs() > best.value().abs() { c } else { best })
    }

    /// Acceleration along `axis` per radian of its own command, m/s²; `None` if no clear response of
    /// the ball to it is seen.
    pub(super) fn slope_m_s2(&self, axis: Axis) -> Option<f64> {
        // The weights of the positions and of the commands are those of the same triangle.
        let per_block = self.best(axis, axis).slope() * axis.drive_sign();
        (self.answers(axis) == AxisResponse::Own)
            .then_some(per_block / (self.block_s * self.block_s))
    }

    /// Returns the command that the motion along `axis` responds to.
    pub(super) fn answers(&self, axis: Axis) -> AxisResponse {
        let best = |of: Axis| self.best(axis, of).value();
        let (own, other) = (best(axis) * axis.drive_sign(), best(axis.other()));
        let clear =
            |r: f64, rival: f64| r * r >= CLEAR_SHARE && rival * rival <= RIVAL_SHARE * r * r;
        match (clear(own, other), clear(other, own)) {
            (true, _) if own > 0.0 => AxisResponse::Own,
            (true, _) => AxisResponse::Against,
            (_, true) => AxisResponse::Other,
            _ => AxisResponse::Unclear,
        }
    }
}
