//! A scene, run: what was decided, what came of it, what to beware of.

use super::decide::{Decision, HowArgs};
use crate::cli::unusable::BadArgument;
use offbd_core::plant::Motion;
use offbd_lab::scene::{
    Configuration, Drive, Event, Failure, Method, Model, Outcome, Pace, Samples, Scene, Subject,
    Survey, run,
};
use offbd_lab::timing::cpu_once;

/// Most samples of one run, 80 bytes each. More are refused: a longer interval
/// is to be asked for.
const MOST_SAMPLES: f64 = 1e6;

/// Usual time between two samples, s, and samples of a short scene.
const SAMPLE_S: f64 = 0.01;
const LEAST_SAMPLES: f64 = 200.0;

/// Accuracy at which the sliding model looks for events, m.
const EVENTS_M: f64 = 1e-6;

/// A sample: its time, s, and the motion.
pub(super) type Sampled = (f64, Motion);

/// One scene, run.
#[derive(Debug)]
pub(super) struct Course {
    pub name: String,
    pub scene: Scene,
    pub decision: Decision,
    pub survey: Survey,
    pub outcome: Result<Outcome, Failure>,
    /// CPU time of the run, without samples, s.
    pub running_s: f64,
    pub samples: Vec<Sampled>,
    /// By the sliding model.
    pub events: Vec<Event>,
    pub warnings: Vec<String>,
}

/// How a course is to be made.
pub(super) struct Plan<'a> {
    pub how: &'a HowArgs,
    /// Time between two samples, s, if one was named.
    pub sample: Option<f64>,
    /// Whether samples are wanted at all.
    pub sampled: bool,
}

impl Plan<'_> {
    /// Runs `scene` under `drive`, which is left as the run leaves it.
    pub(super) fn run<D: Drive + Clone>(
        &self,
        name: &str,
        scene: &Scene,
        drive: &mut D,
    ) -> anyhow::Result<Course> {
        let every_s = self.every_s(scene)?;
        let decision = self.how.decide(scene, drive)?;
        let configuration = decision.configuration;
        let (survey, events) = look(scene, drive);
        let mut before = drive.clone();
        let (outcome, running_s) = cpu_once(|| run(scene, drive, &configuration, None));
        let mut samples = Vec::new();
        if self.sampled {
            let mut sink = |t: f64, at: &Motion| samples.push((t, *at));
            let mut taking = Samples::new(every_s, &mut sink);
            // The same run again: its result is known.
            let _ = run(scene, &mut before, &configuration, Some(&mut taking));
        }
        let asked = self.how.model.0.is_some() || self.how.method.0.is_some();
        let warnings =
            if asked { warnings(scene, &configuration, &survey, &events) } else { Vec::new() };
        let (name, scene) = (name.to_owned(), scene.clone());
        Ok(Course { name, scene, decision, survey, outcome, running_s, samples, events, warnings })
    }

    fn every_s(&self, scene: &Scene) -> Result<f64, BadArgument> {
        let usual = SAMPLE_S.min(scene.duration_s / LEAST_SAMPLES);
        let every_s = self.sample.unwrap_or(usual);
        if scene.duration_s / every_s <= MOST_SAMPLES {
            return Ok(every_s);
        }
        Err(BadArgument(format!(
            "--sample: {every_s} s makes over {MOST_SAMPLES} samples of {} s",
            scene.duration_s
        )))
    }
}

/// What the contact will have to bear, and what happens, by the model that
/// tells; nothing where that one fails.
fn look<D: Drive + Clone>(scene: &Scene, drive: &D) -> (Survey, Vec<Event>) {
    let survey = Survey::of(scene, &mut drive.clone());
    let sliding = Configuration::new(Model::Sliding, Method::Dopri5, Pace::Tolerance(EVENTS_M));
    let told = sliding.ok().and_then(|by| run(scene, &mut drive.clone(), &by, None).ok());
    (survey, told.map(|outcome| outcome.events).unwrap_or_default())
}

/// What a named model does not know of this scene.
fn warnings(
    scene: &Scene,
    configuration: &Configuration,
    survey: &Survey,
    events: &[Event],
) -> Vec<String> {
    let model = configuration.model();
    if !matches!(model, Model::Planar | Model::Rolling | Model::Creeping) {
        return Vec::new();
    }
    let first = events.iter().find(|event| event.what != "rolls");
    if let Some(event) = first {
        let what = event.what;
        return vec![format!(
            "the {model} model does not hold here: the ball {what} at {:.4} s by the sliding model",
            event.at_s
        )];
    }
    if survey.demand > 1.0 {
        return vec![format!(
            "the {model} model does not hold here: friction demand up to {:.2} of μ·F_z, above 1 \
             the ball slips",
            survey.demand
        )];
    }
    if !survey.starts_rolling && matches!(scene.subject, Subject::Ball(_)) {
        return vec![format!(
            "the {model} model does not hold here: the ball does not start rolling on the plate"
        )];
    }
    Vec::new()
}
