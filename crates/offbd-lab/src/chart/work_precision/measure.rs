//! Error and cost of one configuration on one scene.

use nalgebra::Vector2;

use super::ChartedScene;
use super::record::WorkPrecisionRecord;
use crate::scene::{Configuration, Failure, Method, Model, Pace, Samples, one_pass, run};
use crate::timing::{CpuTime, cpu_time};
use offbd_core::plant::Motion;

/// Tolerance of the reference solution, the compliant model by RODAS, m. It agrees with an
/// independent solution (`tests/it/reference.rs`) within 1e-9 m.
const TRUTH_M: f64 = 1e-9;

/// Number of intervals at whose ends positions are compared; chosen.
const COMPARED: f64 = 200.0;

/// Steps charted, s.
pub(super) const STEPS_S: [f64; 13] =
    [1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1];

/// Tolerances charted, m.
pub(super) const TOLERANCES_M: [f64; 8] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9];

/// Accuracies requested from runs in one pass, m.
pub(super) const ASKED_M: [f64; 5] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6];

/// A scene with its reference solution, on which configurations are measured.
pub(super) struct SceneBenchmark {
    charted: ChartedScene,
    truth: Vec<Vector2<f64>>,
    repeats: usize,
}

impl SceneBenchmark {
    pub(super) fn new(charted: ChartedScene, repeats: usize) -> Self {
        let pace = Pace::Tolerance(TRUTH_M);
        let truth = Configuration::new(Model::Compliant, Method::Rodas4, pace)
            .ok()
            .and_then(|tight| path(&charted, &tight).ok())
            .unwrap_or_default();
        Self { charted, truth, repeats }
    }

    /// Measures error and cost of `configuration`.
    pub(super) fn record(&self, configuration: &Configuration) -> WorkPrecisionRecord {
        let (setting, value) = match configuration.pace() {
            Pace::Step(h) => ("step_s", h),
            Pace::Tolerance(tolerance) => ("tolerance_m", tolerance),
        };
        let (error, note) = match path(&self.charted, configuration) {
            Ok(path) => (Some(self.error(&path)), None),
            Err(failure) => (None, Some(failure.to_string())),
        };
        let cost = error.map(|_| self.cost(configuration));
        WorkPrecisionRecord {
            scene: self.charted.name.clone(),
            engine: "offbd".to_owned(),
            model: configuration.model().to_string(),
            method: configuration.method().to_string(),
            setting: setting.to_owned(),
            value,
            error_m: error.filter(|e| e.is_finite()),
            cpu_us_per_s: cost.map(|c| c.us_per_s(self.charted.scene.duration_s)),
            spread: cost.map(|c| c.spread()),
            note,
            front: false,
            asked_m: None,
        }
    }

    /// Measures a run in one pass within `asked_m`; `None` if it is declined. The cost is that
    /// of everything: there is nothing to choose before.
    pub(super) fn in_one_pass(&self, asked_m: f64) -> Option<WorkPrecisionRecord> {
        let ChartedScene { name, scene, laws } = &self.charted;
        let mut path = Vec::new();
        let mut sink = |_: f64, at: &Motion| path.push(at.position.xy());
        let mut samples = Samples::new(scene.duration_s / COMPARED, &mut sink);
        let mut laws = laws.clone();
        let run = one_pass(scene, &mut laws, asked_m, Some(&mut samples)).ok()?;
        let cost = cpu_time(self.repeats, || {
            let _ = std::hint::black_box(one_pass(scene, &mut laws, asked_m, None));
        });
        let models: Vec<&str> = run.stages.iter().map(|stage| stage.model).collect();
        Some(WorkPrecisionRecord {
            scene: name.clone(),
            engine: "offbd".to_owned(),
            model: models.join(", "),
            method: "one-pass".to_owned(),
            setting: "tolerance_m".to_owned(),
            value: asked_m,
            error_m: Some(self.error(&path)),
            cpu_us_per_s: Some(cost.us_per_s(scene.duration_s)),
            spread: Some(cost.spread()),
            note: None,
            front: false,
            asked_m: Some(asked_m),
        })
    }

    fn error(&self, path: &[Vector2<f64>]) -> f64 {
        let apart = path.iter().zip(&self.truth).map(|(a, b)| (a - b).norm());
        // NaN must propagate: `max` would drop it.
        apart.fold(0.0, |worst, d| if d.is_nan() || d > worst { d } else { worst })
    }

    /// Measures the CPU time of a run without samples.
    fn cost(&self, configuration: &Configuration) -> CpuTime {
        let mut laws = self.charted.laws.clone();
        cpu_time(self.repeats, || {
            let _ = run(&self.charted.scene, &mut laws, configuration, None);
        })
    }
}

fn path(
    charted: &ChartedScene,
    configuration: &Configuration,
) -> Result<Vec<Vector2<f64>>, Failure> {
    let mut path = Vec::new();
    let mut sink = |_: f64, at: &Motion| path.push(at.position.xy());
    let mut samples = Samples::new(charted.scene.duration_s / COMPARED, &mut sink);
    run(&charted.scene, &mut charted.laws.clone(), configuration, Some(&mut samples))?;
    Ok(path)
}

/// Returns every model by every method at the charted paces: tolerances for adaptive
/// methods, else steps; short steps for the compliant model only.
pub(super) fn configurations(quick: bool) -> Vec<Configuration> {
    let thin = |i: usize| !quick || i.is_multiple_of(3);
    let mut all = Vec::new();
    for model in Model::ALL {
        for &method in model.methods() {
            let steps = STEPS_S
                .iter()
                .enumerate()
                .filter(|(i, h)| thin(*i) && **h >= shortest(model, quick));
            let tolerances = TOLERANCES_M.iter().enumerate().filter(|(i, _)| thin(*i));
            let paces: Vec<Pace> = if method.adapts() && !is_stiffly_explicit(model, method) {
                tolerances.map(|(_, tolerance)| Pace::Tolerance(*tolerance)).collect()
            } else {
                steps.map(|(_, h)| Pace::Step(*h)).collect()
            };
            all.extend(paces.into_iter().filter_map(|p| Configuration::new(model, method, p).ok()));
        }
    }
    all
}

/// Returns the shortest step charted, s: only the compliant contact needs steps below
/// 0.2 ms.
fn shortest(model: Model, quick: bool) -> f64 {
    match (model, quick) {
        (_, true) => 1e-3,
        (Model::Compliant, _) => 0.0,
        _ => 2e-4,
    }
}

/// Returns whether an explicit method would adapt its steps to the limit of stability of
/// the stiff contact; it is charted with fixed steps instead.
fn is_stiffly_explicit(model: Model, method: Method) -> bool {
    model == Model::Compliant && method == Method::Dopri5
}
