//! A simulated trial of a drive cycle: a ball that follows the twin of a learnt rig, run
//! by the cycle's control law and judged by the rig's own engine.
//!
//! The rig of a trial differs from the learnt one as sessions differ, in level and gain,
//! by the learnt spread. The learnt model error acts on the ball, its readings have the
//! learnt noise, and it sticks up to the learnt breakaway. The device takes one period to
//! respond to a reading.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use core::f64::consts::{SQRT_2, TAU};

use nalgebra::Vector2;

use super::fault::{Effect, TriedFault};
use super::noise::{normal, uniform};
use super::{DriveCycle, DriveLaw};
use crate::diagnosis::{FaultMemory, Transition};
use crate::engine::{Engine, Input, Reach, Setup};
use crate::plant::{PlateShape, RollingState, Twin, TwinModel};
use crate::vocabulary::{Axis, FaultCode, FaultStatus, PerAxis, Sample, SimTime};

/// Speed below which friction may stop a ball, m/s. Chosen.
const STICKS_M_S: f64 = 0.003;
/// Period of the simulated model error, s. Chosen: it keeps its sign for about as long as
/// the correlation time that the monitors assume (0.5 s).
const LEFT_OUT_S: f64 = 1.7;
/// Initial position of the ball as a fraction of the half plate. Chosen.
const START_SHARE: f64 = 0.1;

/// How the session of a trial differs from the rig's mean.
#[derive(Clone, Copy, Debug)]
pub(super) struct Variant {
    /// Level and gain in standard deviations, and the side on which the ball starts.
    pub off: PerAxis<f64>,
    /// Fraction of the level's standard deviation that is applied.
    pub spread: f64,
    /// Stream of the noise.
    pub stream: u64,
}

impl Variant {
    /// The mean session, and both diagonals.
    pub(super) const fn all(spread: f64) -> [Self; 3] {
        [
            Self::new(0.0, 0.0, spread, 1),
            Self::new(1.0, -1.0, spread, 2),
            Self::new(-1.0, 1.0, spread, 3),
        ]
    }

    const fn new(x: f64, y: f64, spread: f64, stream: u64) -> Self {
        Self { off: PerAxis { x, y }, spread, stream }
    }
}

/// The outcome of a trial.
#[derive(Clone, Debug, Default)]
pub(super) struct TrialOutcome {
    /// Time at which each monitor first passed, s; `None` if it did not, or could judge
    /// for too short a time to find a fault.
    pub passed_s: [Option<f64>; FaultCode::COUNT],
    /// Time, s, and transition of the first confirmed fault.
    pub confirmed: Option<(f64, Transition)>,
    /// Whether a test failed.
    pub failed: bool,
    /// Whether the ball reached the edge.
    pub at_edge: bool,
    /// Number of judged samples.
    pub n_judged: u64,
}

/// Runs `cycle` on a rig like that of `setup`, whose sensor reads in the plate's own
/// frame, with or without a fault.
pub(super) fn run(
    setup: &Setup,
    cycle: &DriveCycle,
    variant: Variant,
    fault: Option<TriedFault>,
) -> TrialOutcome {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let effect = fault.map_or(Effect::HEALTHY, TriedFault::effect);
    let mut plant = Plant::new(setup, variant, effect);
    let (mut law, mut commands) = (DriveLaw::default(), cycle.first_commands());
    let (mut outcome, mut transitions) = (TrialOutcome::default(), Vec::new());
    let period_s = 1.0 / setup.rig.sample_rate_hz;
    let n = (cycle.duration_s / period_s).floor() as u64;
    for i in 0..=n {
        let t_s = i as f64 * period_s;
        plant.advance(t_s, commands);
        let read = plant.read(i);
        let sample = Sample { cmd_qx_rad: commands.y, cmd_qy_rad: commands.x, t_s, ..read };
        commands = law.command(cycle, &sample);
        transitions.clear();
        engine.handle(Input::Sample(sample), &mut transitions);
        outcome.n_judged += 1;
        outcome.at_edge |= plant.at_edge();
        outcome.take(t_s, &engine, &mut transitions);
        let spoilt = fault.is_none() && (outcome.at_edge || outcome.failed);
        if spoilt || outcome.confirmed.is_some() {
            return outcome;
        }
    }
    let monitors = engine.state().monitors;
    for (passed_s, monitor) in outcome.passed_s.iter_mut().zip(monitors) {
        *passed_s = passed_s.filter(|_| monitor.reach == Reach::Judged);
    }
    outcome
}

