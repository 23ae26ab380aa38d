//! Runs a scene by a configuration.

use nalgebra::Vector2;

use super::configuration::{Configuration, Method, Model, Pace, SHORTEST_STEP_S};
use super::drive::{Drive, DrivenPlate};
use super::driven_models::{
    DrivenCompliant, DrivenModel, DrivenRolling, DrivenSliding, RollingModel,
};
use super::events::{Event, PhaseTracker};
use super::samples::Samples;
use super::stepping::{
    ErrorBudget, Failure, Integration, MOST_STEPS, NoObserver, RunStatistics, StepObserver,
    whole_steps,
};
use super::{Scene, Subject};
use crate::methods::{RODAS3, RODAS4, Rosenbrock, StepControl};
use crate::models::{Compliant, ContactStep, Creeping};
use offbd_core::maths::{DOPRI5, EULER, MIDPOINT, RK4, dopri5, semi_implicit_euler};
use offbd_core::plant::{Ball, Motion, Phase, Planar, PlateMotion, Rolling, RollingState, Sliding};
use offbd_core::vocabulary::Invalid;

/// The result of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunOutcome {
    pub end: Motion,
    pub statistics: RunStatistics,
    /// Changes of phase; only the sliding model reports them.
    pub events: Vec<Event>,
}

/// Runs `scene` under `drive` by `configuration`, and passes samples to `samples`.
///
/// # Errors
/// [`Failure`] if the state is not finite any more, the steps are too many, or the model
/// is not valid; samples taken until then remain valid.
pub fn run<D: Drive>(
    scene: &Scene,
    drive: &mut D,
    configuration: &Configuration,
    samples: Option<&mut Samples<'_>>,
) -> Result<RunOutcome, Failure> {
    run_within(MOST_STEPS, scene, drive, configuration, samples)
}

/// Like [`run`], with at most `most_steps`.
pub(super) fn run_within<D: Drive>(
    most_steps: u64,
    scene: &Scene,
    drive: &mut D,
    configuration: &Configuration,
    samples: Option<&mut Samples<'_>>,
) -> Result<RunOutcome, Failure> {
    let runner = SceneRunner::new(most_steps, scene, configuration);
    match configuration.model() {
        Model::Planar => runner.planar(drive, samples),
        Model::Rolling => runner.rolling(|ball| scene.rolling(ball), drive, samples),
        Model::Creeping => runner.rolling(|ball| scene.creeping(ball), drive, samples),
        Model::Sliding => runner.sliding(drive, samples, &mut NoObserver),
        Model::Compliant => runner.compliant(drive, samples, &mut NoObserver),
    }
}

/// Checks that `model` can run `scene`: a block does not roll.
///
/// # Errors
/// [`Invalid`] naming `/model`.
pub fn suits(scene: &Scene, model: Model) -> Result<(), Invalid> {
    match (scene.subject, model) {
        (Subject::Block(_), Model::Planar | Model::Rolling | Model::Creeping) => Err(Invalid::new(
            "/model",
            format!("a block slides: the {model} model is for balls only"),
        )),
        _ => Ok(()),
    }
}

/// Longest step of an adaptive method as a share of the plate's shortest time scale.
/// Chosen: longer steps could pass over the plate's motion without resolving it.
pub(super) const LONGEST_PART: f64 = 0.2;

/// First step of a stiff method, s. Chosen short, because the contact may have to settle;
/// the explicit adaptive method starts with its longest step and rejects it if need be.
const FIRST_STEP_S: f64 = 1e-4;

/// Minimum share of the tolerance for one step of the stiff methods. Chosen above 0:
/// across a jump of the contact force the error falls only in proportion to the step, so
/// an even distribution over time could not be met.
const STIFF_SHARE: f64 = 0.02;

/// Runs one scene by one configuration.
pub(super) struct SceneRunner<'a> {
    pub scene: &'a Scene,
    method: Method,
    pace: Pace,
    most_steps: u64,
}

impl<'a> SceneRunner<'a> {
    pub(super) fn new(most_steps: u64, scene: &'a Scene, configuration: &Configuration) -> Self {
        let (method, pace) = (configuration.method(), configuration.pace());
        Self { scene, method, pace, most_steps }
    }

