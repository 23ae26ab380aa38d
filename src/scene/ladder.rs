//! Fidelity chosen, not guessed: the cheapest model and method that meet a
//! wanted accuracy, with the reasons.
//!
//! 1. A survey says whether the ball rolls at all, and how far the planar, the
//!    rolling and the creeping ball are off. The planar one runs on the survey's
//!    word, which is a bound; the others, if near enough, run by
//!    Dormand–Prince, watched step by step: if the friction demand, the normal
//!    force or the edge show that it does not hold, it is given up.
//! 2. Otherwise three candidates compete, the cheapest next run first: the
//!    contact step at ever shorter steps, the rigid sliding model once, RODAS
//!    at ever smaller tolerances. Two runs of one method differ by at least the
//!    error of the finer one, since each error is at most half of the one
//!    before; the finer stands when they differ by less than is wanted.
//!
//! Costs are counted in work, not in time, so that the choice is the same on
//! every machine and in every run.

use super::configuration::{Configuration, Method, Model, Pace};
use super::drive::Drive;
use super::events::Event;
use super::refining::{FIRST_PART, Path, Refining, WORK_CONTACT_STEP, WORK_RODAS4};
use super::run::{Outcome, Stage, run_within};
use super::samples::Samples;
use super::stepping::Failure;
use super::still_rolls::{SURE_TO_ROLL, StillRolls};
use super::survey::Survey;
use super::{Scene, Subject};
use crate::plant::{Motion, Phase};

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

/// Dormand–Prince runs at this many times its part of the wanted accuracy: its
/// estimates are of the fourth-order solution and add up without cancelling.
/// The fifth-order solution is better by 6 times with a handful of steps, the
/// worst case seen, and by over a hundred where the plate swings to and fro a
/// few times.
const DOPRI5_SLACK: f64 = 8.0;
const DOPRI5_SLACK_OF_SWINGS: f64 = 40.0;

/// Shortest times of the plate in a scene from which on it swings to and fro.
const SWINGS: f64 = 4.0;

/// Part of the tolerance that a model's own error may use up.
const MODEL_SHARE: f64 = 0.5;

/// The same for the rigid model, whose own error is mostly all of it.
const RIGID_SHARE: f64 = 0.9;

/// Part of the tolerance by which two runs may differ.
const PAIR_SHARE: f64 = 0.65;

/// A contact that takes longer than this to settle, s, is not rigid to a body
/// that leaves the plate or lands.
const RIGID_SETTLING_S: f64 = 0.005;

/// Work of a run of the sliding model, ns on the machine of the charts.
const WORK_SLIDING: f64 = 20_000.0;

/// The angle of a plate that moves is renewed at least so many times in a scene
/// and in the shortest time of its law.
const LEAST_HOLDS: f64 = 8.0;

/// Most work of one run of the search, per simulated second: fifty times the
/// dearest that is charted. What needs more is out of reach.
const MOST_WORK_PER_S: f64 = 5e7;

