//! The rig without noise, and its judgement by one profile.

use crate::cli::lab::scene::course::Sampled;
use offbd_core::diagnosis::{FaultMemory, Profile, Transition};
use offbd_core::engine::{Engine, Input, Output, Rig, Setup};
use offbd_core::plant::{Motion, Plate, PlateShape};
use offbd_core::vocabulary::{Axis, FaultStatus, Invalid, PerAxis, Sample};
use offbd_lab::simulation::{
    ControllerModel, Disturbances, Reference, Refresh, RigModel, SensorModel, ServoTruth,
    SessionSpread, SimulatedRig, Surface, Truth,
};

/// Length of the recording, s.
pub(in crate::cli::lab::scene) const DURATION_S: f64 = 30.0;

/// What the bad servo is late by, s: the chapter's injected fault.
const LATE_S: f64 = 0.5;

/// Between two readings of the plotted signals, s: the chapter's sample time.
pub(super) const PERIOD_S: f64 = 0.1;

/// What the rig did.
pub(super) struct Recording {
    pub rig: Rig,
    pub samples: Vec<Sample>,
    pub truth: Vec<Sampled>,
}

/// The chapter's enable and deviation of both axes at one moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Signal {
    pub at_s: f64,
    pub enabled: [bool; 2],
    /// |a_twin − a_measured|, m/s²; none where it cannot be told.
    pub deviation: [Option<f64>; 2],
}

/// A fault that was reported.
pub(super) struct Reported {
    pub code: String,
    pub kind: Option<String>,
    pub t_s: f64,
}

/// The verdict of one profile.
pub(super) struct Judged {
    pub profile: Profile,
    pub faults: Vec<Reported>,
    pub signals: Vec<Signal>,
}

/// The chapter's models have no edge. A loop through a servo that is 0.5 s late
/// swings by half a metre; on this plate it does so without the rim, whose
/// impacts no twin foresees.
const PLATE_M: f64 = 1.0;

/// The chapter's rule blames y, too, once x is fast enough: its limit lies
/// below what the axes do to each other. This sequence of places keeps below
/// that, and opens the enable condition of both axes.
const SEED: u64 = 1;

/// What the owner knows.
fn rig() -> Result<Rig, Invalid> {
    let shape = PlateShape::Rectangle { length_m: PLATE_M, width_m: PLATE_M };
    let plate = Plate::new(shape, Plate::CHAPTER.thickness_m(), true)?;
    Ok(Rig { plate, ..Rig::chapter("chapter") })
}

/// A rig whose numbers are those that its twin starts from: no noise, no play,
/// level, free of stiction. With a bad x servo, its commands come late.
fn model(bad_x: bool) -> Result<RigModel, Invalid> {
    let rig = rig()?;
    let servo = ServoTruth {
        dead_time_s: rig.servo.dead_time_s,
        lag_s: rig.servo.lag_s,
        rate_limit_rad_s: rig.servo.rate_limit_rad_s,
        gain: 1.0,
        level_rad: 0.0,
        play_rad: 0.0,
    };
    let late = ServoTruth { dead_time_s: servo.dead_time_s + LATE_S, ..servo };
    Ok(RigModel {
        // Slow enough to swing, not to run away, through the late servo.
        controller: ControllerModel {
            bandwidth_rad_s: 1.1,
            damping: 1.0,
            integral: 0.0,
            derivative_filter_s: 0.03,
            limit_rad: rig.servo.angle_limit_rad,
            feedforward: 0.0,
            turn_per_period_rad: ControllerModel::UNTUNED_RAD,
            resolution_rad: 0.0,
        },
        rig,
        servos: PerAxis { x: if bad_x { late } else { servo }, y: servo },
        surface: Surface { breakaway_rad: 0.0, rolling_rad: 0.0, restitution: 0.5 },
        one_axis: false,
        spread: SessionSpread::default(),
        sensor: SensorModel {
            refresh: Refresh::default(),
            latency_s: 0.0,
            noise_m: 0.0,
            quantum_m: 0.0,
            dead_band_m: 0.0,
            origin_m: PerAxis::default(),
            missing: 0.0,
            outliers: 0.0,
            jitter: 0.0,
        },
    })
}

