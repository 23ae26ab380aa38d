//! The parameters of a servo by least squares over windows of the ball's path, as a
//! calibration learns them: for the trends of a rig.
//!
//! Within a window the path may differ from the twin's by a straight line, the ball's
//! unknown position and velocity at its start. What remains is the sum of three known
//! paths: that of an offset, t²/2, that of a gain change, the twin's own, and that of a
//! delay, the twin's velocity with the opposite sign. Only the sums of squares and products
//! of a window are kept. Of the recent windows those that fit worst do not count, since
//! they may hold pushes (least trimmed squares); windows that leave the recent ones are
//! added to the sums of the session, or not, by the same rule.

use alloc::collections::VecDeque;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::block::ReadingBlock;
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
const LEAST_BLOCKS: usize = 10;
/// Span of the blocks in each third of a window that counts as motion, m: that of a
/// calibration.
const MOVING_M: f64 = 0.002;
/// Time without a block after which a window starts again, s: three readings of a slow
/// sensor.
const BREAK_S: f64 = 0.6;
/// Number of recent windows: together 38 s of motion, in 5 kB. Chosen.
const MAX_RECENT: usize = 32;
/// Number of windows by which the room for recent ones grows. Chosen.
const GROWTH: usize = 4;
/// Fraction of the recent windows that counts; the others may hold pushes: that of a
/// calibration.
const KEPT: f64 = 0.8;
/// Unexplained part that is tolerated in a window besides the median, as a fraction of its
/// own mean square motion: that of a calibration.
const MOTION_SHARE: f64 = 0.3;
/// Rounds of fitting and trimming: those of a calibration.
const TRIM_ROUNDS: usize = 4;
/// Least number of windows for an estimate: that of a calibration.
const LEAST_WINDOWS: usize = 6;
/// Standard deviations of the parameters before anything is known (m/s², 1, s). Offset and
/// gain are those of a broken servo. The delay is that of a slow one: in slow circles
/// friction looks like a delay of 0.1 to 0.2 s, which then distorts the gain. They hardly
/// count for a parameter that the motion tells.
const UNKNOWN: [f64; PARAMETERS] = [0.3, 0.7, 0.05];

/// Sums over the readings of windows without their straight lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct PathSums {
    /// Of the deviation from the twin's path, squared, m².
    squares_m2: f64,
    /// Of the products of the three paths.
    normal: [[f64; PARAMETERS]; PARAMETERS],
    /// Of the products of the three paths with the deviation.
    right: [f64; PARAMETERS],
    n_windows: u32,
    seconds: f64,
}

impl PathSums {
    fn add(&mut self, other: &Self) {
        self.squares_m2 += other.squares_m2;
        for i in 0..PARAMETERS {
            self.right[i] += other.right[i];
            for j in 0..PARAMETERS {
                self.normal[i][j] += other.normal[i][j];
            }
        }
        self.n_windows += other.n_windows;
        self.seconds += other.seconds;
    }

    /// Sum of squares that `c` leaves unexplained, m².
    fn unexplained_m2(&self, c: &Vector3<f64>) -> f64 {
        let explained = 2.0 * c.dot(&Vector3::from(self.right)) - c.dot(&(self.matrix() * c));
        (self.squares_m2 - explained).max(0.0)
    }

    fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| self.normal[i][j])
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

/// The sums of one window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct PathWindow {
    sums: PathSums,
    /// Mean square of the measured motion, m².
    motion_m2: f64,
    n: u32,
}

impl PathWindow {
    fn of(blocks: &[ReadingBlock]) -> Self {
        let (first, last) = (blocks[0].t, blocks[blocks.len() - 1].t);
        let n = blocks.len() as f64;
        let mean = blocks.iter().map(|b| b.t - first).sum::<f64>() / n;
        let spread: f64 = blocks.iter().map(|b| (b.t - first - mean).powi(2)).sum();
        // Each of the columns without its straight line.
        let bent = |of: &dyn Fn(&ReadingBlock, f64) -> f64| -> Vec<f64> {
            let mut values: Vec<f64> = blocks.iter().map(|b| of(b, b.t - first - mean)).collect();
            let level = values.iter().sum::<f64>() / n;
            let along: f64 =
                blocks.iter().zip(&values).map(|(b, v)| (b.t - first - mean) * (v - level)).sum();
            let slope = along / spread;
            for (b, v) in blocks.iter().zip(&mut values) {
                *v -= level + slope * (b.t - first - mean);
            }
            values
        };
        let paths = [
            bent(&|_, t| t * t / 2.0),
            bent(&|b, _| b.path.position_m),
            bent(&|b, _| -b.path.velocity_m_s),
        ];
        let deviation = bent(&|b, _| b.deviation_m());
        let measured = bent(&|b, _| b.measured_m);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let sums = PathSums {
            squares_m2: dot(&deviation, &deviation),
            normal: core::array::from_fn(|i| core::array::from_fn(|j| dot(&paths[i], &paths[j]))),
            right: core::array::from_fn(|i| dot(&paths[i], &deviation)),
            n_windows: 1,
            seconds: last - first,
        };
        Self { sums, motion_m2: dot(&measured, &measured) / n, n: blocks.len() as u32 }
    }