    fn integration<'s, 'b, const N: usize>(
        &self,
        y: [f64; N],
        samples: Option<&'s mut Samples<'b>>,
    ) -> Integration<'s, 'b, N> {
        Integration {
            t: 0.0,
            y,
            statistics: RunStatistics::default(),
            samples,
            most_steps: self.most_steps,
        }
    }

    fn budget(&self) -> ErrorBudget {
        let tolerance = match self.pace {
            Pace::Tolerance(tolerance) => tolerance,
            Pace::Step(_) => f64::INFINITY,
        };
        let stiff = matches!(self.method, Method::Rodas3 | Method::Rodas4);
        ErrorBudget {
            tolerance,
            duration: self.scene.duration_s,
            radius: self.scene.body().arm_m(),
            least_share: if stiff { STIFF_SHARE } else { 0.0 },
        }
    }

    fn control(&self, drive: &impl Drive) -> StepControl {
        let power = match self.method {
            Method::Rodas3 => 2.5,
            Method::Rodas4 => 3.5,
            _ => 4.0,
        };
        let longest = (LONGEST_PART * drive.shortest_time_s()).min(self.scene.duration_s);
        let first = if self.method == Method::Dopri5 { longest } else { FIRST_STEP_S };
        StepControl::new(power, first, SHORTEST_STEP_S, longest.max(SHORTEST_STEP_S))
    }

    /// Calls `piece` for each smooth piece of the drive; returns the final motion.
    fn pieces<D: Drive, const N: usize>(
        &self,
        drive: &mut D,
        integration: &mut Integration<'_, '_, N>,
        motion: impl Fn(&D, f64, &[f64; N]) -> Motion,
        mut piece: impl FnMut(&D, &mut Integration<'_, '_, N>, f64) -> Result<(), Failure>,
    ) -> Result<Motion, Failure> {
        let end = self.scene.duration_s;
        while integration.t < end {
            let at = motion(drive, integration.t, &integration.y);
            let until = drive.begin(integration.t, &at).min(end);
            if integration.t == 0.0
                && let Some(samples) = integration.samples.as_deref_mut()
            {
                samples.take(0.0, |_| at);
            }
            piece(drive, integration, until)?;
        }
        Ok(motion(drive, integration.t, &integration.y))
    }

    fn planar<D: Drive>(
        &self,
        drive: &mut D,
        samples: Option<&mut Samples<'_>>,
    ) -> Result<RunOutcome, Failure> {
        let Subject::Ball(ball) = &self.scene.subject else {
            return Err(Failure::OutOfRange { at_s: 0.0, why: "a block does not roll" });
        };
        let Pace::Step(h) = self.pace else {
            let why = "the planar model takes steps of one length only";
            return Err(Failure::OutOfRange { at_s: 0.0, why });
        };
        let (model, rolling) = (Planar::new(ball, &self.scene.plate), self.scene.rolling(ball));
        let start = RollingState {
            position: self.scene.initial.position.xy(),
            velocity: self.scene.initial.velocity.xy(),
            spin: 0.0,
        };
        drive.begin(0.0, &self.scene.initial);
        let xi = model.enter(&start, &drive.tilt(0.0));
        let motion = |drive: &D, t: f64, y: &[f64; 4]| {
            rolling.leave(&model.leave(&xi_of(y), &drive.tilt(t)).to_row())
        };
        let mut integration = self.integration(row_of(&xi), samples);
        let end = self.pieces(drive, &mut integration, motion, |drive, integration, until| {
            planar_piece(&model, drive, integration, until, h, |t, y| motion(drive, t, y))
        })?;
        Ok(RunOutcome { end, statistics: integration.statistics, events: Vec::new() })
    }

