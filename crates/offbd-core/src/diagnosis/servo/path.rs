//! Evidence against one servo from the path of the last two seconds, whatever the scale of
//! the twin's error.
//!
//! How well the twin fits differs from session to session. The scale s of the misfit is
//! therefore a nuisance here, which is integrated out. Within a window of n points, the
//! deviation y from the twin's path is
//!
//! ```text
//! y(τ) = y₀ + ẏ₀ τ + b τ²/2 + m·z(τ) − d·(v(τ) − v(0)) [+ u·max(τ − τₖ, 0)] + s e(τ),
//! ```
//!
//! where z is the twin's path without its first straight line, v the twin's velocity, b the
//! servo's offset, m its gain change, d its delay, u one push at a price, and e the noise of
//! the readings plus the double integral of white noise: the acceleration that no parameter
//! explains. If the servo is healthy, b, m and d are close to those of the rig's other
//! sessions; if it is broken, they may be anything. With a priori ν degrees of freedom for
//! 1/s², the marginal likelihood of a window is a multivariate Student t (Zellner 1971, 3.2;
//! Lange, Little & Taylor 1989):
//!
//! ```text
//! ln p = −(ν + n)/2 · ln(1 + r²/ν) − ½ ln det C,
//! ```
//!
//! where C is the covariance of y for s = 1, and r² = (y − μ)ᵀ C⁻¹ (y − μ). The evidence is
//! the difference between the two hypotheses. It adds up over windows that do not overlap
//! and never falls below zero: Page's CUSUM. A window that fits badly, for whatever reason,
//! is weak evidence for anything.

use alloc::collections::VecDeque;
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

use super::MAX_NATS;
use super::block::{BREAK_S, ReadingBlock};
use super::filter::{PARAMETERS, PUSH_DEVIATION_M_S, ParameterPrior};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::CLOCK_RESOLUTION_S;

/// Length of a window, s: several times the delay of a servo. Chosen.
const WINDOW_S: f64 = 2.0;
/// Length from which on a window that has just begun is judged, s. Chosen: half of it.
const LEAST_S: f64 = 1.0;
/// Least time that a point covers, s; blocks of readings within are averaged. Chosen: a
/// twentieth of a window.
const POINT_S: f64 = WINDOW_S / 20.0;
/// Least number of points. Chosen: three more than the curve has parameters.
const LEAST_POINTS: usize = 8;
/// Least time between two judgements, s. Chosen: a tenth of a window, since windows that
/// overlap hardly differ.
const JUDGED_S: f64 = WINDOW_S / 10.0;

/// Degrees of freedom of the scale. Chosen on simulated rigs whose misfit changes from
/// session to session by up to a factor of five: an earlier form found 207 of 448 faults of
/// servos at 8 false alarms with a known scale, and with 12 and 3 degrees of freedom 210 and
/// 224, at 3 false alarms each.
const FREEDOM: f64 = 4.0;
/// Room for the points and the judgements of a window, so that doubling does not take more: the one
/// that makes it too long, and a few for clocks that vary.
const POINTS_ROOM: usize = 23;
const JUDGED_ROOM: usize = 12;
/// Price of a push, nats: less than one in twenty windows has one.
const PUSH_NATS: f64 = 3.0;
/// The times of a push that are tried, as fractions of a window. Chosen.
const PUSHED_AT: [f64; 2] = [0.3, 0.65];
/// Standard deviations of the deviation (m) and its rate (m/s) at the start of a window:
/// practically free.
const FREE: [f64; 2] = [1.0, 10.0];
/// Columns of a window: 1, the time, the paths of the three parameters, the deviation, and
/// a push at each of its times.
const COLUMNS: usize = DEVIATION + 1 + PUSHED_AT.len();
const DEVIATION: usize = 2 + PARAMETERS;
/// Unknowns of a hypothesis: straight line, parameters, push.
const UNKNOWNS: usize = DEVIATION + 1;

