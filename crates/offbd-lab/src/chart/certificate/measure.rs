//! Measures one rig: the predictions of its calibration, and what is observed.

use std::collections::BTreeSet;

use serde::Serialize;

use super::CertificatePlan;
use crate::chart::ChartError;
use crate::simulation::{
    BallFault, Disturbances, Fault, FaultEffect, Reference, RigModel, SensorFault, ServoFault,
    SimulatedRig, Variety,
};
use offbd_core::diagnosis::{Calibration, FaultMemory, Prospects, ServoProspects, Transition};
use offbd_core::engine::{Engine, Input, Rig, Setup, calibrate_with_prospects};
use offbd_core::maths::median;
use offbd_core::vocabulary::{Axis, FaultCode, FaultStatus, Sample};

/// Reference motions of the calibration sessions.
const CALIBRATION_MOTIONS: [Reference; 3] =
    [Reference::Lissajous, Reference::Circle, Reference::Steps];
/// Duration of a calibration session, s; chosen: as `offbd soak` does.
const CALIBRATION_S: f64 = 120.0;
/// Duration of a healthy session, s: an hour.
const HOUR_S: f64 = 3600.0;
/// Disturbances in healthy sessions; chosen: as `offbd soak` does.
const DISTURBANCES: Disturbances = Disturbances { pushes_per_minute: 2.0, gusts_per_minute: 1.0 };
/// Onset of a fault in its session, s; chosen.
const ONSET_S: f64 = 15.0;
/// Time after the onset at which a fault counts as not detected, s; chosen.
const HORIZON_S: f64 = 10.0;

/// Predicted and observed false alarms and delays of one rig.
#[derive(Clone, Debug, Serialize)]
pub(super) struct RigResult {
    pub(super) rig: String,
    /// Why the calibration was refused, if it was.
    pub(super) refused: Option<String>,
    pub(super) monitors: Vec<FalseAlarms>,
    pub(super) delays: Vec<DetectionDelay>,
}

/// False alarms of one monitor.
#[derive(Clone, Debug, Serialize)]
pub(super) struct FalseAlarms {
    pub(super) code: &'static str,
    pub(super) promised_per_h: f64,
    /// Rate that nine of ten rigs are promised to stay below.
    pub(super) most_per_h: f64,
    pub(super) came: u32,
    pub(super) watched_h: f64,
}

/// Predicted and observed median delay of one fault; `None` if less than half were
/// detected in time.
#[derive(Clone, Debug, Serialize)]
pub(super) struct DetectionDelay {
    pub(super) fault: &'static str,
    pub(super) promised_s: Option<f64>,
    pub(super) came_s: Option<f64>,
}

/// A fault whose detection delay a calibration predicts.
struct PromisedDelay {
    fault: &'static str,
    effect: FaultEffect,
    promised_s: Option<f64>,
}

/// Calibrates the rig of `seed`, counts its false alarms, and measures the delays of
/// injected faults.
pub(super) fn rig(plan: &CertificatePlan, seed: u64) -> Result<RigResult, ChartError> {
    let model = Variety::Real.rig(seed)?;
    let sessions = calibration_sessions(&model, seed)?;
    let name = model.rig.name.clone();
    let none = RigResult { rig: name, refused: None, monitors: Vec::new(), delays: Vec::new() };
    let calibration = match calibrate_with_prospects(&model.rig, &sessions) {
        Ok(calibration) => calibration,
        Err(refusal) => return Ok(RigResult { refused: Some(refusal.to_string()), ..none }),
    };
    let rig = Rig { calibration: Some(Box::new(calibration.clone())), ..model.rig.clone() };
    let setup = Setup::new(rig, None)?;
    let monitors = watch(plan, &model, &setup, &calibration, seed)?;
    let delays = promises(&calibration)
        .into_iter()
        .map(|promise| delay(plan, &model, &setup, promise, seed))
        .collect::<Result<_, ChartError>>()?;
    Ok(RigResult { monitors, delays, ..none })
}

/// Returns a seed for the `n`-th session of a purpose; seeds of different rigs differ.
fn session_seed(seed: u64, purpose: u64, n: u64) -> u64 {
    seed.wrapping_add((100 * purpose + n + 1) << 32)
}

fn simulated(
    model: &RigModel,
    reference: Reference,
    disturbances: Disturbances,
    seed: u64,
) -> Result<SimulatedRig, ChartError> {
    Ok(SimulatedRig::new(model.of_session(seed), reference, disturbances, seed)?)
}

fn samples(rig: &mut SimulatedRig, seconds: f64) -> impl Iterator<Item = Sample> {
    std::iter::from_fn(|| Some(rig.next_sample())).take_while(move |s| s.t_s <= seconds)
}

fn calibration_sessions(model: &RigModel, seed: u64) -> Result<Vec<Vec<Sample>>, ChartError> {
    let session = |(n, reference): (u64, Reference)| {
        let seed = session_seed(seed, 0, n);
        let mut rig = simulated(model, reference, Disturbances::default(), seed)?;
        Ok(samples(&mut rig, CALIBRATION_S).collect())
    };
    (0..).zip(CALIBRATION_MOTIONS).map(session).collect()
}

