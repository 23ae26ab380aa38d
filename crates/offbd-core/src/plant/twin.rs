//! The twin: servos and a rolling ball that follow the commands of a rig, in lockstep
//! with its samples.
//!
//! The diagnosis needs the *curvature* of the twin's path, which does not change when a
//! straight line is added. So the twin integrates its own acceleration freely, and
//! [`Twin::rebase`] moves it to the ball at any time without hiding a fault. The small
//! terms that depend on the position of the ball (centrifugal, Euler, Coriolis) use the
//! observed motion, which is an argument.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use alloc::collections::VecDeque;
use serde::{Deserialize, Serialize};

use nalgebra::Vector2;

use super::servo::Sweep;
use super::{Fidelity, Ladder, RollingState, Rung, ServoModel, ServoState, Tilt};
use crate::vocabulary::{Axis, PerAxis, SimTime};

/// Most commands remembered for the dead time: half a second at 1 kHz. Beyond it the
/// oldest remembered command is taken as in force.
const COMMAND_HISTORY: usize = 512;

/// Longest integration step, s. Chosen: only the terms that the planar model neglects
/// have an integration error.
const LONGEST_STEP_S: f64 = 0.05;
/// Longest integration step while the ball slides, s: its spin is integrated by Euler's
/// method.
const SLIDING_STEP_S: f64 = 0.01;
/// Longest interval between two samples that the twin integrates over, s: the longest
/// dead time. After a longer one it restarts, which bounds the number of steps whatever
/// the clock says.
pub const LONGEST_SPAN_S: f64 = LONGEST_DEAD_TIME_S;
/// Longest dead time that an asset file may state, s. Chosen.
pub const LONGEST_DEAD_TIME_S: f64 = 5.0;
/// Shortest time in which a servo turns, s; one modelled as a lag starts at once. Chosen.
const LEAST_TURN_S: f64 = 1e-3;

/// One axis of the twin: how the ball responds to the servo that drives it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TwinAxis {
    pub servo: ServoModel,
    /// Time from a command to the servo's first movement, s.
    pub dead_time_s: f64,
    /// Angle asked of the servo, as a multiple of its command, dimensionless; 1 unless a fault is
    /// simulated. It acts after the dead time and before the angle limit.
    pub command_gain: f64,
    /// Measured over modelled acceleration, dimensionless; 1 if units and ball are as the
    /// asset file states.
    pub gain: f64,
    /// Plate angle at a command of zero, rad: plate or servo horn off level.
    pub level_rad: f64,
    /// Deceleration of a rolling ball, m/s².
    pub resistance_m_s2: f64,
}

impl TwinAxis {
    /// An axis as the asset file states it: level, without resistance, and with gains of 1. The
    /// dead time is in s.
    #[must_use]
    pub const fn new(servo: ServoModel, dead_time_s: f64) -> Self {
        let (command_gain, gain, level_rad, resistance_m_s2) = (1.0, 1.0, 0.0, 0.0);
        Self { servo, dead_time_s, command_gain, gain, level_rad, resistance_m_s2 }
    }
}

/// Speed from which on rolling resistance acts fully, m/s; proportional below. Chosen: a
/// slower ball alternately sticks and rolls.
const FULL_RESISTANCE_M_S: f64 = 0.01;

/// Returns the fraction of the rolling resistance that acts at a velocity in m/s, with
/// its sign.
#[must_use]
pub fn resistance_share(velocity_m_s: f64) -> f64 {
    (velocity_m_s / FULL_RESISTANCE_M_S).clamp(-1.0, 1.0)
}

/// The parameters of the twin; immutable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TwinModel {
    pub ladder: Ladder,
    pub axes: PerAxis<TwinAxis>,
}

impl TwinModel {
    /// Builds a twin with the models of `ladder` and two equal axes.
    #[must_use]
    pub fn new(ladder: Ladder, axis: TwinAxis) -> Self {
        Self { ladder, axes: PerAxis { x: axis, y: axis } }
    }
}

/// Motion per axis: position (m), velocity (m/s), acceleration (m/s²).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwinMotion {
    pub position: Vector2<f64>,
    pub velocity: Vector2<f64>,
    pub acceleration: Vector2<f64>,
}