/// What a hypothesis says of the parameters: offset (m/s²), gain change (1), delay (s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Expected {
    pub(super) mean: [f64; PARAMETERS],
    pub(super) deviation: [f64; PARAMETERS],
}

/// A broken servo: slipped by a few degrees, dead, reversed or anything between, slow.
const BROKEN: Expected = Expected { mean: [0.0, -0.6, 0.0], deviation: [0.35, 0.9, 0.2] };

/// Sums over blocks.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct BlockSums {
    n: u32,
    /// Times from the first block on.
    t: f64,
    deviation_m: f64,
    position_m: f64,
    velocity_m_s: f64,
    variance_m2: f64,
    density: f64,
}

/// Means over the blocks of a point. Single precision is finer than any reading, and every engine
/// holds two windows of them.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct DeviationPoint {
    t: f64,
    deviation_m: f32,
    position_m: f32,
    velocity_m_s: f32,
    variance_m2: f32,
    /// Spectral density of the acceleration that no parameter explains, m²/s³.
    density: f32,
}

/// The recent path along one axis relative to the twin's.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct PathEvidence {
    points: VecDeque<DeviationPoint>,
    /// The blocks since the last point, the first of them at `since_s`.
    gathered: BlockSums,
    since_s: f64,
    /// Time of the last block, s.
    last_s: Option<f64>,
    /// Times and evidence of the judgements of one window length.
    judged: VecDeque<(f64, f64)>,
    /// Evidence of the windows before, nats, in [0, [`MAX_NATS`]].
    before_nats: f64,
    nats: Option<f64>,
    most_nats: f64,
}

impl PathEvidence {
    /// Takes a block whose mean has a variance, m², after a time with a spectral density of
    /// unexplained acceleration, m²/s³. `healthy` is the prior of a healthy servo's parameters.
    pub(super) fn take(
        &mut self,
        block: &ReadingBlock,
        variance_m2: f64,
        density: f64,
        healthy: &ParameterPrior,
    ) {
        let t = block.t;
        if self.points.back().is_some_and(|last| t - last.t > BREAK_S) {
            self.clear();
        }
        let block_s = self.last_s.replace(t).map_or(0.0, |last| t - last);
        let sum = &mut self.gathered;
        self.since_s = if sum.n == 0 { t } else { self.since_s };
        sum.n += 1;
        sum.t += t - self.since_s;
        sum.deviation_m += block.deviation_m();
        sum.position_m += block.path.position_m;
        sum.velocity_m_s += block.path.velocity_m_s;
        sum.variance_m2 += variance_m2;
        sum.density += density;
        // Time stamps in milliseconds must not make a point one block longer.
        if t - self.since_s + block_s >= POINT_S - CLOCK_RESOLUTION_S {
            self.close(&Expected { mean: [0.0; PARAMETERS], deviation: healthy.deviation });
        }
    }

    /// Makes a point of the blocks since the last one.
    fn close(&mut self, expected: &Expected) {
        let sum = core::mem::take(&mut self.gathered);
        let n = f64::from(sum.n);
        let t = self.since_s + sum.t / n;
        if self.points.is_empty() {
            self.points.reserve_exact(POINTS_ROOM);
        }
        self.points.push_back(DeviationPoint {
            t,
            deviation_m: (sum.deviation_m / n) as f32,
            position_m: (sum.position_m / n) as f32,
            velocity_m_s: (sum.velocity_m_s / n) as f32,
            variance_m2: (sum.variance_m2 / (n * n)) as f32,
            density: (sum.density / n) as f32,
        });
        while self.points[0].t < t - WINDOW_S {
            self.points.pop_front();
        }
        let from_s = self.points[0].t;
        let due = self.judged.back().is_none_or(|&(at, _)| t - at >= JUDGED_S - CLOCK_RESOLUTION_S);
        if !due || t - from_s < LEAST_S || self.points.len() < LEAST_POINTS {
            return;
        }
        let Some(nats) = evidence(self.points.make_contiguous(), expected) else { return };
        while let Some(&(_, nats)) = self.judged.front().filter(|(at, _)| *at <= from_s) {
            self.before_nats = nats.max(0.0);
            self.judged.pop_front();
        }
        let sum = (self.before_nats + nats).min(MAX_NATS);
        if self.judged.is_empty() {
            self.judged.reserve_exact(JUDGED_ROOM);
        }
        self.judged.push_back((t, sum));
        self.nats = Some(sum);
        self.most_nats = self.most_nats.max(sum);
    }

