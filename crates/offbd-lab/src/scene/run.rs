//! One scene by one configuration.

use nalgebra::Vector2;

use super::configuration::{Configuration, Method, Model, Pace, SHORTEST_STEP_S};
use super::drive::{Drive, Seen};
use super::events::{Event, Sequence};
use super::rungs::{OnCompliant, OnRolling, OnSliding, Rolls, Rung};
use super::samples::Samples;
use super::stepping::{Budget, Course, Failure, MOST_STEPS, Tally, Unwatched, Watch, whole_steps};
use super::{Scene, Subject};
use crate::methods::{RODAS3, RODAS4, StepControl};
use crate::models::{Compliant, ContactStep, Creeping};
use offbd_core::maths::{DOPRI5, EULER, MIDPOINT, RK4, dopri5, semi_implicit_euler};
use offbd_core::plant::{Ball, Motion, Phase, Planar, Rolling, RollingState, Sliding};
use offbd_core::vocabulary::Invalid;

/// What a run came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    pub end: Motion,
    pub tally: Tally,
    /// Rolls, slips, flies, falls: the sliding model tells.
    pub events: Vec<Event>,
}

/// Runs `scene` under `drive` as `configuration` says, sampling into `samples`.
///
/// # Errors
/// [`Failure`] when the state is no number any more or the steps are too many;
/// what was sampled before stands.
pub fn run<D: Drive>(
    scene: &Scene,
    drive: &mut D,
    configuration: &Configuration,
    samples: Option<&mut Samples<'_>>,
) -> Result<Outcome, Failure> {
    run_within(MOST_STEPS, scene, drive, configuration, samples)
}

/// The same with fewer steps at most.
pub(super) fn run_within<D: Drive>(
    most_steps: u64,
    scene: &Scene,
    drive: &mut D,
    configuration: &Configuration,
    samples: Option<&mut Samples<'_>>,
) -> Result<Outcome, Failure> {
    let stage = Stage::new(most_steps, scene, configuration);
    match configuration.model() {
        Model::Planar => stage.planar(drive, samples),
        Model::Rolling => stage.rolling(|ball| scene.rolling(ball), drive, samples, &mut Unwatched),
        Model::Creeping => {
            stage.rolling(|ball| scene.creeping(ball), drive, samples, &mut Unwatched)
        }
        Model::Sliding => stage.sliding(drive, samples, &mut Unwatched),
        Model::Compliant => stage.compliant(drive, samples, &mut Unwatched),
    }
}

/// Whether `model` can be run on `scene` at all: a block does not roll.
///
/// # Errors
/// [`Invalid`] naming `/model`.
pub fn suits(scene: &Scene, model: Model) -> Result<(), Invalid> {
    match (scene.subject, model) {
        (Subject::Block(_), Model::Planar | Model::Rolling | Model::Creeping) => {
            Err(Invalid::new("/model", format!("a block slides: the {model} model has only balls")))
        }
        _ => Ok(()),
    }
}

/// Longest step of an adaptive method as a part of the plate's shortest time:
/// longer ones step over what the plate does without seeing it.
pub(super) const LONGEST_PART: f64 = 0.2;

/// First step of a stiff method, s: the contact may have to settle. The
/// explicit one tries its longest and finds out.
const FIRST_STEP_S: f64 = 1e-4;

/// Smallest share of the tolerance for one step of the stiff methods: through a
/// jump of the contact's force, errors shrink no faster than steps do.
const STIFF_SHARE: f64 = 0.02;

/// A scene with what its configuration needs.
pub(super) struct Stage<'a> {
    pub scene: &'a Scene,
    method: Method,
    pace: Pace,
    most_steps: u64,
}

impl<'a> Stage<'a> {
    pub(super) fn new(most_steps: u64, scene: &'a Scene, configuration: &Configuration) -> Self {
        let (method, pace) = (configuration.method(), configuration.pace());
        Self { scene, method, pace, most_steps }
    }

    fn course<'s, 'b, const N: usize>(
        &self,
        y: [f64; N],
        samples: Option<&'s mut Samples<'b>>,
    ) -> Course<'s, 'b, N> {
        Course { t: 0.0, y, tally: Tally::default(), samples, most_steps: self.most_steps }
    }

