//! Searches the cheapest model and method within a wanted accuracy, for a scene that will
//! run many times.
//!
//! 1. The reference is the scene in one pass at a tenth of the wanted accuracy.
//! 2. Each method of each model is a family of runs from coarse to fine. Again and again
//!    the family goes on whose next run should cost least; a family ends where it keeps
//!    the accuracy, or where it would cost more than the cheapest run that does.
//!
//! Runs are deterministic to the bit, so the measured error is that of every later run.
//! Work is counted in steps times a measured time per step, not in measured time, so that
//! the choice is the same on every machine and in every run.

use nalgebra::Vector2;

use super::configuration::{
    Configuration, FINEST_M, LONGEST_STEP_S, Method, Model, Pace, SHORTEST_STEP_S,
};
use super::drive::Drive;
use super::one_pass::{one_pass, rolls};
use super::run::{LONGEST_PART, run_within};
use super::samples::Samples;
use super::stepping::Failure;
use super::{Scene, Subject};
use offbd_core::plant::{GRAVITY_M_S2, Motion};

/// One candidate that was considered, and its result.
#[derive(Clone, Debug, PartialEq)]
pub struct TriedCandidate {
    pub model: Model,
    pub method: Method,
    /// Estimate of the largest error of the position, m; `None` if there is none.
    pub error_m: Option<f64>,
    pub verdict: String,
}

/// The chosen configuration, and the reasons.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    pub configuration: Configuration,
    /// Estimate of the largest error of the position, m.
    pub error_m: f64,
    /// The candidates in the order of consideration.
    pub tried: Vec<TriedCandidate>,
}

/// No candidate meets the tolerance.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("no model and method meets {tolerance_m:e} m here{}", best(*best_m))]
pub struct OutOfReach {
    pub tolerance_m: f64,
    pub best_m: f64,
    pub tried: Vec<TriedCandidate>,
}

fn best(best_m: f64) -> String {
    if best_m.is_finite() {
        format!("; the best accuracy is about {best_m:.1e} m")
    } else {
        String::new()
    }
}

/// Accuracy of the reference as a share of the wanted one; chosen: a decade.
const REFERENCE_SHARE: f64 = 0.1;

/// Share of the tolerance allowed for the measured difference from the reference plus
/// the reference's own error. Chosen below 1, because the difference may be a little
/// larger between the times of comparison.
const MEASURED_SHARE: f64 = 0.97;

/// Number of intervals at whose ends a run is compared with the reference, if the ball
/// slips or leaves the plate. Chosen prime, so that the times do not all coincide with the
/// ends of steps, where a run is most accurate.
const COMPARED: f64 = 499.0;

/// The same for a ball that rolls, whose error changes as slowly as the plate: per shortest
/// time of the plate, and at least; chosen.
const COMPARED_PER_TIME: f64 = 41.0;
const COMPARED_LEAST: f64 = 61.0;

/// Maximum work of one run, ns per simulated second. Chosen: twenty times the most
/// expensive charted run by RODAS. A scene that needs more is refused.
const MOST_WORK_PER_S: f64 = 5e7;

/// Coarsest tolerance of a method, m; chosen.
const COARSEST_M: f64 = 1e-2;

/// Longest jump to a finer step, as a factor: further ones would miss steps that are
/// better than the order of the method lets expect; chosen.
const LONGEST_JUMP: f64 = 10.0;

/// Share of an error that counts as all of it; chosen.
const STAYS: f64 = 0.5;

/// Chooses for `scene` under `drive` the cheapest configuration whose largest error of
/// the position (x, y) against the compliant model is within `tolerance_m`, which lies in
/// [1e-12, 1].
///
/// # Errors
/// [`OutOfReach`] with the candidates tried, if none meets the tolerance.
pub fn choose<D: Drive + Clone>(
    scene: &Scene,
    drive: &D,
    tolerance_m: f64,
) -> Result<Choice, OutOfReach> {
    let mut tried = Vec::new();
    let reference = match SampledReference::of(scene, drive, tolerance_m * REFERENCE_SHARE) {
        Ok(reference) => reference,
        Err((best_m, verdict)) => {
            let (model, method) = (Model::Compliant, Method::Rodas4);
            tried.push(TriedCandidate { model, method, error_m: None, verdict });
            return Err(OutOfReach { tolerance_m, best_m, tried });
        }
    };
    let mut families = families(scene, drive.shortest_time_s(), tolerance_m, &reference);
    let most_ns = MOST_WORK_PER_S * scene.duration_s.max(1.0);
    let mut best: Option<(f64, Configuration, f64)> = None;
    let mut nearest_m = f64::INFINITY;
    while let Some(next) = cheapest(&families) {
        let family = &mut families[next];
        let most = best.as_ref().map_or(most_ns, |best| best.0);
        if family.work >= most && !tried.is_empty() {
            break;
        }
        let Some(configuration) = family.configuration() else {
            families.swap_remove(next);
            continue;
        };
        let most_steps = (most / family.per_step).max(1.0) as u64;
        let path = SampledPath::run(most_steps, scene, drive, &configuration, &reference);
        let error_m = path.as_ref().map(|path| path.apart(&reference) + reference.error_m);
        let meets = error_m.as_ref().is_ok_and(|e| *e <= tolerance_m * MEASURED_SHARE);
        tried.push(told(&configuration, &error_m, meets, best.is_some()));
        let ended = meets || matches!(error_m, Err(Failure::TooManySteps { .. }));
        let error_m = error_m.unwrap_or(f64::INFINITY);
        nearest_m = nearest_m.min(error_m);
        let steps = path.map_or(0, |path| path.steps);
        let work = steps as f64 * family.per_step;
        if !ended {
            family.refine(error_m / (tolerance_m * MEASURED_SHARE), steps);
            continue;
        }
        families.swap_remove(next);
        if meets && work < best.as_ref().map_or(f64::INFINITY, |best| best.0) {
            best = Some((work, configuration, error_m));
        }
    }
    match best {
        Some((_, configuration, error_m)) => Ok(Choice { configuration, error_m, tried }),
        None => Err(OutOfReach { tolerance_m, best_m: nearest_m, tried }),
    }
}