    /// Pauses while the ball cannot respond; it may continue after a moment.
    pub(super) fn pause(&mut self) {
        self.gathered = BlockSums::default();
        (self.last_s, self.nats) = (None, None);
    }

    /// Restarts the path; the evidence is kept.
    pub(super) fn clear(&mut self) {
        self.pause();
        self.points.clear();
        if let Some((_, nats)) = self.judged.pop_back() {
            self.before_nats = nats.max(0.0);
        }
        self.judged.clear();
    }

    /// Restarts the path without evidence: another cause explains it.
    pub(super) fn exonerate(&mut self) {
        self.clear();
        self.before_nats = 0.0;
    }

    /// Follows a rebase of the twin by the line through `position` m at `t` with slope
    /// `velocity` m/s: the deviation grows by that line.
    pub(super) fn rebase(&mut self, t: f64, position: f64, velocity: f64) {
        let line = |at: f64| position + velocity * (at - t);
        for point in &mut self.points {
            let line_m = line(point.t) as f32;
            point.deviation_m += line_m;
            point.position_m -= line_m;
            point.velocity_m_s -= velocity as f32;
        }
        let sum = &mut self.gathered;
        let n = f64::from(sum.n);
        let lines_m = n * line(self.since_s) + velocity * sum.t;
        sum.deviation_m += lines_m;
        sum.position_m -= lines_m;
        sum.velocity_m_s -= n * velocity;
    }

    /// The current evidence, nats, negative if the path speaks for a healthy servo; `None`
    /// if unknown.
    pub(super) const fn nats(&self) -> Option<f64> {
        self.nats
    }

    /// The largest evidence so far, nats.
    pub(super) const fn most_nats(&self) -> f64 {
        self.most_nats
    }
}

/// The products of the columns of a window, whitened: divided by the square root of the
/// covariance of e.
struct Products([[f64; COLUMNS]; COLUMNS]);

impl Products {
    /// Whitens by the Kalman filter of e, whose innovations are independent.
    fn of(points: &[DeviationPoint]) -> Self {
        let (first, last) = (points[0], points[points.len() - 1]);
        let mut products = [[0.0; COLUMNS]; COLUMNS];
        let (mut at, mut rate) = ([0.0; COLUMNS], [0.0; COLUMNS]);
        let (mut p, mut previous) = ([0.0; 3], first.t);
        for point in points {
            let tau = point.t - first.t;
            let since_first =
                |of: fn(&DeviationPoint) -> f32| f64::from(of(point)) - f64::from(of(&first));
            let mut innovation = [0.0; COLUMNS];
            innovation[..=DEVIATION].copy_from_slice(&[
                1.0,
                tau,
                tau * tau / 2.0,
                since_first(|point| point.position_m) - f64::from(first.velocity_m_s) * tau,
                -since_first(|point| point.velocity_m_s),
                since_first(|point| point.deviation_m),
            ]);
            for (column, share) in innovation[DEVIATION + 1..].iter_mut().zip(PUSHED_AT) {
                *column = (tau - share * (last.t - first.t)).max(0.0);
            }
            let dt = point.t - core::mem::replace(&mut previous, point.t);
            let q = f64::from(point.density) * dt;
            p[0] += dt * (2.0 * p[1] + dt * p[2]) + q * dt * dt / 3.0;
            p[1] += dt * p[2] + q * dt / 2.0;
            p[2] += q;
            let variance = p[0] + f64::from(point.variance_m2);
            let (gain, pull) = (p[0] / variance, p[1] / variance);
            p = [p[0] - gain * p[0], p[1] - gain * p[1], p[2] - pull * p[1]];
            for k in 0..COLUMNS {
                let predicted = at[k] + dt * rate[k];
                innovation[k] -= predicted;
                at[k] = predicted + gain * innovation[k];
                rate[k] += pull * innovation[k];
            }
            for i in 0..COLUMNS {
                let weighted = innovation[i] / variance;
                for j in i..COLUMNS {
                    products[i][j] += weighted * innovation[j];
                }
            }
        }
        Self(products)
    }

