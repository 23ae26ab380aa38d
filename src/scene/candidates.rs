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

/// Part of the wanted accuracy that Dormand–Prince may use up.
const METHOD_SHARE: f64 = 0.1;

/// The coarsest tolerance of RODAS, m.
const COARSEST_M: f64 = 1e-2;

/// A configuration and its work, ns.
pub(super) type Candidate = (f64, Configuration);

/// The candidates for `wanted_m` on a plate that does something within
/// `time_s`, the least work first; without the rolling and the creeping ball
/// unless it `rolls`. None takes more work than the reference.
pub(super) fn candidates(
    scene: &Scene,
    time_s: f64,
    wanted_m: f64,
    rolls: bool,
    reference: &Reference,
) -> Vec<Candidate> {
    let most = reference.work();
    let time_s = time_s.min(scene.duration_s);
    let mut all = by_dopri5(scene, time_s, wanted_m, rolls);
    all.extend(by_contact_steps(scene, time_s, most));
    all.extend(by_rodas(reference));
    all.retain(|(work, _)| *work <= most);
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

fn by_dopri5(scene: &Scene, time_s: f64, wanted_m: f64, rolls: bool) -> Vec<Candidate> {
    let steps = (scene.duration_s / (LONGEST_PART * time_s)).ceil();
    let pace = Pace::Tolerance((wanted_m * METHOD_SHARE).clamp(1e-12, 1.0));
    let models = [
        (Model::Rolling, steps * WORK_DOPRI5),
        (Model::Creeping, steps * WORK_DOPRI5),
        (Model::Sliding, steps * WORK_SLIDING + WORK_EVENTS),
    ];
    let able = models.into_iter().filter(|(model, _)| rolls || *model == Model::Sliding);
    let configured = |model| Configuration::new(model, Method::Dopri5, pace).ok();
    able.filter_map(|(model, work)| Some((work, configured(model)?))).collect()
}

/// Steps of 1, 2 and 5 times powers of ten, from `time_s` down.
fn by_contact_steps(scene: &Scene, time_s: f64, most: f64) -> impl Iterator<Item = Candidate> {
    let decades = (-9..=1).rev().flat_map(|power| [5.0, 2.0, 1.0].map(|n| n * 10_f64.powi(power)));
    let duration = scene.duration_s;
    let steps = decades.map(move |h| (duration / h * WORK_CONTACT_STEP, h));
    let fits = move |(work, h): &(f64, f64)| *h <= time_s && *work <= most;
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
