//! Which command the ball's motion along an axis answers, and with which sign.
//!
//! Readings and commands are averaged over blocks of time. The second difference
//! of three positions is the acceleration seen through a triangular window, so
//! it is correlated with the commands of some delay before through the same
//! window. A controlled ball correlates with much: only what explains half of
//! the motion, twice as much as anything else, is taken as an answer.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use alloc::collections::VecDeque;

use crate::engine::frame::Moment;
use crate::vocabulary::{Axis, PerAxis};

/// Length of a block, s, where it holds enough samples: a delay of 80–300 ms from
/// command to acceleration, as seen on real rigs, is then at most three.
const BLOCK_S: f64 = 0.1;
/// Samples that a block holds at least.
const BLOCK_SAMPLES: f64 = 2.0;
/// Blocks from one position of a second difference to the next.
const SPAN: usize = 3;
/// Delays that are tried: 0 to 3 blocks.
const DELAYS: usize = 4;
/// Blocks that are held: a difference needs two spans and the one in the middle,
/// its earliest command half a triangle and the longest delay before that.
const HELD: usize = 2 * SPAN + DELAYS - 1;
/// Differences from which on a correlation counts: fifteen seconds of blocks.
const LEAST: f64 = 150.0;
/// Share of the motion that a command must explain for the motion to answer it.
const CLEAR: f64 = 0.5;
/// Share of what is explained best that anything else may explain.
const RIVAL: f64 = 0.5;

/// What the motion along an axis answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Answers {
    /// Its own command.
    Own,
    /// Its own command, to the opposite side.
    Against,
    /// The other axis' command, to either side.
    Other,
    /// Nothing that is clear.
    Unclear,
}

/// A mean as it grows.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    n: u32,
    sum: f64,
}

impl Mean {
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
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    position: PerAxis<Mean>,
    command: PerAxis<Mean>,
}

/// A correlation as it grows.
#[derive(Clone, Copy, Debug, Default)]
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

    /// In [−1, 1]; zero where there is too little to say.
    fn value(&self) -> f64 {
        let [a, b] = self.sums;
        let spread = |i: usize| self.squares[i] - self.sums[i] * self.sums[i] / self.n;
        let value = (self.products - a * b / self.n) / (spread(0) * spread(1)).sqrt();
        if self.n >= LEAST && value.is_finite() { value } else { 0.0 }
    }
}

/// The motion along one axis against both commands, at every delay.
type Tried = PerAxis<[Correlation; DELAYS]>;

/// The motion along both axes against both commands.
#[derive(Clone, Debug)]
pub(super) struct Responses {
    block_s: f64,
    /// Number of the block that is being filled.
    number: f64,
    filling: Block,
    held: VecDeque<Block>,
    tried: PerAxis<Tried>,
}

impl Responses {
    pub(super) fn new(sample_rate_hz: f64) -> Self {
        Self {
            block_s: BLOCK_S.max(BLOCK_SAMPLES / sample_rate_hz),
            number: f64::NAN,
            filling: Block::default(),
            held: VecDeque::with_capacity(HELD),
            tried: PerAxis::default(),
        }
    }

    /// Takes a moment; one that comes after its block is over is left out.
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

    /// Ends the block that is being filled; unless the next one `follows`, what
    /// was before is forgotten.
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
        for axis in Axis::ALL {
            let Some(bend) = self.bend(axis) else { continue };
            for of in Axis::ALL {
                for delay in 0..DELAYS {
                    if let Some(command) = self.command(of, delay) {
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

    /// The command through the same window, so many blocks before.
    fn command(&self, axis: Axis, delay: usize) -> Option<f64> {
        let middle = HELD - 1 - SPAN - delay;
        let weighted = |offset: usize| {
            let value = self.held[middle + offset + 1 - SPAN].command[axis].value()?;
            Some(value * (SPAN - offset.abs_diff(SPAN - 1)) as f64)
        };
        (0..2 * SPAN - 1).map(weighted).sum()
    }

    /// What the motion along `axis` answers.
    pub(super) fn answers(&self, axis: Axis) -> Answers {
        let best = |of: Axis| {
            let values = self.tried[axis][of].iter().map(Correlation::value);
            values.fold(0.0, |best: f64, r| if r.abs() > best.abs() { r } else { best })
        };
        let (own, other) = (best(axis) * axis.drive_sign(), best(axis.other()));
        let clear = |r: f64, rival: f64| r * r >= CLEAR && rival * rival <= RIVAL * r * r;
        match (clear(own, other), clear(other, own)) {
            (true, _) if own > 0.0 => Answers::Own,
            (true, _) => Answers::Against,
            (_, true) => Answers::Other,
            _ => Answers::Unclear,
        }
    }
}
