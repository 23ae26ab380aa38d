//! The integration loops for one smooth piece of a scene.

use super::drive::{Drive, DrivenPlate};
use super::driven_models::DrivenModel;
use super::samples::{Samples, StepInterpolant, positions};
use crate::methods::StepControl;
use offbd_core::maths::Estimated;
use offbd_core::plant::{Motion, PlateMotion};

/// Maximum number of steps of a run. Chosen: at 50 ns each they take about a minute.
pub const MOST_STEPS: u64 = 1_000_000_000;

/// Maximum number of phase changes of a run. Chosen to stop a body on the verge of two
/// phases, which would take the shortest steps for ever.
pub(super) const MOST_CHANGES: u32 = 100_000;

/// Why a run ended early.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    #[error("at {at_s:.6} s the state is not a number: the step is too long for this method")]
    NotFinite { at_s: f64 },
    #[error("too many steps at {at_s:.6} s")]
    TooManySteps { at_s: f64 },
    #[error("over {MOST_CHANGES} changes between roll, slip and flight at {at_s:.6} s")]
    TooManyChanges { at_s: f64 },
    /// The model is not valid from this time on.
    #[error("{why} at {at_s:.6} s")]
    OutOfRange { at_s: f64, why: &'static str },
}

/// Counts of a run so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RunStatistics {
    pub steps: u64,
    pub rejected: u64,
    /// Fixed steps of an implicit method that were divided, because the contact begins or
    /// ends in them or a slip grows.
    pub divided: u64,
    /// Sum of the method's error estimates, each as its effect on the position at the end
    /// of the scene, m: the error of position plus that of velocity times the time left.
    pub method_error_m: f64,
}

/// Is called for each accepted step, and may end the run.
pub(super) trait StepObserver<R, const N: usize> {
    fn step(&mut self, system: &R, t: [f64; 2], y: [&[f64; N]; 2]) -> Result<(), Failure>;
}

/// Observes nothing.
pub(super) struct NoObserver;

impl<R, const N: usize> StepObserver<R, N> for NoObserver {
    #[inline]
    fn step(&mut self, _: &R, _: [f64; 2], _: [&[f64; N]; 2]) -> Result<(), Failure> {
        Ok(())
    }
}

/// The allowed error of one step.
#[derive(Clone, Copy, Debug)]
pub(super) struct ErrorBudget {
    /// Allowed error of the position at the end, m.
    pub tolerance: f64,
    /// Duration of the scene, s.
    pub duration: f64,
    /// Factor from an error of spin to one of velocity, m.
    pub radius: f64,
    /// Share of the tolerance that one step may use at least. 0 distributes the
    /// tolerance evenly over time (error per unit step).
    pub least_share: f64,
}

impl ErrorBudget {
    /// Returns the effect of the error `e` of a step at `t` on the position at the end of
    /// the scene, m.
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
            // NaN must propagate: `max` would drop it.
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

/// A numerical integration in progress: time, state and statistics.
pub(super) struct Integration<'a, 'b, const N: usize> {
    pub t: f64,
    pub y: [f64; N],
    pub statistics: RunStatistics,
    pub samples: Option<&'a mut Samples<'b>>,
    /// Maximum number of steps, rejected ones included.
    pub most_steps: u64,
}

impl<const N: usize> Integration<'_, '_, N> {
    /// Accepts a step to the state `y` at `t`, and takes the samples within it.
    #[inline]
    pub(super) fn take<R: DrivenModel<N>>(
        &mut self,
        system: &R,
        t: f64,
        y: [f64; N],
        observer: &mut impl StepObserver<R, N>,
    ) -> Result<(), Failure> {
        if !y.iter().all(|value| value.is_finite()) {
            return Err(Failure::NotFinite { at_s: t });
        }
        if self.statistics.steps + self.statistics.rejected >= self.most_steps {
            return Err(Failure::TooManySteps { at_s: t });
        }
        observer.step(system, [self.t, t], [&self.y, &y])?;
        self.sample(system, t, &y);
        self.statistics.steps += 1;
        (self.t, self.y) = (t, y);
        Ok(())
    }

