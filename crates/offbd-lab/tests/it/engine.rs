//! Black-box tests of the engine: what its results may depend on, and what it detects on
//! simulated rigs with known faults.

mod real_world;

use offbd_core::diagnosis::{AxisCalibration, FaultMemory, Profile, Transition};
use offbd_core::engine::{
    Admission, Engine, Input, Misfit, Plausibility, Rejection, Rig, Setup, calibrate,
};
use offbd_core::vocabulary::{Axis, FaultCode, FaultKind, FaultStatus, Sample};
use offbd_lab::simulation::{Disturbances, Fault, PidGains, Preset, Reference, SimulatedRig};
use proptest::prelude::*;

const LIVELY: Disturbances = Disturbances { pushes_per_minute: 4.0, gusts_per_minute: 1.0 };

/// Returns the rows of a simulated session.
fn session(
    preset: Preset,
    reference: Reference,
    seconds: f64,
    seed: u64,
    fault: &str,
) -> Vec<Sample> {
    let mut rig = SimulatedRig::new(preset.model().unwrap(), reference, LIVELY, seed).unwrap();
    if !fault.is_empty() {
        rig.inject(fault.parse::<Fault>().unwrap());
    }
    let rows = std::iter::from_fn(|| Some(rig.next_sample()));
    rows.take_while(|s| s.t_s < seconds).collect()
}

fn learnt(preset: Preset) -> Setup {
    let mut rig: Rig = preset.model().unwrap().rig;
    let healthy = session(preset, Reference::Steps, 120.0, 1000, "");
    rig.calibration = Some(Box::new(calibrate(&rig, &[healthy]).unwrap()));
    Setup::new(rig, None).unwrap()
}

/// The decisions on `samples`, and the transitions that they cause.
fn judge(setup: &Setup, samples: &[Sample]) -> (Vec<Admission>, Vec<Transition>) {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let mut transitions = Vec::new();
    let take = |&sample| engine.handle(Input::Sample(sample), &mut transitions);
    let admissions = samples.iter().filter_map(take).collect();
    engine.handle(Input::End, &mut transitions);
    (admissions, transitions)
}

fn transitions(setup: &Setup, samples: &[Sample]) -> Vec<Transition> {
    judge(setup, samples).1
}

fn confirmed(transitions: &[Transition]) -> Vec<(FaultCode, f64)> {
    let mut found = Vec::new();
    for t in transitions.iter().filter(|t| t.status == FaultStatus::Confirmed) {
        if found.iter().all(|&(code, _)| code != t.code) {
            found.push((t.code, t.at.seconds()));
        }
    }
    found
}

fn without_seq(samples: &[Sample]) -> Vec<Sample> {
    samples.iter().map(|s| Sample { seq: None, ..*s }).collect()
}

#[test]
fn healthy_rigs_are_silent() {
    for preset in Preset::ALL {
        let setup = learnt(preset);
        for (seed, reference) in (1..).zip(Reference::ALL) {
            let samples = session(preset, reference, 180.0, seed, "");
            let found = confirmed(&transitions(&setup, &samples));
            assert!(found.is_empty(), "{preset} {reference:?}: {found:?}");
        }
    }
}

/// A servo that is off from the first sample on looks like a rig that was moved. Its level is named,
/// with its size; that of a healthy session is not.
#[test]
fn another_level_than_that_of_the_sessions_is_named() {
    let setup = learnt(Preset::Chapter);
    let named = |fault: &str, seed: u64| {
        let samples = session(Preset::Chapter, Reference::Steps, 40.0, seed, fault);
        let mut engine = Engine::new(setup.clone(), FaultMemory::default());
        for &sample in &samples {
            engine.handle(Input::Sample(sample), &mut Vec::new());
        }
        let plausibility = Plausibility::of(&setup.rig, &samples);
        plausibility.levels(&engine.steady_offsets()).collect::<Vec<_>>()
    };
    for seed in 1..7 {
        assert_eq!(named("", seed), [], "{seed}");
        let found = named("y_servo:offset=-0.05@0", seed);
        let [Misfit::Level { axis: Axis::Y, off_rad, spread_rad }] = found[..] else {
            panic!("{seed}: {found:?}");
        };
        assert!((off_rad - 0.05).abs() < 0.005, "{off_rad}");
        assert_eq!(spread_rad, AxisCalibration::POPULATION_LEVEL_SPREAD_RAD);
        assert_eq!(found[0].doubted_servo(), Some(FaultCode::YServo));
    }
}