    fn unexplained_m2(&self, c: &Vector3<f64>) -> f64 {
        self.sums.unexplained_m2(c) / f64::from(self.n)
    }
}

/// The windows of one axis.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct LeastSquares {
    /// The blocks of the next window.
    blocks: Vec<ReadingBlock>,
    recent: VecDeque<PathWindow>,
    /// The windows that have left the recent ones and fit them.
    session: PathSums,
}

impl LeastSquares {
    pub(super) fn take(&mut self, block: &ReadingBlock) {
        if self.blocks.last().is_some_and(|last| block.t - last.t > BREAK_S) {
            self.pause();
        }
        self.blocks.push(*block);
        if self.span_s() >= WINDOW_S && self.blocks.len() >= LEAST_BLOCKS {
            self.close();
        }
    }

    /// The ball cannot respond any more, or the twin is rebased: what came before makes a
    /// shorter window, or none.
    pub(super) fn pause(&mut self) {
        if self.span_s() >= SHORT_WINDOW_S && self.blocks.len() >= LEAST_BLOCKS {
            self.close();
        }
        self.blocks.clear();
    }

    fn span_s(&self) -> f64 {
        let (first, last) = (self.blocks.first(), self.blocks.last());
        first.zip(last).map_or(0.0, |(first, last)| last.t - first.t)
    }

    /// Makes a window of the blocks if the ball moves throughout; drops the first third of
    /// them otherwise.
    fn close(&mut self) {
        let third = self.blocks.len().div_ceil(3);
        if self.blocks.chunks(third).any(|blocks| span_m(blocks) <= MOVING_M) {
            self.blocks.drain(..third);
            return;
        }
        if self.recent.len() == self.recent.capacity() {
            // Each rig has them: they do not double.
            self.recent.reserve_exact(GROWTH);
        }
        self.recent.push_back(PathWindow::of(&self.blocks));
        self.blocks.clear();
        if self.recent.len() > MAX_RECENT {
            let kept = self.kept();
            if let (Some(oldest), Some(true)) = (self.recent.pop_front(), kept.first()) {
                self.session.add(&oldest.sums);
            }
        }
    }

    /// Returns which of the recent windows count. The first round compares with the twin:
    /// a single window in which the controller answers a push weighs more than the others
    /// together, and would fit the parameters to itself.
    fn kept(&self) -> Vec<bool> {
        let n = self.recent.len();
        let n_kept = ((n as f64 * KEPT).ceil() as usize).min(n);
        let mut kept = vec![true; n];
        let mut found = Vector3::zeros();
        for _ in 0..TRIM_ROUNDS {
            let mut left: Vec<f64> = self.recent.iter().map(|w| w.unexplained_m2(&found)).collect();
            let usual = median(&mut left.clone()).unwrap_or(0.0);
            for (left, w) in left.iter_mut().zip(&self.recent) {
                *left /= usual + MOTION_SHARE * w.motion_m2;
            }
            let mut order: Vec<usize> = (0..n).collect();
            order.sort_by(|&a, &b| left[a].total_cmp(&left[b]));
            kept.fill(false);
            order[..n_kept].iter().for_each(|&i| kept[i] = true);
            let Some((next, _)) = self.sums(&kept).solved() else { break };
            found = next;
        }
        kept
    }

    fn sums(&self, kept: &[bool]) -> PathSums {
        let mut sums = PathSums::default();
        let counted = self.recent.iter().zip(kept).filter(|(_, kept)| **kept);
        counted.for_each(|(window, _)| sums.add(&window.sums));
        sums
    }

    /// The parameters over the session; `None` if the ball has moved too little.
    pub(super) fn estimate(&self) -> Option<ServoEstimate> {
        let mut sums = self.sums(&self.kept());
        sums.add(&self.session);
        if self.recent.len() < LEAST_WINDOWS {
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

/// Difference between the largest and the smallest position, m.
fn span_m(blocks: &[ReadingBlock]) -> f64 {
    let positions = blocks.iter().map(|b| b.measured_m);
    let (low, high) = positions.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
    high - low
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

    /// A servo with another offset, gain or delay: the deviation is b t²/2, m times the
    /// twin's path, and the path at t − d less the path at t. The delay is exact in the
    /// first order: 10 ms of sin(2 t) leave (2 · 0.01)²/2 of the path.
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

    /// Of a session of an hour in which the gain changes after half of it, both halves count,
    /// and no more than the recent windows are kept.
    #[test]
    fn a_long_session_counts_as_a_whole_in_bounded_memory() {
        let change = |t: f64| if t < 1800.0 { 0.1 } else { 0.3 };
        let all = follow(3600.0, |t| -change(t) * (2.0 * t).sin() / 4.0 + rough(t));
        let e = all.estimate().unwrap();
        assert!((e.gain - 1.2).abs() < 0.02, "{e:?}");
        assert!(e.seconds > 2000.0, "{e:?}");
        assert!(all.recent.len() <= MAX_RECENT && all.blocks.len() < 100);
    }

    #[test]
    fn a_ball_that_rests_or_a_session_that_has_just_begun_tells_nothing() {
        assert_eq!(follow(6.0, rough).estimate(), None);
        let resting = |t: f64| (2.0 * t).sin() / 4.0 + rough(t);
        assert_eq!(follow(60.0, resting).estimate(), None);
    }
}
