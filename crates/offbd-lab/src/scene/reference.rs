//! What a run is held against: the compliant model, solved so finely that its
//! own error does not matter.

use nalgebra::Vector2;

use super::Scene;
use super::configuration::{Configuration, Method, Model, Pace};
use super::drive::Drive;
use super::run::{Outcome, run_within};
use super::samples::Samples;
use super::stepping::Failure;
use offbd_core::plant::Motion;

/// Time of one step of RODAS, ns on the machine of the charts.
pub(super) const WORK_RODAS4: f64 = 1000.0;

/// The steps of RODAS, of order 4, go with the tolerance to this power: half as
/// many again to twice as many for a tenth of it.
pub(super) const STEPS_BY_TOLERANCE: f64 = 0.25;

/// The first run's tolerance as a part of the wanted accuracy. Coarser ones may
/// agree on the wrong side of a plate that just parts from the ball.
const FIRST_SHARE: f64 = 0.1;

/// The next run's tolerance as a part of the one before.
const FINER: f64 = 0.1;

/// Part of the wanted accuracy by which the two last runs may differ.
const AGREED_SHARE: f64 = 0.1;

/// Smaller tolerances than this, m, lose more by rounding than they gain.
const FINEST_M: f64 = 1e-12;

/// Most work of one run, ns per simulated second: twenty times the dearest that
/// is charted by RODAS. A scene that needs more is out of reach.
const MOST_WORK_PER_S: f64 = 5e7;

/// Steps of `work` ns each that one run of `scene` may take.
pub(super) fn most_steps(scene: &Scene, work: f64) -> u64 {
    (MOST_WORK_PER_S * scene.duration_s.max(1.0) / work) as u64
}

/// Moments at which two runs are compared: a prime number, so that they do not
/// all fall on the ends of steps, where a run is at its best.
const COMPARED: f64 = 499.0;

/// Positions of a run at the moments of comparison, and its steps.
pub(super) struct Path {
    positions: Vec<Vector2<f64>>,
    pub steps: u64,
}

impl Path {
    /// The path of `run`, which samples `scene` as it is told.
    pub(super) fn of(
        scene: &Scene,
        run: impl FnOnce(&mut Samples<'_>) -> Result<Outcome, Failure>,
    ) -> Result<Self, Failure> {
        let mut positions = Vec::new();
        let mut sink = |_: f64, at: &Motion| positions.push(at.position.xy());
        let outcome = run(&mut Samples::new(scene.duration_s / COMPARED, &mut sink))?;
        Ok(Self { positions, steps: outcome.tally.steps + outcome.tally.rejected })
    }

    /// The path by `configuration` in at most `most_steps`.
    pub(super) fn run<D: Drive>(
        most_steps: u64,
        scene: &Scene,
        drive: &mut D,
        configuration: &Configuration,
    ) -> Result<Self, Failure> {
        Self::of(scene, |samples| {
            run_within(most_steps, scene, drive, configuration, Some(samples))
        })
    }

    /// The worst distance from `other`, m.
    pub(super) fn apart(&self, other: &Self) -> f64 {
        let pairs = self.positions.iter().zip(&other.positions);
        pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
    }
}

/// A path and how far it may be off.
pub(super) struct Reference {
    pub path: Path,
    /// What it took, ns.
    pub work: f64,
    /// That of its method, m.
    pub tolerance_m: f64,
    /// More than it is off, m.
    pub error_m: f64,
}

impl Reference {
    /// Runs RODAS at ever smaller tolerances until two runs agree to a tenth
    /// of `wanted_m`.
    ///
    /// # Errors
    /// The accuracy, m, for which they agree well enough, if not for this one.
    pub(super) fn of<D: Drive + Clone>(
        scene: &Scene,
        drive: &D,
        wanted_m: f64,
    ) -> Result<Self, f64> {
        let most_steps = most_steps(scene, WORK_RODAS4);
        let (mut before, mut nearest) = (None, f64::INFINITY);
        let mut tolerance_m = (wanted_m * FIRST_SHARE).max(FINEST_M / FINER);
        while tolerance_m >= FINEST_M {
            let path = rodas(tolerance_m)
                .and_then(|finer| Path::run(most_steps, scene, &mut drive.clone(), &finer).ok());
            if let (Some(path), Some(before)) = (&path, &before) {
                nearest = path.apart(before);
            }
            match path {
                Some(path) if nearest <= wanted_m * AGREED_SHARE => {
                    // The coarser run was farther from it than it is off itself.
                    let work = WORK_RODAS4 * path.steps as f64;
                    return Ok(Self { path, work, tolerance_m, error_m: nearest });
                }
                path => before = path,
            }
            tolerance_m *= FINER;
        }
        Err(nearest / AGREED_SHARE)
    }

    /// The work of RODAS at another tolerance, ns.
    pub(super) fn work_at(&self, tolerance_m: f64) -> f64 {
        self.work * (self.tolerance_m / tolerance_m).powf(STEPS_BY_TOLERANCE)
    }
}

/// The compliant model by RODAS.
pub(super) fn rodas(tolerance_m: f64) -> Option<Configuration> {
    Configuration::new(Model::Compliant, Method::Rodas4, Pace::Tolerance(tolerance_m)).ok()
}
