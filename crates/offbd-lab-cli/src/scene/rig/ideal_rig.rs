//! A rig without noise, and its verdict by one profile.

use crate::scene::scene_run::Sampled;
use offbd_core::diagnosis::{FaultMemory, Profile, Transition};
use offbd_core::engine::{Engine, Input, Rig, Setup};
use offbd_core::plant::{Motion, Plate, PlateShape};
use offbd_core::vocabulary::{Axis, FaultCode, FaultStatus, Invalid, PerAxis, Sample};
use offbd_lab::simulation::{
    ControllerModel, Disturbances, Reference, Refresh, RigModel, SensorModel, ServoTruth,
    SessionSpread, SimulatedRig, Surface, Truth,
};

/// Duration of the recording, s; chosen.
pub(in crate::scene) const DURATION_S: f64 = 30.0;

/// Additional delay of the bad servo, s: the chapter's injected fault.
const LATE_S: f64 = 0.5;

/// Interval between the plotted signals, s: the chapter's sample time.
pub(super) const PERIOD_S: f64 = 0.1;

/// The recording of a rig, and its true motion.
pub(super) struct RigRecording {
    pub rig: Rig,
    pub samples: Vec<Sample>,
    pub truth: Vec<Sampled>,
}

/// The chapter's signals of both axes at one time: enable and deviation.
#[derive(Clone, Copy, Debug)]
pub(super) struct DeviationSignal {
    pub at_s: f64,
    pub enabled: [bool; 2],
    /// |a_twin − a_measured|, m/s²; `None` if it is unknown.
    pub deviation: [Option<f64>; 2],
}

/// A fault that was reported.
pub(super) struct ReportedFault {
    pub code: FaultCode,
    pub kind: Option<String>,
    pub t_s: f64,
}

/// The verdict of one profile.
pub(super) struct ProfileVerdict {
    pub profile: Profile,
    pub faults: Vec<ReportedFault>,
    /// Faults that were suspected, and not confirmed.
    pub pending: Vec<ReportedFault>,
    pub signals: Vec<DeviationSignal>,
}

/// Side of the plate, m. Chosen because the chapter's models have no edge: a loop through a
/// servo that is 0.5 s late swings by half a metre, which on this plate does not reach the
/// rim, whose impacts a twin cannot predict.
const PLATE_M: f64 = 1.0;

/// Seed of the sequence of reference positions. Chosen so that both axes are enabled, but x
/// stays so slow that the chapter's rule does not accuse y as well: its limit lies below
/// the coupling of the axes at high speed.
const SEED: u64 = 1;

/// Returns the rig as its owner knows it.
fn rig() -> Result<Rig, Invalid> {
    let shape = PlateShape::Rectangle { length_m: PLATE_M, width_m: PLATE_M };
    let plate = Plate::new(shape, Plate::CHAPTER.thickness_m(), true)?;
    Ok(Rig { plate, ..Rig::chapter("chapter") })
}

/// Returns a rig with the parameters of its twin: without noise, play, level offset or
/// stiction. A bad x servo receives its commands late.
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
        // So slow that with the late servo the loop oscillates, but does not diverge.
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

/// Records the rig for [`DURATION_S`], with a step to a new position every 3 s.
pub(super) fn record(bad_x: bool) -> Result<RigRecording, Invalid> {
    let model = model(bad_x)?;
    let owned = model.rig.clone();
    let (height, radius) =
        (model.rig.plate.centre_gap_m(&model.rig.ball), model.rig.ball.radius_m());
    let mut rig = SimulatedRig::new(model, Reference::Steps, Disturbances::default(), SEED)?;
    let (mut samples, mut truth) = (Vec::new(), Vec::new());
    loop {
        let sample = rig.next_sample();
        if sample.t_s > DURATION_S {
            return Ok(RigRecording { rig: owned, samples, truth });
        }
        samples.push(sample);
        truth.push((sample.t_s, motion(&rig.truth(), height, radius)));
    }
}

/// Returns the motion of the rolling ball, with a spin about z of zero.
fn motion(truth: &Truth, height: f64, radius: f64) -> Motion {
    let v = truth.velocity;
    Motion {
        position: truth.position.push(height),
        velocity: v.push(0.0),
        spin: nalgebra::Vector3::new(-v.y / radius, v.x / radius, 0.0),
    }
}

/// Judges the recording by `profile`.
pub(super) fn judge(recording: &RigRecording, profile: Profile) -> Result<ProfileVerdict, Invalid> {
    let setup = Setup::new(recording.rig.clone(), Some(profile))?;
    let mut engine = Engine::new(setup, FaultMemory::default());
    let mut judged =
        ProfileVerdict { profile, faults: Vec::new(), pending: Vec::new(), signals: Vec::new() };
    let mut transitions = Vec::new();
    for sample in &recording.samples {
        engine.handle(Input::Sample(*sample), &mut transitions);
        transitions.drain(..).for_each(|transition| judged.take(&transition));
        judged.look(&engine);
    }
    engine.handle(Input::End, &mut transitions);
    transitions.drain(..).for_each(|transition| judged.take(&transition));
    Ok(judged)
}

impl ProfileVerdict {
    fn take(&mut self, transition: &Transition) {
        let Transition { code, status, at, suspicion, .. } = transition;
        let list = match status {
            FaultStatus::Confirmed => &mut self.faults,
            FaultStatus::Pending => &mut self.pending,
            _ => return,
        };
        if list.iter().all(|fault| fault.code != *code) {
            let kind = suspicion.kind.map(|kind| kind.to_string());
            list.push(ReportedFault { code: *code, kind, t_s: at.seconds() });
        }
        self.pending.retain(|fault| self.faults.iter().all(|found| found.code != fault.code));
    }

    fn look(&mut self, engine: &Engine) {
        let evidence = &engine.state().evidence;
        let Some(at) = evidence.at else { return };
        let due = self.signals.last().is_none_or(|s| at.seconds() - s.at_s > PERIOD_S - 1e-6);
        if due {
            self.signals.push(DeviationSignal {
                at_s: at.seconds(),
                enabled: Axis::ALL.map(|axis| evidence.axes[axis].enabled),
                deviation: Axis::ALL.map(|axis| evidence.axes[axis].residual_m_s2().map(f64::abs)),
            });
        }
    }

    /// Returns the largest deviation of both axes while enabled, m/s².
    pub(super) fn largest(&self) -> [f64; 2] {
        [0, 1].map(|i| {
            let enabled = self.signals.iter().filter(|signal| signal.enabled[i]);
            enabled.filter_map(|signal| signal.deviation[i]).fold(0.0, f64::max)
        })
    }

    /// Describes the reported faults with their times, or the suspected ones.
    pub(super) fn words(&self) -> String {
        let named = |fault: &ReportedFault| {
            let kind = fault.kind.as_ref().map(|kind| format!(" ({kind})")).unwrap_or_default();
            format!("{}{kind} at {:.2} s", fault.code, fault.t_s)
        };
        let list =
            |faults: &[ReportedFault]| faults.iter().map(named).collect::<Vec<_>>().join(", ");
        match (&self.faults[..], &self.pending[..]) {
            ([], []) => "nothing".to_owned(),
            ([], pending) => format!("{}, suspected: the rig is not calibrated", list(pending)),
            (faults, _) => list(faults),
        }
    }
}
