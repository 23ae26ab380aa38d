//! Error and cost of one configuration on one scene.

use nalgebra::Vector2;

use super::Charted;
use super::record::Record;
use crate::scene::{Configuration, Failure, Method, Model, Pace, Samples, choose, run};
use crate::timing::{CpuTime, cpu_time};
use offbd_core::plant::Motion;

/// The truth: the compliant model by RODAS at this tolerance, m. Against an
/// independent solution (`tests/it/reference.rs`) it is within 1e-9 m.
const TRUTH_M: f64 = 1e-9;

/// Moments at which positions are compared.
const COMPARED: f64 = 200.0;

/// Steps charted, s.
pub(super) const STEPS_S: [f64; 13] =
    [1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1];

/// Tolerances charted, m.
pub(super) const TOLERANCES_M: [f64; 8] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9];

/// Accuracies asked of the automatic choice, m.
pub(super) const ASKED_M: [f64; 5] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6];

/// A scene with its truth.
pub(super) struct Bench {
    charted: Charted,
    truth: Vec<Vector2<f64>>,
    repeats: usize,
}

impl Bench {
    pub(super) fn new(charted: Charted, repeats: usize) -> Self {
        let pace = Pace::Tolerance(TRUTH_M);
        let truth = Configuration::new(Model::Compliant, Method::Rodas4, pace)
            .ok()
            .and_then(|tight| path(&charted, &tight).ok())
            .unwrap_or_default();
        Self { charted, truth, repeats }
    }

    /// Error and cost of `configuration`.
    pub(super) fn record(&self, configuration: &Configuration) -> Record {
        let (setting, value) = match configuration.pace() {
            Pace::Step(h) => ("step_s", h),
            Pace::Tolerance(tolerance) => ("tolerance_m", tolerance),
        };
        let (error, note) = match path(&self.charted, configuration) {
            Ok(path) => (Some(self.error(&path)), None),
            Err(failure) => (None, Some(failure.to_string())),
        };
        let cost = error.map(|_| self.cost(configuration));
        Record {
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
            choosing_us_per_s: None,
        }
    }

    /// What the program chooses for `asked_m`; none where nothing meets it.
    pub(super) fn chosen(&self, asked_m: f64) -> Option<Record> {
        let Charted { scene, laws, .. } = &self.charted;
        let choice = choose(scene, laws, asked_m).ok()?;
        let choosing = cpu_time(1, || {
            let _ = choose(scene, laws, asked_m);
        });
        Some(Record {
            asked_m: Some(asked_m),
            choosing_us_per_s: Some(choosing.us_per_s(scene.duration_s)),
            ..self.record(&choice.configuration)
        })
    }

    fn error(&self, path: &[Vector2<f64>]) -> f64 {
        let apart = path.iter().zip(&self.truth).map(|(a, b)| (a - b).norm());
        // A distance that is no number must not be lost.
        apart.fold(0.0, |worst, d| if d.is_nan() || d > worst { d } else { worst })
    }

    /// CPU time of a run without samples.
    fn cost(&self, configuration: &Configuration) -> CpuTime {
        let mut laws = self.charted.laws.clone();
        cpu_time(self.repeats, || {
            let _ = run(&self.charted.scene, &mut laws, configuration, None);
        })
    }
}

fn path(charted: &Charted, configuration: &Configuration) -> Result<Vec<Vector2<f64>>, Failure> {
    let mut path = Vec::new();
    let mut sink = |_: f64, at: &Motion| path.push(at.position.xy());
    let mut samples = Samples::new(charted.scene.duration_s / COMPARED, &mut sink);
    run(&charted.scene, &mut charted.laws.clone(), configuration, Some(&mut samples))?;
    Ok(path)
}

/// Every model by every method at every pace that makes sense: explicit steps
/// of the compliant model, and long ones of nothing else.
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

/// The shortest step charted, s: those below a fifth of a millisecond are for
/// the contact alone.
fn shortest(model: Model, quick: bool) -> f64 {
    match (model, quick) {
        (_, true) => 1e-3,
        (Model::Compliant, _) => 0.0,
        _ => 2e-4,
    }
}

/// Left to choose its steps, it creeps along the limit of stability.
fn is_stiffly_explicit(model: Model, method: Method) -> bool {
    model == Model::Compliant && method == Method::Dopri5
}
