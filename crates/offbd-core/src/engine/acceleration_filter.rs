//! The acceleration filter of both axes: sliding windows of equal length, and their fits.

use crate::maths::{Fit, SlidingQuadratic};
use crate::vocabulary::{Axis, PerAxis};
use serde::{Deserialize, Serialize};

/// Measured and predicted paths of both axes over sliding windows.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct AccelerationFilter {
    /// Length of the windows, s.
    window_s: f64,
    windows: PerAxis<SlidingQuadratic>,
    pub(super) fits: PerAxis<Option<Fit>>,
}

impl AccelerationFilter {
    pub(super) fn new(window_s: f64) -> Self {
        Self { window_s, windows: PerAxis::default(), fits: PerAxis::default() }
    }

    /// Length of the window, s; extended to `least_s` to hold enough readings.
    pub(super) fn window_s(&self, least_s: f64) -> f64 {
        self.window_s.max(least_s)
    }

    /// Adds a reading of `axis` and the twin's prediction, m, at time `t`.
    pub(super) fn push(&mut self, axis: Axis, t: f64, measured: f64, predicted: f64, least_s: f64) {
        let window_s = self.window_s(least_s);
        self.windows[axis].push(t, measured, predicted, window_s);
    }

    /// Fits both axes.
    pub(super) fn fit(&mut self) {
        self.fits = PerAxis::from_fn(|axis| self.windows[axis].fit());
    }

    /// Drops all readings.
    pub(super) fn forget(&mut self) {
        for axis in Axis::ALL {
            self.windows[axis].clear();
            self.fits[axis] = None;
        }
    }

    /// Whether the newest reading of any axis is older than `gap_s` at time `t`.
    pub(super) fn stale(&self, t: f64, gap_s: f64) -> bool {
        Axis::ALL.iter().any(|&a| self.windows[a].newest().is_some_and(|n| t - n > gap_s))
    }

    /// Subtracts the straight line through (`t`, `position`) with slope `velocity` from
    /// the predicted path of `axis`.
    pub(super) fn rebase(&mut self, axis: Axis, t: f64, position: f64, velocity: f64) {
        self.windows[axis].rebase(t, position, velocity);
    }
}