/// An offset is not learnt as the level of the session: its test fails until the repair, which is
/// not another fault.
#[test]
fn an_offset_fails_as_long_as_it_lasts() {
    let setup = learnt(Preset::Chapter);
    for seed in 1..4 {
        let fault = "x_servo:offset@60-300";
        let samples = session(Preset::Chapter, Reference::Lissajous, 420.0, seed, fault);
        let found = transitions(&setup, &samples);
        let of_servo = found.iter().filter(|t| t.code == FaultCode::XServo);
        let changes: Vec<_> =
            of_servo.map(|t| (t.at.seconds(), t.byte.test_failed(), t.status)).collect();
        let repaired = changes.iter().position(|(t_s, ..)| *t_s > 300.0).unwrap();
        let (during, after) = changes.split_at(repaired);
        assert!(during[0].0 > 60.0 && during.iter().all(|(_, fails, _)| *fails), "{changes:?}");
        assert_eq!(during.last().unwrap().2, FaultStatus::Confirmed, "{changes:?}");
        // Its kind is a fact by then.
        let known = &found.iter().rfind(|t| t.code == FaultCode::XServo).unwrap().suspicion;
        assert!(known.kind == Some(FaultKind::Offset) && known.is_sure(), "{known:?}");
        assert!(after.iter().all(|(t_s, fails, _)| !fails && *t_s < 330.0), "{changes:?}");
    }
}

/// A servo passes its test again within a minute of motion after its repair, whenever in the session
/// it broke: at first, the level of the session is hardly known.
#[test]
fn a_repaired_servo_passes_whenever_it_broke() {
    let setup = learnt(Preset::Chapter);
    for (seed, onset_s) in (1..).zip([0.0, 0.5, 2.0, 5.0, 20.0]) {
        for kind in ["dead", "hold", "reversed", "slow", "offset"] {
            let repair_s = onset_s + 15.0;
            let fault = format!("y_servo:{kind}@{onset_s}-{repair_s}");
            let samples = session(Preset::Chapter, Reference::Steps, repair_s + 60.0, seed, &fault);
            let found = transitions(&setup, &samples);
            let of_servo: Vec<_> = found.iter().filter(|t| t.code == FaultCode::YServo).collect();
            let told = of_servo.iter().map(|t| (t.at.seconds(), t.byte)).collect::<Vec<_>>();
            assert!(of_servo.iter().any(|t| t.byte.test_failed()), "{fault}: {told:?}");
            assert!(!of_servo.last().unwrap().byte.test_failed(), "{fault}: {told:?}");
        }
    }
}

/// A servo that breaks at the beginning of a session may be confirmed by the duration of its residual,
/// before there is much evidence: what kinds it may be is known all the same.
#[test]
fn a_confirmed_servo_has_kinds() {
    let (setup, mut n_confirmed) = (learnt(Preset::Chapter), 0);
    for (seed, onset_s) in (1..).zip([1.0, 1.0, 1.0, 2.0, 2.0, 3.0]) {
        for kind in ["dead", "hold", "reversed"] {
            let fault = format!("y_servo:{kind}@{onset_s}");
            let samples = session(Preset::Chapter, Reference::Steps, 30.0, seed, &fault);
            let found = transitions(&setup, &samples);
            let confirmed = |t: &&Transition| t.status == FaultStatus::Confirmed;
            let of_servo = found.iter().filter(|t| t.code == FaultCode::YServo).find(confirmed);
            let Some(first) = of_servo else { continue };
            n_confirmed += 1;
            let suspicion = &first.suspicion;
            assert!(
                !suspicion.candidates.is_empty() || suspicion.kind.is_some(),
                "{seed} {fault} {first:?}"
            );
        }
    }
    assert!(n_confirmed >= 9, "{n_confirmed} of 18");
}

