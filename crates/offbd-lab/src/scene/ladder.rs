//! Chooses the cheapest model and method that meet a wanted accuracy, with the reasons.
//!
//! 1. A survey estimates whether the ball rolls, and the errors of the planar, the
//!    rolling and the creeping model. The planar model is accepted on the survey alone,
//!    whose estimate is an upper bound. The rolling and the creeping model, if accurate
//!    enough, are run by Dormand–Prince and checked at every step: a model is dropped if
//!    the friction demand, the normal force or the edge shows that it is not valid.
//! 2. Otherwise a reference is run, the compliant model at a tolerance at which its own
//!    error is negligible. Candidates are run and compared with it in ascending order
//!    of their expected work; the first one that is accurate enough is chosen. Runs
//!    are deterministic to the bit, so the measured error is that of every later run.
//!    The reference itself is a candidate, so there is always one that qualifies.
//!
//! Work is counted in steps, not in measured time, so that the choice is the same on
//! every machine and in every run.

use super::candidates::{self, METHOD_SHARE, Task, WORK_CONTACT_STEP, WORK_DOPRI5};
use super::configuration::{Configuration, Method, Model, Pace};
use super::drive::Drive;
use super::reference::{ReferenceSolution, SampledPath, most_steps};
use super::rolling_check::{RollingCheck, SURE_TO_ROLL};
use super::run::SceneRunner;
use super::stepping::Failure;
use super::survey::Survey;
use super::{Scene, Subject};

/// One candidate that was considered, and its result.
#[derive(Clone, Debug, PartialEq)]
pub struct TriedCandidate {
    pub model: Model,
    pub method: Method,
    /// Estimate of the largest error of the position, m; `None` if there is none.
    pub error_m: Option<f64>,
    pub verdict: String,
}

/// The chosen configuration, and the reasons.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    pub configuration: Configuration,
    /// Estimate of the largest error of the position, m.
    pub error_m: f64,
    pub survey: Survey,
    /// The candidates in the order of consideration; the last one was chosen.
    pub tried: Vec<TriedCandidate>,
}

/// No candidate meets the tolerance.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "no model and method meets {tolerance_m:e} m here; the best accuracy is about {best_m:e} m"
)]
pub struct OutOfReach {
    pub tolerance_m: f64,
    pub best_m: f64,
    pub tried: Vec<TriedCandidate>,
}

/// Share of the tolerance allowed for a model's own error; chosen: the other half is for
/// its method.
const MODEL_SHARE: f64 = 0.5;

/// Share of the tolerance allowed for the measured difference from the reference plus
/// the reference's own error. Chosen below 1, because the difference may be a little
/// larger between the times of comparison.
const MEASURED_SHARE: f64 = 0.97;

/// Minimum number of steps of the planar model in a scene and in the shortest time scale
/// of a moving plate; chosen.
const LEAST_HOLDS: f64 = 8.0;

/// Chooses for `scene` under `drive` the cheapest configuration whose largest error of
/// the position (x, y) against the compliant model is within `tolerance_m`, which lies in
/// [1e-12, 1].
///
/// # Errors
/// [`OutOfReach`] with the candidates tried, if none meets the tolerance.
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
    tried: Vec<TriedCandidate>,
}

impl<D: Drive + Clone> Search<'_, D> {
    fn note(&mut self, model: Model, method: Method, error_m: Option<f64>, verdict: String) {
        self.tried.push(TriedCandidate { model, method, error_m, verdict });
    }

    /// Tries the planar model: small angles, constant within each step. The survey's
    /// bound suffices; a plate that meets it moves too little to need checks.
    fn planar(&mut self) -> Option<(Configuration, f64)> {
        let (survey, method) = (self.survey, Method::ZeroOrderHold);
        let why = if self.scene.edges {
            Some("cannot detect the edge".to_owned())
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

    /// Tries the rolling and the creeping model.
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
            return match self.checked(model) {
                Ok(path) => {
                    let tolerance_m = self.tolerance * METHOD_SHARE;
                    let (work, error_m) = (path.steps as f64 * WORK_DOPRI5, error + tolerance_m);
                    let reference = ReferenceSolution { path, work, tolerance_m, error_m };
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

    /// Runs `model`, the rolling or the creeping ball, and checks its validity at every
    /// step.
    fn checked(&self, model: Model) -> Result<SampledPath, Failure> {
        let (scene, mut drive) = (self.scene, self.drive.clone());
        let finest = candidates::finest(model, self.tolerance)
            .ok_or(Failure::OutOfRange { at_s: 0.0, why: "no such run" })?;
        let runner = SceneRunner::new(most_steps(scene, WORK_DOPRI5), scene, &finest);
        let observer = &mut RollingCheck::new(scene);
        SampledPath::of(scene, |samples| match model {
            Model::Rolling => {
                runner.rolling(|ball| scene.rolling(ball), &mut drive, Some(samples), observer)
            }
            _ => runner.rolling(|ball| scene.creeping(ball), &mut drive, Some(samples), observer),
        })
    }

    /// Returns the first candidate whose measured error against the compliant model is
    /// small enough; else the best accuracy that can be confirmed, m.
    fn measured(&mut self) -> Result<(Configuration, f64), f64> {
        let reference = self.reference()?;
        let rolls = self.unsure_to_roll().is_none();
        let all = candidates::any(&self.task(), rolls, &reference);
        self.first_near(all, &reference).ok_or(reference.error_m)
    }

    /// Returns the first candidate close enough to the reference.
    fn first_near(
        &mut self,
        candidates: Vec<(f64, Configuration)>,
        reference: &ReferenceSolution,
    ) -> Option<(Configuration, f64)> {
        let mut steps_before = 0;
        for (work, configuration) in candidates {
            let fixed = configuration.method() == Method::ContactStep;
            // The drive's pieces are shorter than this step: it gives the previous run.
            if fixed && work <= steps_before as f64 * WORK_CONTACT_STEP {
                continue;
            }
            let measured = self.measure(&configuration, reference);
            if measured.meets {
                return Some((configuration, measured.error_m));
            }
            if fixed {
                steps_before = measured.steps;
            }
        }
        None
    }

    fn reference(&mut self) -> Result<ReferenceSolution, f64> {
        let found = ReferenceSolution::of(self.scene, self.drive, self.tolerance);
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

    /// Runs a candidate and compares it with the reference.
    fn measure(
        &mut self,
        configuration: &Configuration,
        reference: &ReferenceSolution,
    ) -> CandidateError {
        let most_steps = (reference.work / WORK_CONTACT_STEP).ceil() as u64;
        let (model, method) = (configuration.model(), configuration.method());
        match SampledPath::run(most_steps, self.scene, &mut self.drive.clone(), configuration) {
            Ok(path) => {
                let error_m = path.apart(&reference.path) + reference.error_m;
                let meets = error_m <= self.tolerance * MEASURED_SHARE;
                let verdict = if meets { "meets it" } else { "is too inaccurate" };
                let pace = pace_name(configuration);
                self.note(model, method, Some(error_m), format!("{pace} {verdict}"));
                CandidateError { error_m, steps: path.steps, meets }
            }
            Err(failure) => {
                self.note(model, method, None, failure.to_string());
                CandidateError { error_m: f64::INFINITY, steps: 0, meets: false }
            }
        }
    }
}

/// The measured error of a candidate.
struct CandidateError {
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
