use super::*;
use crate::variables::{BALL_RADIUS, INERTIA_FACTOR, PLATE_THICKNESS, X_SERVO};
use offbd_core::engine::{Rig, Setup, free_run};
use offbd_core::vocabulary::Sample;

const COMMAND_GAIN: usize = X_SERVO + 3;
const LAG: usize = X_SERVO + 4;
const LEVEL: usize = X_SERVO + 6;
const DEAD_TIME: usize = X_SERVO + 2;

fn instance(values: &[(usize, f64)]) -> Instance {
    let setup = Setup::new(Rig::chapter("chapter"), None).unwrap();
    let mut instance = Instance::new(&StartValues::of(&setup).unwrap());
    values.iter().for_each(|&(index, value)| instance.set(index as u32, value).unwrap());
    instance.enter_initialization().unwrap();
    instance.exit_initialization().unwrap();
    instance
}

fn run(instance: &mut Instance, steps: u32, h: f64, command: impl Fn(f64) -> f64) {
    for i in 0..steps {
        let t = f64::from(i) * h;
        instance.set(COMMAND_QY as u32, command(t)).unwrap();
        instance.step(t, h).unwrap();
    }
}

/// On a plate that stands still the path is a parabola: v̇x = g/(1 + κ)·cos qx·sin qy.
#[test]
fn validate_a_held_plate_against_the_parabola() {
    let held = [(COMMAND_QX, 0.1), (COMMAND_QY, 0.15), (INERTIA_FACTOR, 2.0 / 3.0), (VX, 0.2)];
    let mut instance = instance(&held);
    run(&mut instance, 40, 0.05, |_| 0.15);
    let a = 9.81 / (1.0 + 2.0 / 3.0) * 0.1_f64.cos() * 0.15_f64.sin();
    let x = instance.get(X as u32).unwrap();
    assert!((x - (0.2 * 2.0 + a * 2.0)).abs() < 1e-12, "{x}");
    let vy = instance.get(VY as u32).unwrap();
    let b = -9.81 / (1.0 + 2.0 / 3.0) * 0.1_f64.sin();
    assert!((vy - b * 2.0).abs() < 1e-12, "{vy}");
}

/// The plate follows a step of the command by the lag's exponential, after the dead time.
#[test]
fn validate_the_plate_against_the_exponential() {
    let mut instance = instance(&[(LAG, 0.05), (DEAD_TIME, 0.02)]);
    run(&mut instance, 10, 0.01, |_| 0.1);
    let angle = instance.get(QY as u32).unwrap();
    let wanted = 0.1 * (1.0 - (-(0.1 - 0.02) / 0.05_f64).exp());
    assert!((angle - wanted).abs() < 1e-12, "{angle}");
}

/// Runs on from `from_s` to `to_s` in steps of 10 ms, with the command 0.1 rad.
fn hold(instance: &mut Instance, from_s: f64, to_s: f64) {
    instance.set(COMMAND_QY as u32, 0.1).unwrap();
    for i in 0..((to_s - from_s) / 0.01).round() as u32 {
        instance.step(from_s + f64::from(i) * 0.01, 0.01).unwrap();
    }
}

/// A servo that loses a part of its gain, and becomes slower, moves from where it is by the
/// exponential of the new lag, at once: the dead time is that of commands.
#[test]
fn validate_a_gain_set_in_mid_run_against_the_exponential() {
    let mut instance = instance(&[(LAG, 0.05), (DEAD_TIME, 0.5), (COMMAND_QY, 0.1)]);
    hold(&mut instance, 0.0, 1.0);
    instance.set(COMMAND_GAIN as u32, -0.4).unwrap();
    instance.set(LAG as u32, 0.2).unwrap();
    assert_eq!(instance.get(QY as u32), Ok(0.1));
    hold(&mut instance, 1.0, 1.3);
    let angle = instance.get(QY as u32).unwrap();
    let wanted = -0.04 + 0.14 * (-0.3 / 0.2_f64).exp();
    assert!((angle - wanted).abs() < 1e-12, "{angle} is not {wanted}");
}

/// A horn that slips tilts the plate by its level, without a push to the ball.
#[test]
fn validate_a_level_set_in_mid_run_against_the_parabola() {
    let mut instance = instance(&[(VX, 0.2)]);
    run(&mut instance, 100, 0.01, |_| 0.0);
    instance.set(LEVEL as u32, 0.05).unwrap();
    instance.step(1.0, 0.5).unwrap();
    assert_eq!(instance.get(QY as u32), Ok(0.05));
    let x = instance.get(X as u32).unwrap();
    let wanted = 0.2 * 1.5 + 9.81 / 1.4 * 0.05_f64.sin() * 0.5 * 0.5 * 0.5;
    assert!((x - wanted).abs() < 1e-12, "{x} is not {wanted}");
}

/// A longer dead time holds back the commands that the servo has not obeyed, and no others.
#[test]
fn validate_a_dead_time_set_in_mid_run_against_the_exponential() {
    let mut instance = instance(&[(LAG, 0.05), (DEAD_TIME, 0.1)]);
    let mut at = |dead_time_s, from_s, to_s| {
        instance.set(DEAD_TIME as u32, dead_time_s).unwrap();
        hold(&mut instance, from_s, to_s);
        instance.get(QY as u32).unwrap()
    };
    let turned = |seconds: f64| 0.1 * (1.0 - (-seconds / 0.05).exp());
    assert_eq!(at(0.1, 0.0, 0.05), 0.0);
    assert_eq!(at(0.3, 0.05, 0.3), 0.0);
    for (dead_time_s, from_s, to_s) in [(0.3, 0.3, 0.35), (2.0, 0.35, 0.4)] {
        let angle = at(dead_time_s, from_s, to_s);
        assert!((angle - turned(to_s - 0.3)).abs() < 1e-12, "{angle} at {to_s} s");
    }
}

