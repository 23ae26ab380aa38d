//! Properties of real rigs that an ideal model lacks: sessions that differ in level and
//! gain, sensors that repeat readings or are slow, rigs with one axis, recordings that are
//! insufficient for calibration. The sessions are simulated and modified accordingly.

use offbd_core::diagnosis::{Calibration, FaultMemory};
use offbd_core::engine::{CannotCalibrate, Engine, Input, Rig, Setup, calibrate};
use offbd_core::vocabulary::{FaultCode, Sample};
use offbd_lab::simulation::{Preset, Reference};

use super::{confirmed, session, transitions};

const SECONDS: f64 = 90.0;

fn rig(preset: Preset) -> Rig {
    preset.model().unwrap().rig
}

fn healthy(preset: Preset, seed: u64) -> Vec<Sample> {
    let reference = if seed.is_multiple_of(2) { Reference::Circle } else { Reference::Steps };
    session(preset, reference, SECONDS, seed, "")
}

/// Returns the same session on a plate whose level is off by a further `level_rad`: the
/// motion is the same, the commands differ.
fn off_level(samples: &[Sample], level_rad: f64) -> Vec<Sample> {
    let shift = |c: f64| c - level_rad;
    let of = |s: &Sample| Sample {
        cmd_qx_rad: s.cmd_qx_rad.map(shift),
        cmd_qy_rad: s.cmd_qy_rad.map(shift),
        ..*s
    };
    samples.iter().map(of).collect()
}

/// Returns every `n`th sample.
fn thinned(samples: &[Sample], n: usize) -> Vec<Sample> {
    samples.iter().step_by(n).copied().collect()
}

/// Returns the same session with a sensor that has a new reading every `n`th sample only.
fn refreshed(samples: &[Sample], n: usize) -> Vec<Sample> {
    let of = |i: usize| Sample {
        x_m: samples[i - i % n].x_m,
        y_m: samples[i - i % n].y_m,
        ..samples[i]
    };
    (0..samples.len()).map(of).collect()
}

fn learnt_from(rig: &Rig, sessions: &[Vec<Sample>]) -> Setup {
    let calibration = calibrate(rig, sessions).unwrap();
    Setup::new(Rig { calibration: Some(Box::new(calibration)), ..rig.clone() }, None).unwrap()
}

fn x_of(calibration: &Calibration) -> offbd_core::diagnosis::AxisCalibration {
    calibration.axes.x.unwrap()
}

const DEGREE: f64 = 0.017_453_292_519_943_295;

#[test]
fn a_session_is_healthy_where_the_levels_of_sessions_are() {
    let rig = rig(Preset::Chapter);
    let levels = [0.0, 1.2, -0.8, 0.4];
    let sessions: Vec<_> = (1..)
        .zip(levels)
        .map(|(seed, level)| off_level(&healthy(Preset::Chapter, seed), level * DEGREE))
        .collect();
    let setup = learnt_from(&rig, &sessions);
    let calibration = setup.rig.calibration.as_ref().unwrap();
    let spread = x_of(calibration).level_spread_rad;
    assert!((0.5 * DEGREE..2.0 * DEGREE).contains(&spread), "{spread}");
    for (session, level) in calibration.sessions.iter().zip(levels) {
        let found = session.x.unwrap().level_rad - calibration.sessions[0].x.unwrap().level_rad;
        assert!((found - level * DEGREE).abs() < 0.1 * DEGREE, "{level}: {found}");
    }
    for (seed, level) in [(11, -1.0), (12, 1.0), (13, 1.5)] {
        let samples = off_level(&healthy(Preset::Chapter, seed), level * DEGREE);
        let found = confirmed(&transitions(&setup, &samples));
        assert!(found.is_empty(), "off level by {level}°: {found:?}");
    }
}

