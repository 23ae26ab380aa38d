//! The twin: servos and a rolling ball that follow the commands of a rig, in
//! lockstep with its samples.
//!
//! One idea: judging needs the *curvature* of the twin's path, and the
//! curvature does not change when a straight line is added. So the twin
//! integrates its own acceleration freely and is re-anchored at will by
//! [`Twin::rebase`], which can neither hide a fault nor let it drift away.
//! The small terms that depend on where the ball is (centrifugal, Euler,
//! Coriolis) use the observed motion, passed in.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use alloc::collections::VecDeque;

use nalgebra::Vector2;

use super::servo::Sweep;
use super::{Fidelity, Ladder, RollingState, Rung, Servo, ServoModel, Tilt};
use crate::vocabulary::{Axis, PerAxis, SimTime};

/// Commands remembered for the dead time. At 1 kHz it holds half a second;
/// beyond it the oldest command is taken as in force.
const COMMAND_HISTORY: usize = 512;

/// Longest step of the twin between two samples, s: only what the planar model
/// leaves out is not exact within it.
const LONGEST_STEP_S: f64 = 0.05;
/// The same while the ball slides, whose spin takes Euler's steps.
const SLIDING_STEP_S: f64 = 0.01;
/// Longest span between two samples that the twin is carried over, s: the longest
/// dead time that an asset file may state. After a longer one it starts afresh,
/// so that no clock makes it take more steps than this.
pub const LONGEST_SPAN_S: f64 = 5.0;
/// Time that any servo takes to turn, s; one modelled as a lag starts at once.
const LEAST_TURN_S: f64 = 1e-3;

/// One axis of the twin: how the ball answers the servo that drives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwinAxis {
    pub servo: ServoModel,
    /// From a command to the servo's first movement, s.
    pub dead_time_s: f64,
    /// Measured over modelled acceleration, dimensionless; 1 when metres,
    /// radians and the ball are what the asset file says.
    pub gain: f64,
    /// Angle at a command of zero, rad: plate and servo horn off level.
    pub level_rad: f64,
    /// Deceleration of a rolling ball, m/s².
    pub resistance_m_s2: f64,
}

/// Speed at which rolling resistance acts in full, m/s: slower, the ball
/// sticks and goes by turns, and half of it is as good a guess as any.
const RESISTED_M_S: f64 = 0.01;

/// Share of the rolling resistance that acts against a velocity, m/s.
#[must_use]
pub fn resisting(velocity_m_s: f64) -> f64 {
    (velocity_m_s / RESISTED_M_S).clamp(-1.0, 1.0)
}

/// What the twin is made of; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwinModel {
    pub ladder: Ladder,
    pub axes: PerAxis<TwinAxis>,
}

impl TwinModel {
    /// A twin by the models of `ladder` whose axes are alike.
    #[must_use]
    pub fn new(ladder: Ladder, axis: TwinAxis) -> Self {
        Self { ladder, axes: PerAxis { x: axis, y: axis } }
    }
}

/// Motion per axis: position m, velocity m/s, acceleration m/s².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TwinMotion {
    pub position: Vector2<f64>,
    pub velocity: Vector2<f64>,
    pub acceleration: Vector2<f64>,
}

/// Commands in force, rad, with the moment from which each holds, s.
#[derive(Clone, Debug, Default)]
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

    /// The command in force at `at` and the moment, if known, at which the next
    /// one takes over; forgets what is older.
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
#[derive(Clone, Debug)]
pub struct Twin {
    model: TwinModel,
    now: Option<SimTime>,
    commands: PerAxis<CommandHistory>,
    servos: PerAxis<Servo>,
    motion: TwinMotion,
    fidelity: Fidelity,
}

impl Twin {
    /// A twin at rest that has seen nothing yet.
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

    /// The model in use and why.
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

    /// Present plate angle behind each axis, rad, level included.
    #[must_use]
    pub fn plate_angle(&self) -> PerAxis<f64> {
        PerAxis::from_fn(|a| self.servos[a].angle + self.model.axes[a].level_rad)
    }