/// A ball that rolls slowly and answers neither servo is not stuck. In a corner, where it stays,
/// the ball or both servos may be the cause.
#[test]
fn a_supply_that_fails_is_not_a_stuck_ball() {
    let mut n_found = 0;
    for preset in [Preset::Chapter, Preset::Pingpong] {
        let setup = learnt(preset);
        for (seed, reference) in
            (1..).zip([Reference::Steps, Reference::Circle, Reference::Lissajous])
        {
            for onset_s in [0, 20] {
                let model = preset.model().unwrap();
                let mut rig = SimulatedRig::new(model, reference, LIVELY, seed).unwrap();
                for servo in ["x_servo", "y_servo"] {
                    rig.inject(format!("{servo}:dead@{onset_s}").parse().unwrap());
                }
                let rows = std::iter::from_fn(|| Some(rig.next_sample()));
                let samples: Vec<_> = rows.take_while(|s| s.t_s < 60.0).collect();
                let mut found = transitions(&setup, &samples);
                found.retain(|t| t.status == FaultStatus::Confirmed);
                let names_servos = |t: &Transition| {
                    let candidates = &t.suspicion.candidates;
                    let is_named = |a| candidates.iter().any(|c| c.code == FaultCode::servo(a));
                    t.code.axis().is_some() || Axis::ALL.into_iter().all(is_named)
                };
                assert!(found.iter().all(names_servos), "{preset} {reference:?}: {found:?}");
                n_found += usize::from(!found.is_empty());
            }
        }
    }
    assert!(n_found >= 11, "{n_found} of 12");
}

/// A ball that is held from the first sample on tells nothing about the servo that asks it to move.
#[test]
fn a_ball_that_has_not_moved_yet_accuses_no_servo_alone() {
    let setup = learnt(Preset::Chapter);
    for seed in 1..7 {
        let samples = session(Preset::Chapter, Reference::Steps, 40.0, seed, "stuck_ball:glued@0");
        let mut found = transitions(&setup, &samples);
        found.retain(|t| t.status == FaultStatus::Confirmed);
        assert!(!found.is_empty(), "{seed}");
        let ball_or_servo =
            |t: &Transition| t.code == FaultCode::StuckBall && t.suspicion.candidates.len() > 1;
        assert!(found.iter().all(ball_or_servo), "{seed}: {found:?}");
    }
}

/// A rim does not turn a ball that lies at it: where the readings of such a ball step, they have
/// jumped.
#[test]
fn readings_of_a_ball_at_the_rim_jump() {
    let setup = learnt(Preset::Chapter);
    let mut n_at_rim = 0;
    for seed in 1..7 {
        let fault = "x_servo:dead@5";
        let mut samples = session(Preset::Chapter, Reference::Steps, 60.0, seed, fault);
        let rests =
            |s: &Sample| (39.0..40.0).contains(&s.t_s) && s.x_m.is_some_and(|x| x.abs() > 0.17);
        n_at_rim += i32::from(samples.iter().filter(|s| rests(s)).count() > 20);
        // The controller gives up, which does not matter to a dead servo.
        for sample in samples.iter_mut().filter(|s| s.t_s >= 30.0) {
            sample.cmd_qy_rad = Some(0.0);
        }
        for sample in samples.iter_mut().filter(|s| s.t_s >= 40.0) {
            sample.x_m = sample.x_m.map(|x| x - 0.04 * x.signum());
        }
        let found = confirmed(&transitions(&setup, &samples));
        let codes: Vec<_> = found.iter().map(|&(code, _)| code).collect();
        assert_eq!(codes, [FaultCode::XServo, FaultCode::Sensor], "{seed}: {found:?}");
    }
    assert!(n_at_rim >= 3, "{n_at_rim} of 6");
}