impl TrialOutcome {
    fn take(&mut self, t_s: f64, engine: &Engine, transitions: &mut Vec<Transition>) {
        for (&code, passed_s) in FaultCode::ALL.iter().zip(&mut self.passed_s) {
            let completed = engine.memory().record(code).status.completed_this_cycle();
            *passed_s = passed_s.or(completed.then_some(t_s));
        }
        for transition in transitions.drain(..) {
            self.failed |= transition.byte.test_failed();
            if transition.status == FaultStatus::Confirmed && self.confirmed.is_none() {
                self.confirmed = Some((t_s, transition));
            }
        }
    }
}

/// The simulated rig of a trial.
struct Plant<'a> {
    setup: &'a Setup,
    variant: Variant,
    effect: Effect,
    twin: Twin,
    position: Vector2<f64>,
    velocity: Vector2<f64>,
    now_s: f64,
    lost: bool,
    last_look: Option<(f64, Sample)>,
}

impl<'a> Plant<'a> {
    fn new(setup: &'a Setup, variant: Variant, effect: Effect) -> Self {
        let start = |axis: Axis| {
            let half_m = setup.rig.plate.half_extent_m(axis);
            if has(setup, axis) { START_SHARE * variant.off[axis] * half_m } else { 0.0 }
        };
        Self {
            twin: Twin::new(model(setup, variant)),
            position: Vector2::new(start(Axis::X), start(Axis::Y)),
            velocity: Vector2::zeros(),
            now_s: 0.0,
            lost: false,
            last_look: None,
            setup,
            variant,
            effect,
        }
    }

    /// Advances to `t_s`, from when on `commands` hold.
    fn advance(&mut self, t_s: f64, commands: PerAxis<Option<f64>>) {
        let Some(at) = SimTime::new(t_s) else { return };
        let answers = self.effect.answers;
        let answered = PerAxis::from_fn(|axis| commands[axis].map(|c| answers[axis] * c));
        let dt = t_s - self.now_s;
        self.now_s = t_s;
        let observed = RollingState { position: self.position, velocity: self.velocity, spin: 0.0 };
        self.twin.rebase(self.position, self.velocity);
        self.twin.advance(at, answered, &observed);
        if dt > 0.0 && !self.effect.sticks && !self.lost {
            self.roll(dt);
            self.hold_at_the_edge();
        }
    }

    fn roll(&mut self, dt: f64) {
        let motion = *self.twin.motion();
        let beyond = Vector2::new(self.left_out(Axis::X), self.left_out(Axis::Y));
        let pull = motion.acceleration + beyond;
        if self.velocity.norm() < STICKS_M_S && pull.norm() < self.breakaway_m_s2() {
            self.velocity = Vector2::zeros();
            return;
        }
        self.position = motion.position + beyond * (dt * dt / 2.0);
        self.velocity = motion.velocity + beyond * dt;
    }

    /// The simulated model error along `axis`, m/s².
    fn left_out(&self, axis: Axis) -> f64 {
        let learnt = self.setup.rig.calibration.as_ref().and_then(|c| c.axes[axis]);
        let size = learnt.map_or(0.0, |l| SQRT_2 * l.model_error_m_s2);
        size * (TAU * (self.now_s / LEFT_OUT_S + 0.3 * self.variant.stream as f64)).sin()
    }

