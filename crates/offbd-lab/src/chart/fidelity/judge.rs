//! Judges the automatic choice against the reference solution: whether it is ever too
//! inaccurate, and how often more expensive than necessary.

use std::hint::black_box;

use serde::Serialize;

use super::errors::{ModelErrors, SMALLER, SceneWithTruth, swinging};
use crate::scene::{Configuration, Method, Model, Pace, choose, run};
use crate::timing::cpu_time;
use offbd_core::plant::Contact;

/// Maximum angular acceleration of a plate that is run, rad/s². Chosen: beyond it the
/// plate throws the ball over hundreds of metres, which no real plate does.
const VIOLENT_RAD_S2: f64 = 150.0;

fn is_violent(amplitude: f64, frequency: f64) -> bool {
    amplitude * (std::f64::consts::TAU * frequency).powi(2) > VIOLENT_RAD_S2
}

/// The wanted accuracies, m; chosen.
pub(super) const TOLERANCES_M: [f64; 3] = [1e-3, 1e-4, 1e-5];

/// Maximum distance between the two runs of the reference solution as a share of the wanted
/// accuracy. Chosen: with a larger one the motion is chaotic and there is no reference.
const TRUTH_SHARE: f64 = 0.2;

/// Ratio of CPU times up to which a choice counts as being as cheap as the cheapest;
/// chosen.
const AS_CHEAP: f64 = 1.5;

/// The verdict on an automatic choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ChoiceVerdict {
    /// The reference solution is not accurate enough.
    NoTruth,
    /// No candidate met the tolerance.
    NothingChosen,
    /// The error of the chosen run is larger than wanted.
    TooCheap,
    /// A cheaper configuration is accurate enough.
    TooDear,
    Right,
}

/// The choice for one accuracy in one cell.
pub(super) struct JudgedChoice {
    pub cheapest: Option<Model>,
    pub chosen: Option<Configuration>,
    pub error: Option<f64>,
    pub verdict: ChoiceVerdict,
    pub cost_factor: Option<f64>,
}

/// The results for one amplitude and frequency on one contact.
pub(super) struct MotionCell {
    pub amplitude: f64,
    pub frequency: f64,
    pub errors: ModelErrors,
    pub judged: Vec<JudgedChoice>,
}

impl MotionCell {
    pub(super) fn measure(contact: &Contact, amplitude: f64, frequency: f64) -> Self {
        let (scene, laws) = swinging(contact, amplitude, frequency)
            .unwrap_or_else(|| unreachable!("the ranges are within a scene's"));
        let (truth, errors) = if is_violent(amplitude, frequency) {
            SceneWithTruth::unknown(scene, laws)
        } else {
            SceneWithTruth::measure(scene, laws)
        };
        let judged = TOLERANCES_M.iter().map(|&tolerance| judged(&truth, &errors, tolerance));
        let judged = judged.collect();
        Self { amplitude, frequency, errors, judged }
    }

    /// Returns whether the reference solution is accurate enough for `tolerance`.
    pub(super) fn has_truth(&self, tolerance: f64) -> bool {
        self.errors.truth_spread <= TRUTH_SHARE * tolerance
    }
}

fn judged(truth: &SceneWithTruth, errors: &ModelErrors, tolerance: f64) -> JudgedChoice {
    let none = JudgedChoice {
        cheapest: None,
        chosen: None,
        error: None,
        verdict: ChoiceVerdict::NoTruth,
        cost_factor: None,
    };
    if errors.truth_spread > TRUTH_SHARE * tolerance {
        return none;
    }
    let meets = errors.by_model().find(|(_, error)| *error <= tolerance);
    let cheapest = Some(meets.map_or(Model::Compliant, |(model, _)| model));
    let Ok(choice) = choose(&truth.scene, &truth.laws, tolerance) else {
        return JudgedChoice { cheapest, verdict: ChoiceVerdict::NothingChosen, ..none };
    };
    let configuration = choice.configuration;
    let error = truth.error(&configuration);
    let cost = cost_s(truth, &configuration);
    let least = least_cost_s(truth, tolerance).map_or(cost, |least| least.min(cost));
    let factor = cost / least;
    let verdict = if error > tolerance {
        ChoiceVerdict::TooCheap
    } else if factor > AS_CHEAP {
        ChoiceVerdict::TooDear
    } else {
        ChoiceVerdict::Right
    };
    let (chosen, error) = (Some(configuration), Some(error));
    JudgedChoice { cheapest, chosen, error, verdict, cost_factor: Some(factor) }
}

/// Measures the CPU time of one run, s.
fn cost_s(truth: &SceneWithTruth, configuration: &Configuration) -> f64 {
    let one = || {
        black_box(run(&truth.scene, &mut truth.laws.clone(), configuration, None).is_ok());
    };
    cpu_time(1, one).minimum_s
}

/// Returns the minimum CPU time, s, over all models that meet `tolerance`, each with the
/// coarsest pace that does.
fn least_cost_s(truth: &SceneWithTruth, tolerance: f64) -> Option<f64> {
    let candidates = SMALLER.into_iter().chain([Model::Compliant]);
    let coarsest = candidates.filter_map(|model| {
        let paces = paces(model, tolerance).into_iter();
        let able = paces.filter_map(|(method, pace)| Configuration::new(model, method, pace).ok());
        able.into_iter().find(|configuration| truth.error(configuration) <= tolerance)
    });
    coarsest.map(|configuration| cost_s(truth, &configuration)).reduce(f64::min)
}

/// Returns methods and paces of a model to try, from the coarsest on.
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

/// Counts of the verdicts over the cells of one contact for one accuracy.
pub(super) struct DecisionCounts {
    /// Number of cells with a reference solution.
    pub judged: usize,
    pub too_cheap: usize,
    pub too_dear: usize,
    /// Median ratio of CPU times over the cells that are too expensive; 1 if there is none.
    pub median_factor: f64,
    /// Largest ratio of CPU times.
    pub worst_factor: f64,
}

impl DecisionCounts {
    pub(super) fn of(cells: &[MotionCell], k: usize) -> Self {
        let count = |verdict| cells.iter().filter(|c| c.judged[k].verdict == verdict).count();
        let dear =
            cells.iter().map(|c| &c.judged[k]).filter(|j| j.verdict == ChoiceVerdict::TooDear);
        let mut factors: Vec<f64> = dear.filter_map(|judged| judged.cost_factor).collect();
        Self {
            judged: cells.len() - count(ChoiceVerdict::NoTruth),
            too_cheap: count(ChoiceVerdict::TooCheap),
            too_dear: count(ChoiceVerdict::TooDear),
            worst_factor: factors.iter().copied().fold(1.0, f64::max),
            median_factor: offbd_core::maths::median(&mut factors).unwrap_or(1.0),
        }
    }
}
