//! Gain, level, dead time and lag of one axis: least trimmed squares over
//! windows, inside a search.

use nalgebra::{Matrix3, Vector3};

use super::recording::{Recording, Stretch};
use crate::diagnosis::Profile;
use crate::engine::Rig;
use crate::engine::frame::Moment;
use crate::plant::{ServoModel, TwinAxis, TwinModel};
use crate::vocabulary::Axis;

/// Windows that are kept, of all: the rest may hold pushes.
const KEPT: f64 = 0.8;

/// One window with its straight line taken away: measured path, twin's path,
/// the parabola t²/2 and what rolling resistance of 1 m/s² would add, all
/// orthogonal to 1 and t.
struct Window {
    yy: f64,
    normal: Matrix3<f64>,
    right: Vector3<f64>,
    n: usize,
}

impl Window {
    fn new(moments: &[Moment], path: &[f64], resisted: &[f64], axis: Axis) -> Self {
        let t0 = moments[0].at;
        let times: Vec<f64> = moments.iter().map(|m| m.at - t0).collect();
        let straighten = |values: Vec<f64>| without_line(&times, values);
        let y = straighten(moments.iter().map(|m| m.position[axis].unwrap_or(0.0)).collect());
        let z = straighten(path.to_vec());
        let p = straighten(times.iter().map(|t| t * t / 2.0).collect());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let r = straighten(resisted.to_vec());
        let causes = [&z, &p, &r];
        Self {
            yy: dot(&y, &y),
            normal: Matrix3::from_fn(|i, j| dot(causes[i], causes[j])),
            right: Vector3::from_fn(|i, _| dot(causes[i], &y)),
            n: moments.len(),
        }
    }

    /// Mean square of what gain and level leave unexplained, m².
    fn unexplained(&self, c: &Vector3<f64>) -> f64 {
        let squares = self.yy - 2.0 * c.dot(&self.right) + c.dot(&(self.normal * c));
        squares.max(0.0) / self.n as f64
    }
}

/// `values` less their least-squares straight line over `times`.
pub(super) fn without_line(times: &[f64], mut values: Vec<f64>) -> Vec<f64> {
    let n = times.len() as f64;
    let (mean_t, mean_v) = (times.iter().sum::<f64>() / n, values.iter().sum::<f64>() / n);
    let (mut tt, mut tv) = (0.0, 0.0);
    for (t, v) in times.iter().zip(&values) {
        tt += (t - mean_t) * (t - mean_t);
        tv += (t - mean_t) * (v - mean_v);
    }
    let slope = if tt > 0.0 { tv / tt } else { 0.0 };
    for (t, v) in times.iter().zip(values.iter_mut()) {
        *v -= mean_v + slope * (t - mean_t);
    }
    values
}

/// Gain, level (as an acceleration) and rolling resistance that explain the windows best.
#[derive(Clone, Copy, Debug)]
pub(super) struct Explained {
    pub(super) gain: f64,
    pub(super) offset_m_s2: f64,
    pub(super) resistance_m_s2: f64,
    /// Mean square left over in the kept windows, m².
    pub(super) left: f64,
    /// Share of the variance explained.
    pub(super) share: f64,
    /// Standard error of the gain.
    pub(super) gain_error: f64,
}

/// How much an unlikely gain costs: a gain off by a factor of e weighs like
/// half as much again left over. It only decides where the data hardly do;
/// gains from 0.5 to 2 have been seen on real rigs.
const GAIN_PRIOR: f64 = 0.5;

impl Explained {
    fn cost(&self) -> f64 {
        let unlikely = self.gain.abs().ln();
        self.left * (1.0 + GAIN_PRIOR * unlikely * unlikely)
    }
}

/// Least trimmed squares over windows: fit, drop the worst, fit again.
fn explain(windows: &mut [Window]) -> Option<Explained> {
    let keep = ((windows.len() as f64 * KEPT).ceil() as usize).min(windows.len());
    let mut kept = windows.len();
    let mut c = Vector3::zeros();
    for _ in 0..4 {
        let sums = |(n, r): (Matrix3<f64>, Vector3<f64>), w: &Window| (n + w.normal, r + w.right);
        let (normal, right) = windows[..kept].iter().fold(Default::default(), sums);
        c = solve(normal, right)?;
        windows.sort_by(|a, b| a.unexplained(&c).total_cmp(&b.unexplained(&c)));
        kept = keep;
    }
    let kept = &windows[..kept];
    let n: usize = kept.iter().map(|w| w.n).sum();
    let left = kept.iter().map(|w| w.unexplained(&c) * w.n as f64).sum::<f64>() / n as f64;
    let total = kept.iter().map(|w| w.yy).sum::<f64>() / n as f64;
    let normal = kept.iter().fold(Matrix3::zeros(), |sum, w| sum + w.normal);
    let normal = if c.z > 0.0 { normal } else { without_resistance(normal) };
    // What is left over is coloured: it counts as one reading a window, not n.
    let gain_error = (left * n as f64 / kept.len() as f64 * normal.try_inverse()?[(0, 0)]).sqrt();
    Some(Explained {
        gain: c.x,
        offset_m_s2: c.y,
        resistance_m_s2: c.z,
        left,
        share: 1.0 - left / total,
        gain_error,
    })
}

