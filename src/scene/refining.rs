//! One method at ever finer paces, and how far it may still be off.

use nalgebra::Vector3;

use super::configuration::{Configuration, Method, Model, Pace};

/// Work of one step, ns on the machine of the charts: what the order of the
/// candidates rests on.
pub(super) const WORK_CONTACT_STEP: f64 = 85.0;
pub(super) const WORK_RODAS4: f64 = 1000.0;

/// The first contact step as a part of the plate's shortest time.
pub(super) const FIRST_PART: f64 = 0.25;

/// Candidates end here: shorter steps or smaller tolerances than these lose
/// more by rounding than they gain.
const FINEST_STEP_S: f64 = 1e-6;
const FINEST_TOLERANCE_M: f64 = 1e-11;

/// A run's positions at the moments of comparison.
pub(super) type Path = Vec<Vector3<f64>>;

/// A finer run has at least so many times the steps.
const LEAST_GROWTH: f64 = 1.3;

/// One method at ever finer paces.
pub(super) struct Refining {
    method: Method,
    /// The next step, s, or tolerance, m.
    next: f64,
    factor: f64,
    finest: f64,
    /// Work of the next run; infinite when there is none.
    pub(super) work: f64,
    growth: f64,
    per_step: f64,
    before: Path,
    /// How far the two runs before were apart, m.
    apart: f64,
    /// Steps of the run before.
    steps: u64,
}

impl Refining {
    pub(super) fn steps(h: f64, duration: f64) -> Self {
        Self {
            method: Method::ContactStep,
            next: h,
            factor: 0.5,
            finest: FINEST_STEP_S,
            work: duration / h * WORK_CONTACT_STEP,
            growth: 2.0,
            per_step: WORK_CONTACT_STEP,
            before: Path::new(),
            apart: f64::INFINITY,
            steps: 0,
        }
    }

    pub(super) fn tolerances(wanted: f64) -> Self {
        Self {
            method: Method::Rodas4,
            next: (wanted * 1000.0).min(1e-2),
            factor: 0.1,
            finest: FINEST_TOLERANCE_M,
            // A guess, until the first run has told.
            work: 40.0 * WORK_RODAS4,
            growth: 1.6,
            per_step: WORK_RODAS4,
            before: Path::new(),
            apart: f64::INFINITY,
            steps: 0,
        }
    }

    pub(super) fn configuration(&mut self) -> Option<Configuration> {
        let pace = match self.method {
            Method::ContactStep => Pace::Step(self.next),
            _ => Pace::Tolerance(self.next),
        };
        Configuration::new(Model::Compliant, self.method, pace).ok()
    }

    /// Error of the run, m, from its difference to the run before; of contact
    /// steps at least a third of the difference before that, since two runs may
    /// happen to agree. `None` for the first run.
    pub(super) fn compare(&mut self, path: Path, steps: u64) -> Option<f64> {
        // A run with nearly as many steps is the same run, and agrees with
        // itself: the plate's own pieces were shorter than the step.
        let refined = steps as f64 > LEAST_GROWTH * self.steps as f64;
        let comparable = refined && self.steps > 0 && self.before.len() == path.len();
        let pairs = self.before.iter().zip(&path).map(|(a, b)| (a - b).xy().norm());
        let apart = pairs.fold(0.0, f64::max);
        let error = comparable.then(|| match self.method {
            Method::ContactStep => apart.max(self.apart / 3.0),
            _ => apart,
        });
        self.apart = if comparable { apart } else { f64::INFINITY };
        (self.before, self.steps) = (path, steps);
        self.next *= self.factor;
        self.work = steps.max(1) as f64 * self.per_step * self.growth;
        if self.next < self.finest {
            self.work = f64::INFINITY;
        }
        error
    }
}