/// Commands, rad, with the time from which each holds, s.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct CommandHistory {
    entries: VecDeque<(f64, f64)>,
}

impl CommandHistory {
    fn push(&mut self, at: f64, command: f64) {
        if self.entries.back().is_some_and(|&(_, last)| last == command) {
            return;
        }
        if self.entries.len() == COMMAND_HISTORY {
            self.entries.pop_front();
        }
        self.entries.push_back((at, command));
    }

    /// Returns the command in force at time `at` and the time, if known, at which the
    /// next one takes over; drops older commands.
    fn in_force(&mut self, at: f64) -> (f64, Option<f64>) {
        let mut next = self.entries.get(1).map(|&(from, _)| from);
        while next.is_some_and(|from| from <= at) {
            self.entries.pop_front();
            next = self.entries.get(1).map(|&(from, _)| from);
        }
        let command = self.entries.front().map_or(0.0, |&(_, command)| command);
        (command, next)
    }
}

/// The twin's state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Twin {
    model: TwinModel,
    now: Option<SimTime>,
    commands: PerAxis<CommandHistory>,
    servos: PerAxis<ServoState>,
    motion: TwinMotion,
    fidelity: Fidelity,
}

impl Twin {
    /// Builds a twin at rest that has seen no sample.
    #[must_use]
    pub fn new(model: TwinModel) -> Self {
        Self {
            model,
            now: None,
            commands: PerAxis::default(),
            servos: PerAxis::default(),
            motion: TwinMotion::default(),
            fidelity: Fidelity::default(),
        }
    }

    /// Continues with the parameters of `model`: the servos and the ball stay as they are, and
    /// the commands that are remembered stay too.
    pub(super) const fn retune(&mut self, model: TwinModel) {
        self.model = model;
    }

    /// The model in use and why it was selected.
    #[must_use]
    pub const fn fidelity(&self) -> &Fidelity {
        &self.fidelity
    }

    /// The twin's present motion; its position and velocity are relative to
    /// the last [`rebase`](Self::rebase).
    #[must_use]
    pub const fn motion(&self) -> &TwinMotion {
        &self.motion
    }

    /// Present plate angle of each axis, rad, level included.
    #[must_use]
    pub fn plate_angle(&self) -> PerAxis<f64> {
        PerAxis::from_fn(|a| self.servos[a].angle + self.model.axes[a].level_rad)
    }

    /// Advances to `to` under the commands seen so far, then stores `commands`, which
    /// hold from `to` on. `observed` is the measured motion of the ball, for the terms
    /// that depend on it.
    ///
    /// The first call, a call after [`restart`](Self::restart), and a call more than
    /// [`LONGEST_SPAN_S`] after the last one place the servos on the given commands
    /// instead.
    pub fn advance(
        &mut self,
        to: SimTime,
        commands: PerAxis<Option<f64>>,
        observed: &RollingState,
    ) {
        if self.now.is_some_and(|now| to - now > LONGEST_SPAN_S) {
            self.restart();
        }
        match self.now {
            Some(now) => self.integrate(now, to, observed),
            None => self.settle(commands),
        }
        self.now = Some(to);
        self.command(commands);
    }

    /// Stores `commands`, which hold from the present time on. Before the first
    /// [`advance`](Self::advance) there is no such time, and nothing is stored.
    pub fn command(&mut self, commands: PerAxis<Option<f64>>) {
        let Some(now) = self.now else { return };
        for axis in Axis::ALL {
            if let Some(command) = commands[axis] {
                self.commands[axis].push(now.seconds(), command);
            }
        }
    }

    /// Forgets all motion, as after a gap: the next sample places the servos on its
    /// commands.
    pub fn restart(&mut self) {
        self.now = None;
        self.motion = TwinMotion::default();
        self.fidelity = Fidelity::default();
        for axis in Axis::ALL {
            self.commands[axis].entries.clear();
        }
    }