    /// Advances to `to` under the commands seen so far, then takes note of the
    /// commands that hold from `to` on. `observed` is the ball's motion as
    /// measured, for the terms that depend on it.
    ///
    /// The first call, any call after [`restart`](Self::restart), and one more
    /// than [`LONGEST_SPAN_S`] after the last, settles the servos on the given
    /// commands instead.
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
        for axis in Axis::ALL {
            if let Some(command) = commands[axis] {
                self.commands[axis].push(to.seconds(), command);
            }
        }
    }

    /// Forgets the past, as after a gap: the next sample settles the twin.
    pub fn restart(&mut self) {
        self.now = None;
        self.motion = TwinMotion::default();
        self.fidelity = Fidelity::default();
        for axis in Axis::ALL {
            self.commands[axis].entries.clear();
        }
    }

    /// Moves the twin onto `position` and `velocity`; returns the straight
    /// line that was taken away, for whoever remembers earlier positions.
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
            let limit = self.model.axes[axis].servo.angle_limit_rad();
            let angle = commands[axis].unwrap_or(0.0).clamp(-limit, limit);
            self.servos[axis] = Servo { angle, ..Servo::default() };
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

    /// One step of `h` seconds: what is linear in the servos' angles exactly,
    /// the rest at their mean.
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
            let rest =
                model.gain * beyond[i] - model.resistance_m_s2 * resisting(observed.velocity[i]);
            let planar = ladder.planar().answer(&before[axis], &swept[axis], model.level_rad, h);
            // The y servo's positive angle drives the ball toward −y.
            let sign = if axis == Axis::X { model.gain } else { -model.gain };
            let motion = &mut self.motion;
            motion.position[i] +=
                motion.velocity[i] * h + sign * planar.position_m + rest * h * h / 2.0;
            motion.velocity[i] += sign * planar.velocity_m_s + rest * h;
            motion.acceleration[i] = sign * planar.acceleration_m_s2 + rest;
        }
    }

    /// The servo of `axis` moved from `start` on for `h` seconds, exactly: a
    /// command that takes over within the step does so at its own moment.
    fn sweep(&mut self, axis: Axis, start: f64, h: f64) -> Sweep {
        let model = &self.model.axes[axis];
        let mut at = start - model.dead_time_s;
        let end = at + h;
        let mut swept = Sweep::start(self.servos[axis]);
        loop {
            let (command, next) = self.commands[axis].in_force(at);
            let until = next.filter(|&n| n < end).unwrap_or(end);
            let part_s = until - at;
            swept = swept.then(&model.servo.sweep(&swept.servo, command, part_s), part_s);
            if until == end {
                return swept;
            }
            at = until;
        }
    }
}

/// How many steps the twins of a thread have taken, for tests of what is bounded.
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

    /// Runs `work`, which may take `most` steps: one more is a panic. Returns how
    /// many it took.
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
        let axis = TwinAxis { servo, dead_time_s, gain: 1.0, level_rad: 0.0, resistance_m_s2: 0.0 };
        // To be held against the rolling ball, nothing may be left out.
        let ladder = Ladder::new(&Ball::default(), &Plate::default(), 0.6, 0.0);
        Twin::new(TwinModel::new(ladder, axis))
    }

    fn at(t: f64) -> SimTime {
        SimTime::new(t).unwrap()
    }

    /// After a jump of qy with a dead time the ball rolls with 5/7 g sin q, from
    /// where the turning plate has left it: (cgap + κ·r)/(1 + κ)·q behind.
    #[test]
    fn validate_step_of_qy_moves_the_ball_along_x() {
        let mut twin = twin(0.05, 0.0);
        for i in 0..=100 {
            let command = if i == 0 { 0.0 } else { 0.1 };
            let commands = PerAxis { x: Some(command), y: Some(0.0) };
            twin.advance(at(f64::from(i) * 0.01), commands, &RollingState::default());
        }
        // The command holds from t = 0.01 s and acts 0.05 s later.
        // At 100 rad/s the jump takes a millisecond: half of it later.
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

    /// A clock in milliseconds, or one that jumped by years, must not keep the
    /// twin busy.
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