/// What a servo does after its repair does not tell what was broken.
#[test]
fn a_repair_does_not_change_the_kind() {
    let setup = learnt(Preset::Chapter);
    for seed in 1..5 {
        let fault = "x_servo:slow@20-60";
        let samples = session(Preset::Chapter, Reference::Lissajous, 120.0, seed, fault);
        let found = transitions(&setup, &samples);
        let of_servo: Vec<_> = found.iter().filter(|t| t.code == FaultCode::XServo).collect();
        let kinds = of_servo.iter().map(|t| (t.at.seconds(), t.suspicion.kind));
        let kinds: Vec<_> = kinds.collect();
        assert!(kinds.iter().any(|(t_s, kind)| *t_s < 60.0 && *kind == Some(FaultKind::Slow)));
        assert_eq!(of_servo.last().unwrap().suspicion.kind, Some(FaultKind::Slow), "{kinds:?}");
    }
}

/// A badly tuned controller makes the ball travel more, because it oscillates. That is not a fault
/// of the rig, which obeys it, and none is found as long as the ball stays off the rim.
#[test]
fn a_ball_that_oscillates_because_of_its_controller_is_not_a_fault() {
    let model = Preset::Chapter.model().unwrap();
    let (setup, usual) = (learnt(Preset::Chapter), model.gains());
    let run = |gains: PidGains, seed: u64| {
        let undisturbed = Disturbances::default();
        let mut rig =
            SimulatedRig::new(model.clone(), Reference::Steps, undisturbed, seed).unwrap();
        rig.tune(gains).unwrap();
        let (mut samples, mut travelled_m) = (Vec::new(), 0.0);
        while rig.truth().t_s < 120.0 {
            samples.push(rig.next_sample());
            travelled_m += rig.truth().velocity.norm() / model.rig.sample_rate_hz;
        }
        (confirmed(&transitions(&setup, &samples)), travelled_m)
    };
    let little_damping = PidGains { derivative: 0.5 * usual.derivative, ..usual };
    let much_integral = PidGains { integral: 5.0 * usual.integral, ..usual };
    for seed in 1..5 {
        let (_, wanted_m) = run(usual, seed);
        for gains in [little_damping, much_integral] {
            let (found, travelled_m) = run(gains, seed);
            assert!(found.is_empty(), "{gains:?}: {found:?}");
            assert!(travelled_m > 1.3 * wanted_m, "{gains:?}: {travelled_m} of {wanted_m} m");
        }
    }
}

/// A controller that makes the ball beat against the rim is not a fault of the rig either: what
/// comes before and after a bounce is not one path.
#[test]
fn bounces_off_the_rim_are_not_a_fault() {
    let mut n_bounced = 0;
    for preset in [Preset::Chapter, Preset::Pingpong] {
        let model = preset.model().unwrap();
        let (setup, usual) = (learnt(preset), model.gains());
        let derivative = usual.derivative;
        let gains = [
            PidGains { derivative: 0.3 * derivative, ..usual },
            PidGains { derivative: 3.0 * derivative, ..usual },
            PidGains { proportional: 3.0 * usual.proportional, ..usual },
            PidGains { proportional: 3.0 * usual.proportional, derivative: 0.0, ..usual },
            PidGains { proportional: (10.0 * usual.proportional).min(10.0), ..usual },
        ];
        for (gains, seed) in gains.into_iter().flat_map(|g| [(g, 10), (g, 13), (g, 15)]) {
            let calm = Disturbances::default();
            let mut rig = SimulatedRig::new(model.clone(), Reference::Steps, calm, seed).unwrap();
            rig.tune(gains).unwrap();
            let (mut samples, mut bounced) = (Vec::new(), false);
            while rig.truth().t_s < 60.0 {
                samples.push(rig.next_sample());
                let (plate, place) = (&model.rig.plate, rig.truth().position);
                let left_m = plate.edge_distance_m(place.x, place.y);
                bounced |= left_m < model.rig.ball.radius_m() + 1e-3;
            }
            let found = confirmed(&transitions(&setup, &samples));
            assert!(found.is_empty(), "{preset} {gains:?} {seed}: {found:?}");
            n_bounced += u32::from(bounced);
        }
    }
    assert!(n_bounced >= 15, "{n_bounced} of 30");
}

