//! The twin in its own simulation: the ball that it observes is separate, and has a spin.
//!
//! The twin of a rig follows a ball whose spin about the plate's normal no sensor sees; here the
//! spin is integrated too, by explicit Euler, from the plate's angles at both ends of a step.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use core::ops::RangeInclusive;
use serde::{Deserialize, Serialize};

use super::{Rolling, RollingState, Tilt, Twin, TwinModel};
use crate::vocabulary::{Axis, PerAxis, SimTime};

/// Share of a step by which it may be too long, so that rounding of times adds no step. Chosen.
const SAME_LENGTH: f64 = 1e-9;

/// A twin with the ball that it moves.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SimulatedTwin {
    twin: Twin,
    rolling: Rolling,
    now: SimTime,
    spin: f64,
    /// Mean rates of the plate in the last step, rad/s.
    rates: PerAxis<f64>,
}

impl SimulatedTwin {
    /// Acceleration that the twin may neglect, m/s²: none, because a simulation does not count
    /// its cost. For the ladder of its model.
    pub const ACCURACY_M_S2: f64 = 0.0;

    /// The longest step can be chosen from this range, s. The twin is made for steps of 1 ms or
    /// longer: in a shorter one it underestimates the effect of the plate's rates. A time that is
    /// divided has steps of at least half of the longest.
    pub const STEPS_S: RangeInclusive<f64> = 2e-3..=0.01;

    /// Starts the twin of `model` at `at`, with its servos at rest on `commands` and its ball in
    /// the motion `ball`.
    #[must_use]
    pub fn start(
        model: TwinModel,
        at: SimTime,
        commands: PerAxis<f64>,
        ball: &RollingState,
    ) -> Self {
        let rolling = *model.ladder.rolling();
        let mut twin = Twin::new(model);
        twin.rebase(ball.position, ball.velocity);
        twin.advance(at, commands.map(Some), ball);
        Self { twin, rolling, now: at, spin: ball.spin, rates: PerAxis::default() }
    }

    /// Continues with the parameters of `model` from now on, as if the rig had changed: servos,
    /// ball and the commands on their way stay as they are. A servo does not return to a command
    /// that it has left, even if its dead time becomes longer. A level that jumps moves the plate
    /// at once, without a push to the ball.
    pub fn retune(&mut self, model: TwinModel) {
        self.rolling = *model.ladder.rolling();
        self.twin.retune(model);
    }

    /// Gives commands, which hold from now on; without one, the servo keeps its command.
    pub fn command(&mut self, commands: PerAxis<Option<f64>>) {
        self.twin.command(commands);
    }

    /// Advances to `to` in equal steps of at most `longest_s` seconds; does nothing if `to` is not
    /// later than now.
    pub fn advance(&mut self, to: SimTime, longest_s: f64) {
        let (from, span) = (self.now, to - self.now);
        if span <= 0.0 {
            return;
        }
        let n = (span / longest_s - SAME_LENGTH).ceil().max(1.0);
        let h = span / n;
        for i in 1..n as u64 {
            self.step(from + i as f64 * h, h);
        }
        self.step(to, h);
    }

    fn step(&mut self, to: SimTime, h: f64) {
        let (ball, before) = (self.ball(), self.plate());
        self.twin.advance(to, PerAxis::default(), &ball);
        let after = self.plate();
        let rates = PerAxis::from_fn(|axis| (after[axis] - before[axis]) / h);
        let turn = |axis: Axis| {
            let mean = f64::midpoint(before[axis], after[axis]);
            [mean, rates[axis], (rates[axis] - self.rates[axis]) / h]
        };
        // The x servo turns qy, the y servo qx.
        let tilt = Tilt::of(turn(Axis::Y), turn(Axis::X));
        self.spin += self.rolling.acceleration(&ball, &tilt.motion()).1 * h;
        (self.rates, self.now) = (rates, to);
    }

    /// The time that the twin has reached.
    #[must_use]
    pub const fn now(&self) -> SimTime {
        self.now
    }

    /// The motion of the ball.
    #[must_use]
    pub fn ball(&self) -> RollingState {
        let motion = self.twin.motion();
        RollingState { position: motion.position, velocity: motion.velocity, spin: self.spin }
    }

    /// The angle of the plate that each servo turns, rad.
    #[must_use]
    pub fn plate(&self) -> PerAxis<f64> {
        self.twin.plate_angle()
    }
}