/// Moments at which two runs are compared.
const COMPARED: f64 = 200.0;

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
    match search.planar().or_else(|| search.smooth()).or_else(|| search.stiff()) {
        Some((configuration, error_m)) => {
            Ok(Choice { configuration, error_m, survey, tried: search.tried })
        }
        None => {
            let errors = search.tried.iter().filter_map(|tried| tried.error_m);
            let best_m = errors.fold(f64::INFINITY, f64::min);
            Err(OutOfReach { tolerance_m, best_m, tried: search.tried })
        }
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
            let share = self.tolerance * (1.0 - MODEL_SHARE);
            let configuration = self.dopri5_within(model, share)?;
            match self.watched(&configuration) {
                Ok(_) => {
                    let error = error + share;
                    self.note(model, Method::Dopri5, Some(error), "meets it".to_owned());
                    return Some((configuration, error));
                }
                Err(failure) => {
                    self.note(model, Method::Dopri5, None, failure.to_string());
                    return None;
                }
            }
        }
        None
    }

    /// Dormand–Prince with steps such that it stays within `error_m`.
    fn dopri5_within(&self, model: Model, error_m: f64) -> Option<Configuration> {
        let swings = self.scene.duration_s / self.drive.shortest_time_s();
        let slack = if swings >= SWINGS { DOPRI5_SLACK_OF_SWINGS } else { DOPRI5_SLACK };
        let pace = Pace::Tolerance((error_m * slack).clamp(1e-12, 1.0));
        Configuration::new(model, Method::Dopri5, pace).ok()
    }

    fn not_smooth(&self, error: f64) -> Option<String> {
        if !self.survey.starts_rolling {
            return Some("the ball does not start rolling on the plate".to_owned());
        }
        if self.survey.demand.is_nan() || self.survey.demand > SURE_TO_ROLL {
            return Some(format!("friction demand up to {:.2} of μ·F_z", self.survey.demand));
        }
        let most = self.tolerance * MODEL_SHARE;
        (error > most).then(|| format!("may be off by {error:.1e} m"))
    }

    fn watched(&self, configuration: &Configuration) -> Result<Outcome, Failure> {
        let (stage, mut drive) = (Stage::new(self.scene, configuration), self.drive.clone());
        let mut watch = StillRolls::new(self.scene);
        match configuration.model() {
            Model::Rolling => stage.rolling(&mut drive, None, &mut watch),
            _ => stage.creeping(&mut drive, None, &mut watch),
        }
    }

    /// The contact step, the sliding model and RODAS, the cheapest run first.
    fn stiff(&mut self) -> Option<(Configuration, f64)> {
        let time = self.drive.shortest_time_s().min(self.scene.duration_s);
        let mut contact = Refining::steps(time * FIRST_PART, self.scene.duration_s);
        let mut rodas = Refining::tolerances(self.tolerance);
        let mut sliding = Some(WORK_SLIDING);
        loop {
            let works = [contact.work, sliding.unwrap_or(f64::INFINITY), rodas.work];
            let cheapest = (0..3).min_by(|&a, &b| works[a].total_cmp(&works[b]))?;
            if works[cheapest] > MOST_WORK_PER_S * self.scene.duration_s.max(1.0) {
                return None;
            }
            let found = match cheapest {
                0 => self.refine(&mut contact),
                1 => {
                    sliding = None;
                    self.slide()
                }
                _ => self.refine(&mut rodas),
            };
            if found.is_some() {
                return found;
            }
        }
    }

    /// The next finer run of one method, compared with the one before.
    fn refine(&mut self, refining: &mut Refining) -> Option<(Configuration, f64)> {
        let configuration = refining.configuration()?;
        let (model, method) = (Model::Compliant, configuration.method());
        let run = self.path(&configuration);
        let (steps, path) = match run {
            Ok((outcome, path)) => {
                if let (Method::ContactStep, Some(why)) = (method, self.unseen_by_steps(&path)) {
                    refining.work = f64::INFINITY;
                    self.note(model, method, None, why.to_owned());
                    return None;
                }
                (outcome.tally.steps + outcome.tally.rejected, path)
            }
            Err(failure) => {
                self.note(model, method, None, failure.to_string());
                (0, Path::new())
            }
        };
        let error = refining.compare(path, steps);
        let pace = pace_name(&configuration);
        let onset = if method == Method::ContactStep { self.onset_error() } else { 0.0 };
        // Two runs that nothing backs up yet tell no error.
        let error = error.filter(|error| error.is_finite())? + onset;
        if error <= self.tolerance * PAIR_SHARE {
            self.note(model, method, Some(error), format!("{pace} meets it"));
            return Some((configuration, error));
        }
        self.note(model, method, Some(error), format!("{pace} may be off by {error:.1e} m"));
        None
    }

    fn slide(&mut self) -> Option<(Configuration, f64)> {
        let (model, method) = (Model::Sliding, Method::Dopri5);
        let pace = Pace::Tolerance((self.tolerance * (1.0 - RIGID_SHARE)).clamp(1e-12, 1.0));
        let configuration = Configuration::new(model, method, pace).ok()?;
        let most = self.most_steps(WORK_RODAS4);
        match run_within(most, self.scene, &mut self.drive.clone(), &configuration, None) {
            Ok(outcome) => {
                let error = self.rigid_error(&outcome);
                let meets = error <= self.tolerance * RIGID_SHARE;
                let verdict = if meets {
                    "meets it".to_owned()
                } else {
                    format!("may be off by {error:.1e} m")
                };
                self.note(model, method, Some(error), verdict);
                meets.then_some((configuration, error))
            }
            Err(failure) => {
                self.note(model, method, None, failure.to_string());
                None
            }
        }
    }

    /// How far the rigid model is off the compliant one, m: creep while it
    /// holds, sag where it turns, and landings, through which the contact
    /// takes the time m/D that the rigid plate does not.
    fn rigid_error(&self, outcome: &Outcome) -> f64 {
        let (body, contact) = (self.scene.body(), &self.scene.contact);
        let share = 1.0 / (body.slip_ease() * body.mass_kg());
        let creep = share * contact.slip_threshold_m_s() * self.scene.duration_s;
        let give = body.mass_kg() / contact.damping_n_s_per_m();
        let landing = 6.0 * (1.0 + contact.friction()) * give * outcome.landing_m_s;
        let flies = |event: &&Event| event.what == Phase::Flight.name();
        let flights = outcome.events.iter().filter(flies).count();
        if flights > 1 || (flights == 1 && self.is_soft()) {
            return f64::INFINITY;
        }
        creep + 4.0 * self.survey.sag_m + landing
    }

    /// Why long fixed steps miss what happens on `path`, if they do.
    fn unseen_by_steps(&self, path: &Path) -> Option<&'static str> {
        let (ground, height) = (self.scene.ground(), self.scene.body().rest_height_m());
        if path.iter().any(|at| ground.margin_m(at.x, at.y) <= 0.0) {
            return Some("the body passes the edge between two steps");
        }
        let flies = path.iter().any(|at| at.z > height);
        (flies && self.is_soft()).then_some("the plate is soft and the ball leaves it")
    }

    /// Whether the contact takes long to settle. Such a plate holds a parting
    /// ball back, and friction, turned round by the pull, drives the slip: which
    /// way is decided by less than a long step sees.
    fn is_soft(&self) -> bool {
        let contact = &self.scene.contact;
        contact.damping_n_s_per_m() / contact.stiffness_n_per_m() > RIGID_SETTLING_S
    }

    /// What long contact steps do not see of the onset of slip, m: there the
    /// regularised friction is below its limit until the slip is v_thr.
    fn onset_error(&self) -> f64 {
        let (body, contact) = (self.scene.body(), &self.scene.contact);
        let share = 1.0 / (body.slip_ease() * body.mass_kg());
        let slips = self.survey.demand > SURE_TO_ROLL || !self.survey.starts_rolling;
        if slips { 0.1 * share * contact.slip_threshold_m_s() * self.scene.duration_s } else { 0.0 }
    }

    /// Steps of `work` each that one run of the search may take.
    fn most_steps(&self, work: f64) -> u64 {
        (MOST_WORK_PER_S * self.scene.duration_s.max(1.0) / work) as u64
    }

    fn path(&self, configuration: &Configuration) -> Result<(Outcome, Path), Failure> {
        let mut path = Path::new();
        let mut sink = |_: f64, at: &Motion| path.push(at.position);
        let mut samples = Samples::new(self.scene.duration_s / COMPARED, &mut sink);
        let most = self.most_steps(WORK_CONTACT_STEP);
        let drive = &mut self.drive.clone();
        let outcome = run_within(most, self.scene, drive, configuration, Some(&mut samples))?;
        Ok((outcome, path))
    }
}

fn pace_name(configuration: &Configuration) -> String {
    match configuration.pace() {
        Pace::Step(h) => format!("step {h:.2e} s"),
        Pace::Tolerance(tolerance) => format!("tolerance {tolerance:.0e} m"),
    }
}
