//! Errors of the models over one scene.

use nalgebra::Vector2;

use crate::scene::{
    Configuration, Law, Laws, Method, Model, Pace, Samples, Scene, Subject, Term, run,
};
use offbd_core::plant::{Ball, Contact, Motion, Plate};

/// Length of a scene, s.
pub(super) const DURATION_S: f64 = 1.0;

/// Time between the moments of comparison, s.
const EVERY_S: f64 = 0.01;

/// Accuracies asked of the truth's two runs, m.
const TRUTH_M: [f64; 2] = [1e-7, 1e-6];

/// Accuracy asked of the models' own methods, m, and the step of the planar
/// model, s: an error that shows is the model's.
const METHOD_M: f64 = 1e-7;
const PLANAR_STEP_S: f64 = 1e-4;

/// The smaller models, from the cheapest on.
pub(super) const SMALLER: [Model; 4] =
    [Model::Planar, Model::Rolling, Model::Creeping, Model::Sliding];

/// Positions at the moments of comparison; shorter where a run ended early.
type Path = Vec<Vector2<f64>>;

/// A scene with its truth.
pub(super) struct Course {
    pub scene: Scene,
    pub laws: Laws,
    truth: Path,
}

/// What the smaller models are off by, m; infinite where there is no number.
pub(super) struct Errors {
    /// How far two runs of the truth differ, m.
    pub truth_spread: f64,
    smaller: [f64; 4],
}

impl Errors {
    pub(super) fn by_model(&self) -> impl Iterator<Item = (Model, f64)> {
        SMALLER.into_iter().zip(self.smaller)
    }
}

/// The ball at rest at the centre of an endless plate that swings about y.
pub(super) fn swinging(contact: &Contact, amplitude: f64, frequency: f64) -> Option<(Scene, Laws)> {
    let ball = Subject::Ball(Ball::default());
    let scene = Scene::new(ball, Plate::default(), *contact, DURATION_S).ok()?;
    let sine = Term::Sine { amplitude, frequency, phase: 0.0 };
    Some((scene, Laws::new(Law::default(), Law::new(&[sine]), Vec::new())))
}

impl Course {
    /// A scene that is not run: nothing is known of it.
    pub(super) fn unknown(scene: Scene, laws: Laws) -> (Self, Errors) {
        let errors = Errors { truth_spread: f64::INFINITY, smaller: [f64::INFINITY; 4] };
        (Self { scene, laws, truth: Path::new() }, errors)
    }

    /// Runs the truth and the smaller models.
    pub(super) fn measure(scene: Scene, laws: Laws) -> (Self, Errors) {
        let [truth, coarser] = TRUTH_M.map(|tolerance| {
            let pace = Pace::Tolerance(tolerance);
            path(&scene, &laws, Model::Compliant, Method::Rodas4, pace)
        });
        let course = Self { scene, laws, truth };
        let smaller = SMALLER.map(|model| {
            let pace = match model {
                Model::Planar => Pace::Step(PLANAR_STEP_S),
                _ => Pace::Tolerance(METHOD_M),
            };
            let path = path(&course.scene, &course.laws, model, model.usual_method(), pace);
            course.off(&path)
        });
        let truth_spread = course.off(&coarser);
        (course, Errors { truth_spread, smaller })
    }

    /// The worst error of one configuration, m.
    pub(super) fn error(&self, configuration: &Configuration) -> f64 {
        self.off(&taken(&self.scene, &self.laws, configuration))
    }

    fn off(&self, path: &Path) -> f64 {
        if path.len() != self.truth.len() {
            return f64::INFINITY;
        }
        let each = path.iter().zip(&self.truth).map(|(a, b)| (a - b).norm());
        each.fold(0.0, |worst: f64, off| if off.is_nan() { f64::INFINITY } else { worst.max(off) })
    }
}

fn path(scene: &Scene, laws: &Laws, model: Model, method: Method, pace: Pace) -> Path {
    let configuration = Configuration::new(model, method, pace);
    configuration.map(|c| taken(scene, laws, &c)).unwrap_or_default()
}

fn taken(scene: &Scene, laws: &Laws, configuration: &Configuration) -> Path {
    let mut path = Path::new();
    let mut sink = |_: f64, at: &Motion| path.push(at.position.xy());
    let mut samples = Samples::new(EVERY_S, &mut sink);
    match run(scene, &mut laws.clone(), configuration, Some(&mut samples)) {
        Ok(_) => path,
        Err(_) => Path::new(),
    }
}
