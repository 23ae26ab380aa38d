//! The reference solution: the compliant model at a tolerance at which its own error is
//! negligible.

use nalgebra::Vector2;

use super::Scene;
use super::configuration::{Configuration, Method, Model, Pace};
use super::drive::Drive;
use super::run::{RunOutcome, run_within};
use super::samples::Samples;
use super::stepping::Failure;
use offbd_core::plant::Motion;

/// CPU time of one step of RODAS, ns, measured on the machine of the charts.
pub(super) const WORK_RODAS4: f64 = 1000.0;

/// Exponent of the tolerance in the number of steps of RODAS, a method of order 4: a
/// tenth of the tolerance takes 1.5 to 2 times the steps.
pub(super) const STEPS_BY_TOLERANCE: f64 = 0.25;

/// Tolerance of the first run as a share of the wanted accuracy. Chosen: at coarser
/// tolerances two runs may agree and yet both miss that the ball just leaves the plate.
const FIRST_SHARE: f64 = 0.1;

/// Tolerance of each further run as a share of the previous one; chosen: a decade.
const FINER: f64 = 0.1;

/// Allowed difference of the last two runs as a share of the wanted accuracy; chosen.
const AGREED_SHARE: f64 = 0.1;

/// Finest tolerance, m; chosen: below it, rounding errors outweigh the gain.
const FINEST_M: f64 = 1e-12;

/// Maximum work of one run, ns per simulated second. Chosen: twenty times the most
/// expensive charted run by RODAS. A scene that needs more is refused.
const MOST_WORK_PER_S: f64 = 5e7;

/// Returns the maximum number of steps, of `work` ns each, for one run of `scene`.
pub(super) fn most_steps(scene: &Scene, work: f64) -> u64 {
    (MOST_WORK_PER_S * scene.duration_s.max(1.0) / work) as u64
}

/// Number of intervals at whose ends two runs are compared. Chosen prime, so that the
/// times do not all coincide with the ends of steps, where a run is most accurate.
const COMPARED: f64 = 499.0;

/// Positions of a run at the times of comparison, and its number of steps.
pub(super) struct SampledPath {
    positions: Vec<Vector2<f64>>,
    pub steps: u64,
}

impl SampledPath {
    /// Returns the path of `run`, which runs `scene` and takes the samples given to it.
    pub(super) fn of(
        scene: &Scene,
        run: impl FnOnce(&mut Samples<'_>) -> Result<RunOutcome, Failure>,
    ) -> Result<Self, Failure> {
        let mut positions = Vec::new();
        let mut sink = |_: f64, at: &Motion| positions.push(at.position.xy());
        let outcome = run(&mut Samples::new(scene.duration_s / COMPARED, &mut sink))?;
        Ok(Self { positions, steps: outcome.statistics.steps + outcome.statistics.rejected })
    }

    /// Runs `scene` by `configuration` in at most `most_steps`; returns its path.
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

    /// Returns the largest distance from `other`, m.
    pub(super) fn apart(&self, other: &Self) -> f64 {
        let pairs = self.positions.iter().zip(&other.positions);
        pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
    }
}

/// A path with a bound of its error.
pub(super) struct ReferenceSolution {
    pub path: SampledPath,
    /// Work of the run, ns.
    pub work: f64,
    /// Tolerance of its method, m.
    pub tolerance_m: f64,
    /// Upper bound of its error, m.
    pub error_m: f64,
}

impl ReferenceSolution {
    /// Runs RODAS at decreasing tolerances until two runs agree to a tenth of
    /// `wanted_m`.
    ///
    /// # Errors
    /// The accuracy, m, to which the last runs do agree, if they never do for
    /// `wanted_m`.
    pub(super) fn of<D: Drive + Clone>(
        scene: &Scene,
        drive: &D,
        wanted_m: f64,
    ) -> Result<Self, f64> {
        let most_steps = most_steps(scene, WORK_RODAS4);
        let (mut before, mut nearest) = (None, f64::INFINITY);
        let mut tolerance_m = (wanted_m * FIRST_SHARE).max(FINEST_M / FINER);
        while tolerance_m >= FINEST_M {
            let path = rodas(tolerance_m).and_then(|finer| {
                SampledPath::run(most_steps, scene, &mut drive.clone(), &finer).ok()
            });
            if let (Some(path), Some(before)) = (&path, &before) {
                nearest = path.apart(before);
            }
            match path {
                Some(path) if nearest <= wanted_m * AGREED_SHARE => {
                    // Its error is less than its distance from the coarser run.
                    let work = WORK_RODAS4 * path.steps as f64;
                    return Ok(Self { path, work, tolerance_m, error_m: nearest });
                }
                path => before = path,
            }
            tolerance_m *= FINER;
        }
        Err(nearest / AGREED_SHARE)
    }

    /// Returns the expected work of RODAS at another tolerance, ns.
    pub(super) fn work_at(&self, tolerance_m: f64) -> f64 {
        self.work * (self.tolerance_m / tolerance_m).powf(STEPS_BY_TOLERANCE)
    }
}

/// Returns the compliant model by RODAS at the given tolerance, m.
pub(super) fn rodas(tolerance_m: f64) -> Option<Configuration> {
    Configuration::new(Model::Compliant, Method::Rodas4, Pace::Tolerance(tolerance_m)).ok()
}
