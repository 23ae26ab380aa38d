//! Errors of the models in one scene.

use nalgebra::Vector2;

use crate::scene::{
    Configuration, Law, Laws, Method, Model, Pace, Samples, Scene, Subject, Term, run,
};
use offbd_core::plant::{Ball, Contact, Motion, Plate};

/// Duration of a scene, s; chosen.
pub(super) const DURATION_S: f64 = 1.0;

/// Interval between the times of comparison, s; chosen.
const EVERY_S: f64 = 0.01;

/// Tolerances of the two runs of the reference solution, m. Chosen: finer than the finest
/// accuracy charted, 1e-5 m.
const TRUTH_M: [f64; 2] = [1e-7, 1e-6];

/// Tolerance of the simpler models' own methods, m. Chosen so that the measured error is
/// that of the model.
const METHOD_M: f64 = 1e-7;
/// Step of the planar model, s; chosen likewise.
const PLANAR_STEP_S: f64 = 1e-4;

/// The simpler models, from the cheapest on.
pub(super) const SMALLER: [Model; 4] =
    [Model::Planar, Model::Rolling, Model::Creeping, Model::Sliding];

/// Positions at the times of comparison; empty if the run failed.
type ComparedPositions = Vec<Vector2<f64>>;

/// A scene with its reference solution.
pub(super) struct SceneWithTruth {
    pub scene: Scene,
    pub laws: Laws,
    truth: ComparedPositions,
}

/// Errors of the simpler models, m; infinite if a run failed.
pub(super) struct ModelErrors {
    /// Distance between the two runs of the reference solution, m.
    pub truth_spread: f64,
    smaller: [f64; 4],
}

impl ModelErrors {
    pub(super) fn by_model(&self) -> impl Iterator<Item = (Model, f64)> {
        SMALLER.into_iter().zip(self.smaller)
    }
}

/// Returns a scene with the ball at rest at the centre of an endless plate that swings
/// about y.
pub(super) fn swinging(contact: &Contact, amplitude: f64, frequency: f64) -> Option<(Scene, Laws)> {
    let ball = Subject::Ball(Ball::default());
    let scene = Scene::new(ball, Plate::default(), *contact, DURATION_S).ok()?;
    let sine = Term::Sine { amplitude, frequency, phase: 0.0 };
    Some((scene, Laws::new(Law::default(), Law::new(&[sine]), Vec::new())))
}

impl SceneWithTruth {
    /// Returns a scene that is not run, with infinite errors.
    pub(super) fn unknown(scene: Scene, laws: Laws) -> (Self, ModelErrors) {
        let errors = ModelErrors { truth_spread: f64::INFINITY, smaller: [f64::INFINITY; 4] };
        (Self { scene, laws, truth: ComparedPositions::new() }, errors)
    }

    /// Runs the reference solution and the simpler models.
    pub(super) fn measure(scene: Scene, laws: Laws) -> (Self, ModelErrors) {
        let [truth, coarser] = TRUTH_M.map(|tolerance| {
            let pace = Pace::Tolerance(tolerance);
            path(&scene, &laws, Model::Compliant, Method::Rodas4, pace)
        });
        let with_truth = Self { scene, laws, truth };
        let smaller = SMALLER.map(|model| {
            let pace = match model {
                Model::Planar => Pace::Step(PLANAR_STEP_S),
                _ => Pace::Tolerance(METHOD_M),
            };
            let path = path(&with_truth.scene, &with_truth.laws, model, model.usual_method(), pace);
            with_truth.off(&path)
        });
        let truth_spread = with_truth.off(&coarser);
        (with_truth, ModelErrors { truth_spread, smaller })
    }

    /// Returns the largest error of one configuration, m.
    pub(super) fn error(&self, configuration: &Configuration) -> f64 {
        self.off(&taken(&self.scene, &self.laws, configuration))
    }

    fn off(&self, path: &ComparedPositions) -> f64 {
        if path.len() != self.truth.len() {
            return f64::INFINITY;
        }
        let each = path.iter().zip(&self.truth).map(|(a, b)| (a - b).norm());
        each.fold(0.0, |worst: f64, off| if off.is_nan() { f64::INFINITY } else { worst.max(off) })
    }
}

fn path(scene: &Scene, laws: &Laws, model: Model, method: Method, pace: Pace) -> ComparedPositions {
    let configuration = Configuration::new(model, method, pace);
    configuration.map(|c| taken(scene, laws, &c)).unwrap_or_default()
}

fn taken(scene: &Scene, laws: &Laws, configuration: &Configuration) -> ComparedPositions {
    let mut path = ComparedPositions::new();
    let mut sink = |_: f64, at: &Motion| path.push(at.position.xy());
    let mut samples = Samples::new(EVERY_S, &mut sink);
    match run(scene, &mut laws.clone(), configuration, Some(&mut samples)) {
        Ok(_) => path,
        Err(_) => ComparedPositions::new(),
    }
}
