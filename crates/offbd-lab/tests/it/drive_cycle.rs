//! Drive cycles of calibrated rigs, run on the same simulated rigs, with sensor noise,
//! quantised commands, play, friction and latencies that the twin, with which the cycles
//! were planned, does not model.

use std::sync::LazyLock;

use offbd_core::diagnosis::{FaultMemory, Transition};
use offbd_core::engine::{
    DriveCycle, DriveLaw, Engine, Input, NotReached, Reach, Rig, Setup, State, TriedFault,
    calibrate, drive_cycle,
};
use offbd_core::vocabulary::{FaultCode, FaultStatus, PerAxis, Sample};
use offbd_lab::simulation::{Disturbances, Fault, Preset, Reference, RigModel, SimulatedRig};

/// Injected faults, with the expected codes. The readings freeze after the start: a sensor
/// without a reading has nothing to repeat.
const FAULTS: [(&str, FaultCode); 7] = [
    ("x_servo:dead@0", FaultCode::XServo),
    ("y_servo:dead@0", FaultCode::YServo),
    ("stuck_ball:glued@0", FaultCode::StuckBall),
    ("sensor:freeze@0.5", FaultCode::Sensor),
    ("sensor:dropout@0", FaultCode::Sensor),
    ("sensor:noise@0", FaultCode::Sensor),
    ("sensor:spikes@0", FaultCode::Sensor),
];

/// All other kinds, on both axes. The offsets begin after the start: from the start they
/// would be indistinguishable from a healthy rig that is off level.
const OTHER_FAULTS: [(&str, FaultCode); 15] = [
    ("x_servo:hold@1", FaultCode::XServo),
    ("y_servo:hold@1", FaultCode::YServo),
    ("x_servo:reversed@0", FaultCode::XServo),
    ("y_servo:reversed@0", FaultCode::YServo),
    ("x_servo:gain=0.5@0", FaultCode::XServo),
    ("y_servo:gain=0.5@0", FaultCode::YServo),
    ("x_servo:offset@4", FaultCode::XServo),
    ("y_servo:offset@4", FaultCode::YServo),
    ("x_servo:slow@0", FaultCode::XServo),
    ("y_servo:slow@0", FaultCode::YServo),
    ("x_servo:intermittent@0", FaultCode::XServo),
    ("y_servo:intermittent@0", FaultCode::YServo),
    ("stuck_ball:sticky@0", FaultCode::StuckBall),
    ("sensor:freeze_axis@0.5", FaultCode::Sensor),
    ("sensor:jump=0.03,0@1", FaultCode::Sensor),
];

fn simulated(model: &RigModel, reference: Reference, seed: u64) -> SimulatedRig {
    SimulatedRig::new(model.clone(), reference, Disturbances::default(), seed).unwrap()
}

/// Returns the rig of `model`, calibrated on `n_sessions` of a minute.
fn learnt(model: &RigModel, n_sessions: u64) -> Rig {
    let session = |seed| {
        let mut rig = simulated(model, Reference::Lissajous, seed);
        (0..(60.0 * model.rig.sample_rate_hz) as u32).map(|_| rig.next_sample()).collect()
    };
    let sessions: Vec<Vec<Sample>> = (5..5 + n_sessions).map(session).collect();
    let calibration = calibrate(&model.rig, &sessions).unwrap();
    Rig { calibration: Some(Box::new(calibration)), ..model.rig.clone() }
}

/// The chapter's rig, calibrated on one session, and its drive cycle.
static CHAPTER: LazyLock<(RigModel, Rig, DriveCycle)> = LazyLock::new(|| {
    let model = Preset::Chapter.model().unwrap();
    let rig = learnt(&model, 1);
    let cycle = drive_cycle(&rig).unwrap();
    (model, rig, cycle)
});

/// The result of a session.
struct Ended {
    transitions: Vec<Transition>,
    state: State,
}