    /// Moves the twin to `position` and `velocity`; returns the straight line that was
    /// subtracted, for callers that hold earlier positions.
    pub fn rebase(&mut self, position: Vector2<f64>, velocity: Vector2<f64>) -> TwinMotion {
        let shift = TwinMotion {
            position: self.motion.position - position,
            velocity: self.motion.velocity - velocity,
            acceleration: Vector2::zeros(),
        };
        self.motion.position = position;
        self.motion.velocity = velocity;
        shift
    }

    fn settle(&mut self, commands: PerAxis<Option<f64>>) {
        for axis in Axis::ALL {
            let model = &self.model.axes[axis];
            let limit = model.servo.angle_limit_rad();
            let asked = model.command_gain * commands[axis].unwrap_or(0.0);
            let angle = asked.clamp(-limit, limit);
            self.servos[axis] = ServoState { angle, ..ServoState::default() };
        }
    }

    fn integrate(&mut self, from: SimTime, to: SimTime, observed: &RollingState) {
        let span = to - from;
        let longest_s = match self.fidelity.rung {
            Rung::Sliding => SLIDING_STEP_S,
            Rung::Planar | Rung::Rolling => LONGEST_STEP_S,
        };
        if span <= longest_s {
            return self.step(from.seconds(), span, observed);
        }
        let steps = (span / longest_s).ceil();
        let h = span / steps;
        for step in 0..steps as u32 {
            self.step(from.seconds() + f64::from(step) * h, h, observed);
        }
    }

    /// One step of `h` seconds: the part linear in the servos' angles exactly, the rest
    /// at their mean.
    fn step(&mut self, start: f64, h: f64, observed: &RollingState) {
        #[cfg(test)]
        steps::count();
        let before = self.servos;
        let swept = PerAxis::from_fn(|axis| self.sweep(axis, start, h));
        self.servos = swept.map(|s| s.servo);
        let ladder = &self.model.ladder;
        let taken_s = h.max(LEAST_TURN_S);
        let mean = |axis: Axis| {
            let (from, to) = (&before[axis], &swept[axis].servo);
            let angle = swept[axis].once / h + self.model.axes[axis].level_rad;
            [angle, (to.angle - from.angle) / taken_s, (to.rate - from.rate) / taken_s]
        };
        // The x servo turns qy, the y servo qx.
        let tilt = Tilt::of(mean(Axis::Y), mean(Axis::X));
        let modelled = ladder.acceleration(&mut self.fidelity, observed, &tilt, h);
        let beyond = modelled - ladder.planar().acceleration(&tilt);
        for (i, axis) in Axis::ALL.into_iter().enumerate() {
            let model = &self.model.axes[axis];
            let rest = model.gain * beyond[i]
                - model.resistance_m_s2 * resistance_share(observed.velocity[i]);
            let planar =
                ladder.planar().path_increment(&before[axis], &swept[axis], model.level_rad, h);
            // The y servo's positive angle drives the ball toward −y.
            let sign = if axis == Axis::X { model.gain } else { -model.gain };
            let motion = &mut self.motion;
            motion.position[i] +=
                motion.velocity[i] * h + sign * planar.position_m + rest * h * h / 2.0;
            motion.velocity[i] += sign * planar.velocity_m_s + rest * h;
            motion.acceleration[i] = sign * planar.acceleration_m_s2 + rest;
        }
    }

    /// Moves the servo of `axis` from `start` for `h` seconds, exactly: a command that
    /// takes over within the step does so at its own time.
    fn sweep(&mut self, axis: Axis, start: f64, h: f64) -> Sweep {
        let model = &self.model.axes[axis];
        let mut at = start - model.dead_time_s;
        let end = at + h;
        let mut swept = Sweep::start(self.servos[axis]);
        loop {
            let (command, next) = self.commands[axis].in_force(at);
            let until = next.filter(|&n| n < end).unwrap_or(end);
            let part_s = until - at;
            let asked = model.command_gain * command;
            swept = swept.then(&model.servo.sweep(&swept.servo, asked, part_s), part_s);
            if until == end {
                return swept;
            }
            at = until;
        }
    }
}

/// Counts the steps of the twins of a thread, for tests of bounded work.
#[cfg(test)]
pub(crate) mod steps {
    use core::cell::Cell;

    thread_local! {
        static TAKEN: Cell<u64> = const { Cell::new(0) };
        static MOST: Cell<u64> = const { Cell::new(u64::MAX) };
    }