    fn get(&self, i: usize, j: usize) -> f64 {
        self.0[i.min(j)][i.max(j)]
    }

    /// Logarithm of the marginal likelihood, nats, up to a constant, if the parameters are
    /// as `expected`, with the push number `push` or none. `None` if it cannot be computed.
    fn log_likelihood(&self, n: usize, expected: &Expected, push: Option<usize>) -> Option<f64> {
        let column = |i: usize| match i {
            DEVIATION => DEVIATION + 1 + push.unwrap_or(0),
            i => i,
        };
        let deviation = |i: usize| match i {
            0 | 1 => FREE[i],
            DEVIATION if push.is_some() => PUSH_DEVIATION_M_S,
            DEVIATION => 0.0,
            i => expected.deviation[i - 2],
        };
        // Of the deviation without the mean of the parameters.
        let off_mean = |i: usize| {
            let means = expected.mean.iter().enumerate();
            self.get(i, DEVIATION) - means.map(|(k, mean)| mean * self.get(i, 2 + k)).sum::<f64>()
        };
        let means = expected.mean.iter().enumerate();
        let squares =
            off_mean(DEVIATION) - means.map(|(k, mean)| mean * off_mean(2 + k)).sum::<f64>();
        // In units of their standard deviations, the covariance of the unknowns is 1.
        let scaled = |i: usize, j: usize| {
            deviation(i) * deviation(j) * self.get(column(i), column(j))
                + f64::from(u8::from(i == j))
        };
        let right = SVector::<f64, UNKNOWNS>::from_fn(|i, _| deviation(i) * off_mean(column(i)));
        let factor = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::from_fn(scaled).cholesky()?;
        let explained = right.dot(&factor.solve(&right));
        let half_log_det: f64 = (0..UNKNOWNS).map(|i| factor.l_dirty()[(i, i)].ln()).sum();
        let misfit = ((squares - explained).max(0.0) / FREEDOM).ln_1p();
        let price = push.map_or(0.0, |_| PUSH_NATS);
        Some(-(FREEDOM + n as f64) / 2.0 * misfit - half_log_det - price)
    }
}

/// Evidence of a window for a broken servo, nats, against one with parameters as
/// `expected`.
fn evidence(points: &[DeviationPoint], expected: &Expected) -> Option<f64> {
    let products = Products::of(points);
    let best = |of: &Expected| {
        let pushes = [None, Some(0), Some(1)];
        let each = pushes.map(|push| products.log_likelihood(points.len(), of, push));
        each.into_iter().flatten().reduce(f64::max)
    };
    Some(best(&BROKEN)? - best(expected)?).filter(|nats| nats.is_finite())
}

#[cfg(test)]
mod tests {
    use super::super::block::TwinPath;
    use super::*;
    use nalgebra::{DMatrix, DVector};

    const HEALTHY: Expected = Expected { mean: [0.0; 3], deviation: [0.03, 0.08, 0.02] };
    const PRIOR: ParameterPrior =
        ParameterPrior { deviation: HEALTHY.deviation, memory_s: [1e9; PARAMETERS] };
    const VARIANCE_M2: f64 = 1e-6;
    const DENSITY: f64 = 1e-4;

    fn twin(t: f64) -> TwinPath {
        let (sin, cos) = (3.0 * t).sin_cos();
        TwinPath {
            position_m: -0.05 * sin,
            velocity_m_s: -0.15 * cos,
            acceleration_m_s2: 0.45 * sin,
        }
    }