#[test]
fn validate_that_injected_faults_are_found_and_nothing_else() {
    let setup = learnt(Preset::Chapter);
    let cases = [
        ("x_servo:dead@20", FaultCode::XServo),
        ("y_servo:hold@20", FaultCode::YServo),
        ("stuck_ball:glued@20", FaultCode::StuckBall),
        ("sensor:freeze@20", FaultCode::Sensor),
        ("sensor:dropout@20", FaultCode::Sensor),
        ("sensor:spikes@20", FaultCode::Sensor),
        ("sensor:noise@20", FaultCode::Sensor),
    ];
    for (fault, code) in cases {
        let samples = session(Preset::Chapter, Reference::Circle, 40.0, 7, fault);
        let found = confirmed(&transitions(&setup, &samples));
        let (first, at) = *found.first().unwrap_or_else(|| panic!("{fault} missed"));
        assert_eq!(first, code, "{fault}: {found:?}");
        assert!((20.0..30.0).contains(&at), "{fault} at {at}");
    }
}

/// The chapter's rule gives false alarms on a rig with a real sensor; the profile
/// `textbook` demonstrates it.
#[test]
fn textbook_alarms_on_a_healthy_rig_where_default_is_silent() {
    let setup = learnt(Preset::Chapter);
    let textbook = Setup::new(setup.rig.clone(), Some(Profile::Textbook)).unwrap();
    // Steps command more than 0.08 rad, which enables the chapter's rule.
    let samples = session(Preset::Chapter, Reference::Steps, 60.0, 3, "");
    assert!(confirmed(&transitions(&setup, &samples)).is_empty());
    let alarms = confirmed(&transitions(&textbook, &samples));
    assert!(!alarms.is_empty());
}

#[test]
fn nothing_is_differenced_across_a_gap() {
    let setup = learnt(Preset::Chapter);
    let mut samples = session(Preset::Chapter, Reference::Circle, 40.0, 5, "");
    samples.retain(|s| !(10.0..22.0).contains(&s.t_s));
    // Meanwhile the ball has been moved, and the clock has been set.
    for sample in samples.iter_mut().filter(|s| s.t_s >= 22.0) {
        sample.t_s += 40_000.0;
    }
    let found = transitions(&setup, &samples);
    assert!(found.is_empty(), "{found:?}");
}

