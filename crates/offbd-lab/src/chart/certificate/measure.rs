//! One rig: what its calibration promises, and what comes.

use std::collections::BTreeSet;

use serde::Serialize;

use super::Plan;
use crate::chart::ChartError;
use crate::simulation::{
    BallFault, Disturbances, Fault, FaultEffect, Reference, RigModel, SensorFault, ServoFault,
    SimulatedRig, Variety,
};
use offbd_core::diagnosis::{Calibration, FaultMemory, Prospects, ServoProspects};
use offbd_core::engine::{Engine, Input, Output, Rig, Setup, calibrate_and_foresee};
use offbd_core::maths::median;
use offbd_core::vocabulary::{Axis, FaultCode, FaultStatus, Sample};

/// What the ball does while the rig is learnt, and for how long, s.
const LEARNT_FROM: [Reference; 3] = [Reference::Lissajous, Reference::Circle, Reference::Steps];
const LEARNT_S: f64 = 120.0;
const HOUR_S: f64 = 3600.0;
/// Hands and air while it is watched, per minute.
const HANDS: Disturbances = Disturbances { pushes_per_minute: 2.0, gusts_per_minute: 1.0 };
/// When a fault begins in its session, and when it counts as not found, s.
const ONSET_S: f64 = 15.0;
const HORIZON_S: f64 = 10.0;

/// What was promised of one rig, and what came.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Measured {
    pub(super) rig: String,
    /// Why nothing could be learnt of it.
    pub(super) refused: Option<String>,
    pub(super) monitors: Vec<Alarms>,
    pub(super) delays: Vec<Delay>,
}

/// False alarms of one monitor.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Alarms {
    pub(super) code: &'static str,
    pub(super) promised_per_h: f64,
    pub(super) came: u32,
    pub(super) watched_h: f64,
}

/// Median delay of one fault; none where fewer than half were found in time.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Delay {
    pub(super) fault: &'static str,
    pub(super) promised_s: Option<f64>,
    pub(super) came_s: Option<f64>,
}

/// A fault of which a calibration says how soon it is found.
struct Promise {
    fault: &'static str,
    effect: FaultEffect,
    promised_s: Option<f64>,
}

/// Learns the rig of `seed`, watches it, and puts faults into it.
pub(super) fn rig(plan: &Plan, seed: u64) -> Result<Measured, ChartError> {
    let model = Variety::Real.rig(seed)?;
    let sessions = learnt_from(&model, seed)?;
    let name = model.rig.name.clone();
    let none = Measured { rig: name, refused: None, monitors: Vec::new(), delays: Vec::new() };
    let learnt = match calibrate_and_foresee(&model.rig, &sessions, "", "") {
        Ok(learnt) => learnt,
        Err(refusal) => return Ok(Measured { refused: Some(refusal.to_string()), ..none }),
    };
    let rig = Rig { calibration: Some(learnt.clone()), ..model.rig.clone() };
    let setup = Setup::new(rig, None)?;
    let monitors = watch(plan, &model, &setup, &learnt, seed)?;
    let delays = promises(&learnt)
        .into_iter()
        .map(|promise| delay(plan, &model, &setup, promise, seed))
        .collect::<Result<_, ChartError>>()?;
    Ok(Measured { monitors, delays, ..none })
}

/// A seed for the `n`-th session of a purpose; those of different rigs differ.
fn session_seed(seed: u64, purpose: u64, n: u64) -> u64 {
    seed.wrapping_add((100 * purpose + n + 1) << 32)
}

fn simulated(
    model: &RigModel,
    reference: Reference,
    hands: Disturbances,
    seed: u64,
) -> Result<SimulatedRig, ChartError> {
    Ok(SimulatedRig::new(model.of_session(seed), reference, hands, seed)?)
}

fn samples(rig: &mut SimulatedRig, seconds: f64) -> impl Iterator<Item = Sample> {
    std::iter::from_fn(|| Some(rig.next_sample())).take_while(move |s| s.t_s <= seconds)
}

fn learnt_from(model: &RigModel, seed: u64) -> Result<Vec<Vec<Sample>>, ChartError> {
    let session = |(n, reference): (u64, Reference)| {
        let seed = session_seed(seed, 0, n);
        let mut rig = simulated(model, reference, Disturbances::default(), seed)?;
        Ok(samples(&mut rig, LEARNT_S).collect())
    };
    (0..).zip(LEARNT_FROM).map(session).collect()
}