/// A jump of the level within a session is a fault, however much sessions differ.
#[test]
fn a_horn_that_slips_is_found_where_sessions_differ_by_as_much() {
    let rig = rig(Preset::Chapter);
    let sessions: Vec<_> = (1..)
        .zip([0.0, 2.0, -2.0, 1.0])
        .map(|(seed, level)| off_level(&healthy(Preset::Chapter, seed), level * DEGREE))
        .collect();
    let setup = learnt_from(&rig, &sessions);
    let samples =
        session(Preset::Chapter, Reference::Steps, SECONDS, 21, "x_servo:offset=0.035@40");
    let found = confirmed(&transitions(&setup, &samples));
    let (code, at) = *found.first().expect("a slip of 2° is missed");
    assert_eq!(code, FaultCode::XServo);
    assert!((40.0..46.0).contains(&at), "{at}");
}

/// Without calibration, faults of servos, ball and noise are not distinguishable from
/// properties of the rig.
#[test]
fn a_rig_that_is_not_learnt_confirms_only_what_needs_no_learning() {
    let setup = Setup::new(rig(Preset::Chapter), None).unwrap();
    for fault in
        ["x_servo:dead@20", "y_servo:reversed@20", "stuck_ball:glued@20", "sensor:noise@20"]
    {
        let samples = session(Preset::Chapter, Reference::Steps, 60.0, 7, fault);
        let found = confirmed(&transitions(&setup, &samples));
        assert!(found.is_empty(), "{fault}: {found:?}");
    }
    for fault in ["sensor:freeze@20", "sensor:dropout@20", "sensor:jump=0.1,0@20"] {
        let samples = session(Preset::Chapter, Reference::Steps, 60.0, 7, fault);
        let found = confirmed(&transitions(&setup, &samples));
        let (code, at) = *found.first().unwrap_or_else(|| panic!("{fault} is missed"));
        assert!(code == FaultCode::Sensor && (20.0..26.0).contains(&at), "{fault} at {at}");
    }
}

/// A sensor that is logged faster than it refreshes does not count as delayed or frozen:
/// the calibration agrees with that of the same sensor logged at its own rate.
#[test]
fn a_sensor_that_repeats_its_readings_teaches_the_same() {
    let rig = rig(Preset::Chapter);
    let sessions = [healthy(Preset::Chapter, 1), healthy(Preset::Chapter, 3)];
    let slow = sessions.each_ref().map(|s| refreshed(s, 3));
    let (own, repeated) = (learnt_from(&rig, &sessions), learnt_from(&rig, &slow));
    let of = |setup: &Setup| x_of(setup.rig.calibration.as_ref().unwrap());
    let (own, repeated_x) = (of(&own), of(&repeated));
    assert!((repeated_x.gain / own.gain - 1.0).abs() < 0.08, "{repeated_x:?} {own:?}");
    let delay = |a: offbd_core::diagnosis::AxisCalibration| a.dead_time_s + a.lag_s;
    assert!((delay(repeated_x) - delay(own)).abs() < 0.015, "{repeated_x:?} {own:?}");
    let found = confirmed(&transitions(&repeated, &refreshed(&healthy(Preset::Chapter, 5), 3)));
    assert!(found.is_empty(), "{found:?}");
}

/// Readings that repeat for longer than any healthy ones count as frozen, wherever the
/// ball is and whatever is commanded.
#[test]
fn frozen_readings_are_told_by_the_longest_healthy_repeat() {
    for preset in Preset::ALL {
        let setup = learnt_from(&rig(preset), &[healthy(preset, 1), healthy(preset, 3)]);
        for seed in 30..34 {
            let samples = session(preset, Reference::Circle, 60.0, seed, "sensor:freeze@30");
            let found = confirmed(&transitions(&setup, &samples));
            let (code, at) = *found.first().unwrap_or_else(|| panic!("{preset} {seed}: missed"));
            assert_eq!(code, FaultCode::Sensor, "{preset} {seed}");
            assert!((30.0..36.0).contains(&at), "{preset} {seed}: {at}");
        }
    }
}