impl Ended {
    /// Returns whether every monitor, except those of a missing axis, has a result after
    /// long enough to have detected a fault.
    fn all_tested(&self, cycle: &DriveCycle) -> bool {
        cycle.monitors.iter().all(|monitor| {
            let ended = &self.state.monitors[monitor.code as usize];
            let tested = ended.readiness.complete_this_cycle && ended.reach == Reach::Judged;
            tested || monitor.passed == Err(NotReached::NoSuchAxis)
        })
    }

    fn first_confirmed(&self) -> Option<&Transition> {
        self.transitions.iter().find(|t| t.status == FaultStatus::Confirmed)
    }
}

fn judge(rig: &Rig, samples: impl Iterator<Item = Sample>) -> Ended {
    let mut engine = Engine::new(Setup::new(rig.clone(), None).unwrap(), FaultMemory::default());
    let mut transitions = Vec::new();
    for sample in samples {
        engine.handle(Input::Sample(sample), &mut transitions);
    }
    engine.handle(Input::End, &mut transitions);
    Ended { transitions, state: engine.state() }
}

/// Runs `cycle` on the simulated rig, with or without a fault.
fn drive(model: &RigModel, rig: &Rig, cycle: &DriveCycle, fault: Option<&str>) -> Ended {
    let mut simulated = simulated(model, Reference::Hold, 11);
    if let Some(fault) = fault {
        simulated.inject(fault.parse::<Fault>().unwrap());
    }
    let mut law = DriveLaw::default();
    let next = || Some(simulated.next_sample_by(|read| law.command(cycle, read)));
    let in_time = |s: &Sample| s.t_s <= cycle.duration_s;
    judge(rig, std::iter::from_fn(next).take_while(in_time))
}

/// Runs `cycle` on `model` with each of `faults` that concerns its axes; returns the faults
/// that are not named by the first confirmed transition.
fn wrong(
    model: &RigModel,
    rig: &Rig,
    cycle: &DriveCycle,
    faults: &[(&str, FaultCode)],
) -> Vec<String> {
    let mut wrong = Vec::new();
    for &(fault, code) in faults {
        if code.axis().is_some_and(|axis| cycle.feedback[axis].is_none()) {
            continue;
        }
        let ended = drive(model, rig, cycle, Some(fault));
        let named = |t: &Transition| {
            t.code == code || t.suspicion.candidates.iter().any(|c| c.code == code)
        };
        if !ended.first_confirmed().is_some_and(named) {
            let found = ended.transitions.iter().map(|t| (t.at.seconds(), t.code, t.status));
            wrong.push(format!("{fault}: {:?}", found.collect::<Vec<_>>()));
        }
    }
    wrong
}

#[test]
fn a_drive_cycle_ends_every_not_tested_and_finds_what_it_says() {
    let (model, rig, cycle) = &*CHAPTER;
    // A ball at rest for the same time leaves monitors untested.
    let rests = |row: &Sample| Sample { x_m: Some(1e-4 * (row.t_s * 100.0 % 2.0).floor()), ..*row };
    let level =
        Sample { cmd_qx_rad: Some(0.0), cmd_qy_rad: Some(0.0), y_m: Some(0.0), ..cycle.rows[0] };
    let resting = cycle.rows.iter().map(|row| rests(&Sample { t_s: row.t_s, ..level }));
    assert!(!judge(rig, resting).all_tested(cycle));

    let healthy = drive(model, rig, cycle, None);
    assert_eq!(healthy.transitions, []);
    assert!(healthy.all_tested(cycle), "{:?}", healthy.state.monitors);
    let mut all = [&FAULTS[..], &OTHER_FAULTS].concat();
    // A servo that answers half is found where the cycle says that it is.
    let half_along = |(fault, code): &(&str, FaultCode)| {
        code.axis().filter(|_| fault.contains("gain=0.5")).map(TriedFault::HalfGain)
    };
    let promised = |half| cycle.faults.iter().any(|f| f.fault == half && f.after_s.is_some());
    all.retain(|fault| half_along(fault).is_none_or(promised));
    assert!(all.contains(&("x_servo:gain=0.5@0", FaultCode::XServo)), "{:?}", cycle.faults);
    assert_eq!(wrong(model, rig, cycle, &all), Vec::<String>::new());
}

