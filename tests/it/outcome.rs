//! What a session comes to, monitor by monitor, and when nothing can be said.

use offbd::wire::verdict::{Outcome, SummaryView, Verdict};
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Engine, Input, Output, Rig, Setup, calibrate};
use offbd_core::vocabulary::{FaultCode, FaultStatus, Sample};
use offbd_lab::simulation::{Disturbances, Fault, Preset, Reference, SimulatedRig};

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

/// What a session comes to on what earlier ones have left in `memory`, and what
/// it leaves.
fn summary_after(
    memory: FaultMemory,
    setup: &Setup,
    samples: &[Sample],
) -> (SummaryView, FaultMemory) {
    let mut engine = Engine::new(setup.clone(), memory);
    let (mut outputs, mut verdict) = (Vec::new(), Verdict::default());
    let inputs = samples.iter().map(|&s| Input::Sample(s)).chain([Input::End]);
    inputs.for_each(|input| engine.handle(input, &mut outputs));
    outputs.iter().for_each(|output| verdict.take(output));
    let summary = verdict.summary("s", samples.len() as u64, 0, 0.0);
    (summary.with_monitors(verdict.monitors(&engine.state())), engine.memory().clone())
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
fn a_rig_that_is_not_learnt_says_so_of_servos_and_ball() {
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

/// A learnt rig looks through windows of half a second or more, and takes as long
/// again to confirm.
#[test]
fn of_a_moment_nothing_is_judged_and_of_two_seconds_little() {
    let setup = learnt(Preset::Chapter);
    let of = |seconds: f64| {
        let samples = session(Preset::Chapter, Reference::Circle, seconds, 5, "");
        summary(&setup, &samples)
    };
    let moment = of(0.3);
    assert_eq!(moment.outcome, Some(Outcome::NotJudged), "{moment:?}");
    assert!(outcomes(&moment).iter().all(|&o| o == Outcome::NotJudged));
    let short = of(2.0);
    assert!(shares(&short)[..2].iter().all(|share| (0.0..0.8).contains(share)), "{short:?}");
    assert_ne!(of(1.2).outcome, Some(Outcome::NoFault));
}

#[test]
fn a_ball_at_rest_says_nothing_of_servos_or_itself() {
    use Outcome::{NoFault, NotJudged};
    let rest = |i: u32| Sample {
        t_s: 0.01 * f64::from(i),
        cmd_qx_rad: Some(0.0),
        cmd_qy_rad: Some(0.0),
        // A tenth of a millimetre to and fro: the sensor lives.
        x_m: Some(1e-4 * f64::from(i % 3)),
        y_m: Some(1e-4 * f64::from(i % 2)),
        ..Sample::default()
    };
    let mut setup = learnt(Preset::Chapter);
    // A level plate that holds its ball by half a degree.
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

/// The owner's debounce holds for the sensor, too, and a jump of the readings
/// lasts for as long as it takes.
#[test]
fn the_owners_debounce_delays_a_sensor_fault() {
    let setup = learnt(Preset::Chapter);
    let mut patient = setup.rig.clone();
    patient.diagnostics.debounce_s = Some(2.5);
    let patient = Setup::new(patient, None).unwrap();
    for fault in ["sensor:dropout@10", "sensor:jump@10"] {
        let samples = session(Preset::Chapter, Reference::Circle, 20.0, 7, fault);
        let at = |setup: &Setup| {
            let found = confirmed(&outputs(setup, &samples));
            assert_eq!(found.first().map(|f| f.0), Some(FaultCode::Sensor), "{fault}: {found:?}");
            found[0].1
        };
        // 2.5 s in the place of 0.3 s.
        let later_s = at(&patient) - at(&setup);
        assert!((2.1..2.4).contains(&later_s), "{fault}: {later_s} s later");
    }
}

#[test]
fn a_jump_is_told_by_its_size_and_moment() {
    let samples = session(Preset::Chapter, Reference::Circle, 20.0, 7, "sensor:jump@10");
    let all = outputs(&learnt(Preset::Chapter), &samples);
    let jump = all.iter().find_map(|output| match output {
        Output::Transition(t) => t.evidence.jump,
        Output::Admitted(_) => None,
    });
    let jump = jump.expect("the readings step");
    assert!((9.95..10.1).contains(&jump.at_s), "{jump:?}");
    assert!((0.01..0.2).contains(&jump.size_m), "{jump:?}");
}

/// A fault that goes on into the next session is found there again, and one that
/// is gone is no fault of that session though it stays on record.
#[test]
fn each_session_says_what_it_has_found_itself() {
    let setup = learnt(Preset::Chapter);
    let of = |fault: &str| session(Preset::Chapter, Reference::Circle, 20.0, 7, fault);
    let (first, memory) = summary_after(FaultMemory::default(), &setup, &of("x_servo:dead@5"));
    assert_eq!(first.faults, ["x_servo"]);
    let (second, memory) = summary_after(memory, &setup, &of("x_servo:dead@0"));
    assert_eq!((second.faults, second.outcome), (first.faults, Some(Outcome::Fault)));
    assert_eq!(memory.record(FaultCode::XServo).occurrences, 1, "it has never passed");
    let (third, memory) = summary_after(memory, &setup, &of(""));
    assert_eq!((third.faults, third.outcome), (vec![], Some(Outcome::NoFault)));
    assert_eq!(memory.record(FaultCode::XServo).word(), FaultStatus::Confirmed);
}

/// A monitor that must see a failure for a minute has judged nothing in half of
/// one, nor does the session count for its in-use ratio.
#[test]
fn how_long_it_takes_to_judge_goes_with_the_settings_in_force() {
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
