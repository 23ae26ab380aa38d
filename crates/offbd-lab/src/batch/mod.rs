//! Many rolling balls, one step at a time, as many at once as the machine has
//! lanes: for fleets, for families of parameters, for noise drawn many times.
//!
//! One idea: a ball's step is a fixed sequence of IEEE operations without
//! branches, written once for one ball and looped over blocks of balls. So a
//! ball's path depends, to the bit, on nothing but its own inputs: not on its
//! neighbours, their number, or the instructions of the machine. Each ball may
//! have a rig, a plate and a step of its own.
//!
//! Use [`Rolling`](offbd_core::plant::Rolling) for one ball, an external force or a higher
//! order; use a [`RollingBatch`] where there are dozens. It knows no edges and
//! no limits of friction either.

mod block;
mod instructions;
mod step;

pub use instructions::Instructions;
pub use step::RollingConstants;

use block::{Block, LANES};
use offbd_core::plant::RollingState;

/// The plates of all balls at the middle of a step, ball by ball in the order
/// of the batch. A plate that is held is the same columns again.
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
    blocks: Vec<Block>,
    n_balls: usize,
    instructions: Instructions,
}

impl RollingBatch {
    /// A batch of balls at rest in the middle of their plates. The only place
    /// that allocates: 80 bytes a ball, rounded up to whole blocks of 32.
    #[must_use]
    pub fn new(balls: &[RollingConstants], instructions: Instructions) -> Self {
        let mut blocks = vec![Block::EMPTY; balls.len().div_ceil(LANES)];
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

    /// # Panics
    /// If there is no ball `i`.
    #[must_use]
    pub fn state(&self, i: usize) -> RollingState {
        assert!(i < self.n_balls, "ball {i} of {}", self.n_balls);
        self.blocks[i / LANES].motion(i % LANES).into()
    }

    /// # Panics
    /// If there is no ball `i`.
    pub fn set_state(&mut self, i: usize, to: &RollingState) {
        assert!(i < self.n_balls, "ball {i} of {}", self.n_balls);
        self.blocks[i / LANES].set_motion(i % LANES, to.into());
    }

    /// The states in the order of the balls.
    pub fn states(&self) -> impl Iterator<Item = RollingState> {
        (0..self.n_balls).map(|i| self.state(i))
    }

    /// Advances every ball by its own step, as
    /// [`RollingConstants::midpoint`] does. Allocates nothing. A number that
    /// is none spoils the one ball that it belongs to.
    ///
    /// # Panics
    /// If a column has not one value per ball.
    pub fn step(&mut self, plates: &PlateColumns<'_>) {
        for column in plates.columns() {
            assert_eq!(column.len(), self.n_balls, "a column needs a value per ball");
        }
        self.instructions.step(&mut self.blocks, plates);
    }
}

#[cfg(test)]
mod tests;