/// A missing axis does not widen the limits of the other one.
#[test]
fn noise_is_found_on_a_rig_with_one_axis() {
    let one_axis = |samples: Vec<Sample>| -> Vec<Sample> {
        samples.into_iter().map(|s| Sample { cmd_qx_rad: None, y_m: None, ..s }).collect()
    };
    let sessions = [1, 3].map(|seed| one_axis(healthy(Preset::Pingpong, seed)));
    let setup = learnt_from(&rig(Preset::Pingpong), &sessions);
    let clean = one_axis(session(Preset::Pingpong, Reference::Circle, 60.0, 8, ""));
    assert!(confirmed(&transitions(&setup, &clean)).is_empty());
    let noise_m = x_of(setup.rig.calibration.as_ref().unwrap()).noise_m;
    // Eight times the calibrated noise, in a fixed pattern.
    let pattern = [1.0, -0.4, 0.7, -1.5, 0.2, 1.3, -0.9, -0.6];
    let noisy = clean.iter().enumerate().map(|(i, s)| match s.t_s >= 30.0 {
        true => Sample { x_m: s.x_m.map(|x| x + 8.0 * noise_m * pattern[i * 5 % 8]), ..*s },
        false => *s,
    });
    let found = confirmed(&transitions(&setup, &noisy.collect::<Vec<_>>()));
    let (code, at) = *found.first().expect("noise is missed");
    assert!(code == FaultCode::Sensor && (30.0..33.0).contains(&at), "{found:?}");
}

/// A jump of the readings without a change of velocity is detected even with a slow
/// sensor.
#[test]
fn a_step_is_seen_by_a_sensor_at_ten_hertz() {
    let thin = |seed, fault| {
        thinned(&session(Preset::Chapter, Reference::Circle, SECONDS, seed, fault), 10)
    };
    let mut rig = rig(Preset::Chapter);
    rig.sample_rate_hz = 10.0;
    let setup = learnt_from(&rig, &[thin(1, ""), thin(3, "")]);
    assert!(confirmed(&transitions(&setup, &thin(5, ""))).is_empty());
    for seed in 40..44 {
        let found = confirmed(&transitions(&setup, &thin(seed, "sensor:jump=0.06,0@40")));
        let (code, at) = *found.first().unwrap_or_else(|| panic!("{seed}: missed"));
        assert!(code == FaultCode::Sensor && (40.0..42.0).contains(&at), "{seed}: {found:?}");
    }
}

/// Readings far outside the plate are a fault of the sensor, not a ball past the edge.
#[test]
fn readings_far_off_the_plate_are_the_sensors() {
    let setup = learnt_from(
        &rig(Preset::Chapter),
        &[healthy(Preset::Chapter, 1), healthy(Preset::Chapter, 3)],
    );
    let mut samples = healthy(Preset::Chapter, 5);
    for s in samples.iter_mut().filter(|s| s.t_s >= 30.0) {
        s.x_m = s.x_m.map(|x| x + 3.0);
    }
    let found = confirmed(&transitions(&setup, &samples));
    let (code, at) = *found.first().expect("missed");
    assert!(code == FaultCode::Sensor && (30.0..31.0).contains(&at), "{found:?}");
}

/// A calibration that is accepted gives no alarm on its own sessions; others are refused.
#[test]
fn a_calibration_accuses_none_of_its_own_sessions() {
    for preset in Preset::ALL {
        for seed in [50, 51, 52] {
            let whole = healthy(preset, seed);
            for sessions in
                [vec![whole.clone()], vec![refreshed(&whole, 4)], vec![thinned(&whole, 3)]]
            {
                let rig = rig(preset);
                let Ok(calibration) = calibrate(&rig, &sessions) else { continue };
                let setup =
                    Setup::new(Rig { calibration: Some(Box::new(calibration)), ..rig }, None)
                        .unwrap();
                let found = confirmed(&transitions(&setup, &sessions[0]));
                assert!(found.is_empty(), "{preset} {seed}: {found:?}");
            }
        }
    }
}