/// Returns the index of the family with the least expected work.
fn cheapest(families: &[MethodFamily]) -> Option<usize> {
    let by_work = |a: &usize, b: &usize| families[*a].work.total_cmp(&families[*b].work);
    (0..families.len()).min_by(by_work)
}

fn told(
    by: &Configuration,
    error_m: &Result<f64, &Failure>,
    meets: bool,
    after_another: bool,
) -> TriedCandidate {
    let pace = match by.pace() {
        Pace::Step(h) => format!("step {h:.0e} s"),
        Pace::Tolerance(tolerance) => format!("tolerance {tolerance:.0e} m"),
    };
    let verdict = match error_m {
        Ok(_) if meets => format!("{pace} meets it"),
        Ok(_) => format!("{pace} is too inaccurate"),
        Err(Failure::TooManySteps { .. }) if after_another => {
            format!("{pace} costs more than the cheapest so far")
        }
        Err(failure) => failure.to_string(),
    };
    let error_m = error_m.as_ref().ok().copied();
    TriedCandidate { model: by.model(), method: by.method(), error_m, verdict }
}

/// Positions of a run at the times of comparison, and its number of steps.
struct SampledPath {
    positions: Vec<Vector2<f64>>,
    steps: u64,
}

impl SampledPath {
    /// Runs `scene` by `configuration` in at most `most_steps`.
    fn run<D: Drive + Clone>(
        most_steps: u64,
        scene: &Scene,
        drive: &D,
        configuration: &Configuration,
        reference: &SampledReference,
    ) -> Result<Self, Failure> {
        let mut positions = Vec::with_capacity(reference.positions.len());
        let mut sink = |_: f64, at: &Motion| positions.push(at.position.xy());
        let mut samples = Samples::of_positions(reference.every_s, &mut sink);
        let samples = Some(&mut samples);
        let run = run_within(most_steps, scene, &mut drive.clone(), configuration, samples)?;
        Ok(Self { positions, steps: run.statistics.steps + run.statistics.rejected })
    }

    /// Returns the largest distance from the reference, m.
    fn apart(&self, reference: &SampledReference) -> f64 {
        let pairs = self.positions.iter().zip(&reference.positions);
        pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
    }
}

/// The scene in one pass.
struct SampledReference {
    positions: Vec<Vector2<f64>>,
    /// Interval of its positions, s.
    every_s: f64,
    /// Its wanted accuracy, m.
    error_m: f64,
    /// Whether the ball rolls to the end, except for creep.
    rolls: bool,
}

impl SampledReference {
    /// # Errors
    /// The best accuracy, m, for which there is a reference, and why it is not better.
    fn of<D: Drive + Clone>(scene: &Scene, drive: &D, error_m: f64) -> Result<Self, (f64, String)> {
        let rolls = rolls(scene, drive, error_m);
        let times = scene.duration_s / drive.shortest_time_s();
        let compared = if rolls {
            (COMPARED_PER_TIME * times).clamp(COMPARED_LEAST, COMPARED).round()
        } else {
            COMPARED
        };
        let every_s = (scene.duration_s / compared).max(SHORTEST_STEP_S);
        let mut positions = Vec::with_capacity(compared as usize + 1);
        let mut sink = |_: f64, at: &Motion| positions.push(at.position.xy());
        let mut samples = Samples::of_positions(every_s, &mut sink);
        match one_pass(scene, &mut drive.clone(), error_m, Some(&mut samples)) {
            Ok(_) => Ok(Self { positions, every_s, error_m, rolls }),
            Err(declined) => {
                let coarser = (1..16).map(|power| error_m * 10_f64.powi(power));
                let able =
                    |error_m: &f64| one_pass(scene, &mut drive.clone(), *error_m, None).is_ok();
                let best_m = coarser.take_while(|e| *e <= 1.0).find(able);
                Err((best_m.unwrap_or(f64::INFINITY) / REFERENCE_SHARE, declined.why))
            }
        }
    }
}