    fn budget(&self) -> Budget {
        let tolerance = match self.pace {
            Pace::Tolerance(tolerance) => tolerance,
            Pace::Step(_) => f64::INFINITY,
        };
        let stiff = matches!(self.method, Method::Rodas3 | Method::Rodas4);
        Budget {
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

    /// Calls `piece` for each smooth piece of the drive.
    fn pieces<D: Drive, const N: usize>(
        &self,
        drive: &mut D,
        course: &mut Course<'_, '_, N>,
        motion: impl Fn(&D, f64, &[f64; N]) -> Motion,
        mut piece: impl FnMut(&D, &mut Course<'_, '_, N>, f64) -> Result<(), Failure>,
    ) -> Result<Motion, Failure> {
        let end = self.scene.duration_s;
        while course.t < end {
            let at = motion(drive, course.t, &course.y);
            let until = drive.begin(course.t, &at).min(end);
            if course.t == 0.0
                && let Some(samples) = course.samples.as_deref_mut()
            {
                samples.take(0.0, |_| at);
            }
            piece(drive, course, until)?;
        }
        Ok(motion(drive, course.t, &course.y))
    }

    fn planar<D: Drive>(
        &self,
        drive: &mut D,
        samples: Option<&mut Samples<'_>>,
    ) -> Result<Outcome, Failure> {
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
        let mut course = self.course(row_of(&xi), samples);
        let end = self.pieces(drive, &mut course, motion, |drive, course, until| {
            planar_piece(&model, drive, course, until, h, |t, y| motion(drive, t, y))
        })?;
        Ok(Outcome { end, tally: course.tally, events: Vec::new() })
    }

    /// The rolling or the creeping ball.
    pub(super) fn rolling<D: Drive, M: Rolls, W>(
        &self,
        model: impl Fn(&Ball) -> M,
        drive: &mut D,
        samples: Option<&mut Samples<'_>>,
        watch: &mut W,
    ) -> Result<Outcome, Failure>
    where
        W: for<'p> Watch<OnRolling<'p, M, D>, 5>,
    {
        let Subject::Ball(ball) = &self.scene.subject else {
            return Err(Failure::OutOfRange { at_s: 0.0, why: "a block does not roll" });
        };
        let (model, mass) = (&model(ball), ball.mass_kg());
        drive.begin(0.0, &self.scene.initial);
        let start = model.enter(&self.scene.initial, &Seen::new(drive, mass, 0.0).at(0.0));
        let mut course = self.course(start, samples);
        let (mut control, budget) = (self.control(drive), self.budget());
        let motion =
            |drive: &D, t: f64, y: &[f64; 5]| model.leave(y, &Seen::new(drive, mass, t).at(t));
        let end = self.pieces(drive, &mut course, motion, |drive, course, until| {
            let rung = OnRolling { model, plate: Seen::new(drive, mass, course.t) };
            self.explicit(&rung, course, until, (&mut control, &budget), watch)
        })?;
        Ok(Outcome { end, tally: course.tally, events: Vec::new() })
    }

    pub(super) fn sliding<D: Drive, W>(
        &self,
        drive: &mut D,
        samples: Option<&mut Samples<'_>>,
        watch: &mut W,
    ) -> Result<Outcome, Failure>
    where
        W: for<'p> Watch<OnSliding<'p, D>, 9>,
    {
        let body = self.scene.body();
        let model = Sliding::new(body, self.scene.contact.friction(), self.scene.ground());
        let mut sequence = Sequence::new();
        let mut course = self.course(self.scene.initial.to_row(), samples);
        let (mut control, budget) = (self.control(drive), self.budget());
        let motion = |_: &D, _: f64, y: &[f64; 9]| Motion::from_row(y);
        let end = self.pieces(drive, &mut course, motion, |drive, course, until| {
            let plate = Seen::new(drive, body.mass_kg(), course.t);
            let mut rung = OnSliding { model: &model, phase: Phase::Flight, plate };
            sequence.piece(&mut rung, course, until, (&mut control, &budget), watch)
        })?;
        Ok(Outcome { end, tally: course.tally, events: sequence.events })
    }

    pub(super) fn compliant<D: Drive, W>(
        &self,
        drive: &mut D,
        samples: Option<&mut Samples<'_>>,
        watch: &mut W,
    ) -> Result<Outcome, Failure>
    where
        W: for<'p> Watch<OnCompliant<'p, D>, 9>,
    {
        let model = self.scene.compliant();
        let mut course = self.course(self.scene.initial.to_row(), samples);
        let (mut control, budget) = (self.control(drive), self.budget());
        let motion = |_: &D, _: f64, y: &[f64; 9]| Motion::from_row(y);
        let end = self.pieces(drive, &mut course, motion, |drive, course, until| {
            let plate = Seen::new(drive, model.body.mass_kg(), course.t);
            let rung = OnCompliant { model: &model, plate };
            self.stiff(&rung, course, until, (&mut control, &budget), watch)
        })?;
        Ok(Outcome { end, tally: course.tally, events: Vec::new() })
    }

    /// One piece by an explicit method.
    fn explicit<R: Rung<N>, const N: usize>(
        &self,
        rung: &R,
        course: &mut Course<'_, '_, N>,
        until: f64,
        adaptive: (&mut StepControl, &Budget),
        watch: &mut impl Watch<R, N>,
    ) -> Result<(), Failure> {
        let Pace::Step(h) = self.pace else {
            return course.adaptive(rung, until, adaptive, watch, |r, t, y, h, first| {
                Some(dopri5(r, t, y, h, first))
            });
        };
        match self.method {
            Method::Euler => {
                course.fixed(rung, until, h, watch, |r, t, y, h| EULER.step(r, t, y, h))
            }
            Method::SemiImplicitEuler => {
                course.fixed(rung, until, h, watch, semi_implicit_euler::<N, R>)
            }
            Method::Midpoint => {
                course.fixed(rung, until, h, watch, |r, t, y, h| MIDPOINT.step(r, t, y, h))
            }
            Method::Rk4 => course.fixed(rung, until, h, watch, |r, t, y, h| RK4.step(r, t, y, h)),
            _ => course.fixed(rung, until, h, watch, |r, t, y, h| DOPRI5.step(r, t, y, h)),
        }
    }

    /// One piece of the compliant model by any of its methods.
    fn stiff<'p, D: Drive>(
        &self,
        rung: &OnCompliant<'p, D>,
        course: &mut Course<'_, '_, 9>,
        until: f64,
        adaptive: (&mut StepControl, &Budget),
        watch: &mut impl Watch<OnCompliant<'p, D>, 9>,
    ) -> Result<(), Failure> {
        match (self.method, self.pace) {
            (Method::ContactStep, Pace::Step(h)) => contact_steps(rung, course, until, h, watch),
            (Method::Rodas3, Pace::Step(h)) => course.fixed(rung, until, h, watch, |r, t, y, h| {
                RODAS3.step(r, t, y, h).map_or([f64::NAN; 9], |to| to.y)
            }),
            (Method::Rodas4, Pace::Step(h)) => course.fixed(rung, until, h, watch, |r, t, y, h| {
                RODAS4.step(r, t, y, h).map_or([f64::NAN; 9], |to| to.y)
            }),
            (Method::Rodas3, _) => {
                course
                    .adaptive(rung, until, adaptive, watch, |r, t, y, h, _| RODAS3.step(r, t, y, h))
            }
            (Method::Rodas4, _) => {
                course
                    .adaptive(rung, until, adaptive, watch, |r, t, y, h, _| RODAS4.step(r, t, y, h))
            }
            _ => self.explicit(rung, course, until, adaptive, watch),
        }
    }
}

/// One piece by contact steps of at most `h`.
fn contact_steps<'p, D: Drive>(
    rung: &OnCompliant<'p, D>,
    course: &mut Course<'_, '_, 9>,
    until: f64,
    h: f64,
    watch: &mut impl Watch<OnCompliant<'p, D>, 9>,
) -> Result<(), Failure> {
    let steps = whole_steps(until - course.t, h);
    let stepper = ContactStep::new(rung.model, (until - course.t) / steps as f64);
    course.fixed(rung, until, h, watch, |r, t, y, h| {
        stepper.step(&Motion::from_row(y), &r.plate.at(t + h / 2.0)).to_row()
    })
}