    /// Roughness of the readings, m.
    fn rough(t: f64) -> f64 {
        1e-3 * (37.0 * t).sin()
    }

    /// Follows `seconds` of a ball that deviates by `off` m from the twin.
    fn follow(path: &mut PathEvidence, from_s: f64, seconds: f64, off: impl Fn(f64) -> f64) {
        for i in 0..(seconds / 0.05) as u32 {
            let t = from_s + f64::from(i) * 0.05;
            let path_m = twin(t);
            let measured_m = path_m.position_m + off(t);
            let block = ReadingBlock { t, measured_m, path: path_m, n: 5 };
            path.take(&block, VARIANCE_M2, DENSITY, &PRIOR);
        }
    }

    fn nats(seconds: f64, off: impl Fn(f64) -> f64) -> f64 {
        let mut path = PathEvidence::default();
        follow(&mut path, 50.0, seconds, off);
        path.nats().unwrap()
    }

    fn points() -> Vec<DeviationPoint> {
        let point = |i: u32| {
            let t = 7.0 + f64::from(i) * 0.1;
            let TwinPath { position_m, velocity_m_s, .. } = twin(t);
            DeviationPoint {
                t,
                deviation_m: (rough(t) + 0.02 * (t - 7.0).powi(2)) as f32,
                position_m: position_m as f32,
                velocity_m_s: velocity_m_s as f32,
                variance_m2: (VARIANCE_M2 * (1.0 + f64::from(i % 3))) as f32,
                density: DENSITY as f32,
            }
        };
        (0..21).map(point).collect()
    }

    /// Against the formula with the whole covariance matrix: that of the double integral of
    /// white noise is q (s² t/2 − s³/6) for s ≤ t.
    #[test]
    fn the_likelihood_is_that_of_the_covariance_matrix() {
        let points = points();
        let n = points.len();
        let tau = |i: usize| points[i].t - points[0].t;
        let since_first = |i: usize, of: fn(&DeviationPoint) -> f32| {
            f64::from(of(&points[i])) - f64::from(of(&points[0]))
        };
        let covariance = DMatrix::from_fn(n, n, |i, j| {
            let (s, t) = (tau(i.min(j)), tau(i.max(j)));
            let noise = if i == j { f64::from(points[i].variance_m2) } else { 0.0 };
            noise + f64::from(points[i].density) * (s * s * t / 2.0 - s * s * s / 6.0)
        });
        let length_s = tau(n - 1);
        let dense = |expected: &Expected, push: Option<usize>| {
            let at = push.map_or(0.0, |k| PUSHED_AT[k] * length_s);
            let columns = DMatrix::from_fn(n, 6, |i, j| match j {
                0 => 1.0,
                1 => tau(i),
                2 => tau(i) * tau(i) / 2.0,
                3 => {
                    let start_m_s = f64::from(points[0].velocity_m_s);
                    since_first(i, |point| point.position_m) - start_m_s * tau(i)
                }
                4 => -since_first(i, |point| point.velocity_m_s),
                _ => (tau(i) - at).max(0.0),
            });
            let [b, m, d] = expected.deviation;
            let push_m_s = if push.is_some() { PUSH_DEVIATION_M_S } else { 0.0 };
            let deviations = DVector::from_row_slice(&[FREE[0], FREE[1], b, m, d, push_m_s]);
            let prior = DMatrix::from_diagonal(&deviations.map(|d| d * d));
            let [b, m, d] = expected.mean;
            let mean = DVector::from_row_slice(&[0.0, 0.0, b, m, d, 0.0]);
            let y = DVector::from_fn(n, |i, _| since_first(i, |point| point.deviation_m));
            let off = y - &columns * mean;
            let whole = &covariance + &columns * prior * columns.transpose();
            let r2 = off.dot(&(whole.clone().try_inverse().unwrap() * &off));
            let half_log_det = 0.5 * (whole.determinant() / covariance.determinant()).ln();
            let price = push.map_or(0.0, |_| PUSH_NATS);
            -(FREEDOM + n as f64) / 2.0 * (r2 / FREEDOM).ln_1p() - half_log_det - price
        };
        let products = Products::of(&points);
        for expected in [&HEALTHY, &BROKEN] {
            for push in [None, Some(0), Some(1)] {
                let found = products.log_likelihood(n, expected, push).unwrap();
                let wanted = dense(expected, push);
                assert!((found - wanted).abs() < 1e-6, "{push:?}: {found}, not {wanted}");
            }
        }
    }