    pub(super) fn count() {
        TAKEN.set(TAKEN.get() + 1);
        assert!(TAKEN.get() <= MOST.get(), "the twins took more than {} steps", MOST.get());
    }

    /// Runs `work`, which panics if it takes more than `most` steps. Returns its result
    /// and the number of steps.
    pub(crate) fn within<T>(most: u64, work: impl FnOnce() -> T) -> (T, u64) {
        TAKEN.set(0);
        MOST.set(most);
        let done = work();
        MOST.set(u64::MAX);
        (done, TAKEN.get())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{Ball, Plate};

    fn twin(dead_time_s: f64, lag_s: f64) -> Twin {
        let servo = ServoModel::new(0.2, lag_s, 100.0).unwrap();
        let axis = TwinAxis::new(servo, dead_time_s);
        // Zero accuracy: compared with the rolling ball, nothing may be neglected.
        let ladder = Ladder::new(&Ball::default(), &Plate::default(), 0.6, 0.0);
        Twin::new(TwinModel::new(ladder, axis))
    }

    fn at(t: f64) -> SimTime {
        SimTime::new(t).unwrap()
    }

    /// After a step of qy the ball rolls with 5/7 g sin q once the dead time is over,
    /// from where the turning plate has left it: (cgap + κ·r)/(1 + κ)·q behind.
    #[test]
    fn validate_step_of_qy_moves_the_ball_along_x() {
        let mut twin = twin(0.05, 0.0);
        for i in 0..=100 {
            let command = if i == 0 { 0.0 } else { 0.1 };
            let commands = PerAxis { x: Some(command), y: Some(0.0) };
            twin.advance(at(f64::from(i) * 0.01), commands, &RollingState::default());
        }
        // The command holds from t = 0.01 s and acts 0.05 s later. At 100 rad/s the turn
        // takes a millisecond; half of it counts as delay.
        let seconds = 1.0 - 0.06 - 0.0005;
        let a = 5.0 / 7.0 * 9.81 * 0.1_f64.sin();
        let behind = (Plate::default().centre_gap_m(&Ball::default()) + 0.4 * 0.0127) / 1.4 * 0.1;
        let x = twin.motion().position.x + behind;
        assert!((x - a * seconds * seconds / 2.0).abs() < 2e-6, "{x}");
        assert!(twin.motion().position.y.abs() < 1e-12);
    }

    #[test]
    fn positive_qx_moves_the_ball_toward_negative_y() {
        let mut twin = twin(0.0, 0.05);
        for i in 0..=50 {
            let commands = PerAxis { x: None, y: Some(0.1) };
            twin.advance(at(f64::from(i) * 0.01), commands, &RollingState::default());
        }
        assert!(twin.motion().position.y < -0.01);
        assert_eq!(twin.motion().position.x, 0.0);
    }

    /// A clock in milliseconds, or one that jumps by years, must not cause long work.
    #[test]
    fn a_long_span_is_not_integrated_but_starts_afresh() {
        let commands = PerAxis { x: Some(0.1), y: Some(0.0) };
        let mut twin = twin(0.05, 0.05);
        for (t_s, most) in [(0.0, 0), (LONGEST_SPAN_S, 500), (10.001, 0), (1e12, 0)] {
            let advance = || twin.advance(at(t_s), commands, &RollingState::default());
            steps::within(most, advance);
        }
        assert_eq!(*twin.motion(), TwinMotion::default());
    }

    #[test]
    fn rebasing_returns_the_line_taken_away() {
        let mut twin = twin(0.0, 0.0);
        for i in 0..=10 {
            let commands = PerAxis { x: Some(0.1), y: Some(0.05) };
            twin.advance(at(f64::from(i) * 0.1), commands, &RollingState::default());
        }
        let before = *twin.motion();
        let shift = twin.rebase(Vector2::new(0.01, 0.02), Vector2::zeros());
        assert_eq!(twin.motion().position + shift.position, before.position);
        assert_eq!(twin.motion().velocity + shift.velocity, before.velocity);
        assert_eq!(twin.motion().acceleration, before.acceleration);
    }
}