fn xi_of(y: &[f64; 4]) -> [Vector2<f64>; 2] {
    [Vector2::new(y[0], y[1]), Vector2::new(y[2], y[3])]
}

fn row_of(xi: &[Vector2<f64>; 2]) -> [f64; 4] {
    [xi[0].x, xi[0].y, xi[1].x, xi[1].y]
}

/// Fixed steps of at most `h`, each with the angle of its middle held.
fn planar_piece<D: Drive>(
    model: &Planar,
    drive: &D,
    course: &mut Course<'_, '_, 4>,
    until: f64,
    h: f64,
    motion: impl Fn(f64, &[f64; 4]) -> Motion,
) -> Result<(), Failure> {
    let n = whole_steps(until - course.t, h);
    let h = (until - course.t) / n as f64;
    for i in 1..=n {
        let t = if i == n { until } else { course.t + h };
        let angle = drive.tilt(course.t + h / 2.0).angle;
        let from = xi_of(&course.y);
        let y = row_of(&model.hold(&from, &angle, h));
        if !y.iter().all(|value| value.is_finite()) {
            return Err(Failure::NotFinite { at_s: t });
        }
        let start = course.t;
        if let Some(samples) = course.samples.as_deref_mut() {
            samples.take(t, |within| match within {
                None => motion(t, &y),
                Some(at) => motion(at, &row_of(&model.hold(&from, &angle, at - start))),
            });
        }
        course.tally.steps += 1;
        (course.t, course.y) = (t, y);
    }
    Ok(())
}

/// The models that a scene asks for.
impl Scene {
    pub(super) fn rolling(&self, ball: &Ball) -> Rolling {
        Rolling::new(ball, &self.plate)
    }

    pub(super) fn creeping(&self, ball: &Ball) -> Creeping {
        Creeping::new(ball, &self.plate, &self.contact)
    }

    /// The compliant model of the scene, faithful to the chapter's S-function.
    #[must_use]
    pub fn compliant(&self) -> Compliant {
        Compliant::new(self.body(), self.contact, self.ground())
    }
}
