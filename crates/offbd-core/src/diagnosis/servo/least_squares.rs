//! The parameters of a servo by least squares over windows of the ball's path, as a
//! calibration learns them: for the trends of a rig.
//!
//! Within a window the path may differ from the twin's by a straight line, the ball's
//! unknown position and velocity at its start. What remains is the sum of three known
//! paths: that of an offset, t²/2, that of a gain change, the twin's own, and that of a
//! delay, the twin's velocity with the opposite sign. Only sums of squares and products are
//! kept, of the window that goes on, of a few recent ones and of the session. Of the recent
//! windows those that fit worst do not count, since they may hold pushes (least trimmed
//! squares); windows that leave them are added to the session, or not, by the same rule.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::block::{BREAK_S, ReadingBlock};
use super::estimate::ServoEstimate;
use super::filter::PARAMETERS;
use crate::maths::median;
#[cfg(not(feature = "std"))]
use crate::no_std::*;

/// Length of a window, s: the longer one of a calibration.
const WINDOW_S: f64 = 1.2;
/// Least length of a window that ends because the ball cannot respond any more, s: the
/// shorter one of a calibration.
const SHORT_WINDOW_S: f64 = 0.6;
/// Least number of blocks in a window, which is extended if necessary: that of a
/// calibration.
const LEAST_BLOCKS: u32 = 10;
/// Parts of a window that must all have motion: as in a calibration.
const PARTS: usize = 3;
/// Span of the blocks in each part that counts as motion, m: that of a calibration.
const MOVING_M: f64 = 0.002;
/// Number of recent windows, in 0.4 kB. Chosen: an engine has a few hundred bytes for each
/// axis.
const MAX_RECENT: usize = 8;
/// Number of recent windows that count; the others may hold pushes. Chosen: as a
/// calibration keeps 80 %.
const MAX_KEPT: usize = 7;
/// Unexplained part that is tolerated in a window besides the median, as a fraction of its
/// own mean square motion: that of a calibration.
const MOTION_SHARE: f64 = 0.3;
/// Rounds of fitting and trimming: those of a calibration.
const TRIM_ROUNDS: usize = 4;
/// Least number of windows for an estimate: that of a calibration.
const LEAST_WINDOWS: u32 = 6;
/// Standard deviations of the parameters before anything is known (m/s², 1, s). Offset and
/// gain are those of a broken servo. The delay is that of a slow one: in slow circles
/// friction looks like a delay of 0.1 to 0.2 s, which then distorts the gain. They hardly
/// count for a parameter that the motion determines.
const UNKNOWN: [f64; PARAMETERS] = [0.3, 0.7, 0.05];

/// Places of the upper triangle of a symmetric 3 × 3 matrix in its list of six.
const PLACES: [[usize; PARAMETERS]; PARAMETERS] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// Sums over the readings of windows without their straight lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct PathSums {
    /// Of the deviation from the twin's path, squared, m².
    squares_m2: f64,
    /// Of the products of the three paths, by [`PLACES`].
    normal: [f64; 6],
    /// Of the products of the three paths with the deviation.
    right: [f64; PARAMETERS],
    n_windows: u32,
    seconds: f64,
}

impl PathSums {
    fn add(&mut self, window: &PathWindow) {
        self.squares_m2 += f64::from(window.squares_m2);
        for (sum, value) in self.normal.iter_mut().zip(window.normal) {
            *sum += f64::from(value);
        }
        for (sum, value) in self.right.iter_mut().zip(window.right) {
            *sum += f64::from(value);
        }
        self.n_windows += 1;
        self.seconds += f64::from(window.seconds);
    }

    /// Sum of squares that `c` leaves unexplained, m².
    fn unexplained_m2(&self, c: &Vector3<f64>) -> f64 {
        let explained = 2.0 * c.dot(&Vector3::from(self.right)) - c.dot(&(self.matrix() * c));
        (self.squares_m2 - explained).max(0.0)
    }

    fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| self.normal[PLACES[i][j]])
    }

    /// Returns the parameters and their covariance; `None` if nothing is known. The
    /// residual is correlated: each window counts as one reading.
    fn solved(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let free = f64::from(self.n_windows) - PARAMETERS as f64;
        let solve = |variance: f64| {
            let prior = Vector3::from(UNKNOWN.map(|deviation| variance / (deviation * deviation)));
            let inverse = (self.matrix() + Matrix3::from_diagonal(&prior)).try_inverse()?;
            Some((inverse * Vector3::from(self.right), inverse))
        };
        let variance =
            |c: &Vector3<f64>| (self.unexplained_m2(c) / free.max(1.0)).max(f64::MIN_POSITIVE);
        let (first, _) = solve(self.squares_m2 / free.max(1.0))?;
        let variance = variance(&first);
        let (found, inverse) = solve(variance)?;
        Some((found, inverse * variance))
    }
}

/// The sums of one window, as in [`PathSums`]. Single precision rounds them by 6e-8, less
/// than the share that readings to a thousandth of the motion leave unexplained, 1e-6.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct PathWindow {
    squares_m2: f32,
    normal: [f32; 6],
    right: [f32; PARAMETERS],
    /// Mean square of the measured motion, m².
    motion_m2: f32,
    seconds: f32,
    n: u32,
}

impl PathWindow {
    /// Mean square that `c` leaves unexplained, m².
    fn unexplained_m2(&self, c: &Vector3<f64>) -> f64 {
        let mut sums = PathSums::default();
        sums.add(self);
        sums.unexplained_m2(c) / f64::from(self.n)
    }
}

/// Columns of a window: 1, the time, the three paths, the deviation.
const COLUMNS: usize = 6;
const TIME: usize = 1;
const PATHS: usize = 2;
const DEVIATION: usize = 5;

/// The window that goes on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct OpenWindow {
    from_s: f64,
    last_s: f64,
    n: u32,
    /// Sums of the products of the columns; the lower triangle is not used.
    products: [[f64; COLUMNS]; COLUMNS],
    /// Smallest and largest position in each part, m; equal in a part without blocks.
    spans_m: [[f32; 2]; PARTS],
    n_parts: u32,
}

impl OpenWindow {
    fn seconds(&self) -> f64 {
        self.last_s - self.from_s
    }

    fn take(&mut self, block: &ReadingBlock) {
        if self.n == 0 {
            self.from_s = block.t;
        }
        self.last_s = block.t;
        self.n += 1;
        let t = self.seconds();
        let path = &block.path;
        let columns =
            [1.0, t, t * t / 2.0, path.position_m, -path.velocity_m_s, block.deviation_m()];
        for i in 0..COLUMNS {
            for j in i..COLUMNS {
                self.products[i][j] += columns[i] * columns[j];
            }
        }
        let part = ((t / WINDOW_S * PARTS as f64) as usize).min(PARTS - 1);
        let at = block.measured_m as f32;
        let span = &mut self.spans_m[part];
        *span = if part as u32 == self.n_parts {
            self.n_parts += 1;
            [at; 2]
        } else {
            [span[0].min(at), span[1].max(at)]
        };
    }

    /// Whether the ball moves throughout.
    fn moves(&self) -> bool {
        let parts = &self.spans_m[..self.n_parts as usize];
        parts.iter().all(|[low, high]| f64::from(high - low) > MOVING_M)
    }

    /// Sum of the products of two columns without their straight lines.
    fn bent(&self, i: usize, j: usize) -> f64 {
        let product = |i: usize, j: usize| self.products[i.min(j)][i.max(j)];
        let n = f64::from(self.n);
        let about_mean = |i: usize, j: usize| product(i, j) - product(0, i) * product(0, j) / n;
        about_mean(i, j) - about_mean(TIME, i) * about_mean(TIME, j) / about_mean(TIME, TIME)
    }

