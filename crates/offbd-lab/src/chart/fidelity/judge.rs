//! The choice beside the truth: never too cheap, and how often too dear.

use std::hint::black_box;

use serde::Serialize;

use super::errors::{Course, Errors, SMALLER, swinging};
use crate::scene::{Configuration, Method, Model, Pace, choose, run};
use crate::timing::cpu_time;
use offbd_core::plant::Contact;

/// Plates that turn with more than this, rad/s², are not run: they throw the
/// ball about at once, over hundreds of metres, as no plate of this kind does.
const VIOLENT_RAD_S2: f64 = 150.0;

fn is_violent(amplitude: f64, frequency: f64) -> bool {
    amplitude * (std::f64::consts::TAU * frequency).powi(2) > VIOLENT_RAD_S2
}

/// Accuracies wanted, m.
pub(super) const TOLERANCES_M: [f64; 3] = [1e-3, 1e-4, 1e-5];

/// Two runs of the truth that differ by more than this part of the finest
/// accuracy are none: the ball is thrown about, and neighbours part.
const TRUTH_SHARE: f64 = 0.2;

/// A model that costs less than this times the cheapest is as cheap.
const AS_CHEAP: f64 = 1.5;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Verdict {
    /// The truth itself is not known well enough.
    NoTruth,
    /// Nothing was chosen: out of reach.
    NothingChosen,
    /// The chosen run is off by more than wanted.
    TooCheap,
    /// A cheaper one would have done.
    TooDear,
    Right,
}

/// One accuracy in one cell.
pub(super) struct Judged {
    pub cheapest: Option<Model>,
    pub chosen: Option<Configuration>,
    pub error: Option<f64>,
    pub verdict: Verdict,
    pub cost_factor: Option<f64>,
}

/// One amplitude and frequency on one contact.
pub(super) struct Cell {
    pub amplitude: f64,
    pub frequency: f64,
    pub errors: Errors,
    pub judged: Vec<Judged>,
}

impl Cell {
    pub(super) fn measure(contact: &Contact, amplitude: f64, frequency: f64) -> Self {
        let (scene, laws) = swinging(contact, amplitude, frequency)
            .unwrap_or_else(|| unreachable!("the ranges are within a scene's"));
        let (course, errors) = if is_violent(amplitude, frequency) {
            Course::unknown(scene, laws)
        } else {
            Course::measure(scene, laws)
        };
        let judged = TOLERANCES_M.iter().map(|&tolerance| judged(&course, &errors, tolerance));
        let judged = judged.collect();
        Self { amplitude, frequency, errors, judged }
    }

    /// Whether the truth is known well enough to judge by.
    pub(super) fn has_truth(&self, tolerance: f64) -> bool {
        self.errors.truth_spread <= TRUTH_SHARE * tolerance
    }
}

fn judged(course: &Course, errors: &Errors, tolerance: f64) -> Judged {
    let none = Judged {
        cheapest: None,
        chosen: None,
        error: None,
        verdict: Verdict::NoTruth,
        cost_factor: None,
    };
    if errors.truth_spread > TRUTH_SHARE * tolerance {
        return none;
    }
    let meets = errors.by_model().find(|(_, error)| *error <= tolerance);
    let cheapest = Some(meets.map_or(Model::Compliant, |(model, _)| model));
    let Ok(choice) = choose(&course.scene, &course.laws, tolerance) else {
        return Judged { cheapest, verdict: Verdict::NothingChosen, ..none };
    };
    let configuration = choice.configuration;
    let error = course.error(&configuration);
    let cost = cost_s(course, &configuration);
    let least = least_cost_s(course, tolerance).map_or(cost, |least| least.min(cost));
    let factor = cost / least;
    let verdict = if error > tolerance {
        Verdict::TooCheap
    } else if factor > AS_CHEAP {
        Verdict::TooDear
    } else {
        Verdict::Right
    };
    let (chosen, error) = (Some(configuration), Some(error));
    Judged { cheapest, chosen, error, verdict, cost_factor: Some(factor) }
}

/// CPU time of one run, s.
fn cost_s(course: &Course, configuration: &Configuration) -> f64 {
    let one = || {
        black_box(run(&course.scene, &mut course.laws.clone(), configuration, None).is_ok());
    };
    cpu_time(1, one).minimum_s
}

/// The least CPU time of what meets `tolerance`, each model at its coarsest
/// pace that does, s.
fn least_cost_s(course: &Course, tolerance: f64) -> Option<f64> {
    let candidates = SMALLER.into_iter().chain([Model::Compliant]);
    let coarsest = candidates.filter_map(|model| {
        let paces = paces(model, tolerance).into_iter();
        let able = paces.filter_map(|(method, pace)| Configuration::new(model, method, pace).ok());
        able.into_iter().find(|configuration| course.error(configuration) <= tolerance)
    });
    coarsest.map(|configuration| cost_s(course, &configuration)).reduce(f64::min)
}

/// Paces of a model to try, from the coarsest on.
fn paces(model: Model, tolerance: f64) -> Vec<(Method, Pace)> {
    let steps = |method, coarsest: f64, n: i32| -> Vec<(Method, Pace)> {
        (0..n).map(|i| (method, Pace::Step(coarsest / 2_f64.powi(i)))).collect()
    };
    match model {
        Model::Planar => steps(Method::ZeroOrderHold, 0.04, 7),
        Model::Compliant => steps(Method::ContactStep, 0.01, 9),
        _ => [100.0, 10.0, 1.0].map(|f| (Method::Dopri5, Pace::Tolerance(f * tolerance))).to_vec(),
    }
}

/// How the cells of one contact were decided for one accuracy.
pub(super) struct Tally {
    /// Cells with a truth.
    pub judged: usize,
    pub too_cheap: usize,
    pub too_dear: usize,
    /// Of the cells decided too dear; 1 where there is none.
    pub median_factor: f64,
    pub worst_factor: f64,
}

impl Tally {
    pub(super) fn of(cells: &[Cell], k: usize) -> Self {
        let count = |verdict| cells.iter().filter(|c| c.judged[k].verdict == verdict).count();
        let dear = cells.iter().map(|c| &c.judged[k]).filter(|j| j.verdict == Verdict::TooDear);
        let mut factors: Vec<f64> = dear.filter_map(|judged| judged.cost_factor).collect();
        Self {
            judged: cells.len() - count(Verdict::NoTruth),
            too_cheap: count(Verdict::TooCheap),
            too_dear: count(Verdict::TooDear),
            worst_factor: factors.iter().copied().fold(1.0, f64::max),
            median_factor: offbd_core::maths::median(&mut factors).unwrap_or(1.0),
        }
    }
}