    fn breakaway_m_s2(&self) -> f64 {
        let learnt = self.setup.rig.calibration.as_ref();
        let of = |axis: Axis| {
            let known = learnt.and_then(|c| c.axes[axis]);
            known.map_or(0.0, |l| l.breakaway_rad * l.gain.abs())
        };
        of(Axis::X).max(of(Axis::Y)) * self.setup.rig.ball.rolling_gravity()
    }

    /// Distance of the ball from the edge, m.
    fn edge_m(&self) -> f64 {
        self.setup.rig.plate.edge_distance_m(self.position.x, self.position.y)
    }

    fn at_edge(&self) -> bool {
        self.edge_m() < self.setup.rig.contact_room_m()
    }

    /// Stops the ball at a rim, or drops it off a plate without one.
    fn hold_at_the_edge(&mut self) {
        let (plate, side_m) = (&self.setup.rig.plate, self.setup.rig.ball.radius_m());
        if !plate.rim() {
            self.lost |= self.edge_m() < 0.0;
            return;
        }
        if self.edge_m() >= side_m {
            return;
        }
        if let PlateShape::Round { diameter_m } = plate.shape() {
            self.position *= (diameter_m / 2.0 - side_m).max(0.0) / self.position.norm();
            self.velocity = Vector2::zeros();
            return;
        }
        for (i, axis) in Axis::ALL.into_iter().enumerate() {
            let most_m = (plate.half_extent_m(axis) - side_m).max(0.0);
            if self.position[i].abs() > most_m {
                self.position[i] = most_m.copysign(self.position[i]);
                self.velocity[i] = 0.0;
            }
        }
    }

    /// The sensor's reading at the `i`th sample.
    fn read(&mut self, i: u64) -> Sample {
        let refresh_s = self.setup.rig.calibration.as_ref().map_or(0.0, |c| c.sensor.refresh_s);
        let held = |&(at_s, _): &(f64, Sample)| {
            self.effect.repeats || self.now_s - at_s < refresh_s - 1e-6
        };
        if let Some((_, reading)) = self.last_look.filter(held) {
            return reading;
        }
        let reading = self.look(i);
        self.last_look = Some((self.now_s, reading));
        reading
    }

    fn look(&self, i: u64) -> Sample {
        if self.lost || self.effect.is_blind {
            return Sample::default();
        }
        let stream = 8 * self.variant.stream;
        let spike = uniform(stream, i) < self.effect.spike_share;
        let along = |axis: Axis| {
            let (stream, half_m) =
                (stream + 1 + axis as u64, self.setup.rig.plate.half_extent_m(axis));
            let of_noise = self.noise_m(axis) * normal(stream, i);
            let anywhere_m = half_m * (2.0 * uniform(stream, i) - 1.0);
            let read_m = if spike { anywhere_m } else { self.position[axis as usize] + of_noise };
            has(self.setup, axis).then_some(read_m)
        };
        Sample { x_m: along(Axis::X), y_m: along(Axis::Y), ..Sample::default() }
    }

    /// Standard deviation of a reading, m.
    fn noise_m(&self, axis: Axis) -> f64 {
        let learnt = self.setup.rig.calibration.as_ref().and_then(|c| c.axes[axis]);
        self.effect.noise_factor * learnt.map_or(0.0, |l| l.noise_m)
    }
}

/// Whether the rig is learnt along `axis`.
fn has(setup: &Setup, axis: Axis) -> bool {
    setup.rig.calibration.as_ref().is_some_and(|c| c.axes[axis].is_some())
}

/// The twin of the session described by `variant`.
fn model(setup: &Setup, variant: Variant) -> TwinModel {
    let mut twin = setup.twin;
    for axis in Axis::ALL {
        let Some(learnt) = setup.rig.calibration.as_ref().and_then(|c| c.axes[axis]) else {
            continue;
        };
        twin.axes[axis].level_rad += variant.spread * variant.off[axis] * learnt.level_spread_rad;
        twin.axes[axis].gain *= 1.0 + variant.off[axis] * learnt.gain_spread;
    }
    twin
}