    fn closed(&self) -> PathWindow {
        let mut normal = [0.0; 6];
        for i in 0..PARAMETERS {
            for j in i..PARAMETERS {
                normal[PLACES[i][j]] = self.bent(PATHS + i, PATHS + j) as f32;
            }
        }
        let position = PATHS + 1;
        let squares_m2 = self.bent(DEVIATION, DEVIATION).max(0.0);
        let motion_m2 =
            self.bent(position, position) + 2.0 * self.bent(position, DEVIATION) + squares_m2;
        PathWindow {
            squares_m2: squares_m2 as f32,
            normal,
            right: core::array::from_fn(|i| self.bent(PATHS + i, DEVIATION) as f32),
            motion_m2: (motion_m2 / f64::from(self.n)) as f32,
            seconds: self.seconds() as f32,
            n: self.n,
        }
    }
}

/// The windows of one axis.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct LeastSquares {
    open: OpenWindow,
    /// The recent windows, as a ring: `n_closed` modulo their number is the oldest once all
    /// are there.
    recent: [PathWindow; MAX_RECENT],
    n_closed: u64,
    /// The windows that have left the recent ones and fit them.
    session: PathSums,
}

impl LeastSquares {
    pub(super) fn take(&mut self, block: &ReadingBlock) {
        if self.open.n > 0 && block.t - self.open.last_s > BREAK_S {
            self.pause();
        }
        self.open.take(block);
        if self.open.seconds() >= WINDOW_S && self.open.n >= LEAST_BLOCKS {
            self.close();
        }
    }

    /// The ball cannot respond any more, or the twin is rebased: what came before makes a
    /// shorter window, or none.
    pub(super) fn pause(&mut self) {
        if self.open.seconds() >= SHORT_WINDOW_S && self.open.n >= LEAST_BLOCKS {
            self.close();
        }
        self.open = OpenWindow::default();
    }

    /// Ends the window, which counts if the ball moves throughout.
    fn close(&mut self) {
        let closed = core::mem::take(&mut self.open);
        if !closed.moves() {
            return;
        }
        let oldest = (self.n_closed % MAX_RECENT as u64) as usize;
        if self.n_closed >= MAX_RECENT as u64 && self.kept()[oldest] {
            self.session.add(&self.recent[oldest]);
        }
        self.recent[oldest] = closed.closed();
        self.n_closed += 1;
    }

    fn n_recent(&self) -> usize {
        self.n_closed.min(MAX_RECENT as u64) as usize
    }

    /// Returns which of the recent windows count. The first round compares with the twin:
    /// a single window in which the controller answers a push weighs more than the others
    /// together, and would fit the parameters to itself.
    fn kept(&self) -> [bool; MAX_RECENT] {
        let n = self.n_recent();
        let n_kept = (n * MAX_KEPT).div_ceil(MAX_RECENT);
        let mut kept = core::array::from_fn(|i| i < n);
        let mut found = Vector3::zeros();
        for _ in 0..TRIM_ROUNDS {
            let mut left = self.recent.map(|window| window.unexplained_m2(&found));
            let mut sorted = left;
            let usual = median(&mut sorted[..n]).unwrap_or(0.0);
            for (left, window) in left.iter_mut().zip(&self.recent) {
                *left /= usual + MOTION_SHARE * f64::from(window.motion_m2);
            }
            let mut order: [usize; MAX_RECENT] = core::array::from_fn(|i| i);
            order[..n].sort_unstable_by(|&a, &b| left[a].total_cmp(&left[b]));
            kept = [false; MAX_RECENT];
            order[..n_kept].iter().for_each(|&i| kept[i] = true);
            let mut sums = PathSums::default();
            self.add_kept(&kept, &mut sums);
            let Some((next, _)) = sums.solved() else { break };
            found = next;
        }
        kept
    }

    fn add_kept(&self, kept: &[bool; MAX_RECENT], sums: &mut PathSums) {
        let counted = self.recent.iter().zip(kept).filter(|(_, kept)| **kept);
        counted.for_each(|(window, _)| sums.add(window));
    }

