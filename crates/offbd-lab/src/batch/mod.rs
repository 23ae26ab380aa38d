//! Steps many rolling balls at once with vector instructions: for fleets, parameter
//! sweeps and Monte Carlo runs.
//!
//! A ball's step is a fixed sequence of IEEE operations without branches, written
//! once for one ball and looped over blocks of balls. So a ball's path depends, to
//! the bit, on its own inputs alone: not on its neighbours, their number, or the
//! instructions of the machine. Each ball may have its own rig, plate and step.
//!
//! Use [`Rolling`](offbd_core::plant::Rolling) for one ball, an external force or a
//! higher order; use a [`RollingBatch`] for dozens of balls. Like `Rolling`, it models
//! neither edges nor the limit of friction.

mod block;
mod instructions;
mod step;

pub use instructions::Instructions;
pub use step::RollingConstants;

use block::{LANES, LaneBlock};
use offbd_core::plant::RollingState;

/// The plates of all balls at the middle of a step, one value per ball in the order
/// of the batch. For plates that stand still, pass the same columns again.
#[derive(Clone, Copy, Debug)]
pub struct PlateColumns<'a> {
    /// Angles about x, rad, within ±1000.
    pub qx_rad: &'a [f64],
    /// Angles about the turned y, rad, within ±1000.
    pub qy_rad: &'a [f64],
    /// q̇x, rad/s.
    pub qx_rate: &'a [f64],
    /// q̇y, rad/s.
    pub qy_rate: &'a [f64],
    /// q̈x, rad/s².
    pub qx_acceleration: &'a [f64],
    /// q̈y, rad/s².
    pub qy_acceleration: &'a [f64],
    /// Length of the step, s.
    pub step_s: &'a [f64],
}

impl<'a> PlateColumns<'a> {
    #[inline(always)]
    fn columns(&self) -> [&'a [f64]; 7] {
        [
            self.qx_rad,
            self.qy_rad,
            self.qx_rate,
            self.qy_rate,
            self.qx_acceleration,
            self.qy_acceleration,
            self.step_s,
        ]
    }
}

/// Rolling balls that are advanced together.
#[derive(Clone, Debug)]
pub struct RollingBatch {
    blocks: Vec<LaneBlock>,
    n_balls: usize,
    instructions: Instructions,
}

impl RollingBatch {
    /// Creates a batch of balls at rest at the centre of their plates. Only this
    /// function allocates: 80 bytes per ball, rounded up to whole blocks of 32.
    #[must_use]
    pub fn new(balls: &[RollingConstants], instructions: Instructions) -> Self {
        let mut blocks = vec![LaneBlock::EMPTY; balls.len().div_ceil(LANES)];
        for (i, ball) in balls.iter().enumerate() {
            blocks[i / LANES].set_constants(i % LANES, ball);
        }
        Self { blocks, n_balls: balls.len(), instructions }
    }

    #[must_use]
    pub fn len(&self) -> usize {
        self.n_balls
    }

    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.n_balls == 0
    }

    /// Returns the state of ball `i`.
    ///
    /// # Panics
    /// If there is no ball `i`.
    #[must_use]
    pub fn state(&self, i: usize) -> RollingState {
        assert!(i < self.n_balls, "ball {i} of {}", self.n_balls);
        self.blocks[i / LANES].motion(i % LANES).into()
    }

    /// Sets the state of ball `i`.
    ///
    /// # Panics
    /// If there is no ball `i`.
    pub fn set_state(&mut self, i: usize, to: &RollingState) {
        assert!(i < self.n_balls, "ball {i} of {}", self.n_balls);
        self.blocks[i / LANES].set_motion(i % LANES, to.into());
    }

    /// Returns the states in the order of the balls.
    pub fn states(&self) -> impl Iterator<Item = RollingState> {
        (0..self.n_balls).map(|i| self.state(i))
    }

    /// Advances every ball by its own step, as [`RollingConstants::midpoint`] does.
    /// Allocates nothing. A NaN or an infinity affects only the ball it belongs to.
    ///
    /// # Panics
    /// If a column does not have exactly one value per ball.
    pub fn step(&mut self, plates: &PlateColumns<'_>) {
        for column in plates.columns() {
            assert_eq!(column.len(), self.n_balls, "a column needs a value per ball");
        }
        self.instructions.step(&mut self.blocks, plates);
    }
}

#[cfg(test)]
mod tests;
