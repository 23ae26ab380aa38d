//! Deviation of the ball's path from the twin's over two seconds.
//!
//! Within two seconds the path may differ from the twin's by a parabola with one kink:
//! initial position and velocity, the level of the session, and one push. The remaining
//! deviation is due to the servo, beyond what healthy sessions have shown. It needs no
//! model of the noise, so that it works on rigs that the twin fits badly; a steady offset
//! cannot be seen.

use alloc::collections::VecDeque;
use serde::{Deserialize, Serialize};

use crate::maths::kinked_parabola_rms;

/// Length of the path, s: of 1.2 to 3 s the one that told most faults put into recordings
/// of a real rig from its healthy ones, at one limit for all of them.
const WINDOW_S: f64 = 2.0;
/// Fraction of it that must be covered. Chosen.
const COVERED: f64 = 0.85;
/// Least number of points. Chosen: three more than the curve has parameters.
const LEAST_POINTS: usize = 8;
/// Least time that a point covers, s: blocks of readings within are averaged. Chosen.
const POINT_S: f64 = 0.15;
/// Time without a point after which the path is restarted, s: three readings of a slow
/// sensor.
const BREAK_S: f64 = 0.6;

/// The recent path along one axis relative to the twin's.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct PathError {
    points: VecDeque<(f64, f64)>,
    /// Number and sums of time and deviation of the blocks since the last point, and the
    /// time of the first of them, s.
    gathered: (u32, f64, f64),
    since_s: f64,
    /// Time of the last block, s.
    last_s: Option<f64>,
    /// The current deviation, m; `None` if unknown.
    error_m: Option<f64>,
    /// The largest deviation so far, m.
    most_m: f64,
}

impl PathError {
    /// Takes the mean deviation of a block of readings from the twin's path.
    pub(super) fn take(&mut self, t: f64, deviation_m: f64) {
        if self.points.back().is_some_and(|last| t - last.0 > BREAK_S) {
            self.clear();
        }
        let block_s = self.last_s.replace(t).map_or(0.0, |last| t - last);
        let (n, times, deviations) = self.gathered;
        self.gathered = (n + 1, times + t, deviations + deviation_m);
        self.since_s = if n == 0 { t } else { self.since_s };
        if t - self.since_s + block_s >= POINT_S {
            self.close();
        }
    }

    /// Makes a point of the accumulated blocks.
    fn close(&mut self) {
        let (n, times, deviations) = core::mem::take(&mut self.gathered);
        let t = times / f64::from(n);
        self.points.push_back((t, deviations / f64::from(n)));
        while self.points[0].0 < t - WINDOW_S {
            self.points.pop_front();
        }
        let covered = t - self.points[0].0 >= COVERED * WINDOW_S;
        let enough = covered && self.points.len() >= LEAST_POINTS;
        let points = self.points.make_contiguous();
        self.error_m = enough.then(|| kinked_parabola_rms(points)).flatten();
        self.most_m = self.most_m.max(self.error_m.unwrap_or(0.0));
    }

    /// Pauses while the ball cannot respond; it may continue after a moment.
    pub(super) fn pause(&mut self) {
        self.gathered = Default::default();
        (self.last_s, self.error_m) = (None, None);
    }

    /// Restarts the path.
    pub(super) fn clear(&mut self) {
        self.pause();
        self.points.clear();
    }

    /// Follows a rebase of the twin by the line through `position` m at `t` with slope
    /// `velocity` m/s: the deviation grows by that line.
    pub(super) fn rebase(&mut self, t: f64, position: f64, velocity: f64) {
        let line = |at: f64| position + velocity * (at - t);
        for (at, deviation_m) in &mut self.points {
            *deviation_m += line(*at);
        }
        let (n, times, deviations) = &mut self.gathered;
        *deviations += f64::from(*n) * line(0.0) + velocity * *times;
    }

    /// The current deviation, m; `None` if unknown.
    pub(super) const fn error_m(&self) -> Option<f64> {
        self.error_m
    }

    /// The largest deviation so far, m.
    pub(super) const fn most_m(&self) -> f64 {
        self.most_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The path error after 4 s of `path`, in blocks of 50 ms.
    fn left(path: impl Fn(f64) -> f64) -> PathError {
        let mut error = PathError::default();
        for i in 0..80 {
            let t = f64::from(i) * 0.05;
            error.take(t, path(t));
        }
        error
    }

    #[test]
    fn a_level_and_a_push_leave_nothing_and_a_dead_servo_much() {
        let pushed = |t: f64| 0.1 * t * t + 0.3 * (t - 3.0).max(0.0);
        // The kink lies between two points.
        assert!(left(pushed).error_m().unwrap() < 2e-3);
        let dead = |t: f64| 0.05 * (5.0 * t).sin();
        assert!(left(dead).error_m().unwrap() > 0.01);
    }

    #[test]
    fn what_is_not_known_is_not_told() {
        let mut error = PathError::default();
        for i in 0..30 {
            error.take(f64::from(i) * 0.05, 0.0);
        }
        assert_eq!(error.error_m(), None, "1.5 s");
        let mut error = left(|_| 0.0);
        assert!(error.error_m().is_some());
        error.take(5.0, 0.0);
        assert_eq!(error.error_m(), None, "after a break");
    }

    #[test]
    fn a_line_taken_from_the_twin_changes_nothing() {
        let path = |t: f64| 0.02 * (3.0 * t).sin();
        let (mut moved, still) = (left(path), left(path));
        moved.rebase(4.0, 0.7, 0.2);
        for i in 80..90 {
            let t = f64::from(i) * 0.05;
            moved.take(t, path(t) + 0.7 + 0.2 * (t - 4.0));
        }
        assert!(moved.error_m().unwrap() < 1.5 * still.most_m(), "{moved:?}");
    }
}