    /// Runs the rolling or the creeping ball.
    fn rolling<D: Drive, M: RollingModel>(
        &self,
        model: impl Fn(&Ball) -> M,
        drive: &mut D,
        samples: Option<&mut Samples<'_>>,
    ) -> Result<RunOutcome, Failure> {
        let Subject::Ball(ball) = &self.scene.subject else {
            return Err(Failure::OutOfRange { at_s: 0.0, why: "a block does not roll" });
        };
        let (model, mass) = (&model(ball), ball.mass_kg());
        drive.begin(0.0, &self.scene.initial);
        let start = model.enter(&self.scene.initial, &DrivenPlate::new(drive, mass, 0.0).at(0.0));
        let mut integration = self.integration(start, samples);
        let (mut control, budget) = (self.control(drive), self.budget());
        let motion = |drive: &D, t: f64, y: &[f64; 5]| {
            model.leave(y, &DrivenPlate::new(drive, mass, t).at(t))
        };
        let end = self.pieces(drive, &mut integration, motion, |drive, integration, until| {
            let system =
                DrivenRolling { model, plate: DrivenPlate::new(drive, mass, integration.t) };
            if let (Method::Midpoint, Pace::Step(h)) = (self.method, self.pace) {
                let plate = &system.plate;
                let step = |y: &[f64; 5], plate: &PlateMotion, h| model.midpoint(y, plate, h);
                integration.by_middles((&system, plate), until, h, &mut NoObserver, step)
            } else {
                let adaptive = (&mut control, &budget);
                self.explicit(&system, integration, until, adaptive, &mut NoObserver)
            }
        })?;
        Ok(RunOutcome { end, statistics: integration.statistics, events: Vec::new() })
    }

    pub(super) fn sliding<D: Drive, W>(
        &self,
        drive: &mut D,
        samples: Option<&mut Samples<'_>>,
        observer: &mut W,
    ) -> Result<RunOutcome, Failure>
    where
        W: for<'p> StepObserver<DrivenSliding<'p, D>, 9>,
    {
        self.sliding_from((0.0, &self.scene.initial, 0.0), drive, samples, observer)
    }

    /// Runs the sliding model from a motion on, as [`Self::compliant_from`], with a damper
    /// that holds a body that leaves the plate for `hold_s`, s.
    pub(super) fn sliding_from<D: Drive, W>(
        &self,
        (from_s, start, hold_s): (f64, &Motion, f64),
        drive: &mut D,
        samples: Option<&mut Samples<'_>>,
        observer: &mut W,
    ) -> Result<RunOutcome, Failure>
    where
        W: for<'p> StepObserver<DrivenSliding<'p, D>, 9>,
    {
        let body = self.scene.body();
        let model = Sliding::new(body, self.scene.contact.friction(), self.scene.ground());
        let mut sequence = PhaseTracker::new(hold_s);
        let mut integration =
            Integration { t: from_s, ..self.integration(start.to_row(), samples) };
        let (mut control, budget) = (self.control(drive), self.budget());
        let motion = |_: &D, _: f64, y: &[f64; 9]| Motion::from_row(y);
        let end = self.pieces(drive, &mut integration, motion, |drive, integration, until| {
            let plate = DrivenPlate::new(drive, body.mass_kg(), integration.t);
            let mut system = DrivenSliding { model: &model, phase: Phase::Flight, plate };
            sequence.piece(&mut system, integration, until, (&mut control, &budget), observer)
        })?;
        Ok(RunOutcome { end, statistics: integration.statistics, events: sequence.events })
    }

    pub(super) fn compliant<D: Drive, W>(
        &self,
        drive: &mut D,
        samples: Option<&mut Samples<'_>>,
        observer: &mut W,
    ) -> Result<RunOutcome, Failure>
    where
        W: for<'p> StepObserver<DrivenCompliant<'p, D>, 9>,
    {
        let integration = self.integration(self.scene.initial.to_row(), samples);
        self.compliant_on(integration, drive, observer)
    }

    fn compliant_on<D: Drive, W>(
        &self,
        mut integration: Integration<'_, '_, 9>,
        drive: &mut D,
        observer: &mut W,
    ) -> Result<RunOutcome, Failure>
    where
        W: for<'p> StepObserver<DrivenCompliant<'p, D>, 9>,
    {
        let model = self.scene.compliant();
        let (mut control, budget) = (self.control(drive), self.budget());
        let motion = |_: &D, _: f64, y: &[f64; 9]| Motion::from_row(y);
        let end = self.pieces(drive, &mut integration, motion, |drive, integration, until| {
            let plate = DrivenPlate::new(drive, model.body.mass_kg(), integration.t);
            let system = DrivenCompliant { model: &model, plate };
            self.stiff(&system, integration, until, (&mut control, &budget), observer)
        })?;
        Ok(RunOutcome { end, statistics: integration.statistics, events: Vec::new() })
    }

