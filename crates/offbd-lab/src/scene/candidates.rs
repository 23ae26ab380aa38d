//! Lists the configurations that may run a scene, with their expected work.

use super::Scene;
use super::configuration::{Configuration, Method, Model, Pace};
use super::reference::{ReferenceSolution, rodas};
use super::run::LONGEST_PART;

/// CPU time of one contact step, ns, measured on the machine of the charts.
pub(super) const WORK_CONTACT_STEP: f64 = 80.0;
/// CPU time of one Dormand–Prince step of a rolling ball, ns, measured likewise.
pub(super) const WORK_DOPRI5: f64 = 500.0;
/// CPU time of one Dormand–Prince step of the sliding model, ns, measured likewise.
const WORK_SLIDING: f64 = 700.0;

/// CPU time in which the sliding model locates a slip, a flight and a landing, ns,
/// measured on the machine of the charts.
const WORK_EVENTS: f64 = 10_000.0;

/// Finest tolerance of Dormand–Prince as a fraction of the wanted accuracy. Its error
/// estimates are those of the fourth-order solution and add up without cancelling: the
/// error of the fifth-order solution has never been observed to exceed them.
pub(super) const METHOD_SHARE: f64 = 0.1;

/// Tolerances at which Dormand–Prince is tried, as multiples of its finest one:
/// decades, chosen.
const COARSER: [f64; 4] = [1000.0, 100.0, 10.0, 1.0];
/// Estimated growth of the work from each of these tolerances to the next finer one.
const GROWTH: f64 = 1.5;

/// The coarsest tolerance of RODAS, m; chosen.
const COARSEST_M: f64 = 1e-2;

/// A scene to be run.
pub(super) struct Task<'a> {
    pub scene: &'a Scene,
    /// The shortest time scale of the plate's motion, s.
    pub time_s: f64,
    /// The wanted accuracy, m.
    pub wanted_m: f64,
}

/// Expected work, ns, and a configuration.
type Candidate = (f64, Configuration);

/// Returns the candidates of a scene for which `model`, the rolling or the creeping
/// ball, is accurate enough, in ascending order of work; the last one is `model` at its
/// finest tolerance.
pub(super) fn smooth(task: &Task<'_>, model: Model) -> Vec<Candidate> {
    let mut all = by_dopri5(task, model);
    let most = all.last().map_or(0.0, |finest| finest.0);
    all.extend(by_contact_steps(task, most));
    ordered(all, most)
}

/// Returns the candidates of a scene of which only the `reference` is known, in
/// ascending order of work, none with more work than the reference; with the rolling
/// and the creeping ball only if the ball `rolls`.
pub(super) fn any(task: &Task<'_>, rolls: bool, reference: &ReferenceSolution) -> Vec<Candidate> {
    let mut all = Vec::new();
    if rolls {
        all.extend(by_dopri5(task, Model::Rolling));
        all.extend(by_dopri5(task, Model::Creeping));
    }
    let finest = finest(Model::Sliding, task.wanted_m);
    all.extend(finest.map(|finest| (task.dopri5_steps() * WORK_SLIDING + WORK_EVENTS, finest)));
    all.extend(by_contact_steps(task, reference.work));
    all.extend(by_rodas(reference));
    ordered(all, reference.work)
}

fn ordered(mut all: Vec<Candidate>, most: f64) -> Vec<Candidate> {
    all.retain(|(work, _)| *work <= most);
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

/// Returns `model` by Dormand–Prince at its finest tolerance, at which the method's
/// error is negligible.
pub(super) fn finest(model: Model, wanted_m: f64) -> Option<Configuration> {
    dopri5(model, wanted_m * METHOD_SHARE)
}

fn dopri5(model: Model, tolerance_m: f64) -> Option<Configuration> {
    let pace = Pace::Tolerance(tolerance_m.clamp(1e-12, 1.0));
    Configuration::new(model, Method::Dopri5, pace).ok()
}

impl Task<'_> {
    /// Returns the minimum number of Dormand–Prince steps.
    fn dopri5_steps(&self) -> f64 {
        (self.scene.duration_s / (LONGEST_PART * self.time_s)).ceil().max(1.0)
    }
}

fn by_dopri5(task: &Task<'_>, model: Model) -> Vec<Candidate> {
    let (least, finest) = (task.dopri5_steps() * WORK_DOPRI5, task.wanted_m * METHOD_SHARE);
    let paces = COARSER.into_iter().zip(0..);
    paces
        .filter_map(|(coarser, finer)| {
            Some((least * GROWTH.powi(finer), dopri5(model, finest * coarser)?))
        })
        .collect()
}

/// Returns the contact step at step sizes of 1, 2 and 5 times powers of ten.
fn by_contact_steps(task: &Task<'_>, most: f64) -> impl Iterator<Item = Candidate> {
    let decades = (-9..=1).rev().flat_map(|power| [5.0, 2.0, 1.0].map(|n| n * 10_f64.powi(power)));
    let duration = task.scene.duration_s;
    let longest = duration.min(task.time_s);
    let steps = decades.map(move |h| (duration / h * WORK_CONTACT_STEP, h));
    let fits = move |(work, h): &(f64, f64)| *h <= longest && *work <= most;
    steps.filter(fits).filter_map(|(work, h)| {
        let pace = Pace::Step(h);
        Some((work, Configuration::new(Model::Compliant, Method::ContactStep, pace).ok()?))
    })
}

/// Returns RODAS at tolerances from the reference's up, by factors of ten.
fn by_rodas(reference: &ReferenceSolution) -> impl Iterator<Item = Candidate> {
    let tolerances = (0..).map(|power| reference.tolerance_m * 10_f64.powi(power));
    tolerances
        .take_while(|tolerance| *tolerance <= COARSEST_M * 1.1)
        .filter_map(|tolerance| Some((reference.work_at(tolerance), rodas(tolerance)?)))
}
