//! Fidelity chosen, not guessed: the cheapest model and method that meet a
//! wanted accuracy, with the reasons.
//!
//! 1. A survey says whether the ball rolls at all, and how far the rolling and
//!    the creeping ball are off. The first that is near enough runs by
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

use nalgebra::Vector2;

use super::configuration::{Configuration, Method, Model, Pace};
use super::drive::Drive;
use super::run::{Outcome, Stage, run};
use super::rungs::{OnCreeping, OnRolling};
use super::samples::Samples;
use super::stepping::{Failure, Watch};
use super::survey::Survey;
use super::{Scene, Subject};
use crate::plant::{Ground, Motion, Rolling};

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

/// Dormand–Prince runs at this many times the wanted accuracy: its estimates
/// are of the fourth-order solution and add up without cancelling, so that the
/// fifth-order solution is over a hundred times better on the charted scenes.
const DOPRI5_SLACK: f64 = 20.0;

/// Part of the tolerance that a model's own error may use up.
const MODEL_SHARE: f64 = 0.5;

/// Part of the tolerance by which two runs may differ.
const PAIR_SHARE: f64 = 0.8;

/// Beyond this friction demand a survey is not believed: the ball may slip.
const SURE_TO_ROLL: f64 = 0.9;

/// Work of one step, ns on the machine of the charts: what the order of the
/// candidates rests on.
const WORK_CONTACT_STEP: f64 = 80.0;
const WORK_SLIDING: f64 = 20_000.0;
const WORK_RODAS4: f64 = 1300.0;

/// The first contact step as a part of the plate's shortest time.
const FIRST_PART: f64 = 0.25;