/// The least squares; a resistance that would drive the ball is none.
fn solve(normal: Matrix3<f64>, right: Vector3<f64>) -> Option<Vector3<f64>> {
    let c = normal.try_inverse()? * right;
    if c.z > 0.0 {
        return Some(c);
    }
    let right = Vector3::new(right.x, right.y, 0.0);
    Some(without_resistance(normal).try_inverse()? * right)
}

fn without_resistance(mut normal: Matrix3<f64>) -> Matrix3<f64> {
    for k in 0..2 {
        (normal[(2, k)], normal[(k, 2)]) = (0.0, 0.0);
    }
    normal[(2, 2)] = 1.0;
    normal
}

/// Step of dead time and lag at which the search ends, s.
const FINEST_STEP_S: f64 = 0.001;
/// Where the search looks next: dead time and lag trade off against each
/// other along a narrow valley, so it also looks across both.
const DIRECTIONS: [(f64, f64); 10] = [
    (1.0, 0.0),
    (-1.0, 0.0),
    (0.0, 1.0),
    (0.0, -1.0),
    (1.0, -1.0),
    (-1.0, 1.0),
    (2.0, -1.0),
    (-2.0, 1.0),
    (1.0, -2.0),
    (-1.0, 2.0),
];

/// The recordings of one axis, ready to be fitted.
pub(super) struct Fitter<'a> {
    pub(super) rig: &'a Rig,
    pub(super) recordings: &'a [Recording],
    pub(super) stretches: Vec<Vec<Stretch>>,
    pub(super) axis: Axis,
}

impl Fitter<'_> {
    /// Windows in which the ball moves.
    pub(super) fn n_windows(&self) -> usize {
        self.stretches.iter().map(Vec::len).sum()
    }

    pub(super) fn model(
        &self,
        dead_time_s: f64,
        lag_s: f64,
        gain: f64,
        level_rad: f64,
        resistance_m_s2: f64,
    ) -> Option<TwinModel> {
        let spec = &self.rig.servo;
        let servo = ServoModel::new(spec.angle_limit_rad, lag_s, spec.rate_limit_rad_s).ok()?;
        let axis = TwinAxis { servo, dead_time_s, gain, level_rad, resistance_m_s2 };
        Some(TwinModel::new(self.rig.ladder(Profile::Default), axis))
    }

    fn explain(&self, dead_time_s: f64, lag_s: f64) -> Option<Explained> {
        let model = self.model(dead_time_s, lag_s, 1.0, 0.0, 0.0)?;
        let mut windows = Vec::with_capacity(self.n_windows());
        for (recording, stretches) in self.recordings.iter().zip(&self.stretches) {
            let path = recording.twin_path(&model, self.axis);
            windows.extend(stretches.iter().map(|s| {
                let resisted = &recording.resisted[self.axis][s.clone()];
                Window::new(&recording.moments[s.clone()], &path[s.clone()], resisted, self.axis)
            }));
        }
        explain(&mut windows)
    }

    /// Dead time and lag that leave the least: a coarse grid, then a pattern
    /// search that halves its steps.
    pub(super) fn search(&self) -> Option<(f64, f64, Explained)> {
        let mut best: Option<(f64, f64, Explained)> = None;
        let try_at = |dead: f64, lag: f64, best: &mut Option<(f64, f64, Explained)>| {
            if dead < 0.0 || lag < 0.0 {
                return;
            }
            let Some(found) = self.explain(dead, lag) else { return };
            if best.is_none_or(|(.., b)| found.cost() < b.cost()) {
                *best = Some((dead, lag, found));
            }
        };
        for dead in [0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3] {
            for lag in [0.01, 0.03, 0.06, 0.1, 0.15, 0.22] {
                try_at(dead, lag, &mut best);
            }
        }
        let mut step = 0.02;
        while step >= FINEST_STEP_S {
            let (dead, lag, before) = best?;
            for (d, l) in DIRECTIONS {
                try_at(dead + d * step, lag + l * step, &mut best);
            }
            if best.is_some_and(|(.., after)| after.cost() == before.cost()) {
                step /= 2.0;
            }
        }
        best
    }
}