    /// Runs the compliant model from the motion `start` at `from_s` on, without a sample
    /// there unless it is 0.
    pub(super) fn compliant_from<D: Drive>(
        &self,
        from_s: f64,
        start: &Motion,
        drive: &mut D,
        samples: Option<&mut Samples<'_>>,
    ) -> Result<RunOutcome, Failure> {
        let integration = Integration { t: from_s, ..self.integration(start.to_row(), samples) };
        self.compliant_on(integration, drive, &mut NoObserver)
    }

    /// Integrates one piece by an explicit method.
    fn explicit<R: DrivenModel<N>, const N: usize>(
        &self,
        system: &R,
        integration: &mut Integration<'_, '_, N>,
        until: f64,
        adaptive: (&mut StepControl, &ErrorBudget),
        observer: &mut impl StepObserver<R, N>,
    ) -> Result<(), Failure> {
        let Pace::Step(h) = self.pace else {
            return integration.adaptive(system, until, adaptive, observer, |r, t, y, h, first| {
                Some(dopri5(r, t, y, h, first))
            });
        };
        match self.method {
            Method::Euler => {
                integration.fixed(system, until, h, observer, |r, t, y, h| EULER.step(r, t, y, h))
            }
            Method::SemiImplicitEuler => {
                integration.fixed(system, until, h, observer, semi_implicit_euler::<N, R>)
            }
            Method::Midpoint => integration
                .fixed(system, until, h, observer, |r, t, y, h| MIDPOINT.step(r, t, y, h)),
            Method::Rk4 => {
                integration.fixed(system, until, h, observer, |r, t, y, h| RK4.step(r, t, y, h))
            }
            _ => {
                integration.fixed(system, until, h, observer, |r, t, y, h| DOPRI5.step(r, t, y, h))
            }
        }
    }

    /// Integrates one piece of the compliant model by any of its methods.
    fn stiff<'p, D: Drive>(
        &self,
        system: &DrivenCompliant<'p, D>,
        integration: &mut Integration<'_, '_, 9>,
        until: f64,
        adaptive: (&mut StepControl, &ErrorBudget),
        observer: &mut impl StepObserver<DrivenCompliant<'p, D>, 9>,
    ) -> Result<(), Failure> {
        match (self.method, self.pace) {
            (Method::ContactStep, Pace::Step(h)) => {
                contact_steps(system, integration, until, h, observer)
            }
            (Method::Rodas3, Pace::Step(h)) => {
                self.fixed_implicit(&RODAS3, system, integration, until, h, observer)
            }
            (Method::Rodas4, Pace::Step(h)) => {
                self.fixed_implicit(&RODAS4, system, integration, until, h, observer)
            }
            (Method::Rodas3, _) => {
                integration.adaptive(system, until, adaptive, observer, |r, t, y, h, _| {
                    RODAS3.step(r, t, y, h)
                })
            }
            (Method::Rodas4, _) => {
                integration.adaptive(system, until, adaptive, observer, |r, t, y, h, _| {
                    RODAS4.step(r, t, y, h)
                })
            }
            _ => self.explicit(system, integration, until, adaptive, observer),
        }
    }

    /// Integrates one piece of the compliant model by fixed steps of an implicit method. A
    /// step in which the contact begins or ends, or in which a slip grows, is divided: the
    /// method takes its Jacobian where the step begins, and would be an explicit one there.
    fn fixed_implicit<'p, D: Drive, const S: usize>(
        &self,
        method: &Rosenbrock<S>,
        system: &DrivenCompliant<'p, D>,
        integration: &mut Integration<'_, '_, 9>,
        until: f64,
        h: f64,
        observer: &mut impl StepObserver<DrivenCompliant<'p, D>, 9>,
    ) -> Result<(), Failure> {
        let n = whole_steps(until - integration.t, h);
        let h = (until - integration.t) / n as f64;
        let budget = ErrorBudget { tolerance: DIVIDED_M, ..self.budget() };
        for i in 1..=n {
            let (t, y) = (integration.t, integration.y);
            let end = if i == n { until } else { t + h };
            let tried = method.step(system, t, &y, h);
            let whole = tried.filter(|to| system.keeps_contact(t, [&y, &to.y], h));
            if let Some(to) = whole {
                integration.take(system, end, to.y, observer)?;
                continue;
            }
            integration.statistics.divided += 1;
            let power = f64::from(method.order) - 0.5;
            let longest = h.max(SHORTEST_STEP_S);
            let mut control =
                StepControl::new(power, FIRST_STEP_S.min(h), SHORTEST_STEP_S, longest);
            let by = (&mut control, &budget);
            integration
                .adaptive(system, end, by, observer, |r, t, y, h, _| method.step(r, t, y, h))?;
        }
        Ok(())
    }
}

