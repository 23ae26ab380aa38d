//! The loops that carry a system through one smooth piece of a scene.

use super::rungs::Rung;
use super::samples::{Samples, Span};
use crate::methods::StepControl;
use offbd_core::maths::Estimated;

/// More steps than this end a run: at 50 ns each it has taken a minute.
pub const MOST_STEPS: u64 = 1_000_000_000;

/// More changes of phase than this end a run: a body on the verge of two would
/// take the smallest steps for ever.
pub(super) const MOST_CHANGES: u32 = 100_000;

/// Why a run ended early.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    #[error("the state is no number any more at {at_s:.6} s: the step is too long for this method")]
    NotFinite { at_s: f64 },
    #[error("too many steps at {at_s:.6} s")]
    TooManySteps { at_s: f64 },
    #[error("over {MOST_CHANGES} changes between roll, slip and flight at {at_s:.6} s")]
    TooManyChanges { at_s: f64 },
    /// The run was to stop where its model is not valid.
    #[error("{why} at {at_s:.6} s")]
    OutOfRange { at_s: f64, why: &'static str },
}

/// What a run has done so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    pub steps: u64,
    pub rejected: u64,
    /// What the method's estimates add up to at the end of the scene, m:
    /// errors of position, and errors of velocity times the time left.
    pub method_error_m: f64,
}

/// Sees each step that stands, and may end the run.
pub(super) trait Watch<R, const N: usize> {
    fn step(&mut self, rung: &R, t: [f64; 2], y: [&[f64; N]; 2]) -> Result<(), Failure>;
}

/// Watches nothing.
pub(super) struct Unwatched;

impl<R, const N: usize> Watch<R, N> for Unwatched {
    #[inline]
    fn step(&mut self, _: &R, _: [f64; 2], _: [&[f64; N]; 2]) -> Result<(), Failure> {
        Ok(())
    }
}

/// How large an error of one step may be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    /// Wanted error of the position at the end, m.
    pub tolerance: f64,
    /// Length of the scene, s.
    pub duration: f64,
    /// Turns an error of spin into one of velocity, m.
    pub radius: f64,
    /// Smallest part of the tolerance that one step may use up. 0 shares it
    /// out evenly over time (error per unit step).
    pub least_share: f64,
}

impl Budget {
    /// What the error `e` of a step that ends at `t` does to the position at
    /// the end, m.
    #[inline]
    pub(super) fn at_the_end<const N: usize>(
        &self,
        e: &[f64; N],
        positions: usize,
        t: f64,
        h: f64,
    ) -> f64 {
        let left = (self.duration - t).max(h);
        let mut worst = [0.0_f64; 3];
        for (i, error) in e.iter().map(|e| e.abs()).enumerate() {
            let worst = &mut worst[(i / positions).min(2)];
            // NaN must come through: `max` would lose it.
            if error.is_nan() || error > *worst {
                *worst = error;
            }
        }
        worst[0] + left * (worst[1] + self.radius * worst[2])
    }

    fn share(&self, h: f64) -> f64 {
        self.tolerance * (h / self.duration).max(self.least_share)
    }
}

/// Where a run stands: time, state, and how far it has come.
pub(super) struct Course<'a, 'b, const N: usize> {
    pub t: f64,
    pub y: [f64; N],
    pub tally: Tally,
    pub samples: Option<&'a mut Samples<'b>>,
    /// Steps, rejected ones included, that end the run.
    pub most_steps: u64,
}

impl<const N: usize> Course<'_, '_, N> {
    /// Goes over to `y` at `t`, sampling on the way.
    #[inline]
    pub(super) fn take<R: Rung<N>>(
        &mut self,
        rung: &R,
        t: f64,
        y: [f64; N],
        watch: &mut impl Watch<R, N>,
    ) -> Result<(), Failure> {
        if !y.iter().all(|value| value.is_finite()) {
            return Err(Failure::NotFinite { at_s: t });
        }
        if self.tally.steps + self.tally.rejected >= self.most_steps {
            return Err(Failure::TooManySteps { at_s: t });
        }
        watch.step(rung, [self.t, t], [&self.y, &y])?;
        self.sample(rung, t, &y);
        self.tally.steps += 1;
        (self.t, self.y) = (t, y);
        Ok(())
    }

    #[inline]
    fn sample<R: Rung<N>>(&mut self, rung: &R, t: f64, y: &[f64; N]) {
        let Some(samples) = self.samples.as_deref_mut() else { return };
        let mut span: Option<Span<'_, N>> = None;
        samples.take(t, |within| match within {
            None => rung.motion(t, y),
            Some(within) => {
                let span = span.get_or_insert_with(|| Span {
                    t: [self.t, t],
                    y: [&self.y, y],
                    rate: [rung.rate(self.t, &self.y), rung.rate(t, y)],
                });
                rung.motion(within, &span.at(within, R::POSITIONS, R::SMOOTH))
            }
        });
    }

    /// Fixed steps of at most `h` up to `until`.
    #[inline]
    pub(super) fn fixed<R: Rung<N>>(
        &mut self,
        rung: &R,
        until: f64,
        h: f64,
        watch: &mut impl Watch<R, N>,
        step: impl Fn(&R, f64, &[f64; N], f64) -> [f64; N],
    ) -> Result<(), Failure> {
        let n = whole_steps(until - self.t, h);
        let h = (until - self.t) / n as f64;
        for i in 1..=n {
            let y = step(rung, self.t, &self.y, h);
            // Stages of one step and the next share their moment this way.
            let t = if i == n { until } else { self.t + h };
            self.take(rung, t, y, watch)?;
        }
        Ok(())
    }

    /// Steps by `control` up to `until`, each within `budget`.
    #[inline]
    pub(super) fn adaptive<R: Rung<N>>(
        &mut self,
        rung: &R,
        until: f64,
        (control, budget): (&mut StepControl, &Budget),
        watch: &mut impl Watch<R, N>,
        step: impl Fn(&R, f64, &[f64; N], f64, &mut [f64; N]) -> Option<Estimated<N>>,
    ) -> Result<(), Failure> {
        let mut first = rung.rate(self.t, &self.y);
        while self.t < until {
            let (h, end) = next_step(self.t, until, control.h);
            let mut last = first;
            let tried = step(rung, self.t, &self.y, h, &mut last);
            let error = tried
                .as_ref()
                .map_or(f64::NAN, |tried| budget.at_the_end(&tried.error, R::POSITIONS, self.t, h));
            if !control.accepts(h, error / budget.share(h)) {
                self.tally.rejected += 1;
                continue;
            }
            let Some(Estimated { y, .. }) = tried else {
                return Err(Failure::NotFinite { at_s: self.t });
            };
            self.tally.method_error_m += error;
            first = last;
            self.take(rung, end, y, watch)?;
        }
        Ok(())
    }
}

/// How many equal steps of at most `h` make up `span`.
pub(super) fn whole_steps(span: f64, h: f64) -> u64 {
    (span / h - 1e-9).ceil().max(1.0) as u64
}

/// The step to try at `t`, and where it ends: the end of the piece is met, and
/// no tiny step is left before it.
pub(super) fn next_step(t: f64, until: f64, h: f64) -> (f64, f64) {
    let left = until - t;
    if h >= left * (1.0 - 1e-9) {
        (left, until)
    } else if h > left / 2.0 {
        (left / 2.0, t + left / 2.0)
    } else {
        (h, t + h)
    }
}
