//! Fidelity chosen, not guessed: the cheapest model and method that meet a
//! wanted accuracy, with the reasons.
//!
//! 1. A survey says whether the ball rolls at all, and how far the planar, the
//!    rolling and the creeping ball are off. The planar one runs on the survey's
//!    word, which is a bound; the others, if near enough, run by
//!    Dormand–Prince, watched step by step: if the friction demand, the normal
//!    force or the edge show that it does not hold, it is given up.
//! 2. Otherwise a reference is run, the compliant model so finely that its own
//!    error does not matter, and candidates are run and held against it, in the
//!    order of the work that they are expected to take. The first that is near
//!    enough stands. A run repeats itself to the bit, so that what was measured
//!    is what will be; and since the reference is one of the candidates, there
//!    always is one.
//!
//! Work is counted in steps, not in time, so that the choice is the same on
//! every machine and in every run.

use super::candidates::{self, METHOD_SHARE, Task, WORK_CONTACT_STEP, WORK_DOPRI5};
use super::configuration::{Configuration, Method, Model, Pace};
use super::drive::Drive;
use super::reference::{Path, Reference, most_steps};
use super::run::Stage;
use super::stepping::Failure;
use super::still_rolls::{SURE_TO_ROLL, StillRolls};
use super::survey::Survey;
use super::{Scene, Subject};

/// One candidate that was looked at, and what became of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Tried {
    pub model: Model,
    pub method: Method,
    /// Estimate of the worst error of position, m, where there is one.
    pub error_m: Option<f64>,
    pub verdict: String,
}

/// What was chosen, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    pub configuration: Configuration,
    /// Estimate of the worst error of position, m.
    pub error_m: f64,
    pub survey: Survey,
    /// In the order in which they were looked at; the last one was chosen.
    pub tried: Vec<Tried>,
}

/// No candidate meets the tolerance.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "no model and method meets {tolerance_m:e} m here; the nearest comes to about {best_m:e} m"
)]
pub struct OutOfReach {
    pub tolerance_m: f64,
    pub best_m: f64,
    pub tried: Vec<Tried>,
}

/// Part of the tolerance that a model's own error may use up.
const MODEL_SHARE: f64 = 0.5;

/// Part of the tolerance by which a run may differ from the reference, with the
/// reference's own error: between the moments of comparison it may be a little
/// more.
const MEASURED_SHARE: f64 = 0.97;

/// The angle of a plate that moves is renewed at least so many times in a scene
/// and in the shortest time of its law.
const LEAST_HOLDS: f64 = 8.0;

/// Chooses for `scene` under `drive` the cheapest configuration whose worst
/// error of position (x, y) against the compliant model stays within
/// `tolerance_m`, in [1e-12, 1].
///
/// # Errors
/// [`OutOfReach`] with what was tried.
pub fn choose<D: Drive + Clone>(
    scene: &Scene,
    drive: &D,
    tolerance_m: f64,
) -> Result<Choice, OutOfReach> {
    let survey = Survey::of(scene, &mut drive.clone());
    let mut search = Search { scene, drive, tolerance: tolerance_m, survey, tried: Vec::new() };
    let found = search.planar().or_else(|| search.smooth()).map_or_else(|| search.measured(), Ok);
    match found {
        Ok((configuration, error_m)) => {
            Ok(Choice { configuration, error_m, survey, tried: search.tried })
        }
        Err(best_m) => Err(OutOfReach { tolerance_m, best_m, tried: search.tried }),
    }
}

struct Search<'a, D> {
    scene: &'a Scene,
    drive: &'a D,
    tolerance: f64,
    survey: Survey,
    tried: Vec<Tried>,
}

