//! A body that slides, flies and lands on a stiff plate: the rigid model with a bound of
//! what it leaves out.
//!
//! Three corrections or bounds come from the contact, m·δ̈ + D·δ̇ + K·δ = m·n, with the
//! depth δ, the normal force per mass n that the rigid plate needs, and the decays
//! λ₁ < λ₂:
//!
//! - **Leaving**: as n falls through 0 at a steady rate, the depth follows D/K later, and
//!   until then the damper pulls the body back with m·n. The run keeps the body on the
//!   plate for that time.
//! - **Landing** at v: the plate takes the momentum within 1/λ₂, up to the depth v/λ₂, and
//!   gives back and takes again v·λ₁/λ₂ within 1/λ₁.
//! - **Slip**: friction is μ·(n − δ̈) per mass, so that at constant slip direction a
//!   velocity is off by μ times the change of δ̇, and a position by μ times that of δ.

use std::f64::consts::SQRT_2;

use nalgebra::Vector3;

use super::bound::{ErrorBound, WindowError};
use super::window::decays;
use super::{DEEPEST, HandOver};
use crate::scene::Scene;
use crate::scene::configuration::{Configuration, Method, Model, Pace};
use crate::scene::drive::Drive;
use crate::scene::driven_models::DrivenSliding;
use crate::scene::run::{RunOutcome, SceneRunner};
use crate::scene::samples::Samples;
use crate::scene::stepping::{Failure, MOST_STEPS, NoObserver, StepObserver};
use crate::scene::survey::SURE_TO_ROLL;
use offbd_core::maths::System;
use offbd_core::plant::{Body, GRAVITY_M_S2, Hold, Motion, Phase, PlateMotion};

/// Tolerance of the method as a share of the wanted accuracy, and its limits, m; chosen.
const METHOD_SHARE: f64 = 0.1;
const COARSEST_M: f64 = 1e-3;
const FINEST_M: f64 = 1e-10;

/// Longest delay of the depth as a share of the plate's shortest time. Chosen: with a soft
/// contact of half of that time one of 400 random scenes exceeded its bound.
const LONGEST_LAG: f64 = 0.05;

/// The rest of a scene, from where the body leaves the models on the plate.
pub(super) struct Slide<'a> {
    pub scene: &'a Scene,
    pub tolerance_m: f64,
    pub from: &'a HandOver,
}

impl Slide<'_> {
    /// Runs the rigid model to the end, with its bound as the error of the method. Returns
    /// `None`, and takes no samples, if the bound exceeds the tolerance.
    pub(super) fn run<D: Drive + Clone>(
        &self,
        drive: &mut D,
        samples: Option<&mut Samples<'_>>,
    ) -> Option<RunOutcome> {
        let contact = StiffContact::of(self.scene, drive.shortest_time_s())?;
        let tolerance = (self.tolerance_m * METHOD_SHARE).min(COARSEST_M);
        if tolerance < FINEST_M {
            return None;
        }
        let pace = Pace::Tolerance(tolerance);
        let by = Configuration::new(Model::Sliding, Method::Dopri5, pace).ok()?;
        let runner = SceneRunner::new(MOST_STEPS, self.scene, &by);
        let left = &self.from.left;
        let start = contact.without_creep(&left.motion)?;
        let mut tried = drive.clone();
        let most_m = self.tolerance_m - self.from.error_m;
        let depth = contact.body.rest_height_m() - left.motion.position.z;
        let carried = depth / contact.sag_per_normal;
        let bound = ErrorBound::default();
        let mut bound = SlideBound { contact, most_m, carried, bound, last: None };
        let from = (left.at_s, &start, contact.lag);
        let mut run = runner.sliding_from(from, &mut tried, None, &mut bound).ok()?;
        run.statistics.method_error_m += bound.bound.after(0.0);
        if run.statistics.method_error_m > most_m {
            return None;
        }
        if samples.is_some() {
            runner.sliding_from(from, drive, samples, &mut NoObserver).ok()?;
        } else {
            *drive = tried;
        }
        Some(run)
    }
}

/// The contact of a body on a plate that is nearly rigid.
#[derive(Clone, Copy)]
struct StiffContact {
    body: Body,
    friction: f64,
    threshold: f64,
    /// Depth per normal force per mass, m/K, s².
    sag_per_normal: f64,
    /// Delay of the depth, D/K, s.
    lag: f64,
    /// The decays λ₁ < λ₂ of the depth, 1/s.
    decay: [f64; 2],
}

