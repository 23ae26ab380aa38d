//! A block of [`LANES`] balls in structure-of-arrays layout: one row per quantity.
//!
//! Every loop has a fixed number of iterations that do not depend on each other, so
//! the compiler vectorises it. Lanes never mix: a NaN in one ball does not reach
//! another.

use super::step::{BallNumbers, PlateRotation, RollingConstants};
use offbd_core::maths::sine::{reduced, turned};

/// Number of balls in a block. Chosen large enough that independent iterations hide
/// the latency of the dependency chain within each, and small enough that a block
/// with its inputs (5.4 kB) stays in the L1 cache.
pub(super) const LANES: usize = 32;

/// One quantity of every ball of a block, aligned to a cache line (64 bytes).
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(super) struct Row(pub [f64; LANES]);

impl Row {
    pub(super) const ZERO: Self = Self([0.0; LANES]);
}

/// Constants and states of a block of balls. Lanes without a ball hold zeros and
/// stay zero.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LaneBlock {
    constants: [Row; 5],
    state: [Row; 5],
}

/// The columns of [`PlateColumns`](super::PlateColumns) for one block, in their
/// order.
pub(super) type Inputs<'a> = [&'a [f64; LANES]; 7];

/// Buffers for sin qx, cos qx, sin qy and cos qy of a block.
pub(super) type Scratch = [Row; 4];

impl LaneBlock {
    pub(super) const EMPTY: Self = Self { constants: [Row::ZERO; 5], state: [Row::ZERO; 5] };

    pub(super) fn set_constants(&mut self, lane: usize, of: &RollingConstants) {
        let RollingConstants { centre_gap, spin_arm, curvature, share, coriolis } = *of;
        let values = [centre_gap, spin_arm, curvature, share, coriolis];
        for (row, value) in self.constants.iter_mut().zip(values) {
            row.0[lane] = value;
        }
    }

    pub(super) fn motion(&self, lane: usize) -> BallNumbers {
        let [x, y, vx, vy, spin] = self.state.each_ref().map(|row| row.0[lane]);
        BallNumbers { x, y, vx, vy, spin }
    }

    pub(super) fn set_motion(&mut self, lane: usize, to: BallNumbers) {
        let BallNumbers { x, y, vx, vy, spin } = to;
        for (row, value) in self.state.iter_mut().zip([x, y, vx, vy, spin]) {
            row.0[lane] = value;
        }
    }

    #[inline(always)]
    pub(super) fn step(&mut self, inputs: &Inputs<'_>, scratch: &mut Scratch) {
        let [qx, qy, rest @ ..] = *inputs;
        let [sin_x, cos_x, sin_y, cos_y] = scratch;
        sines(qx, sin_x, cos_x);
        sines(qy, sin_y, cos_y);
        advance(&mut self.state, &self.constants, scratch, rest);
    }
}

/// [`sin_cos`](offbd_core::maths::sine::sin_cos) of a row, in two loops, which halves
/// the dependency chain of each. `sin` and `cos` hold the intermediate results.
#[inline(always)]
fn sines(angle: &[f64; LANES], sin: &mut Row, cos: &mut Row) {
    for ((x, turns), &angle) in sin.0.iter_mut().zip(&mut cos.0).zip(angle) {
        (*x, *turns) = reduced(angle);
    }
    for (sin, cos) in sin.0.iter_mut().zip(&mut cos.0) {
        (*sin, *cos) = turned(*sin, *cos);
    }
}

#[inline(always)]
fn advance(
    [x, y, vx, vy, spin]: &mut [Row; 5],
    [centre_gap, spin_arm, curvature, share, coriolis]: &[Row; 5],
    [sin_x, cos_x, sin_y, cos_y]: &Scratch,
    [rate_x, rate_y, acceleration_x, acceleration_y, step]: [&[f64; LANES]; 5],
) {
    for i in 0..LANES {
        let constants = RollingConstants {
            centre_gap: centre_gap.0[i],
            spin_arm: spin_arm.0[i],
            curvature: curvature.0[i],
            share: share.0[i],
            coriolis: coriolis.0[i],
        };
        let rotation = PlateRotation {
            x: (sin_x.0[i], cos_x.0[i]),
            y: (sin_y.0[i], cos_y.0[i]),
            rate: [rate_x[i], rate_y[i]],
            acceleration: [acceleration_x[i], acceleration_y[i]],
        };
        let motion =
            BallNumbers { x: x.0[i], y: y.0[i], vx: vx.0[i], vy: vy.0[i], spin: spin.0[i] };
        let moved = constants.step(&motion, &rotation, step[i]);
        x.0[i] = moved.x;
        y.0[i] = moved.y;
        vx.0[i] = moved.vx;
        vy.0[i] = moved.vy;
        spin.0[i] = moved.spin;
    }
}
