//! What may run a scene, with the work that it is expected to take.

use super::Scene;
use super::configuration::{Configuration, Method, Model, Pace};
use super::reference::{Reference, rodas};
use super::run::LONGEST_PART;

/// Times of one step, ns on the machine of the charts.
pub(super) const WORK_CONTACT_STEP: f64 = 80.0;
pub(super) const WORK_DOPRI5: f64 = 500.0;
const WORK_SLIDING: f64 = 700.0;

/// Time that the sliding model spends on finding a slip, a flight and a
/// landing, ns on the machine of the charts.
const WORK_EVENTS: f64 = 10_000.0;

/// Part of the tolerance at which Dormand–Prince runs at its finest. Its
/// estimates are of the fourth-order solution and add up without cancelling:
/// the fifth-order one has never been seen to be off by more.
pub(super) const METHOD_SHARE: f64 = 0.1;

/// It is tried at so many times that as well, and each takes about
/// [`GROWTH`] times the work of the one before.
const COARSER: [f64; 4] = [1000.0, 100.0, 10.0, 1.0];
const GROWTH: f64 = 1.5;

/// The coarsest tolerance of RODAS, m.
const COARSEST_M: f64 = 1e-2;

/// What is to be run.
pub(super) struct Task<'a> {
    pub scene: &'a Scene,
    /// The plate does something of its own within this time, s.
    pub time_s: f64,
    /// The accuracy, m.
    pub wanted_m: f64,
}

/// A configuration and its work, ns.
type Candidate = (f64, Configuration);

/// The candidates where `model`, the rolling or the creeping ball, will do: the
/// least work first, its finest steps last.
pub(super) fn smooth(task: &Task<'_>, model: Model) -> Vec<Candidate> {
    let mut all = by_dopri5(task, model);
    let most = all.last().map_or(0.0, |finest| finest.0);
    all.extend(by_contact_steps(task, most));
    ordered(all, most)
}

/// The candidates where nothing is known but the `reference`, the least work
/// first, none with more than its own; without the rolling and the creeping
/// ball unless it `rolls`.
pub(super) fn any(task: &Task<'_>, rolls: bool, reference: &Reference) -> Vec<Candidate> {
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

/// `model` by Dormand–Prince with steps so short that they do not matter.
pub(super) fn finest(model: Model, wanted_m: f64) -> Option<Configuration> {
    dopri5(model, wanted_m * METHOD_SHARE)
}

fn dopri5(model: Model, tolerance_m: f64) -> Option<Configuration> {
    let pace = Pace::Tolerance(tolerance_m.clamp(1e-12, 1.0));
    Configuration::new(model, Method::Dopri5, pace).ok()
}

impl Task<'_> {
    /// The least number of steps of Dormand–Prince.
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

/// Steps of 1, 2 and 5 times powers of ten.
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

/// Tolerances from the reference's up, by tens.
fn by_rodas(reference: &Reference) -> impl Iterator<Item = Candidate> {
    let tolerances = (0..).map(|power| reference.tolerance_m * 10_f64.powi(power));
    tolerances
        .take_while(|tolerance| *tolerance <= COARSEST_M * 1.1)
        .filter_map(|tolerance| Some((reference.work_at(tolerance), rodas(tolerance)?)))
}