/// Hours of healthy operation, counted by monitor.
fn watch(
    plan: &Plan,
    model: &RigModel,
    setup: &Setup,
    learnt: &Calibration,
    seed: u64,
) -> Result<Vec<Alarms>, ChartError> {
    let mut came = [0_u32; FaultCode::COUNT];
    for n in 0..plan.healthy_h {
        let reference = Reference::ALL[n as usize % Reference::ALL.len()];
        let mut rig = simulated(model, reference, HANDS, session_seed(seed, 1, n))?;
        count(setup, samples(&mut rig, HOUR_S), &mut came);
    }
    let Some(certificate) = &learnt.certificate else { return Ok(Vec::new()) };
    let alarms = |(i, code): (usize, &FaultCode)| {
        let promised_per_h = certificate[i].alarms_per_hour?;
        let watched_h = plan.healthy_h as f64;
        Some(Alarms { code: code.as_str(), promised_per_h, came: came[i], watched_h })
    };
    Ok(FaultCode::ALL.iter().enumerate().filter_map(alarms).collect())
}

/// Counts the false alarms of one session. One that is told again with its kind
/// is the same.
fn count(setup: &Setup, samples: impl Iterator<Item = Sample>, came: &mut [u32]) {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let (mut outputs, mut failing) = (Vec::new(), BTreeSet::new());
    for sample in samples {
        engine.handle(Input::Sample(sample), &mut outputs);
        for output in outputs.drain(..) {
            let Output::Transition(change) = output else { continue };
            if !change.byte.test_failed() {
                failing.remove(&change.code);
            } else if change.status == FaultStatus::Confirmed && failing.insert(change.code) {
                came[change.code as usize] += 1;
            }
        }
    }
}

/// Every fault of which a delay is promised, or that it will not be found.
fn promises(learnt: &Calibration) -> Vec<Promise> {
    let Some(prospects) = &learnt.prospects else { return Vec::new() };
    let servo = |axis: Axis| {
        prospects.servos[axis].as_ref().map_or(Vec::new(), |servo| of_servo(axis, servo))
    };
    Axis::ALL.into_iter().flat_map(servo).chain(of_rig(prospects)).collect()
}

fn of_servo(axis: Axis, servo: &ServoProspects) -> Vec<Promise> {
    let slip = ServoFault::Offset(1_f64.to_radians());
    [
        ("servo dead", ServoFault::Dead, servo.dead_s),
        ("servo answers half", ServoFault::Gain(0.5), servo.half_gain_s),
        ("servo off by 1°", slip, servo.offset_1deg_s),
    ]
    .map(|(fault, kind, promised_s)| {
        let effect = FaultEffect::Servo(axis, kind);
        Promise { fault, effect, promised_s }
    })
    .into()
}

fn of_rig(prospects: &Prospects) -> [Promise; 3] {
    let Prospects { stuck_s, frozen_s, unseen_s, .. } = *prospects;
    [
        ("ball stuck", FaultEffect::Ball(BallFault::Glued), stuck_s),
        ("readings frozen", FaultEffect::Sensor(SensorFault::Freeze), frozen_s),
        ("no readings", FaultEffect::Sensor(SensorFault::Dropout(1.0)), unseen_s),
    ]
    .map(|(fault, effect, promised_s)| Promise { fault, effect, promised_s })
}

/// The median delay of a fault over sessions of its own, each while the ball does
/// what it did when the rig was learnt.
fn delay(
    plan: &Plan,
    model: &RigModel,
    setup: &Setup,
    promise: Promise,
    seed: u64,
) -> Result<Delay, ChartError> {
    let Promise { fault, effect, promised_s } = promise;
    let purpose = 2 + effect.code() as u64;
    let mut delays = Vec::new();
    for n in 0..plan.n_faulty {
        let reference = LEARNT_FROM[n as usize % LEARNT_FROM.len()];
        let seed = session_seed(seed, purpose, n);
        let mut rig = simulated(model, reference, Disturbances::default(), seed)?;
        rig.inject(Fault { effect, onset_s: ONSET_S, end_s: None });
        let recorded = samples(&mut rig, ONSET_S + HORIZON_S);
        delays.push(found_s(setup, recorded, effect.code()).unwrap_or(f64::INFINITY));
    }
    let came_s = median(&mut delays).filter(|delay| delay.is_finite());
    Ok(Delay { fault, promised_s, came_s })
}

/// When the fault was confirmed under its code, s after its onset.
fn found_s(setup: &Setup, samples: impl Iterator<Item = Sample>, wanted: FaultCode) -> Option<f64> {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let mut outputs = Vec::new();
    for sample in samples {
        engine.handle(Input::Sample(sample), &mut outputs);
        let confirmed = outputs.drain(..).any(|output| match output {
            Output::Transition(t) => t.code == wanted && t.status == FaultStatus::Confirmed,
            Output::Admitted(_) => false,
        });
        if confirmed && sample.t_s > ONSET_S {
            return Some(sample.t_s - ONSET_S);
        }
    }
    None
}