/// Tolerance of the divided steps, m; chosen: it costs some tens of steps a landing.
const DIVIDED_M: f64 = 1e-6;

/// Integrates one piece by contact steps of at most `h`, s.
fn contact_steps<'p, D: Drive>(
    system: &DrivenCompliant<'p, D>,
    integration: &mut Integration<'_, '_, 9>,
    until: f64,
    h: f64,
    observer: &mut impl StepObserver<DrivenCompliant<'p, D>, 9>,
) -> Result<(), Failure> {
    let steps = whole_steps(until - integration.t, h);
    let stepper = ContactStep::new(system.model, (until - integration.t) / steps as f64);
    integration.by_middles((system, &system.plate), until, h, observer, |y, plate, _| {
        stepper.step(&Motion::from_row(y), plate).to_row()
    })
}

fn xi_of(y: &[f64; 4]) -> [Vector2<f64>; 2] {
    [Vector2::new(y[0], y[1]), Vector2::new(y[2], y[3])]
}

fn row_of(xi: &[Vector2<f64>; 2]) -> [f64; 4] {
    [xi[0].x, xi[0].y, xi[1].x, xi[1].y]
}

/// Integrates one piece of the planar model by fixed steps of at most `h`, s, each with
/// the angle at its middle.
fn planar_piece<D: Drive>(
    model: &Planar,
    drive: &D,
    integration: &mut Integration<'_, '_, 4>,
    until: f64,
    h: f64,
    motion: impl Fn(f64, &[f64; 4]) -> Motion,
) -> Result<(), Failure> {
    let n = whole_steps(until - integration.t, h);
    let h = (until - integration.t) / n as f64;
    for i in 1..=n {
        let t = if i == n { until } else { integration.t + h };
        if integration.statistics.steps >= integration.most_steps {
            return Err(Failure::TooManySteps { at_s: t });
        }
        let angle = drive.tilt(integration.t + h / 2.0).angle;
        let from = xi_of(&integration.y);
        let y = row_of(&model.hold(&from, &angle, h));
        if !y.iter().all(|value| value.is_finite()) {
            return Err(Failure::NotFinite { at_s: t });
        }
        let start = integration.t;
        if let Some(samples) = integration.samples.as_deref_mut() {
            samples.take(t, |within| match within {
                None => motion(t, &y),
                Some(at) => motion(at, &row_of(&model.hold(&from, &angle, at - start))),
            });
        }
        integration.statistics.steps += 1;
        (integration.t, integration.y) = (t, y);
    }
    Ok(())
}

/// The models of a scene.
impl Scene {
    pub(super) fn rolling(&self, ball: &Ball) -> Rolling {
        Rolling::new(ball, &self.plate)
    }

    pub(super) fn creeping(&self, ball: &Ball) -> Creeping {
        Creeping::new(ball, &self.plate, &self.contact)
    }

    /// Returns the compliant model of the scene, faithful to the chapter's S-function.
    #[must_use]
    pub fn compliant(&self) -> Compliant {
        Compliant::new(self.body(), self.contact, self.ground())
    }
}
