//! Least-squares quadratics over a sliding window of unevenly spaced readings: the
//! acceleration filter, applied to a measured and a predicted path at once.
//!
//! For n readings spaced T apart with standard deviation σ the standard error of the
//! acceleration is σ_a = σ/T²·√(720/(n(n²−1)(n²−4))). Because the fit is linear, the fit
//! of the difference *is* the difference of the fits: both paths pass through the same
//! filter at the same times, and its delay cancels in the residual. Sums are updated as
//! readings enter and leave, in O(1) amortised; they are recomputed once per window so
//! that rounding errors do not accumulate.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use alloc::collections::VecDeque;
use serde::{Deserialize, Serialize};

use nalgebra::{Matrix3, Vector3};

/// Most readings in a window; beyond it the oldest are dropped, which shortens the
/// window. 4096 is 0.5 s at 8 kHz.
const MAX_POINTS: usize = 4096;

/// Least number of readings to make room for. Chosen.
const LEAST_GROWTH: usize = 4;

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Point {
    t: f64,
    measured: f64,
    predicted: f64,
}

/// Returns the window length, s, at which readings `period_s` apart with standard
/// deviation `noise` give an acceleration with standard error `error`: the formula above
/// for many readings, σ_a = σ·√(720·T)/W^(5/2), solved for W.
#[must_use]
pub fn window_for(noise: f64, period_s: f64, error: f64) -> f64 {
    (noise * (720.0 * period_s).sqrt() / error).powf(0.4)
}

/// Sums over the window, weighted with powers of u = t − origin.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct PowerSums {
    u: [f64; 5],
    measured: [f64; 3],
    deviation: [f64; 3],
    deviation_squared: f64,
}

impl PowerSums {
    fn add(&mut self, u: f64, point: &Point, sign: f64) {
        let d = point.measured - point.predicted;
        let mut power = sign;
        for k in 0..5 {
            self.u[k] += power;
            if k < 3 {
                self.measured[k] += power * point.measured;
                self.deviation[k] += power * d;
            }
            power *= u;
        }
        self.deviation_squared += sign * d * d;
    }
}

/// Position, velocity and acceleration of a fitted path at its newest reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FittedPath {
    pub position: f64,
    pub velocity: f64,
    pub acceleration: f64,
}

impl FittedPath {
    fn of(coefficients: &Vector3<f64>, u: f64) -> Self {
        let [c0, c1, c2] = (*coefficients).into();
        Self {
            position: c0 + u * (c1 + u * c2),
            velocity: c1 + 2.0 * u * c2,
            acceleration: 2.0 * c2,
        }
    }
}

/// The fits of a window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// The measured path.
    pub measured: FittedPath,
    /// Measured − predicted path; its acceleration is the residual.
    pub deviation: FittedPath,
    /// Standard deviation of the readings about the fitted deviation.
    pub scatter: f64,
    /// Standard error of the deviation's acceleration, for white noise.
    pub acceleration_error: f64,
    /// Readings in the window.
    pub n: usize,
    /// Time from the oldest to the newest reading, s.
    pub span_s: f64,
}

/// The filter; see the module documentation.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct SlidingQuadratic {
    points: VecDeque<Point>,
    origin: f64,
    sums: PowerSums,
}

impl SlidingQuadratic {
    /// Adds a reading newer than all others and drops those older than `window_s` before
    /// it.
    pub fn push(&mut self, t: f64, measured: f64, predicted: f64, window_s: f64) {
        let point = Point { t, measured, predicted };
        if self.points.is_empty() {
            self.origin = t;
            self.sums = PowerSums::default();
        }
        if self.points.len() == self.points.capacity() {
            self.points.reserve_exact(self.growth(t, window_s));
        }
        self.points.push_back(point);
        self.sums.add(t - self.origin, &point, 1.0);
        while let Some(oldest) = self.points.front().copied()
            && (t - oldest.t > window_s || self.points.len() > MAX_POINTS)
        {
            self.points.pop_front();
            self.sums.add(oldest.t - self.origin, &oldest, -1.0);
        }
        if t - self.origin > 2.0 * window_s {
            self.rebuild();
        }
    }

    /// The number of readings at `t` and later to make room for: as many as there are, but
    /// no more than the window will hold at their rate.
    fn growth(&self, t: f64, window_s: f64) -> usize {
        let n = self.points.len();
        let span_s = self.points.front().map_or(0.0, |oldest| t - oldest.t);
        // Both ends of the window, and the reading that has just left it.
        let full = (n as f64 * window_s / span_s).round() as usize;
        let full = full.min(MAX_POINTS - 1) + 2;
        full.saturating_sub(n).clamp(LEAST_GROWTH, n.max(LEAST_GROWTH))
    }

    /// Subtracts the straight line through (`t`, `position`) with slope `velocity` from
    /// the predicted path; accelerations do not change.
    pub fn rebase(&mut self, t: f64, position: f64, velocity: f64) {
        for point in &mut self.points {
            point.predicted -= position + velocity * (point.t - t);
        }
        self.rebuild();
    }

    /// Drops all readings.
    pub fn clear(&mut self) {
        self.points.clear();
    }

    /// Time of the newest reading.
    #[must_use]
    pub fn newest(&self) -> Option<f64> {
        self.points.back().map(|p| p.t)
    }

    fn rebuild(&mut self) {
        self.sums = PowerSums::default();
        let Some(oldest) = self.points.front() else { return };
        self.origin = oldest.t;
        for point in &self.points {
            self.sums.add(point.t - self.origin, point, 1.0);
        }
    }

