//! The path of a ball under the commands of one axis by the planar model alone, for the
//! search of dead time and lag.
//!
//! It leaves out what [`Planar::left_out`] bounds: the other axis, and whatever is of
//! second order in the angles. The servo is that of the twin, solved in the same steps.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use core::ops::Range;

use super::recording::{Recording, Stretch};
use crate::plant::{LONGEST_SPAN_S, Planar, ServoModel, ServoState, Sweep};
use crate::vocabulary::Axis;

/// Time before a stretch from which on the servo is followed, s: nine of the longest lags
/// of the grid, after which it has forgotten how it stood. Chosen.
const WARM_S: f64 = 2.0;

/// The commands of one axis of a recording.
pub(super) struct CommandedPath {
    planar: Planar,
    axis: Axis,
    times: Vec<f64>,
    runs: Vec<Run>,
}

/// Moments without a gap between them, and their commands.
struct Run {
    moments: Range<usize>,
    /// Each command, rad, with the time from which it holds, s.
    changes: Vec<(f64, f64)>,
}

/// A point of the path of a ball that was at rest at the start of its stretch.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PathPoint {
    pub(super) position_m: f64,
    pub(super) velocity_m_s: f64,
}

impl CommandedPath {
    pub(super) fn new(recording: &Recording, axis: Axis, planar: Planar) -> Self {
        let gap_s = recording.gap_s.min(LONGEST_SPAN_S);
        let times: Vec<f64> = recording.moments.iter().map(|m| m.at.seconds()).collect();
        let mut runs: Vec<Run> = Vec::new();
        for (i, m) in recording.moments.iter().enumerate() {
            if i == 0 || times[i] - times[i - 1] > gap_s {
                runs.push(Run { moments: i..i, changes: Vec::new() });
            }
            let Some(run) = runs.last_mut() else { continue };
            run.moments.end = i + 1;
            let last = run.changes.last().map(|&(_, command)| command);
            if let Some(command) = m.command[axis].filter(|&c| last != Some(c)) {
                run.changes.push((times[i], command));
            }
        }
        Self { planar, axis, times, runs }
    }

    /// The moment from which on a servo is followed for it to be known at moment `at`.
    pub(super) fn warm(&self, at: usize, dead_time_s: f64) -> usize {
        self.times.partition_point(|t| *t < self.times[at] - WARM_S - dead_time_s)
    }

    /// Begins to follow a `servo` that starts to move `dead_time_s` after its command.
    pub(super) fn walk<'a>(&'a self, servo: &'a ServoModel, dead_time_s: f64) -> Walk<'a> {
        Walk {
            path: self,
            model: servo,
            dead_time_s,
            at: usize::MAX,
            run: 0,
            next: 0,
            command: 0.0,
            servo: ServoState::default(),
            point: PathPoint::default(),
        }
    }
}

/// A servo and a ball on their way along the moments of a recording.
pub(super) struct Walk<'a> {
    path: &'a CommandedPath,
    model: &'a ServoModel,
    dead_time_s: f64,
    /// The present moment.
    at: usize,
    run: usize,
    /// The change of the run after the command in force.
    next: usize,
    command: f64,
    servo: ServoState,
    point: PathPoint,
}

impl Walk<'_> {
    /// Puts the points of `stretch` into `points`, of a ball at rest at its start. A walk
    /// costs least from one stretch to the next.
    pub(super) fn along(&mut self, stretch: &Stretch, points: &mut Vec<PathPoint>) {
        let warm = self.path.warm(stretch.start, self.dead_time_s);
        if self.at > stretch.start || self.at < warm {
            self.start(warm, stretch.start);
        }
        while self.at < stretch.start {
            self.step();
        }
        self.point = PathPoint::default();
        points.clear();
        points.push(self.point);
        while self.at + 1 < stretch.end {
            self.step();
            points.push(self.point);
        }
    }

    /// Places the servo on the command in force at moment `from`, or at the start of the
    /// run of moment `to` if that is later.
    fn start(&mut self, from: usize, to: usize) {
        self.run = self.path.runs.partition_point(|r| r.moments.end <= to);
        let run = &self.path.runs[self.run];
        self.at = from.max(run.moments.start);
        let until = self.path.times[self.at] - self.dead_time_s;
        // Before the first command of a run that command is in force.
        self.next = run.changes.partition_point(|&(since, _)| since <= until).max(1);
        self.command = run.changes.get(self.next - 1).map_or(0.0, |&(_, command)| command);
        let limit = self.model.angle_limit_rad();
        self.servo =
            ServoState { angle: self.command.clamp(-limit, limit), ..ServoState::default() };
        self.point = PathPoint::default();
    }

    /// Advances to the next moment; after a gap, starts again.
    fn step(&mut self) {
        let path = self.path;
        let run = &path.runs[self.run];
        let to = self.at + 1;
        if to == run.moments.end {
            return self.start(to, to);
        }
        let (mut from, until) =
            (path.times[self.at] - self.dead_time_s, path.times[to] - self.dead_time_s);
        let h = until - from;
        let mut swept = Sweep::start(self.servo);
        while let Some(&(since, command)) = run.changes.get(self.next).filter(|c| c.0 < until) {
            let part_s = since - from;
            swept = swept.then(&self.model.sweep(&swept.servo, self.command, part_s), part_s);
            (from, self.command, self.next) = (since, command, self.next + 1);
        }
        let part_s = until - from;
        swept = swept.then(&self.model.sweep(&swept.servo, self.command, part_s), part_s);
        let added = path.planar.path_increment(&self.servo, &swept, 0.0, h);
        let (sign, point) = (path.axis.drive_sign(), &mut self.point);
        point.position_m += point.velocity_m_s * h + sign * added.position_m;
        point.velocity_m_s += sign * added.velocity_m_s;
        (self.servo, self.at) = (swept.servo, to);
    }
}