/// Simulates healthy sessions; returns the false alarms by monitor.
fn watch(
    plan: &CertificatePlan,
    model: &RigModel,
    setup: &Setup,
    calibration: &Calibration,
    seed: u64,
) -> Result<Vec<FalseAlarms>, ChartError> {
    let mut came = [0_u32; FaultCode::COUNT];
    for n in 0..plan.healthy_h {
        let reference = Reference::ALL[n as usize % Reference::ALL.len()];
        let mut rig = simulated(model, reference, DISTURBANCES, session_seed(seed, 1, n))?;
        count(setup, samples(&mut rig, HOUR_S), &mut came);
    }
    let Some(certificate) = &calibration.certificate else { return Ok(Vec::new()) };
    let alarms = |(i, code): (usize, &FaultCode)| {
        let promised_per_h = certificate[i].alarms_per_hour?;
        let most_per_h = certificate[i].most_alarms_per_hour?;
        let (came, watched_h) = (came[i], plan.healthy_h as f64);
        Some(FalseAlarms { code: code.as_str(), promised_per_h, most_per_h, came, watched_h })
    };
    Ok(FaultCode::ALL.iter().enumerate().filter_map(alarms).collect())
}

/// Counts the false alarms of one session. A fault that is reported again, with its kind,
/// counts once.
fn count(setup: &Setup, samples: impl Iterator<Item = Sample>, came: &mut [u32]) {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let (mut transitions, mut failing) = (Vec::new(), BTreeSet::new());
    for sample in samples {
        engine.handle(Input::Sample(sample), &mut transitions);
        for change in transitions.drain(..) {
            if !change.byte.test_failed() {
                failing.remove(&change.code);
            } else if change.status == FaultStatus::Confirmed && failing.insert(change.code) {
                came[change.code as usize] += 1;
            }
        }
    }
}

/// Returns every fault for which the calibration predicts a delay, or that it will not be
/// detected.
fn promises(calibration: &Calibration) -> Vec<PromisedDelay> {
    let Some(prospects) = &calibration.prospects else { return Vec::new() };
    let servo = |axis: Axis| {
        prospects.servos[axis].as_ref().map_or(Vec::new(), |servo| of_servo(axis, servo))
    };
    Axis::ALL.into_iter().flat_map(servo).chain(of_rig(prospects)).collect()
}

fn of_servo(axis: Axis, servo: &ServoProspects) -> Vec<PromisedDelay> {
    let slip = ServoFault::Offset(1_f64.to_radians());
    [
        ("servo dead", ServoFault::Dead, servo.dead_s),
        ("servo answers half", ServoFault::Gain(0.5), servo.half_gain_s),
        ("servo off by 1°", slip, servo.offset_1deg_s),
    ]
    .map(|(fault, kind, promised_s)| {
        let effect = FaultEffect::Servo(axis, kind);
        PromisedDelay { fault, effect, promised_s }
    })
    .into()
}

fn of_rig(prospects: &Prospects) -> [PromisedDelay; 3] {
    let Prospects { stuck_s, frozen_s, unseen_s, .. } = *prospects;
    [
        ("ball stuck", FaultEffect::Ball(BallFault::Glued), stuck_s),
        ("readings frozen", FaultEffect::Sensor(SensorFault::Freeze), frozen_s),
        ("no readings", FaultEffect::Sensor(SensorFault::Dropout(1.0)), unseen_s),
    ]
    .map(|(fault, effect, promised_s)| PromisedDelay { fault, effect, promised_s })
}

/// Measures the median delay of a fault over sessions with the reference motions of the
/// calibration.
fn delay(
    plan: &CertificatePlan,
    model: &RigModel,
    setup: &Setup,
    promise: PromisedDelay,
    seed: u64,
) -> Result<DetectionDelay, ChartError> {
    let PromisedDelay { fault, effect, promised_s } = promise;
    let purpose = 2 + effect.code() as u64;
    let mut delays = Vec::new();
    for n in 0..plan.n_faulty {
        let reference = CALIBRATION_MOTIONS[n as usize % CALIBRATION_MOTIONS.len()];
        let seed = session_seed(seed, purpose, n);
        let mut rig = simulated(model, reference, Disturbances::default(), seed)?;
        rig.inject(Fault { effect, onset_s: ONSET_S, end_s: None });
        let recorded = samples(&mut rig, ONSET_S + HORIZON_S);
        delays.push(found_s(setup, recorded, effect.code()).unwrap_or(f64::INFINITY));
    }
    let came_s = median(&mut delays).filter(|delay| delay.is_finite());
    Ok(DetectionDelay { fault, promised_s, came_s })
}

/// Returns the time from the onset to the confirmation of the code `wanted`, s.
fn found_s(setup: &Setup, samples: impl Iterator<Item = Sample>, wanted: FaultCode) -> Option<f64> {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let mut transitions = Vec::new();
    for sample in samples {
        engine.handle(Input::Sample(sample), &mut transitions);
        let confirms = |t: Transition| t.code == wanted && t.status == FaultStatus::Confirmed;
        let confirmed = transitions.drain(..).any(confirms);
        if confirmed && sample.t_s > ONSET_S {
            return Some(sample.t_s - ONSET_S);
        }
    }
    None
}
