//! A look at the ball: the filter of each axis over one window, and its fit.

use crate::maths::{Fit, SlidingQuadratic};
use crate::vocabulary::{Axis, PerAxis};

/// Readings and predictions of both axes through windows of one length.
#[derive(Clone, Debug)]
pub(super) struct Look {
    /// Length of the windows, s.
    window_s: f64,
    windows: PerAxis<SlidingQuadratic>,
    pub(super) fits: PerAxis<Option<Fit>>,
}

impl Look {
    pub(super) fn new(window_s: f64) -> Self {
        Self { window_s, windows: PerAxis::default(), fits: PerAxis::default() }
    }

    /// Length of the window, s, where it takes `least_s` to hold enough readings.
    pub(super) fn window_s(&self, least_s: f64) -> f64 {
        self.window_s.max(least_s)
    }

    /// Takes a reading of `axis` and what was predicted for it, m, at `t`.
    pub(super) fn push(&mut self, axis: Axis, t: f64, measured: f64, predicted: f64, least_s: f64) {
        let window_s = self.window_s(least_s);
        self.windows[axis].push(t, measured, predicted, window_s);
    }

    /// Fits both axes to what their windows hold.
    pub(super) fn fit(&mut self) {
        self.fits = PerAxis::from_fn(|axis| self.windows[axis].fit());
    }

    /// Forgets every reading.
    pub(super) fn forget(&mut self) {
        for axis in Axis::ALL {
            self.windows[axis].clear();
            self.fits[axis] = None;
        }
    }

    /// Whether the newest reading of an axis is older than `gap_s` at `t`.
    pub(super) fn stale(&self, t: f64, gap_s: f64) -> bool {
        Axis::ALL.iter().any(|&a| self.windows[a].newest().is_some_and(|n| t - n > gap_s))
    }

    /// Takes the straight line through (`t`, `position`) with slope `velocity`
    /// away from what was predicted along `axis`.
    pub(super) fn rebase(&mut self, axis: Axis, t: f64, position: f64, velocity: f64) {
        self.windows[axis].rebase(t, position, velocity);
    }
}