/// The model moves as the twin under the same commands, recorded, whose samples are between the
/// steps of the integration.
#[test]
fn the_path_is_that_of_a_free_run() {
    let setup = Setup::new(Rig::chapter("chapter"), None).unwrap();
    let (h, command) = (0.013, |t: f64| 0.15 * (4.0 * t).sin());
    let sample = |i: u32| {
        let (t_s, held) = (f64::from(i) * h, Some(0.0));
        let cmd_qy_rad = Some(command(t_s));
        Sample { t_s, cmd_qx_rad: held, cmd_qy_rad, x_m: Some(0.02), y_m: held, seq: None }
    };
    let samples: Vec<Sample> = (0..=200).map(sample).collect();
    let points = free_run(&setup, &samples, 0.005).unwrap();
    let mut instance = instance(&[(LONGEST_STEP, 0.005), (X, 0.02)]);
    run(&mut instance, 200, h, command);
    let end = points[200];
    for (index, wanted) in [
        (X, end.ball.position.x),
        (VX, end.ball.velocity.x),
        (Y, end.ball.position.y),
        (QY, end.plate.x),
    ] {
        let got = instance.get(index as u32).unwrap();
        assert!((got - wanted).abs() < 1e-12, "{}: {got} is not {wanted}", VARIABLES[index].name);
    }
}

/// With a shorter step of the integration the path changes by less: it converges.
#[test]
fn the_path_converges_with_the_step() {
    let at = |longest| {
        let mut instance = instance(&[(LONGEST_STEP, longest), (LAG, 0.05)]);
        run(&mut instance, 200, 0.01, |t| 0.15 * (4.0 * t).sin());
        instance.get(X as u32).unwrap()
    };
    let path = [0.01, 0.005, 0.0025].map(at);
    let ratio = (path[0] - path[1]) / (path[1] - path[2]);
    assert!((1.5..5.0).contains(&ratio), "{path:?}: {ratio}");
}

#[test]
fn a_saved_state_goes_on_alike_to_the_bit() {
    let mut instance = instance(&[(DEAD_TIME, 0.035), (PLATE_THICKNESS, 0.01)]);
    run(&mut instance, 20, 0.01, |t| t);
    let mut copy = Instance::from_bytes(&instance.to_bytes().unwrap()).unwrap();
    for one in [&mut instance, &mut copy] {
        one.step(0.2, 0.01).unwrap();
        one.step(0.21, 0.02).unwrap();
    }
    assert_eq!(instance.values, copy.values);
    assert!(Instance::from_bytes(b"no instance").is_err());
}

/// A step from such a state would not end.
#[test]
fn a_saved_state_with_values_that_cannot_be_set_is_refused() {
    let mut started = instance(&[]);
    started.step(0.0, 0.01).unwrap();
    let refused = |change: &dyn Fn(&mut Instance)| {
        let mut changed = started.clone();
        change(&mut changed);
        Instance::from_bytes(&changed.to_bytes().unwrap()).unwrap_err().to_string()
    };
    let step = refused(&|instance| instance.values[LONGEST_STEP] = 1e-12);
    assert!(step.starts_with("longest_step: "), "{step}");
    let time = refused(&|instance| instance.values[TIME] = 1e9);
    assert_eq!(time, "the state was not saved by this model: the twin is at another time");
    started.values[TIME] = f64::NAN;
    assert!(Instance::from_bytes(&started.to_bytes().unwrap()).is_err());
}

#[test]
fn what_does_not_fit_is_refused_in_words() {
    let mut instance = instance(&[]);
    let radius = instance.set(BALL_RADIUS as u32, 0.02).unwrap_err().to_string();
    assert_eq!(radius, "ball_radius cannot be set after the initialization");
    let lag = instance.set(LAG as u32, -1.0).unwrap_err().to_string();
    assert_eq!(lag, "x_servo.lag: -1 is outside 0 to 10");
    let late = instance.step(0.5, 0.01).unwrap_err().to_string();
    assert_eq!(late, "the step begins at 0.5 s, but the last one ended at 0 s");
    assert!(matches!(instance.step(0.0, 0.0), Err(Refusal::Value(_))));
    assert!(matches!(instance.step(0.0, f64::NAN), Err(Refusal::Value(_))));
    assert!(matches!(instance.step(f64::NAN, 0.1), Err(Refusal::OtherTime { .. })));
    assert_eq!(instance.get(999), Err(Refusal::NoVariable(999)));
    let command = instance.set(COMMAND_QX as u32, f64::INFINITY).unwrap_err().to_string();
    assert_eq!(command, "cmd_qx: inf is outside -1000 to 1000");
    instance.terminate().unwrap();
    let after = instance.step(0.0, 0.1).unwrap_err().to_string();
    assert_eq!(after, "a step is not allowed after the end");
    instance.reset();
    instance.set(BALL_RADIUS as u32, 0.02).unwrap();
}

#[test]
fn start_values_are_outputs_during_the_initialization() {
    let setup = Setup::new(Rig::chapter("chapter"), None).unwrap();
    let mut instance = Instance::new(&StartValues::of(&setup).unwrap());
    instance.start_at(3.0).unwrap();
    instance.enter_initialization().unwrap();
    instance.set(COMMAND_QY as u32, 0.5).unwrap();
    instance.set(Y as u32, 0.04).unwrap();
    // The servo's limit is 0.2 rad.
    assert_eq!(instance.get(QY as u32), Ok(0.2));
    assert_eq!(instance.get(Y as u32), Ok(0.04));
    assert_eq!(instance.get(TIME as u32), Ok(3.0));
}