    #[inline]
    fn sample<R: DrivenModel<N>>(&mut self, system: &R, t: f64, y: &[f64; N]) {
        let Some(samples) = self.samples.as_deref_mut() else { return };
        if !R::SMOOTH && !samples.whole_motions() {
            let (from, ends) = ([&self.y, y], [self.t, t]);
            samples.take(t, |within| {
                let position = positions(within.unwrap_or(t), ends, from, R::POSITIONS);
                Motion { position, ..Motion::default() }
            });
            return;
        }
        let mut interpolant: Option<StepInterpolant<'_, N>> = None;
        samples.take(t, |within| match within {
            None => system.motion(t, y),
            Some(within) => {
                let interpolant = interpolant.get_or_insert_with(|| StepInterpolant {
                    t: [self.t, t],
                    y: [&self.y, y],
                    rate: [system.rate(self.t, &self.y), system.rate(t, y)],
                });
                system.motion(within, &interpolant.at(within, R::POSITIONS, R::SMOOTH))
            }
        });
    }

    /// Integrates up to `until` by fixed steps of at most `h`.
    #[inline]
    pub(super) fn fixed<R: DrivenModel<N>>(
        &mut self,
        system: &R,
        until: f64,
        h: f64,
        observer: &mut impl StepObserver<R, N>,
        step: impl Fn(&R, f64, &[f64; N], f64) -> [f64; N],
    ) -> Result<(), Failure> {
        let n = whole_steps(until - self.t, h);
        let h = (until - self.t) / n as f64;
        for i in 1..=n {
            let y = step(system, self.t, &self.y, h);
            // The last stage of a step and the first of the next share the same time.
            let t = if i == n { until } else { self.t + h };
            self.take(system, t, y, observer)?;
        }
        Ok(())
    }

    /// Integrates up to `until` by fixed steps of at most `h`, each with the plate at its
    /// middle. The plate is evaluated for several steps at once.
    #[inline]
    pub(super) fn by_middles<R: DrivenModel<N>, D: Drive>(
        &mut self,
        (system, plate): (&R, &DrivenPlate<'_, D>),
        until: f64,
        h: f64,
        observer: &mut impl StepObserver<R, N>,
        step: impl Fn(&[f64; N], &PlateMotion, f64) -> [f64; N],
    ) -> Result<(), Failure> {
        let mut left = whole_steps(until - self.t, h);
        let h = (until - self.t) / left as f64;
        while left > 0 {
            let first = self.t + h / 2.0;
            let several = left >= TOGETHER as u64 && !plate.is_still();
            let plates = several.then(|| plate.grid::<TOGETHER>(first, h));
            for i in 0..if several { TOGETHER } else { 1 } {
                left -= 1;
                let t = if left == 0 { until } else { self.t + h };
                let motion = plates.as_ref().map_or_else(|| plate.at(first), |all| all.motion(i));
                let y = step(&self.y, &motion, h);
                self.take(system, t, y, observer)?;
            }
        }
        Ok(())
    }

    /// Integrates up to `until` by steps that `control` chooses, each with an error within
    /// `budget`.
    #[inline]
    pub(super) fn adaptive<R: DrivenModel<N>>(
        &mut self,
        system: &R,
        until: f64,
        (control, budget): (&mut StepControl, &ErrorBudget),
        observer: &mut impl StepObserver<R, N>,
        step: impl Fn(&R, f64, &[f64; N], f64, &mut [f64; N]) -> Option<Estimated<N>>,
    ) -> Result<(), Failure> {
        let mut first = system.rate(self.t, &self.y);
        while self.t < until {
            let (h, end) = next_step(self.t, until, control.h);
            let mut last = first;
            let tried = step(system, self.t, &self.y, h, &mut last);
            let error = tried
                .as_ref()
                .map_or(f64::NAN, |tried| budget.at_the_end(&tried.error, R::POSITIONS, self.t, h));
            let longest = tried.as_ref().map_or(f64::INFINITY, |tried| {
                system.longest_step_s(&self.y).min(system.longest_step_s(&tried.y))
            });
            let too_long = if h > longest { (h / longest).powi(4) } else { 0.0 };
            let scaled = error / budget.share(h);
            if !control.accepts(h, if too_long > scaled { too_long } else { scaled }) {
                self.statistics.rejected += 1;
                continue;
            }
            let Some(Estimated { y, .. }) = tried else {
                return Err(Failure::NotFinite { at_s: self.t });
            };
            self.statistics.method_error_m += error;
            first = last;
            self.take(system, end, y, observer)?;
        }
        Ok(())
    }
}

/// Number of steps for which the plate is evaluated at once. Chosen: enough for vectors
/// and a recurrence, and few enough for the closest memory.
const TOGETHER: usize = 16;

/// Returns the number of equal steps of at most `h` that fill `duration`.
pub(super) fn whole_steps(duration: f64, h: f64) -> u64 {
    (duration / h - 1e-9).ceil().max(1.0) as u64
}

/// Returns the length of the step to try at `t`, and its end. The last step ends exactly
/// at `until`, and no tiny step remains before it.
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
