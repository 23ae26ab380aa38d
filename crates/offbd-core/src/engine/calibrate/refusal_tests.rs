//! Tests of refusals, and that every calibration ends.

use proptest::prelude::*;

use super::tests::session;
use super::*;
use crate::diagnosis::FaultMemory;
use crate::engine::{Engine, Input, Setup};
use crate::plant::steps;

fn refused(rig: &Rig, sessions: &[Vec<Sample>]) -> String {
    calibrate(rig, sessions).unwrap_err().to_string()
}

fn changed(change: impl Fn(&mut Sample)) -> Vec<Sample> {
    let mut samples = session(30.0, 0.03, 1.0);
    samples.iter_mut().for_each(change);
    samples
}

/// The ball of the asset file may be as large as the width of the plate: that of a beam may.
#[test]
fn a_ball_without_room_on_its_plate_is_named() {
    let mut rig = Rig::chapter("a");
    rig.ball = crate::plant::Ball::new(0.12, 0.051, 0.4).unwrap();
    let refused = refused(&rig, &[session(60.0, 0.03, 1.0)]);
    assert!(refused.contains("the ball, 0.12 m in radius, would touch the edge"), "{refused}");
    // Also where the command explains the motion: at most positions such a ball could not be.
    let at = |share| Misfit::NoRoom { share, radius_m: 0.09 };
    assert!(at(0.76).prevents_learning() && !at(0.4).prevents_learning());
}

#[test]
fn what_cannot_be_of_the_rig_is_refused_with_its_session() {
    let rig = Rig::chapter("a");
    let healthy = changed(|_| {});
    let ms = refused(&rig, &[healthy.clone(), changed(|s| s.t_s *= 1e3)]);
    assert!(ms.starts_with("session 2: ") && ms.ends_with("is t_s in ms?"), "{ms}");
    let off = refused(&rig, &[changed(|s| s.x_m = s.x_m.map(|x| x + 0.3))]);
    assert!(off.contains("100 % of the positions lie outside the plate"), "{off}");
    let degrees = |c: &mut Option<f64>| *c = c.map(f64::to_degrees);
    let commands = refused(
        &rig,
        &[changed(|s| {
            degrees(&mut s.cmd_qx_rad);
            degrees(&mut s.cmd_qy_rad);
        })],
    );
    assert!(commands.contains("is axes.command_unit_rad 0.0175?"), "{commands}");
}

#[test]
fn motion_that_the_command_does_not_explain_is_told_by_its_cause() {
    let rig = Rig::chapter("a");
    let swapped = refused(&rig, &[changed(|s| core::mem::swap(&mut s.x_m, &mut s.y_m))]);
    assert!(swapped.contains("x answers the command of qx, not that of qy"), "{swapped}");
    let noise = refused(
        &rig,
        &[changed(|s| {
            s.x_m = Some(0.05 * (1.9 * s.t_s).sin());
            s.y_m = Some(0.05 * (2.3 * s.t_s).cos());
        })],
    );
    assert!(noise.contains("clearly does: noise, drag, stiction"), "{noise}");
}

#[test]
fn no_refusal_shows_what_is_not_a_number() {
    for percent in [f64::NAN, f64::INFINITY] {
        let words = CannotCalibrate::TooLittleExcitation { axis: Axis::X, percent }.to_string();
        assert!(!words.contains("NaN") && !words.contains("inf"), "{words}");
    }
}

/// Most steps of the twins that a calibration may take per sample, whatever the clock
/// says.
const MOST_LEARNING_STEPS: u64 = 30_000;
/// Most steps of the twins that a calibration without prospects takes per sample of a long
/// session: it takes some 25, a search that follows the twin over all of it at each dead
/// time and lag some 460.
const USUAL_LEARNING_STEPS: u64 = 50;

#[test]
fn the_search_follows_the_twin_over_a_long_session_a_few_times() {
    let samples = session(240.0, 0.03, 1.0);
    let most = USUAL_LEARNING_STEPS * samples.len() as u64;
    let (learnt, _) = steps::within(most, || calibrate(&Rig::chapter("a"), &[samples]));
    assert!(learnt.is_ok(), "{learnt:?}");
}

/// Clocks that are too fast or too slow, stand still, jump and go back.
fn clock() -> impl Strategy<Value = (f64, Vec<(usize, f64)>)> {
    let jump = (0.0..10.0_f64, any::<bool>())
        .prop_map(|(exponent, back)| if back { -1.0 } else { 1.0 } * 10_f64.powf(exponent));
    (-3.0..6.0_f64, proptest::collection::vec((0..600_usize, jump), 0..4))
        .prop_map(|(exponent, jumps)| (10_f64.powf(exponent), jumps))
}

/// Most steps of the twin that judging may take per sample: five seconds of a sliding
/// ball.
const MOST_JUDGED_STEPS: u64 = 500;

/// A healthy session of 24 s at 25 Hz with such a clock.
fn by_clock(scale: f64, jumps: &[(usize, f64)]) -> Vec<Sample> {
    let mut samples: Vec<Sample> = session(24.0, 0.03, 1.0).into_iter().step_by(4).collect();
    for (i, s) in samples.iter_mut().enumerate() {
        s.t_s *= scale;
        s.t_s += jumps.iter().filter(|(from, _)| i >= *from).map(|(_, by)| by).sum::<f64>();
    }
    samples
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn a_calibration_ends_whatever_the_clock_says(
        (scale, jumps) in clock(), is_scaled in any::<bool>(),
    ) {
        let rig = Rig { sample_rate_hz: 25.0, ..Rig::chapter("a") };
        let samples = by_clock(if is_scaled { scale } else { 1.0 }, &jumps);
        let most = MOST_LEARNING_STEPS * samples.len() as u64;
        let _ = steps::within(most, || calibrate_with_prospects(&rig, &[samples]));
    }

    #[test]
    fn judging_ends_whatever_the_clock_says((scale, jumps) in clock()) {
        let rig = Rig { sample_rate_hz: 25.0, ..Rig::chapter("a") };
        let samples = by_clock(scale, &jumps);
        let mut engine = Engine::new(Setup::new(rig, None).unwrap(), FaultMemory::default());
        let most = MOST_JUDGED_STEPS * samples.len() as u64;
        steps::within(most, || {
            let mut transitions = Vec::new();
            for sample in &samples {
                engine.handle(Input::NewSample(*sample), &mut transitions);
            }
            engine.handle(Input::End, &mut transitions);
        });
    }
}
