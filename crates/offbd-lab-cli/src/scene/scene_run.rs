//! Runs a scene: the decision, the result, and warnings.

use super::decide::{ConfigurationArgs, Decision, NoModelMeets, TOLERANCE_M};
use super::words;
use offbd_core::plant::{GRAVITY_M_S2, Motion};
use offbd_lab::scene::{
    Configuration, Drive, Event, Failure, Method, Model, OnePass, Pace, RunOutcome, Samples, Scene,
    Stage, StepLimits, Subject, Survey, one_pass, run,
};
use offbd_lab::timing::cpu_once;
use offbd_terminal::errors::BadArgument;

/// Maximum number of samples of one run, 80 bytes each; chosen to bound the memory. A
/// shorter interval is refused.
const MOST_SAMPLES: f64 = 1e6;

/// Default sampling interval, s; chosen.
const SAMPLE_S: f64 = 0.01;
/// Minimum default number of samples of a short scene; chosen.
const LEAST_SAMPLES: f64 = 200.0;

/// Tolerance of the run of the sliding model that locates events, m; chosen.
const EVENTS_M: f64 = 1e-6;

/// A sample: its time, s, and the motion.
pub(super) type Sampled = (f64, Motion);

/// The run of one scene.
#[derive(Debug)]
pub(super) struct SceneRun {
    pub name: String,
    pub scene: Scene,
    pub decision: Decision,
    pub survey: Survey,
    pub outcome: Result<RunOutcome, Failure>,
    /// The models of a run in one pass, in order of time.
    pub stages: Vec<Stage>,
    /// CPU time of the run, without samples, s.
    pub running_s: f64,
    pub samples: Vec<Sampled>,
    /// Events by the sliding model.
    pub events: Vec<Event>,
    pub warnings: Vec<String>,
}

/// The options of a run.
pub(super) struct RunRequest<'a> {
    pub how: &'a ConfigurationArgs,
    /// Requested sampling interval, s, if any.
    pub sample: Option<f64>,
    /// Whether samples are wanted at all.
    pub sampled: bool,
}

impl RunRequest<'_> {
    /// Runs `scene` under `drive`, which ends in its state after the run.
    pub(super) fn run<D: Drive + Clone>(
        &self,
        name: &str,
        scene: &Scene,
        drive: &mut D,
    ) -> anyhow::Result<SceneRun> {
        let every_s = self.every_s(scene)?;
        let decision = self.how.decide(scene, drive)?;
        let (survey, events) = look(scene, drive);
        let mut before = drive.clone();
        let by = |drive: &mut D, samples: Option<&mut Samples<'_>>| match &decision.configuration {
            Some(by) => Ok((run(scene, drive, by, samples), Vec::new())),
            None => in_one_pass(scene, drive, decision.wanted_m, samples),
        };
        let (ran, running_s) = cpu_once(|| by(drive, None));
        let (outcome, stages) = ran?;
        let mut samples = Vec::new();
        if self.sampled {
            let mut sink = |t: f64, at: &Motion| samples.push((t, *at));
            let mut taking = Samples::new(every_s, &mut sink);
            // The same run again: its outcome is the same.
            let _ = by(&mut before, Some(&mut taking));
        }
        let warnings = match &decision.configuration {
            Some(by) if !self.how.chooses() => warnings(scene, by, &survey, &events),
            _ => Vec::new(),
        };
        let (name, scene) = (name.to_owned(), scene.clone());
        Ok(SceneRun {
            name,
            scene,
            decision,
            survey,
            outcome,
            stages,
            running_s,
            samples,
            events,
            warnings,
        })
    }

    fn every_s(&self, scene: &Scene) -> Result<f64, BadArgument> {
        let usual = SAMPLE_S.min(scene.duration_s / LEAST_SAMPLES);
        let every_s = self.sample.unwrap_or(usual);
        if scene.duration_s / every_s <= MOST_SAMPLES {
            return Ok(every_s);
        }
        Err(BadArgument(format!(
            "--sample: an interval of {every_s} s gives over {MOST_SAMPLES} samples in {} s",
            scene.duration_s
        )))
    }
}

/// Runs the scene in one pass within `wanted_m`.
fn in_one_pass<D: Drive + Clone>(
    scene: &Scene,
    drive: &mut D,
    wanted_m: Option<f64>,
    samples: Option<&mut Samples<'_>>,
) -> Result<(Result<RunOutcome, Failure>, Vec<Stage>), NoModelMeets> {
    let OnePass { end, stages, statistics, .. } =
        one_pass(scene, drive, wanted_m.unwrap_or(TOLERANCE_M), samples)?;
    Ok((Ok(RunOutcome { end, statistics, events: Vec::new() }), stages))
}

/// Surveys the scene, and locates its events by the sliding model; no events if that run
/// fails.
fn look<D: Drive + Clone>(scene: &Scene, drive: &D) -> (Survey, Vec<Event>) {
    let survey = Survey::of(scene, &mut drive.clone());
    let sliding = Configuration::new(Model::Sliding, Method::Dopri5, Pace::Tolerance(EVENTS_M));
    let told = sliding.ok().and_then(|by| run(scene, &mut drive.clone(), &by, None).ok());
    (survey, told.map(|outcome| outcome.events).unwrap_or_default())
}

/// Returns warnings if a requested model is not valid for this scene, or a step not stable.
fn warnings(
    scene: &Scene,
    configuration: &Configuration,
    survey: &Survey,
    events: &[Event],
) -> Vec<String> {
    let model = configuration.model();
    if let Some(limits) = unstable(scene, configuration) {
        return vec![limits];
    }
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

/// Returns a warning if a fixed step of an explicit method is too long for the contact.
fn unstable(scene: &Scene, by: &Configuration) -> Option<String> {
    let (Model::Compliant, Pace::Step(step)) = (by.model(), by.pace()) else { return None };
    let method = by.method();
    let limits = StepLimits::of(method, &scene.compliant(), GRAVITY_M_S2)?;
    let [stable, normal] = [limits.least_s(), limits.normal_s].map(words::plain);
    if step > limits.normal_s {
        let what = "the contact throws the body off";
        return Some(format!("{method} above {normal} s is not stable: {what}"));
    }
    (step > limits.slip_s).then(|| {
        format!(
            "{method} above {stable} s lets the slip chatter: the position hardly shows it, but \
             slip and friction losses are too large"
        )
    })
}