/// Two sessions, one of which behaves like another rig, are refused.
#[test]
fn sessions_that_contradict_each_other_are_refused_or_make_wide() {
    let sessions = [
        healthy(Preset::Chapter, 1),
        session(Preset::Chapter, Reference::Steps, SECONDS, 3, "x_servo:dead@10"),
    ];
    let error = calibrate(&rig(Preset::Chapter), &sessions).unwrap_err();
    let named =
        matches!(error, CannotCalibrate::Untested { .. } | CannotCalibrate::AccusesItself { .. });
    assert!(named, "{error}");
}

/// The speed of the ball is not known at first. A servo that answers half must not become a healthy
/// one meanwhile.
#[test]
fn a_servo_that_answers_half_from_the_start_is_found() {
    let sessions = [2, 3, 4].map(|seed| healthy(Preset::Chapter, seed));
    let setup = learnt_from(&rig(Preset::Chapter), &sessions);
    for seed in 6..10 {
        let fault = "x_servo:gain=0.5@0";
        let samples = session(Preset::Chapter, Reference::Circle, 20.0, seed, fault);
        let found = confirmed(&transitions(&setup, &samples));
        assert_eq!(found.first().map(|f| f.0), Some(FaultCode::XServo), "{seed}");
    }
}

/// If the ball was never observed at rest, its breakaway tilt is unknown, not zero: it may
/// rest at one degree.
#[test]
fn a_breakaway_that_was_not_observed_is_not_zero() {
    let rig = rig(Preset::Chapter);
    let sessions = [2, 4].map(|seed| healthy(Preset::Chapter, seed));
    let setup = learnt_from(&rig, &sessions);
    assert_eq!(x_of(setup.rig.calibration.as_ref().unwrap()).rest_s, 0.0);
    let mut engine = Engine::new(setup, FaultMemory::default());
    let mut transitions = Vec::new();
    // The ball rests in the middle while the plate is held at half a degree.
    for i in 0..2000_u32 {
        let tremble = if i % 2 == 0 { 1e-4 } else { 0.0 };
        let sample = Sample {
            seq: None,
            t_s: f64::from(i) * 0.01,
            cmd_qx_rad: Some(0.5 * DEGREE),
            cmd_qy_rad: Some(0.5 * DEGREE),
            x_m: Some(tremble),
            y_m: Some(tremble),
        };
        engine.handle(Input::Sample(sample), &mut transitions);
    }
    let found = confirmed(&transitions);
    assert!(found.iter().all(|&(code, _)| code != FaultCode::StuckBall), "{found:?}");
}

/// On a rig with a poorly fitting twin, neither accelerations nor likelihoods of a known
/// scale are conclusive, but with the path they are, if its evidence in healthy sessions is
/// known.
#[test]
fn on_a_rig_that_is_fitted_badly_the_path_accuses_the_servo() {
    let mut learnt = learnt_from(
        &rig(Preset::Chapter),
        &[healthy(Preset::Chapter, 2), healthy(Preset::Chapter, 3)],
    );
    let calibration = learnt.rig.calibration.as_mut().unwrap();
    let axis = calibration.axes.x.as_mut().unwrap();
    assert!(axis.most_path_nats.is_some_and(|nats| nats < 10.0), "{axis:?}");
    (axis.model_error_m_s2, axis.residual_m_s2) = (0.1, 1.0);
    let mut without = learnt.clone();
    let axes = &mut without.rig.calibration.as_mut().unwrap().axes;
    axes.x.as_mut().unwrap().most_path_nats = None;
    for seed in 6..10 {
        let fault = "x_servo:gain=0.3@20";
        let samples = session(Preset::Chapter, Reference::Circle, 60.0, seed, fault);
        let judged = |setup: &Setup| confirmed(&transitions(setup, &samples));
        assert_eq!(judged(&learnt).first().map(|f| f.0), Some(FaultCode::XServo), "{seed}");
        assert!(judged(&without).iter().all(|f| f.0 != FaultCode::XServo), "{seed}");
    }
}