    /// Returns the fit over the window; `None` for fewer than four readings, or if they
    /// lie too close together to determine a parabola.
    #[must_use]
    pub fn fit(&self) -> Option<Fit> {
        let (oldest, newest) = (self.points.front()?, self.points.back()?);
        let n = self.points.len();
        if n < 4 {
            return None;
        }
        let s = &self.sums;
        let normal = Matrix3::new(
            s.u[0], s.u[1], s.u[2], //
            s.u[1], s.u[2], s.u[3], //
            s.u[2], s.u[3], s.u[4],
        );
        let inverse = normal.try_inverse().filter(|i| i[(2, 2)] > 0.0 && i[(2, 2)].is_finite())?;
        let measured = inverse * Vector3::from(s.measured);
        let moments = Vector3::from(s.deviation);
        let deviation = inverse * moments;
        let squares = (s.deviation_squared - deviation.dot(&moments)).max(0.0);
        let scatter = (squares / (n - 3) as f64).sqrt();
        let u = newest.t - self.origin;
        Some(Fit {
            measured: FittedPath::of(&measured, u),
            deviation: FittedPath::of(&deviation, u),
            scatter,
            acceleration_error: 2.0 * scatter * inverse[(2, 2)].sqrt(),
            n,
            span_s: newest.t - oldest.t,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Pushes `n` readings of `path` spaced `dt` apart; the predicted path is zero.
    fn filled(n: usize, dt: f64, window_s: f64, path: impl Fn(f64) -> f64) -> SlidingQuadratic {
        let mut filter = SlidingQuadratic::default();
        for i in 0..n {
            let t = i as f64 * dt;
            filter.push(t, path(t), 0.0, window_s);
        }
        filter
    }

    /// Noise factors of a least-squares quadratic over N samples spaced T:
    /// σ_a·T²/σ for N = 5, 9, 13, 21.
    #[test]
    fn validate_published_noise_factors() {
        for (n, factor) in [(5, 0.534), (9, 0.114), (13, 0.0447), (21, 0.0134)] {
            let fit = filled(n, 0.01, 1.0, |t| (t * 1e4).sin()).fit().unwrap();
            let found = fit.acceleration_error / fit.scatter * 1e-4;
            assert!((found / factor - 1.0).abs() < 5e-3, "N = {n}: {found} against {factor}");
        }
    }

    /// A window of the computed length gives the wanted error. It holds a whole number of
    /// readings, which costs up to 5/2 of a reading's share, here 2.5 %.
    #[test]
    fn validate_the_window_for_an_error() {
        let (noise, period_s, error) = (5e-4, 0.004, 0.008);
        let window_s = window_for(noise, period_s, error);
        let n = (window_s / period_s) as usize;
        assert!(n > 90, "{n}");
        let fit = filled(n, period_s, 10.0, |t| (t * 1e4).sin()).fit().unwrap();
        let found = fit.acceleration_error / fit.scatter * noise;
        assert!((found / error - 1.0).abs() < 0.03, "{found} against {error} with {n}");
    }

    #[test]
    fn a_parabola_is_found_exactly_however_long_it_runs() {
        let path = |t: f64| 0.1 - 0.2 * t + 0.15 * t * t;
        let filter = filled(20_000, 0.005, 0.5, path);
        let (fit, t) = (filter.fit().unwrap(), 19_999.0 * 0.005);
        assert_eq!(fit.n, 101);
        assert!((fit.measured.acceleration - 0.3).abs() < 1e-6, "{fit:?}");
        assert!((fit.measured.velocity - (0.3 * t - 0.2)).abs() < 1e-6, "{fit:?}");
        assert!((fit.measured.position - path(t)).abs() < 1e-9, "{fit:?}");
    }

    #[test]
    fn the_memory_is_that_of_the_window() {
        for (n, period_s) in [(51, 0.01), (101, 0.005), (4, 0.2)] {
            let filter = filled(1000, period_s, 0.5 + 1e-6, |t| t);
            let (held, room) = (filter.points.len(), filter.points.capacity());
            assert!(held.abs_diff(n) <= 1 && room <= n + 1 + LEAST_GROWTH, "{held} of {room}");
        }
        let at_once = filled(100, 0.0, 0.5, |t| t).points.capacity();
        assert!(at_once < 200, "{at_once}");
    }

    proptest! {
        /// The updated sums agree with recomputed ones.
        #[test]
        fn sliding_equals_afresh(
            readings in proptest::collection::vec((0.001..0.05_f64, -0.2..0.2_f64, -0.2..0.2_f64), 10..300)
        ) {
            let mut slid = SlidingQuadratic::default();
            let mut t = 1000.0;
            for &(dt, y, z) in &readings {
                t += dt;
                slid.push(t, y, z, 0.4);
            }
            let mut afresh = slid.clone();
            afresh.rebuild();
            if let (Some(a), Some(b)) = (slid.fit(), afresh.fit()) {
                prop_assert!((a.deviation.acceleration - b.deviation.acceleration).abs()
                    <= 1e-9 * (1.0 + b.acceleration_error));
                prop_assert!((a.scatter - b.scatter).abs() < 1e-9);
            }
        }

        /// Subtracting a straight line from the prediction changes no acceleration.
        #[test]
        fn rebasing_keeps_the_residual(p in -1.0..1.0_f64, v in -1.0..1.0_f64) {
            let mut filter = filled(60, 0.01, 0.5, |t| (3.0 * t).sin() * 0.1);
            let before = filter.fit().unwrap();
            filter.rebase(0.59, p, v);
            let after = filter.fit().unwrap();
            prop_assert!((before.deviation.acceleration - after.deviation.acceleration).abs() < 1e-8);
            prop_assert!((after.deviation.position - before.deviation.position - p).abs() < 1e-10);
        }
    }
}