    /// The parameters over the session; `None` if the ball has moved too little.
    pub(super) fn estimate(&self) -> Option<ServoEstimate> {
        let mut sums = self.session;
        self.add_kept(&self.kept(), &mut sums);
        if sums.n_windows < LEAST_WINDOWS {
            return None;
        }
        let (found, covariance) = sums.solved()?;
        let error = |k: usize| covariance[(k, k)].sqrt();
        Some(ServoEstimate {
            offset_m_s2: found[0],
            offset_error_m_s2: error(0),
            gain: 1.0 + found[1],
            gain_error: error(1),
            delay_s: found[2],
            delay_error_s: error(2),
            seconds: sums.seconds,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::TwinPath;
    use super::*;

    const DT_S: f64 = 0.05;

    /// Follows `seconds` of a ball that deviates by `off` m from a twin that accelerates by
    /// sin(2 t) m/s².
    fn follow(seconds: f64, off: impl Fn(f64) -> f64) -> LeastSquares {
        let mut found = LeastSquares::default();
        for i in 0..(seconds / DT_S) as u32 {
            let t = f64::from(i) * DT_S;
            let path = TwinPath {
                position_m: -(2.0 * t).sin() / 4.0,
                velocity_m_s: -(2.0 * t).cos() / 2.0,
                acceleration_m_s2: (2.0 * t).sin(),
            };
            let measured_m = path.position_m + off(t);
            found.take(&ReadingBlock { t, measured_m, path, n: 1 });
        }
        found
    }

    /// Roughness of the readings, m, so that the errors are not zero.
    fn rough(t: f64) -> f64 {
        1e-4 * (37.0 * t).sin()
    }

    /// The deviation of a servo with the wrong offset b is b t²/2; with the wrong gain m, m times
    /// the twin's path; with the delay d, the path at t − d minus the path at t. The estimate of a
    /// delay is exact to first order: for sin(2 t), 10 ms leave (2 · 0.01)²/2 of the path.
    #[test]
    fn validate_parameters_against_closed_forms() {
        let late = |t: f64| ((2.0 * t).sin() - (2.0 * (t - 0.01)).sin()) / 4.0;
        type Deviation<'a> = &'a dyn Fn(f64) -> f64;
        let cases: [(Deviation<'_>, [f64; 3]); 3] = [
            (&|t| 0.05 * t * t + 0.3 * t, [0.1, 1.0, 0.0]),
            (&|t| (2.0 * t).sin() / 8.0 - 1.0, [0.0, 0.5, 0.0]),
            (&late, [0.0, 1.0, 0.01]),
        ];
        for (off, wanted) in cases {
            let e = follow(30.0, |t| off(t) + rough(t)).estimate().unwrap();
            for (found, wanted) in [e.offset_m_s2, e.gain, e.delay_s].into_iter().zip(wanted) {
                assert!((found - wanted).abs() < 1e-3, "{e:?}, not {wanted}");
            }
            assert!(e.gain_error < 0.01 && e.gain_error > 0.0, "{e:?}");
        }
    }

    /// One window in nine with a push: it is left out, and the gain of the others remains.
    #[test]
    fn a_push_now_and_then_changes_nothing() {
        let pushed = |t: f64| 0.4 * (t.rem_euclid(10.8) - 5.0).max(0.0);
        let off = |t: f64| (2.0 * t).sin() / 8.0 + rough(t);
        let e = follow(36.0, |t| off(t) + pushed(t)).estimate().unwrap();
        assert!((e.gain - 0.5).abs() < 0.01, "{e:?}");
    }

    /// Of a session of an hour in which the gain changes after half of it, both halves count.
    #[test]
    fn a_long_session_counts_as_a_whole() {
        let change = |t: f64| if t < 1800.0 { 0.1 } else { 0.3 };
        let all = follow(3600.0, |t| -change(t) * (2.0 * t).sin() / 4.0 + rough(t));
        let e = all.estimate().unwrap();
        assert!((e.gain - 1.2).abs() < 0.02, "{e:?}");
        assert!(e.seconds > 2000.0, "{e:?}");
    }

    #[test]
    fn a_ball_that_rests_or_a_session_that_has_just_begun_tells_nothing() {
        assert_eq!(follow(6.0, rough).estimate(), None);
        let resting = |t: f64| (2.0 * t).sin() / 4.0 + rough(t);
        assert_eq!(follow(60.0, resting).estimate(), None);
    }
}