/// Ball and beam: with one servo, its faults look like a stuck ball; both are named.
#[test]
fn a_rig_with_one_axis_has_a_cycle_along_it() {
    let chapter = Preset::Chapter.model().unwrap();
    let model = RigModel { one_axis: true, ..chapter };
    let rig = learnt(&model, 3);
    let cycle = drive_cycle(&rig).unwrap();
    assert_eq!(cycle.monitors[1].passed, Err(NotReached::NoSuchAxis));
    let healthy = drive(&model, &rig, &cycle, None);
    assert_eq!(healthy.transitions, []);
    assert!(healthy.all_tested(&cycle), "{:?}", healthy.state.monitors);
    assert_eq!(wrong(&model, &rig, &cycle, &FAULTS), Vec::<String>::new());
}

/// A camera of 30 Hz with a resolution of 1 mm, and servos with a resolution of 0.5°.
#[test]
fn a_coarse_rig_takes_longer() {
    let model = Preset::Pingpong.model().unwrap();
    let rig = learnt(&model, 3);
    let cycle = drive_cycle(&rig).unwrap();
    let healthy = drive(&model, &rig, &cycle, None);
    assert_eq!(healthy.transitions, []);
    assert!(healthy.all_tested(&cycle), "{:?}", healthy.state.monitors);
    assert_eq!(wrong(&model, &rig, &cycle, &FAULTS), Vec::<String>::new());
    assert!((5.0..20.0).contains(&cycle.duration_s), "{}", cycle.duration_s);
}

/// The true position of the ball stays on the plate.
#[test]
fn a_healthy_ball_stays_clear_of_the_edge() {
    let (model, rig, cycle) = &*CHAPTER;
    for seed in 0..5 {
        let mut simulated = simulated(model, Reference::Hold, seed);
        let mut law = DriveLaw::default();
        let mut closest_m = f64::INFINITY;
        while simulated.truth().t_s < cycle.duration_s {
            simulated.next_sample_by(|read| law.command(cycle, read));
            let at = simulated.truth().position;
            closest_m = closest_m.min(rig.plate.edge_distance_m(at.x, at.y));
        }
        assert!(closest_m > rig.ball.radius_m(), "seed {seed}: {closest_m}");
    }
}

/// A rig with other axes, signs and units goes through the same motion.
#[test]
fn a_device_with_other_axes_and_units_is_led_alike() {
    let (model, rig, own) = &*CHAPTER;
    let mut other = rig.clone();
    other.mapping.swap = true;
    other.mapping.sign = PerAxis { x: -1.0, y: 1.0 };
    other.mapping.position_unit_m = 1e-3;
    other.mapping.command_unit_rad = 0.5;
    let cycle = drive_cycle(&other).unwrap();
    assert_eq!(own.faults, cycle.faults);
    let mut simulated = simulated(model, Reference::Hold, 11);
    let mut law = DriveLaw::default();
    let next = || {
        let mut logged = None;
        simulated.next_sample_by(|read| {
            // The readings and commands in this device's axes and units.
            let (x_m, y_m) = (read.y_m.map(|y| 1e3 * y), read.x_m.map(|x| -1e3 * x));
            let here = Sample { x_m, y_m, ..*read };
            let commands = law.command(&cycle, &here);
            logged = Some(Sample { cmd_qx_rad: commands.y, cmd_qy_rad: commands.x, ..here });
            commands.map(|command| command.map(|c| 0.5 * c))
        });
        logged
    };
    let in_time = |s: &Sample| s.t_s <= cycle.duration_s;
    let healthy = judge(&other, std::iter::from_fn(next).take_while(in_time));
    assert_eq!(healthy.transitions, []);
    assert!(healthy.all_tested(&cycle), "{:?}", healthy.state.monitors);
}
