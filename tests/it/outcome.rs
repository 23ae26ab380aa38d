//! The outcomes of sessions and their monitors, and when a monitor does not judge.

use offbd::wire::verdict::{Outcome, SummaryView, Verdict};
use offbd::wire::words::CodeWord;
use offbd_core::diagnosis::{FaultMemory, Transition};
use offbd_core::engine::{Engine, Input, Rig, Setup, calibrate};
use offbd_core::vocabulary::{FaultCode, FaultStatus, Sample};
use offbd_lab::simulation::{Disturbances, Fault, Preset, Reference, SimulatedRig};

const LIVELY: Disturbances = Disturbances { pushes_per_minute: 4.0, gusts_per_minute: 1.0 };

/// Returns the samples of a simulated session.
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

fn transitions(setup: &Setup, samples: &[Sample]) -> Vec<Transition> {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let mut transitions = Vec::new();
    for &sample in samples {
        engine.handle(Input::Sample(sample), &mut transitions);
    }
    engine.handle(Input::End, &mut transitions);
    transitions
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

/// Returns the summary of a session that starts with `memory`, and the memory after it.
fn summary_after(
    memory: FaultMemory,
    setup: &Setup,
    samples: &[Sample],
) -> (SummaryView, FaultMemory) {
    let mut engine = Engine::new(setup.clone(), memory);
    let mut verdict = Verdict::default();
    for input in samples.iter().map(|&s| Input::Sample(s)).chain([Input::End]) {
        let mut transitions = Vec::new();
        engine.handle(input, &mut transitions);
        verdict.take(engine.n_accepted(), &transitions);
    }
    let summary = verdict.summary("s", samples.len() as u64, 0, 0.0);
    (
        summary.with_monitors(verdict.monitors(&engine.state(), engine.memory())),
        engine.memory().clone(),
    )
}

fn summary(setup: &Setup, samples: &[Sample]) -> SummaryView {
    summary_after(FaultMemory::default(), setup, samples).0
}

fn outcomes(summary: &SummaryView) -> Vec<Outcome> {
    summary.monitors.iter().map(|m| m.outcome).collect()
}

fn shares(summary: &SummaryView) -> Vec<f64> {
    summary.monitors.iter().map(|m| m.judged_share).collect()
}

#[test]
fn a_healthy_session_is_judged_by_every_monitor_for_most_of_its_time() {
    let samples = session(Preset::Chapter, Reference::Circle, 30.0, 5, "");
    let found = summary(&learnt(Preset::Chapter), &samples);
    assert_eq!(found.outcome, Some(Outcome::NoFault), "{found:?}");
    for monitor in &found.monitors {
        assert!((0.8..=1.0).contains(&monitor.judged_share), "{monitor:?}");
        assert!((monitor.judged_s / 30.0 - monitor.judged_share).abs() < 0.01, "{monitor:?}");
    }
}

#[test]
fn servos_and_ball_of_a_rig_that_is_not_learnt_have_the_outcome_not_learnt() {
    use Outcome::{NoFault, NotLearnt};
    let setup = Setup::new(Preset::Chapter.model().unwrap().rig, None).unwrap();
    let samples = session(Preset::Chapter, Reference::Circle, 30.0, 5, "");
    let found = summary(&setup, &samples);
    assert_eq!(outcomes(&found), [NotLearnt, NotLearnt, NotLearnt, NoFault]);
    assert_eq!(found.outcome, Some(NotLearnt));
}

#[test]
fn without_commands_no_servo_is_judged() {
    use Outcome::{NoFault, NotJudged};
    let samples = session(Preset::Chapter, Reference::Circle, 30.0, 5, "");
    let silent = |s: &Sample| Sample { cmd_qx_rad: None, cmd_qy_rad: None, ..*s };
    let found = summary(&learnt(Preset::Chapter), &samples.iter().map(silent).collect::<Vec<_>>());
    // The ball rolls, and readings need no command.
    assert_eq!(outcomes(&found), [NotJudged, NotJudged, NoFault, NoFault], "{found:?}");
    assert_eq!(shares(&found)[..2], [0.0, 0.0]);
    assert_eq!(found.outcome, Some(Outcome::PartlyJudged));
}

/// A learnt rig uses windows of half a second or more, and the confirmation takes as long
/// again.
#[test]
fn a_very_short_session_is_not_judged() {
    let setup = learnt(Preset::Chapter);
    let of = |seconds: f64| {
        let samples = session(Preset::Chapter, Reference::Circle, seconds, 5, "");
        summary(&setup, &samples)
    };
    let very_short = of(0.3);
    assert_eq!(very_short.outcome, Some(Outcome::NotJudged), "{very_short:?}");
    assert!(outcomes(&very_short).iter().all(|&o| o == Outcome::NotJudged));
    let short = of(2.0);
    assert!(shares(&short)[..2].iter().all(|share| (0.0..0.8).contains(share)), "{short:?}");
    assert_ne!(of(1.2).outcome, Some(Outcome::NoFault));
}

#[test]
fn a_ball_at_rest_leaves_servos_and_ball_not_judged() {
    use Outcome::{NoFault, NotJudged};
    let rest = |i: u32| Sample {
        t_s: 0.01 * f64::from(i),
        cmd_qx_rad: Some(0.0),
        cmd_qy_rad: Some(0.0),
        // Noise of a tenth of a millimetre, so that the readings are not frozen.
        x_m: Some(1e-4 * f64::from(i % 3)),
        y_m: Some(1e-4 * f64::from(i % 2)),
        ..Sample::default()
    };
    let mut setup = learnt(Preset::Chapter);
    // A level plate with a breakaway angle of half a degree.
    for axis in [&mut setup.rig.calibration.as_mut().unwrap().axes] {
        for learnt in [&mut axis.x, &mut axis.y] {
            let learnt = learnt.as_mut().unwrap();
            (learnt.level_rad, learnt.breakaway_rad) = (0.0, 0.01);
        }
    }
    let setup = Setup::new(setup.rig, None).unwrap();
    let found = summary(&setup, &(0..3000).map(rest).collect::<Vec<_>>());
    assert_eq!(outcomes(&found), [NotJudged, NotJudged, NotJudged, NoFault], "{found:?}");
    assert!(shares(&found)[..3].iter().all(|&share| share < 0.05), "{found:?}");
    assert!(shares(&found)[3] > 0.9);
    assert_eq!(found.outcome, Some(Outcome::PartlyJudged));
}

/// Of a time in which the sensor hides what the servos do, nobody says that there was no fault.
#[test]
fn servos_are_not_judged_under_a_sensor_that_stays_broken() {
    use Outcome::{Fault, NoFault, NotJudged};
    let setup = learnt(Preset::Chapter);
    let of = |fault: &str| {
        let samples = session(Preset::Chapter, Reference::Steps, 60.0, 9, fault);
        summary(&setup, &samples)
    };
    let lasting = of("sensor:spikes@20");
    assert_eq!(outcomes(&lasting), [NotJudged, NotJudged, NotJudged, Fault], "{lasting:?}");
    assert!(shares(&lasting)[0] > 0.2, "it was judged before: {lasting:?}");
    let repaired = of("sensor:spikes@20-30");
    assert_eq!(outcomes(&repaired), [NoFault, NoFault, NoFault, Fault], "{repaired:?}");
}

/// The debounce setting also applies to the sensor, and a jump of the readings counts as a
/// failure for as long.
#[test]
fn the_debounce_setting_delays_a_sensor_fault() {
    let setup = learnt(Preset::Chapter);
    let mut patient = setup.rig.clone();
    patient.diagnostics.debounce_s = Some(2.5);
    let patient = Setup::new(patient, None).unwrap();
    for fault in ["sensor:dropout@10", "sensor:jump@10"] {
        let samples = session(Preset::Chapter, Reference::Circle, 20.0, 7, fault);
        let at = |setup: &Setup| {
            let found = confirmed(&transitions(setup, &samples));
            assert_eq!(found.first().map(|f| f.0), Some(FaultCode::Sensor), "{fault}: {found:?}");
            found[0].1
        };
        // 2.5 s instead of 0.3 s.
        let later_s = at(&patient) - at(&setup);
        assert!((2.1..2.4).contains(&later_s), "{fault}: {later_s} s later");
    }
}

#[test]
fn a_jump_is_reported_with_size_and_time() {
    let samples = session(Preset::Chapter, Reference::Circle, 20.0, 7, "sensor:jump@10");
    let all = transitions(&learnt(Preset::Chapter), &samples);
    let jump = all.iter().find_map(|t| t.evidence.jump);
    let jump = jump.expect("the readings step");
    assert!((9.95..10.1).contains(&jump.at_s), "{jump:?}");
    assert!((0.01..0.2).contains(&jump.size_m), "{jump:?}");
}

/// A fault that continues in the next session is found there again. A fault that has ended is
/// not in the verdict, although it stays in the fault memory.
#[test]
fn a_verdict_contains_only_faults_found_in_its_session() {
    let setup = learnt(Preset::Chapter);
    let of = |fault: &str| session(Preset::Chapter, Reference::Circle, 20.0, 7, fault);
    let (first, memory) = summary_after(FaultMemory::default(), &setup, &of("x_servo:dead@5"));
    assert_eq!(first.faults, [CodeWord::XServo]);
    let (second, memory) = summary_after(memory, &setup, &of("x_servo:dead@0"));
    assert_eq!((second.faults, second.outcome), (first.faults, Some(Outcome::Fault)));
    assert_eq!(memory.record(FaultCode::XServo).occurrences, 1, "its test has never passed");
    let (third, memory) = summary_after(memory, &setup, &of(""));
    assert_eq!((third.faults, third.outcome), (vec![], Some(Outcome::NoFault)));
    assert_eq!(memory.record(FaultCode::XServo).word(), FaultStatus::Confirmed);
}

/// A monitor that requires a failure of one minute has judged nothing in half a minute, and
/// the session does not count for its in-use ratio.
#[test]
fn the_time_needed_to_judge_depends_on_the_debounce_setting() {
    let mut rig = learnt(Preset::Chapter).rig;
    rig.diagnostics.debounce_s = Some(60.0);
    let samples = session(Preset::Chapter, Reference::Circle, 30.0, 5, "");
    let setup = Setup::new(rig, None).unwrap();
    let (found, memory) = summary_after(FaultMemory::default(), &setup, &samples);
    assert_eq!(found.outcome, Some(Outcome::NotJudged), "{found:?}");
    for &code in FaultCode::ALL {
        let in_use = memory.record(code).in_use;
        assert_eq!((in_use.cycles, in_use.with_data, in_use.judged), (1, 0, 0), "{code}");
    }
}