    #[test]
    fn a_broken_servo_is_evidence_and_a_healthy_one_is_not() {
        let position = |t: f64| twin(t).position_m;
        assert!(nats(4.0, |t| rough(t) - position(t)) > 5.0, "dead");
        assert!(nats(4.0, |t| rough(t) - 2.0 * position(t)) > 5.0, "reversed");
        assert!(nats(4.0, |t| rough(t) + 0.15 * (t - 50.0).powi(2)) > 5.0, "slipped");
        assert!(nats(4.0, rough) < 0.0, "healthy");
        let pushed = |t: f64| rough(t) + 0.3 * (t - 53.0).max(0.0);
        assert!(nats(4.0, pushed) < 3.0, "pushed");
    }

    /// A misfit of no servo, ten times larger than the noise: with a known scale, it would
    /// be evidence of hundreds of nats.
    #[test]
    fn what_fits_nothing_is_hardly_evidence() {
        let off = |t: f64| 10.0 * rough(t) + 5e-3 * (11.0 * t).sin();
        assert!(nats(4.0, off) < 3.0, "{}", nats(4.0, off));
    }

    /// Windows that are each too weak accumulate, and a servo that has recovered is acquitted.
    #[test]
    fn weak_evidence_adds_up_and_fades() {
        let half = |t: f64| rough(t) - 0.35 * twin(t).position_m;
        let mut path = PathEvidence::default();
        follow(&mut path, 50.0, 4.0, half);
        let first = path.nats().unwrap();
        follow(&mut path, 54.0, 16.0, half);
        let then = path.nats().unwrap();
        assert!(then > first + 3.0, "{first}, then {then}");
        path.clear();
        follow(&mut path, 80.0, 2.0, half);
        assert!(path.nats().unwrap() > then - 3.0, "kept over a gap");
        follow(&mut path, 82.0, 60.0, rough);
        assert!(path.nats().unwrap() < 0.0, "{:?}", path.nats());
    }

    #[test]
    fn what_is_not_known_is_not_told() {
        let mut path = PathEvidence::default();
        follow(&mut path, 50.0, 0.9, rough);
        assert_eq!(path.nats(), None, "0.9 s");
        follow(&mut path, 50.9, 2.0, rough);
        assert!(path.nats().is_some());
        follow(&mut path, 54.0, 0.5, rough);
        assert_eq!(path.nats(), None, "after a break");
    }

    #[test]
    fn a_line_taken_from_the_twin_changes_nothing() {
        let off = |t: f64| rough(t) - 0.5 * twin(t).position_m;
        let mut still = PathEvidence::default();
        follow(&mut still, 50.0, 3.0, off);
        let mut moved = still.clone();
        moved.rebase(53.0, 0.7, 0.2);
        follow(&mut still, 53.0, 1.0, off);
        for i in 0..20 {
            let t = 53.0 + f64::from(i) * 0.05;
            let mut path_m = twin(t);
            let measured_m = path_m.position_m + off(t);
            path_m.position_m -= 0.7 + 0.2 * (t - 53.0);
            path_m.velocity_m_s -= 0.2;
            let block = ReadingBlock { t, measured_m, path: path_m, n: 5 };
            moved.take(&block, VARIANCE_M2, DENSITY, &PRIOR);
        }
        let (still, moved) = (still.nats().unwrap(), moved.nats().unwrap());
        assert!((still - moved).abs() < 1e-2, "{still}, {moved}");
    }
}