/// One method of one model, refined run by run.
struct MethodFamily {
    model: Model,
    method: Method,
    /// The next pace: a step, s, or a tolerance, m.
    value: f64,
    /// The finest pace.
    finest: f64,
    /// CPU time of a step, ns.
    per_step: f64,
    /// Expected work of the next run, ns.
    work: f64,
    /// Error of the last run over the allowed one, and its number of steps.
    over: f64,
    steps: u64,
}

impl MethodFamily {
    fn configuration(&self) -> Option<Configuration> {
        let pace =
            if self.method.adapts() { Pace::Tolerance(self.value) } else { Pace::Step(self.value) };
        Configuration::new(self.model, self.method, pace).ok()
    }

    /// Goes on to a finer pace after a run of so many steps with `over` times the allowed
    /// error. A fixed step is refined by what a method of order 2 needs, a tolerance by
    /// decades.
    fn refine(&mut self, over: f64, steps: u64) {
        // Where the pieces of the drive are shorter than its step, a run repeats the last one.
        let repeated = steps > 0 && steps == self.steps;
        let stays = !repeated && over > STAYS * self.over;
        let (before, work) = (self.value, steps as f64 * self.per_step);
        (self.over, self.steps) = (over, steps);
        if self.method.adapts() {
            self.value /= 10.0;
            // A method of order 4 or 5.
            self.work = self.work.max(work) * 10_f64.powf(0.2);
        } else {
            let jump = over.sqrt().clamp(1.0, LONGEST_JUMP);
            self.value = rounded_down((before / jump).min(0.9 * before));
            self.work = if repeated { work } else { work.max(self.work) * before / self.value };
        }
        // What stays as the method gets finer is the model's own error.
        if self.value < self.finest || stays && self.model != Model::Compliant {
            self.work = f64::INFINITY;
        }
    }
}

/// Returns the largest of 1, 2 and 5 times powers of ten that is at most `step`.
fn rounded_down(step: f64) -> f64 {
    let power = 10_f64.powf(step.log10().floor());
    let of = |n: &f64| n * power <= step * (1.0 + 1e-9);
    [5.0, 2.0, 1.0].into_iter().find(of).unwrap_or(0.5) * power
}

/// CPU times of one step, ns, measured on the machine of the charts.
const WORK_PLANAR: f64 = 20.0;
const WORK_MIDPOINT: f64 = 30.0;
const WORK_CONTACT_STEP: f64 = 60.0;
const WORK_DOPRI5: f64 = 500.0;
/// The sliding model locates slips, flights and landings.
const WORK_SLIDING: f64 = 1500.0;
const WORK_RODAS4: f64 = 1000.0;

/// Returns the families that may run `scene`, each at its coarsest pace.
fn families(
    scene: &Scene,
    time_s: f64,
    wanted_m: f64,
    reference: &SampledReference,
) -> Vec<MethodFamily> {
    let longest = scene.duration_s.min(LONGEST_PART * time_s);
    let (coarsest, over) = (scene.duration_s / longest, f64::INFINITY);
    let rolls = reference.rolls && matches!(scene.subject, Subject::Ball(_));
    let stepped = |model, method, per_step| {
        let value = rounded_down(longest.clamp(SHORTEST_STEP_S, LONGEST_STEP_S));
        let (finest, work) = (SHORTEST_STEP_S, scene.duration_s / value * per_step);
        MethodFamily { model, method, value, finest, per_step, work, over, steps: 0 }
    };
    let adapted = |model, method, per_step, coarser: f64| {
        let value = (wanted_m * coarser).clamp(FINEST_M, COARSEST_M);
        let finest = (wanted_m / 50.0).clamp(FINEST_M, 1e-3 * COARSEST_M);
        let work = coarsest * per_step;
        MethodFamily { model, method, value, finest, per_step, work, over, steps: 0 }
    };
    let mut all = vec![
        stepped(Model::Compliant, Method::ContactStep, WORK_CONTACT_STEP),
        // While a ball rolls, the contact's stiffness hardly matters to the error.
        adapted(Model::Compliant, Method::Rodas4, WORK_RODAS4, if rolls { 1000.0 } else { 10.0 }),
    ];
    if rolls {
        all.push(stepped(Model::Planar, Method::ZeroOrderHold, WORK_PLANAR));
        all.push(stepped(Model::Rolling, Method::Midpoint, WORK_MIDPOINT));
        all.push(adapted(Model::Rolling, Method::Dopri5, WORK_DOPRI5, 100.0));
        all.push(adapted(Model::Creeping, Method::Dopri5, WORK_DOPRI5, 100.0));
    } else if sag_m(scene) <= wanted_m {
        all.push(adapted(Model::Sliding, Method::Dopri5, WORK_SLIDING, 1.0));
    }
    all
}

/// Returns the sag of the body at rest on a level plate, m: the sliding model has none.
fn sag_m(scene: &Scene) -> f64 {
    scene.body().mass_kg() * GRAVITY_M_S2 / scene.contact.stiffness_n_per_m()
}