/// A single outlier after a gap in which the ball could have moved as far: the gate first
/// accepts it, and then revokes it.
#[test]
fn an_outlier_that_could_be_the_ball_is_not_noise() {
    let setup = learnt(Preset::Chapter);
    let mut samples = session(Preset::Chapter, Reference::Circle, 90.0, 8, "");
    let mut blinked = false;
    for sample in &mut samples {
        let blinks = (2.0..2.15).contains(&(sample.t_s % 6.0));
        sample.x_m = match sample.x_m {
            Some(_) if blinks => None,
            Some(x_m) if blinked => Some(x_m + 0.07),
            seen => seen,
        };
        blinked = blinks;
    }
    let found = transitions(&setup, &samples);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn a_session_without_faults_is_not_tested_rather_than_passed_where_it_cannot_be() {
    let setup = learnt(Preset::Chapter);
    let mut engine = Engine::new(setup, FaultMemory::default());
    let mut transitions = Vec::new();
    for i in 0..500 {
        let unseen =
            Sample { t_s: f64::from(i) * 0.01, cmd_qx_rad: Some(0.0), ..Sample::default() };
        engine.handle(Input::Sample(unseen), &mut transitions);
    }
    for &code in &[FaultCode::XServo, FaultCode::YServo, FaultCode::StuckBall] {
        let byte = engine.memory().record(code).status;
        assert!(!byte.completed_this_cycle(), "{code}: {byte}");
        assert!(!engine.state().monitors[code as usize].readiness.enabled);
    }
}

#[test]
fn late_and_far_samples_are_set_aside_and_the_rest_is_judged_the_same() {
    let setup = learnt(Preset::Chapter);
    let samples = session(Preset::Chapter, Reference::Circle, 30.0, 6, "x_servo:dead@10");
    let mut disturbed = samples.clone();
    let hour_ago = Sample { seq: Some(900_001), t_s: samples[999].t_s - 3600.0, ..samples[999] };
    let next_year = Sample { seq: Some(900_002), t_s: samples[999].t_s + 3.2e7, ..samples[999] };
    disturbed.splice(1000..1000, [hour_ago, next_year]);
    let (clean, (admissions, found)) = (transitions(&setup, &samples), judge(&setup, &disturbed));
    let aside: Vec<_> = admissions
        .iter()
        .filter_map(|a| if let Admission::SetAside(reason) = a { Some(*reason) } else { None })
        .collect();
    assert!(matches!(aside[..], [Rejection::Jump { .. }, Rejection::Jump { .. }]), "{aside:?}");
    assert_eq!(clean, found);
    assert!(!clean.is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Reordering within the reorder window and duplicates do not change the verdict.
    #[test]
    fn the_verdict_depends_on_the_samples_alone(
        swaps in proptest::collection::vec((0..2900_usize, 1..6_usize), 0..200),
        twice in proptest::collection::vec(0..2900_usize, 0..50),
    ) {
        let setup = Setup::new(Preset::Chapter.model().unwrap().rig, None).unwrap();
        let samples =
            without_seq(&session(Preset::Chapter, Reference::Circle, 30.0, 9, "stuck_ball:glued@12"));
        let wanted = transitions(&setup, &samples);
        prop_assert!(!wanted.is_empty());
        let mut order: Vec<usize> = (0..samples.len()).collect();
        let mut touched = vec![false; samples.len()];
        for (i, by) in swaps {
            // Each sample moves at most once, by at most 6 rows: 60 ms.
            if !touched[i] && !touched[i + by] {
                order.swap(i, i + by);
                touched[i] = true;
                touched[i + by] = true;
            }
        }
        let mut arrived: Vec<Sample> = order.into_iter().map(|i| samples[i]).collect();
        for i in twice {
            arrived.insert(i + 40, arrived[i]);
        }
        let found = transitions(&setup, &arrived);
        prop_assert_eq!(found, wanted);
    }

    /// Whatever the input: one admission per sample, no panic, and only finite numbers in
    /// the evidence.
    #[test]
    fn any_numbers_get_an_answer(
        rows in proptest::collection::vec(
            (any::<Option<u64>>(), any::<f64>(), any::<[Option<f64>; 4]>()), 1..200),
        near in proptest::collection::vec((-0.3..0.3_f64, -0.3..0.3_f64, 0.0..0.2_f64), 0..300),
    ) {
        let setup = Setup::new(Rig::chapter("a"), None).unwrap();
        let mut engine = Engine::new(setup, FaultMemory::default());
        let mut t_s = 0.0;
        let wild = rows.into_iter().map(|(seq, t_s, [a, b, c, d])| Sample {
            seq, t_s, cmd_qx_rad: a, cmd_qy_rad: b, x_m: c, y_m: d,
        });
        let tame = near.into_iter().map(|(q, x, dt)| {
            t_s += dt;
            Sample { t_s, cmd_qy_rad: Some(q), cmd_qx_rad: Some(-q), x_m: Some(x), y_m: Some(-x), ..Sample::default() }
        });
        for sample in wild.chain(tame) {
            let mut out = Vec::new();
            prop_assert!(engine.handle(Input::Sample(sample), &mut out).is_some());
        }
        let evidence = engine.state().evidence;
        for axis in [evidence.axes.x, evidence.axes.y] {
            prop_assert!(axis.residual_m_s2().is_none_or(f64::is_finite));
            prop_assert!(axis.limit_m_s2.is_finite());
        }
    }
}