impl<D: Drive + Clone> Search<'_, D> {
    fn note(&mut self, model: Model, method: Method, error_m: Option<f64>, verdict: String) {
        self.tried.push(Tried { model, method, error_m, verdict });
    }

    /// Small angles, held from step to step: the survey's bounds suffice, there
    /// is nothing to watch on a plate so gentle that they do.
    fn planar(&mut self) -> Option<(Configuration, f64)> {
        let (survey, method) = (self.survey, Method::ZeroOrderHold);
        let why = if self.scene.edges {
            Some("nobody watches the edge".to_owned())
        } else {
            self.not_smooth(survey.planar_error_m)
        };
        if let Some(why) = why {
            self.note(Model::Planar, method, Some(survey.planar_error_m), why);
            return None;
        }
        let share = self.tolerance * (1.0 - MODEL_SHARE);
        let whole = self.scene.duration_s;
        let time = whole.min(self.drive.shortest_time_s());
        let longest = if survey.planar_step_s.is_finite() { time / LEAST_HOLDS } else { whole };
        let h = (survey.planar_step_s * share.sqrt()).min(longest);
        let configuration = Configuration::new(Model::Planar, method, Pace::Step(h)).ok()?;
        let error = survey.planar_error_m + share;
        self.note(Model::Planar, method, Some(error), "meets it".to_owned());
        Some((configuration, error))
    }

    /// The rolling and the creeping ball.
    fn smooth(&mut self) -> Option<(Configuration, f64)> {
        let survey = self.survey;
        if matches!(self.scene.subject, Subject::Block(_)) {
            return None;
        }
        for (model, error) in
            [(Model::Rolling, survey.rolling_error_m), (Model::Creeping, survey.creeping_error_m)]
        {
            if let Some(why) = self.not_smooth(error) {
                self.note(model, Method::Dopri5, Some(error), why);
                continue;
            }
            return match self.watched(model) {
                Ok(path) => {
                    let tolerance_m = self.tolerance * METHOD_SHARE;
                    let (work, error_m) = (path.steps as f64 * WORK_DOPRI5, error + tolerance_m);
                    let reference = Reference { path, work, tolerance_m, error_m };
                    self.first_near(candidates::smooth(&self.task(), model), &reference)
                }
                Err(failure) => {
                    self.note(model, Method::Dopri5, None, failure.to_string());
                    None
                }
            };
        }
        None
    }

    fn task(&self) -> Task<'_> {
        let time_s = self.drive.shortest_time_s();
        Task { scene: self.scene, time_s, wanted_m: self.tolerance }
    }

    fn not_smooth(&self, error: f64) -> Option<String> {
        let most = self.tolerance * MODEL_SHARE;
        self.unsure_to_roll()
            .or_else(|| (error > most).then(|| format!("may be off by {error:.1e} m")))
    }

    fn unsure_to_roll(&self) -> Option<String> {
        if !self.survey.starts_rolling {
            return Some("the ball does not start rolling on the plate".to_owned());
        }
        (self.survey.demand.is_nan() || self.survey.demand > SURE_TO_ROLL)
            .then(|| format!("friction demand up to {:.2} of μ·F_z", self.survey.demand))
    }

    /// The path of `model`, a ball that rolls, as long as it does.
    fn watched(&self, model: Model) -> Result<Path, Failure> {
        let (scene, mut drive) = (self.scene, self.drive.clone());
        let finest = candidates::finest(model, self.tolerance)
            .ok_or(Failure::OutOfRange { at_s: 0.0, why: "no such run" })?;
        let stage = Stage::new(most_steps(scene, WORK_DOPRI5), scene, &finest);
        let watch = &mut StillRolls::new(scene);
        Path::of(scene, |samples| match model {
            Model::Rolling => {
                stage.rolling(|ball| scene.rolling(ball), &mut drive, Some(samples), watch)
            }
            _ => stage.rolling(|ball| scene.creeping(ball), &mut drive, Some(samples), watch),
        })
    }

    /// The first candidate that the compliant model bears out; else the
    /// accuracy for which it could, m.
    fn measured(&mut self) -> Result<(Configuration, f64), f64> {
        let reference = self.reference()?;
        let rolls = self.unsure_to_roll().is_none();
        let all = candidates::any(&self.task(), rolls, &reference);
        self.first_near(all, &reference).ok_or(reference.error_m)
    }

    /// The first candidate that is near enough to the reference.
    fn first_near(
        &mut self,
        candidates: Vec<(f64, Configuration)>,
        reference: &Reference,
    ) -> Option<(Configuration, f64)> {
        let mut steps_before = 0;
        for (work, configuration) in candidates {
            let fixed = configuration.method() == Method::ContactStep;
            // The plate's own pieces are shorter than the step: the same run.
            if fixed && work <= steps_before as f64 * WORK_CONTACT_STEP {
                continue;
            }
            let off = self.off(&configuration, reference);
            if off.meets {
                return Some((configuration, off.error_m));
            }
            if fixed {
                steps_before = off.steps;
            }
        }
        None
    }

    fn reference(&mut self) -> Result<Reference, f64> {
        let found = Reference::of(self.scene, self.drive, self.tolerance);
        let (error_m, verdict) = match &found {
            Ok(reference) => {
                let verdict = format!("tolerance {:.0e} m to compare with", reference.tolerance_m);
                (Some(reference.error_m), verdict)
            }
            Err(_) => (None, "does not settle".to_owned()),
        };
        self.note(Model::Compliant, Method::Rodas4, error_m, verdict);
        found
    }

    /// Runs a candidate and holds it against the reference.
    fn off(&mut self, configuration: &Configuration, reference: &Reference) -> Off {
        let most_steps = (reference.work / WORK_CONTACT_STEP).ceil() as u64;
        let (model, method) = (configuration.model(), configuration.method());
        match Path::run(most_steps, self.scene, &mut self.drive.clone(), configuration) {
            Ok(path) => {
                let error_m = path.apart(&reference.path) + reference.error_m;
                let meets = error_m <= self.tolerance * MEASURED_SHARE;
                let verdict = if meets { "meets it" } else { "is off" };
                let pace = pace_name(configuration);
                self.note(model, method, Some(error_m), format!("{pace} {verdict}"));
                Off { error_m, steps: path.steps, meets }
            }
            Err(failure) => {
                self.note(model, method, None, failure.to_string());
                Off { error_m: f64::INFINITY, steps: 0, meets: false }
            }
        }
    }
}

/// What came of a candidate.
struct Off {
    error_m: f64,
    steps: u64,
    meets: bool,
}

fn pace_name(configuration: &Configuration) -> String {
    match configuration.pace() {
        Pace::Step(h) => format!("step {h:.0e} s"),
        Pace::Tolerance(tolerance) => format!("tolerance {tolerance:.0e} m"),
    }
}