/// Error of the impulse while the damper holds a body that leaves, as a share of it.
/// Chosen: its normal force is taken to fall at a steady rate.
const HOLD_SHARE: f64 = 0.3;

/// Velocity that a change between slip and no slip costs, in rates of the depth; chosen.
const CHANGE_SHARE: f64 = 2.0;

impl StiffContact {
    /// Returns `None` if the contact oscillates, or is soft compared with the shortest time
    /// of the plate, s.
    fn of(scene: &Scene, time: f64) -> Option<Self> {
        let (body, contact) = (scene.body(), &scene.contact);
        let stiffness = contact.stiffness_n_per_m();
        let lag = contact.damping_n_s_per_m() / stiffness;
        let decay = decays(body.mass_kg(), contact)?;
        (lag <= LONGEST_LAG * time.min(scene.duration_s)).then(|| Self {
            body,
            friction: contact.friction(),
            threshold: contact.slip_threshold_m_s(),
            sag_per_normal: body.mass_kg() / stiffness,
            lag,
            decay,
        })
    }

    /// Returns the motion without a slip that is creep: friction has stopped it. `None` if
    /// the body is deeper in the plate than its weight presses it, and is thrown up.
    fn without_creep(&self, at: &Motion) -> Option<Motion> {
        let (body, mut to) = (&self.body, *at);
        let depth = body.rest_height_m() - at.position.z;
        if depth > DEEPEST * GRAVITY_M_S2 * self.sag_per_normal {
            return None;
        }
        let [x, y] = body.slip(&at.velocity, &at.spin).map(|s| {
            if depth >= 0.0 && s.abs() <= self.threshold { s / body.slip_ease() } else { 0.0 }
        });
        to.velocity += Vector3::new(x, y, 0.0) / body.mass_kg();
        to.spin += Vector3::new(y, -x, 0.0) * (body.arm_m() * body.inverse_inertia());
        Some(to)
    }

    /// Returns what an impulse per mass along the normal changes, m/s: the velocity along the
    /// normal, and by friction that along both axes, now and at the next landing.
    fn pull(&self, impulse: f64) -> f64 {
        (1.0 + 2.0 * SQRT_2 * self.friction) * impulse
    }

    /// Returns the normal force per mass that a rigid plate needs at `y`, m/s².
    fn normal(y: &[f64; 9], plate: &PlateMotion) -> f64 {
        let at = Motion::from_row(y);
        -plate.free(&at.position, &at.velocity).z
    }
}

/// Carries the bound along a run of the rigid model.
struct SlideBound {
    contact: StiffContact,
    /// Bound at which the run ends, m.
    most_m: f64,
    /// Normal force per mass that the contact carries at the start, m/s².
    carried: f64,
    bound: ErrorBound,
    last: Option<Last>,
}

/// The end of the last step.
struct Last {
    phase: Phase,
    /// Velocity away from the plate, m/s.
    rise: f64,
    /// Normal force per mass that a rigid plate needs, m/s².
    normal: f64,
    /// Duration of the step, s.
    duration: f64,
}

impl SlideBound {
    /// Returns what one step in `phase` adds, and the square of the rate of growth, 1/s².
    fn within(
        &self,
        phase: &Phase,
        h: f64,
        [n0, n1]: [f64; 2],
        plate: &PlateMotion,
    ) -> (WindowError, f64) {
        let c = &self.contact;
        let (turn, alpha) = (plate.omega.norm(), plate.alpha.norm());
        let shake = turn * turn + alpha;
        let Phase::Contact(holds) = phase else {
            return (WindowError::default(), shake);
        };
        let slips = holds.iter().any(|hold| *hold != Hold::Stick);
        // A velocity error e changes the normal force by 2·|Ω|·e, and friction by μ times
        // that along both axes.
        let grip = if slips { SQRT_2 * c.friction } else { 0.0 };
        let drag = grip * turn;
        let rate = drag + (drag * drag + (1.0 + grip) * shake).sqrt();
        let sag = c.sag_per_normal * n0.abs().max(n1.abs()).max(GRAVITY_M_S2);
        let share = 1.0 / (c.body.mass_kg() * c.body.slip_ease());
        let slip = SQRT_2 * c.threshold;
        let offset = share * slip + 2.0 * sag * turn;
        let acceleration = sag * shake + 2.0 * plate.omega.z.abs() * (offset + slip);
        let mut added =
            WindowError { position: offset * h, velocity: acceleration * h, passing: grip * sag };
        if n1 < 0.0 {
            added.velocity += HOLD_SHARE * c.pull(n1.abs() * h / 2.0);
        }
        (added, rate * rate)
    }

