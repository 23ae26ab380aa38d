//! The engine from outside: what it may and may not depend on, and what it
//! finds on rigs whose truth is known.

mod real_world;

use offbd_core::diagnosis::{FaultMemory, Profile};
use offbd_core::engine::{Admission, Engine, Input, Output, Rejection, Rig, Setup, calibrate};
use offbd_core::vocabulary::{FaultCode, FaultStatus, Sample};
use offbd_lab::simulation::{Disturbances, Fault, Preset, Reference, SimulatedRig};
use proptest::prelude::*;

const LIVELY: Disturbances = Disturbances { pushes_per_minute: 4.0, gusts_per_minute: 1.0 };

/// Rows of a simulated session.
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
    rig.calibration = Some(calibrate(&rig, &[healthy], "", "").unwrap());
    Setup::new(rig, None).unwrap()
}

fn outputs(setup: &Setup, samples: &[Sample]) -> Vec<Output> {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let mut outputs = Vec::new();
    for &sample in samples {
        engine.handle(Input::Sample(sample), &mut outputs);
    }
    engine.handle(Input::End, &mut outputs);
    outputs
}

fn transitions(outputs: &[Output]) -> Vec<String> {
    outputs
        .iter()
        .filter(|o| matches!(o, Output::Transition(_)))
        .map(|o| format!("{o:?}"))
        .collect()
}

fn confirmed(outputs: &[Output]) -> Vec<(FaultCode, f64)> {
    let mut found = Vec::new();
    for output in outputs {
        if let Output::Transition(t) = output
            && t.status == FaultStatus::Confirmed
            && found.iter().all(|&(code, _)| code != t.code)
        {
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
            let found = confirmed(&outputs(&setup, &samples));
            assert!(found.is_empty(), "{preset} {reference:?}: {found:?}");
        }
    }
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
        let found = confirmed(&outputs(&setup, &samples));
        let (first, at) = *found.first().unwrap_or_else(|| panic!("{fault} missed"));
        assert_eq!(first, code, "{fault}: {found:?}");
        assert!((20.0..30.0).contains(&at), "{fault} at {at}");
    }
}

/// The chapter's rule cannot work on a rig with a real sensor; that is what
/// the profile is kept for.
#[test]
fn textbook_alarms_on_a_healthy_rig_where_default_is_silent() {
    let setup = learnt(Preset::Chapter);
    let textbook = Setup::new(setup.rig.clone(), Some(Profile::Textbook)).unwrap();
    // Steps open the chapter's gate: they command more than 0.08 rad.
    let samples = session(Preset::Chapter, Reference::Steps, 60.0, 3, "");
    assert!(confirmed(&outputs(&setup, &samples)).is_empty());
    let alarms = confirmed(&outputs(&textbook, &samples));
    assert!(!alarms.is_empty());
}

#[test]
fn nothing_is_differenced_across_a_gap() {
    let setup = learnt(Preset::Chapter);
    let mut samples = session(Preset::Chapter, Reference::Circle, 40.0, 5, "");
    samples.retain(|s| !(10.0..22.0).contains(&s.t_s));
    // Somebody has moved the ball meanwhile, and the clock was set.
    for sample in samples.iter_mut().filter(|s| s.t_s >= 22.0) {
        sample.t_s += 40_000.0;
    }
    let outputs = outputs(&setup, &samples);
    assert!(transitions(&outputs).is_empty(), "{:?}", transitions(&outputs));
}

/// A lone reading far off, after the ball was lost from sight for long enough to
/// have come that far: the gate cannot know it at once, and takes it back.
#[test]
fn an_outlier_that_could_be_the_ball_is_no_noise() {
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
    let outputs = outputs(&setup, &samples);
    assert!(transitions(&outputs).is_empty(), "{:?}", transitions(&outputs));
}

#[test]
fn a_session_without_faults_is_not_tested_rather_than_passed_where_it_cannot_be() {
    let setup = learnt(Preset::Chapter);
    let mut engine = Engine::new(setup, FaultMemory::default());
    let mut outputs = Vec::new();
    for i in 0..500 {
        let unseen =
            Sample { t_s: f64::from(i) * 0.01, cmd_qx_rad: Some(0.0), ..Sample::default() };
        engine.handle(Input::Sample(unseen), &mut outputs);
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
    let (clean, found) = (outputs(&setup, &samples), outputs(&setup, &disturbed));
    let aside: Vec<_> = found
        .iter()
        .filter_map(|o| match o {
            Output::Admitted(Admission::SetAside(reason)) => Some(*reason),
            _ => None,
        })
        .collect();
    assert!(matches!(aside[..], [Rejection::Late { .. }, Rejection::Jump { .. }]), "{aside:?}");
    assert_eq!(transitions(&clean), transitions(&found));
    assert!(!transitions(&clean).is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Arrival within the reorder window, and sending twice, change nothing.
    #[test]
    fn the_verdict_depends_on_the_samples_alone(
        swaps in proptest::collection::vec((0..2900_usize, 1..6_usize), 0..200),
        twice in proptest::collection::vec(0..2900_usize, 0..50),
    ) {
        let setup = Setup::new(Preset::Chapter.model().unwrap().rig, None).unwrap();
        let samples =
            without_seq(&session(Preset::Chapter, Reference::Circle, 30.0, 9, "stuck_ball:glued@12"));
        let wanted = transitions(&outputs(&setup, &samples));
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
        let found = outputs(&setup, &arrived);
        prop_assert_eq!(transitions(&found), wanted);
    }

    /// Whatever comes in: one answer a sample, no panic, nothing that is not
    /// finite in what is reported.
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
            engine.handle(Input::Sample(sample), &mut out);
            let admitted = out.iter().filter(|o| matches!(o, Output::Admitted(_))).count();
            prop_assert_eq!(admitted, 1);
        }
        let evidence = engine.state().evidence;
        for axis in [evidence.axes.x, evidence.axes.y] {
            prop_assert!(axis.residual_m_s2().is_none_or(f64::is_finite));
            prop_assert!(axis.limit_m_s2.is_finite());
        }
    }
}