/// Candidates end here: shorter steps or smaller tolerances than these lose
/// more by rounding than they gain.
const FINEST_STEP_S: f64 = 1e-6;
const FINEST_TOLERANCE_M: f64 = 1e-11;

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
    match search.smooth().or_else(|| search.stiff()) {
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

/// A run's positions at the moments of comparison.
type Path = Vec<Vector2<f64>>;

impl<D: Drive + Clone> Search<'_, D> {
    fn note(&mut self, model: Model, method: Method, error_m: Option<f64>, verdict: String) {
        self.tried.push(Tried { model, method, error_m, verdict });
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
            let pace = Pace::Tolerance((self.tolerance * DOPRI5_SLACK).clamp(1e-12, 1.0));
            let configuration = Configuration::new(model, Method::Dopri5, pace).ok()?;
            match self.watched(&configuration) {
                Ok(_) => {
                    let error = error + self.tolerance * (1.0 - MODEL_SHARE);
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
            if works[cheapest] == f64::INFINITY {
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
            Ok((outcome, path)) => (outcome.tally.steps + outcome.tally.rejected, path),
            Err(failure) => {
                self.note(model, method, None, failure.to_string());
                (0, Vec::new())
            }
        };
        let error = refining.compare(path, steps);
        let pace = pace_name(&configuration);
        let error = error?;
        if error <= self.tolerance * PAIR_SHARE {
            self.note(model, method, Some(error), format!("{pace} meets it"));
            return Some((configuration, error));
        }
        self.note(model, method, Some(error), format!("{pace} may be off by {error:.1e} m"));
        None
    }

    fn slide(&mut self) -> Option<(Configuration, f64)> {
        let (model, method) = (Model::Sliding, Method::Dopri5);
        let pace = Pace::Tolerance((self.tolerance * DOPRI5_SLACK / 10.0).clamp(1e-12, 1.0));
        let configuration = Configuration::new(model, method, pace).ok()?;
        match run(self.scene, &mut self.drive.clone(), &configuration, None) {
            Ok(outcome) => {
                let error = self.rigid_error(&outcome);
                let meets = error <= self.tolerance * (1.0 - 1.0 / 10.0);
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
        let landing = 1.5 * (1.0 + contact.friction()) * give * outcome.landing_m_s;
        creep + 4.0 * self.survey.sag_m + landing
    }

    fn path(&self, configuration: &Configuration) -> Result<(Outcome, Path), Failure> {
        let mut path = Path::new();
        let mut sink = |_: f64, at: &Motion| path.push(at.position.xy());
        let mut samples = Samples::new(self.scene.duration_s / COMPARED, &mut sink);
        let outcome = run(self.scene, &mut self.drive.clone(), configuration, Some(&mut samples))?;
        Ok((outcome, path))
    }
}

fn pace_name(configuration: &Configuration) -> String {
    match configuration.pace() {
        Pace::Step(h) => format!("step {h:.2e} s"),
        Pace::Tolerance(tolerance) => format!("tolerance {tolerance:.0e} m"),
    }
}

/// One method at ever finer paces.
struct Refining {
    method: Method,
    /// The next step, s, or tolerance, m.
    next: f64,
    factor: f64,
    finest: f64,
    /// Work of the next run; infinite when there is none.
    work: f64,
    growth: f64,
    per_step: f64,
    before: Path,
}

impl Refining {
    fn steps(h: f64, duration: f64) -> Self {
        Self {
            method: Method::ContactStep,
            next: h,
            factor: 0.5,
            finest: FINEST_STEP_S,
            work: duration / h * WORK_CONTACT_STEP,
            growth: 2.0,
            per_step: WORK_CONTACT_STEP,
            before: Path::new(),
        }
    }

    fn tolerances(wanted: f64) -> Self {
        Self {
            method: Method::Rodas4,
            next: (wanted * 100.0).min(1e-2),
            factor: 0.1,
            finest: FINEST_TOLERANCE_M,
            // A guess, until the first run has told.
            work: 40.0 * WORK_RODAS4,
            growth: 1.8,
            per_step: WORK_RODAS4,
            before: Path::new(),
        }
    }

    fn configuration(&mut self) -> Option<Configuration> {
        let pace = match self.method {
            Method::ContactStep => Pace::Step(self.next),
            _ => Pace::Tolerance(self.next),
        };
        Configuration::new(Model::Compliant, self.method, pace).ok()
    }

    /// The difference from the run before, m; `None` for the first one.
    fn compare(&mut self, path: Path, steps: u64) -> Option<f64> {
        let error = (!self.before.is_empty() && self.before.len() == path.len()).then(|| {
            let apart = self.before.iter().zip(&path).map(|(a, b)| (a - b).norm());
            apart.fold(0.0, f64::max)
        });
        self.before = path;
        self.next *= self.factor;
        self.work = steps.max(1) as f64 * self.per_step * self.growth;
        if self.next < self.finest {
            self.work = f64::INFINITY;
        }
        error
    }
}

/// Ends a run where the ball would slip, leave the plate or pass its edge.
struct StillRolls {
    rolling: Option<Rolling>,
    friction: f64,
    ground: Ground,
}

impl StillRolls {
    fn new(scene: &Scene) -> Self {
        let rolling = match &scene.subject {
            Subject::Ball(ball) => Some(Rolling::new(ball, &scene.plate)),
            Subject::Block(_) => None,
        };
        Self { rolling, friction: scene.contact.friction(), ground: scene.ground() }
    }

    fn check(
        &self,
        t: f64,
        y: &[f64; 5],
        plate: &crate::plant::PlateMotion,
    ) -> Result<(), Failure> {
        let demand = self
            .rolling
            .map_or(f64::INFINITY, |rolling| rolling.grip(y, plate).demand(self.friction));
        if demand.is_nan() || demand >= SURE_TO_ROLL {
            let why =
                if demand == f64::INFINITY { "the ball would fly" } else { "the ball would slip" };
            return Err(Failure::OutOfRange { at_s: t, why });
        }
        if self.ground.margin_m(y[0], y[1]) <= 0.0 {
            return Err(Failure::OutOfRange { at_s: t, why: "the ball passes the edge" });
        }
        Ok(())
    }
}

impl<'p, D: Drive> Watch<OnRolling<'p, D>, 5> for StillRolls {
    fn step(
        &mut self,
        rung: &OnRolling<'p, D>,
        t: [f64; 2],
        y: [&[f64; 5]; 2],
    ) -> Result<(), Failure> {
        self.check(t[1], y[1], &rung.plate.at(t[1]))
    }
}

impl<'p, D: Drive> Watch<OnCreeping<'p, D>, 5> for StillRolls {
    fn step(
        &mut self,
        rung: &OnCreeping<'p, D>,
        t: [f64; 2],
        y: [&[f64; 5]; 2],
    ) -> Result<(), Failure> {
        self.check(t[1], y[1], &rung.plate.at(t[1]))
    }
}