    /// Returns what a landing with the velocity `v` towards the plate adds.
    ///
    /// An axis that slips on is slowed by all of it in the end. One that stops is held by
    /// what is left of the normal force when the plate takes back what it gave.
    fn landing(
        &self,
        v: f64,
        n: f64,
        holds: &[Hold; 2],
        slip: [f64; 2],
        friction: [f64; 2],
    ) -> WindowError {
        let c = &self.contact;
        let [slow, fast] = c.decay;
        let back = c.friction * v * slow / fast;
        let least = c.friction * (n - v * slow * slow / fast);
        let reach = 2.0 * back * c.body.mass_kg() * c.body.slip_ease() + c.threshold;
        let lost = [0, 1].map(|a| match holds[a] {
            Hold::Stick if friction[a].abs() <= SURE_TO_ROLL * least => 0.0,
            Hold::Slip(_) if slip[a].abs() > reach => 0.0,
            _ => 2.0 * back,
        });
        WindowError {
            position: SQRT_2 * c.friction * v / fast,
            velocity: lost[0].hypot(lost[1]),
            passing: 0.0,
        }
    }

    /// Returns what it costs that the damper does not hold a body whose normal force per mass
    /// jumps from `carried` to n < 0, until its depth is 0, nor for `more` s.
    fn thrown(&self, n: f64, carried: f64, more: f64) -> WindowError {
        let c = &self.contact;
        if n >= 0.0 {
            return WindowError::default();
        }
        let hold = c.lag * (carried.max(0.0) / -n).ln_1p() + more.max(0.0);
        let velocity = c.pull(-n * hold);
        WindowError { velocity, ..WindowError::default() }
    }

    /// Returns what a change between slip and no slip adds, in a step in which the normal
    /// force changes from n₀ to n₁.
    fn change(&self, h: f64, [n0, n1]: [f64; 2]) -> WindowError {
        let c = &self.contact;
        let rate = c.sag_per_normal * (n1 - n0).abs() / h;
        let velocity = CHANGE_SHARE * SQRT_2 * c.friction * rate;
        WindowError { velocity, ..WindowError::default() }
    }
}

impl<'p, D: Drive> StepObserver<DrivenSliding<'p, D>, 9> for SlideBound {
    fn step(
        &mut self,
        system: &DrivenSliding<'p, D>,
        t: [f64; 2],
        y: [&[f64; 9]; 2],
    ) -> Result<(), Failure> {
        let (phase, h) = (system.phase, t[1] - t[0]);
        if phase == Phase::Fallen {
            return Err(Failure::OutOfRange { at_s: t[0], why: "the body passes the edge" });
        }
        // The plate's acceleration may have jumped since the end of the last step.
        let (before, plate) = (system.plate.at(t[0]), system.plate.at(t[1]));
        let n = [StiffContact::normal(y[0], &before), StiffContact::normal(y[1], &plate)];
        let (mut added, growth) = self.within(&phase, h, n, &plate);
        let change = match (&self.last, &phase) {
            (Some(Last { phase: Phase::Flight, rise, .. }), Phase::Contact(holds)) => {
                let at = Motion::from_row(y[0]);
                let (rate, free) =
                    (system.rate(t[0], y[0]), before.free(&at.position, &at.velocity));
                let friction = [rate[3] - free.x, rate[4] - free.y];
                let slip = self.contact.body.slip(&at.velocity, &at.spin);
                self.landing((-rise).max(0.0), n[0], holds, slip, friction)
            }
            (Some(Last { phase: Phase::Contact(last), .. }), Phase::Contact(now))
                if last != now =>
            {
                self.change(h, n)
            }
            (Some(last @ Last { phase: Phase::Contact(_), .. }), Phase::Flight) => {
                let held = if last.normal < 0.0 { last.duration } else { self.contact.lag };
                self.thrown(n[0], last.normal, self.contact.lag - held)
            }
            (None, Phase::Flight) => self.thrown(n[0], self.carried, 0.0),
            _ => WindowError::default(),
        };
        added.position += change.position;
        added.velocity += change.velocity;
        self.bound.carry(growth, h, &added);
        if self.bound.after(0.0) > self.most_m {
            let why = "what a rigid plate leaves out exceeds the accuracy";
            return Err(Failure::OutOfRange { at_s: t[1], why });
        }
        self.last = Some(Last { phase, rise: y[1][5], normal: n[1], duration: h });
        Ok(())
    }
}