/// Half a minute of the rig, sent to a new place every 3 s.
pub(super) fn record(bad_x: bool) -> Result<Recording, Invalid> {
    let model = model(bad_x)?;
    let owned = model.rig.clone();
    let (height, radius) =
        (model.rig.plate.centre_gap_m(&model.rig.ball), model.rig.ball.radius_m());
    let mut rig = SimulatedRig::new(model, Reference::Steps, Disturbances::default(), SEED)?;
    let (mut samples, mut truth) = (Vec::new(), Vec::new());
    loop {
        let sample = rig.next_sample();
        if sample.t_s > DURATION_S {
            return Ok(Recording { rig: owned, samples, truth });
        }
        samples.push(sample);
        truth.push((sample.t_s, motion(&rig.truth(), height, radius)));
    }
}

/// The rolling ball's motion: spin about z is not simulated.
fn motion(truth: &Truth, height: f64, radius: f64) -> Motion {
    let v = truth.velocity;
    Motion {
        position: truth.position.push(height),
        velocity: v.push(0.0),
        spin: nalgebra::Vector3::new(-v.y / radius, v.x / radius, 0.0),
    }
}

/// The recording before the engine, by `profile`.
pub(super) fn judge(recording: &Recording, profile: Profile) -> Result<Judged, Invalid> {
    let setup = Setup::new(recording.rig.clone(), Some(profile))?;
    let mut engine = Engine::new(setup, FaultMemory::default());
    let mut judged = Judged { profile, faults: Vec::new(), signals: Vec::new() };
    let mut outputs = Vec::new();
    for sample in &recording.samples {
        engine.handle(Input::Sample(*sample), &mut outputs);
        outputs.drain(..).for_each(|output| judged.take(&output));
        judged.look(&engine);
    }
    engine.handle(Input::End, &mut outputs);
    outputs.drain(..).for_each(|output| judged.take(&output));
    Ok(judged)
}

impl Judged {
    fn take(&mut self, output: &Output) {
        let Output::Transition(transition) = output else { return };
        let Transition { code, status, at, suspicion, .. } = &**transition;
        let known = self.faults.iter().any(|fault| fault.code == code.to_string());
        if *status == FaultStatus::Confirmed && !known {
            self.faults.push(Reported {
                code: code.to_string(),
                kind: suspicion.kind.map(|kind| kind.to_string()),
                t_s: at.seconds(),
            });
        }
    }

    fn look(&mut self, engine: &Engine) {
        let evidence = &engine.state().evidence;
        let Some(at) = evidence.at else { return };
        let due = self.signals.last().is_none_or(|s| at.seconds() - s.at_s > PERIOD_S - 1e-6);
        if due {
            self.signals.push(Signal {
                at_s: at.seconds(),
                enabled: Axis::ALL.map(|axis| evidence.axes[axis].enabled),
                deviation: Axis::ALL.map(|axis| evidence.axes[axis].residual_m_s2().map(f64::abs)),
            });
        }
    }

    /// Largest deviation of both axes while enabled, m/s².
    pub(super) fn largest(&self) -> [f64; 2] {
        [0, 1].map(|i| {
            let enabled = self.signals.iter().filter(|signal| signal.enabled[i]);
            enabled.filter_map(|signal| signal.deviation[i]).fold(0.0, f64::max)
        })
    }

    /// What was reported, and when.
    pub(super) fn words(&self) -> String {
        let named = |fault: &Reported| {
            let kind = fault.kind.as_ref().map(|kind| format!(" ({kind})")).unwrap_or_default();
            format!("{}{kind} at {:.2} s", fault.code, fault.t_s)
        };
        let words: Vec<String> = self.faults.iter().map(named).collect();
        if words.is_empty() { "nothing".to_owned() } else { words.join(", ") }
    }
}
