use super::*;
use crate::engine::calibrate::tests::session;

/// A healthy session of the chapter's rig, with each row changed.
fn changed(change: impl Fn(&mut Sample)) -> Vec<Sample> {
    let mut samples = session(30.0, 0.03, 0.9);
    samples.iter_mut().for_each(change);
    samples
}

fn misfits(samples: &[Sample]) -> Vec<Misfit> {
    Plausibility::of(&Rig::chapter("a"), samples).misfits()
}

/// The misfits of a session as one string.
fn said(samples: &[Sample]) -> String {
    misfits(samples).iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

fn scale(value: &mut Option<f64>, factor: f64) {
    *value = value.map(|v| v * factor);
}

#[test]
fn a_session_that_fits_is_left_in_peace() {
    assert_eq!(misfits(&changed(|_| {})), []);
}

#[test]
fn a_clock_in_milliseconds_is_named() {
    let ms = changed(|s| s.t_s *= 1e3);
    let words = "a sample comes every 10 s, but by the asset file's sample_rate_hz of 100 every 0.01 s: \
                 is t_s in ms?";
    assert_eq!(said(&ms), words);
    assert!(said(&changed(|s| s.t_s *= 1e6)).ends_with("is t_s in µs?"));
}

#[test]
fn a_rate_that_is_off_by_more_than_three_is_named_without_a_guess() {
    assert_eq!(misfits(&changed(|s| s.t_s *= 1.4)), []);
    let words = "a sample comes every 0.028 s, but by the asset file's sample_rate_hz of 100 every \
                 0.01 s: are samples left out, or is sample_rate_hz 35.7?";
    assert_eq!(said(&changed(|s| s.t_s *= 2.8)), words);
    for factor in [4.0, 0.25] {
        let found = misfits(&changed(|s| s.t_s *= factor));
        assert!(matches!(found[..], [Misfit::Rate { per_second: None, .. }]), "{found:?}");
    }
}

#[test]
fn positions_in_millimetres_or_centimetres_are_named() {
    for (factor, unit) in [(1e3, "0.001"), (1e2, "0.01 or 0.001")] {
        let other = changed(|s| {
            scale(&mut s.x_m, factor);
            scale(&mut s.y_m, factor);
        });
        let said = said(&other);
        assert!(said.contains(" % of the positions lie outside the plate of the asset file"));
        assert!(said.ends_with(&format!(": is axes.position_unit_m {unit}?")), "{said}");
    }
}

#[test]
fn positions_off_the_plate_are_named_without_a_guess_at_the_unit() {
    let off = changed(|s| s.x_m = s.x_m.map(|x| x + 0.3));
    assert_eq!(said(&off), "100 % of the positions lie outside the plate of the asset file");
}

#[test]
fn commands_in_degrees_are_named() {
    let degrees = changed(|s| {
        scale(&mut s.cmd_qx_rad, 1.0 / DEGREE);
        scale(&mut s.cmd_qy_rad, 1.0 / DEGREE);
    });
    let said = said(&degrees);
    assert!(said.contains("beyond servo.angle_limit_rad, 0.2 rad"), "{said}");
    assert!(said.ends_with("is axes.command_unit_rad 0.0175?"), "{said}");
}

#[test]
fn a_limit_entered_too_small_is_not_a_question_of_degrees() {
    let mut rig = Rig::chapter("a");
    rig.servo.angle_limit_rad = 0.003;
    let found = Plausibility::of(&rig, &changed(|_| {})).misfits();
    assert!(matches!(found[..], [Misfit::Commands { unit_rad: None, .. }]), "{found:?}");
}

#[test]
fn swapped_axes_are_named_by_both() {
    let swapped = changed(|s| core::mem::swap(&mut s.x_m, &mut s.y_m));
    let wanted = Axis::ALL.map(|axis| Misfit::Swapped { axis, swap: false });
    assert_eq!(misfits(&swapped), wanted);
    let rig = Rig::chapter("a");
    let mapping = crate::engine::AxisMapping { swap: true, ..rig.mapping };
    assert_eq!(Plausibility::of(&Rig { mapping, ..rig }, &swapped).misfits(), []);
}

#[test]
fn a_wrong_sign_is_named_of_its_axis() {
    let wrong = changed(|s| scale(&mut s.y_m, -1.0));
    assert_eq!(misfits(&wrong), [Misfit::WrongSign { axis: Axis::Y, sign: 1.0 }]);
}

/// A calibration settles the axes: a servo in the opposite direction is then a fault, and
/// an axis that it lacks is not missed.
#[test]
fn a_calibration_answers_for_the_axes() {
    let mut rig = Rig::chapter("a");
    let beam = changed(|s| s.y_m = None);
    let learnt = crate::engine::calibrate(&rig, core::slice::from_ref(&beam)).unwrap();
    rig.calibration = Some(Box::new(learnt));
    let found = |samples: &[Sample]| Plausibility::of(&rig, samples).misfits();
    assert_eq!(found(&beam), []);
    assert_eq!(found(&changed(|s| scale(&mut s.x_m, -1.0))), []);
    assert_eq!(found(&changed(|s| s.x_m = None)), [Misfit::OneAxis { axis: Axis::X }]);
}

#[test]
fn motion_that_answers_nothing_is_not_a_question_of_axes() {
    // A sensor that sways by itself, unrelated to any command.
    let noise = changed(|s| {
        s.x_m = Some(0.05 * (1.9 * s.t_s).sin());
        s.y_m = Some(0.05 * (2.3 * s.t_s).cos());
    });
    assert_eq!(misfits(&noise), []);
}

#[test]
fn what_is_missing_is_named() {
    assert_eq!(misfits(&changed(|s| (s.x_m, s.y_m) = (None, None))), [Misfit::NoReadings]);
    let no_commands = changed(|s| (s.cmd_qx_rad, s.cmd_qy_rad) = (None, None));
    assert_eq!(misfits(&no_commands), [Misfit::NoCommands]);
    let crossed = changed(|s| (s.x_m, s.cmd_qx_rad) = (None, None));
    assert_eq!(misfits(&crossed), [Misfit::NoAxis]);
    let held = changed(|s| (s.cmd_qx_rad, s.cmd_qy_rad) = (Some(0.01), Some(0.0)));
    assert_eq!(misfits(&held), [Misfit::CommandsHeld]);
    let beam = changed(|s| s.y_m = None);
    assert_eq!(misfits(&beam), [Misfit::OneAxis { axis: Axis::Y }]);
    assert_eq!(misfits(&[]), [Misfit::NoReadings]);
}

#[test]
fn two_seconds_are_too_short() {
    let found = said(&changed(|_| {})[..200]);
    assert_eq!(found, "2.0 s are too short to be judged; record at least 3 s");
}

#[test]
fn the_order_of_the_rows_and_gaps_do_not_matter() {
    let mut rows = changed(|_| {});
    rows.chunks_mut(2).for_each(<[Sample]>::reverse);
    rows.drain(900..1400);
    rows.iter_mut().skip(1200).for_each(|s| s.t_s += 1e9);
    assert_eq!(misfits(&rows), []);
}

/// Readings a tenth of what they should be, as from centimetres read as millimetres.
fn a_tenth(s: &mut Sample) {
    scale(&mut s.x_m, 0.1);
    scale(&mut s.y_m, 0.1);
}

#[test]
fn positions_in_a_unit_that_is_too_small_are_named() {
    let words = "the motion is 0.09 of what the commands ask: are the positions 10 times as large \
                 (axes.position_unit_m 10 instead of 1)?";
    assert_eq!(said(&changed(a_tenth)), words);
    let found = misfits(&changed(|s| {
        a_tenth(s);
        a_tenth(s);
    }));
    assert!(matches!(found[..], [Misfit::Scale { factor: 100.0, .. }]), "{found:?}");
    // One axis alone is not a question of units, nor is an answer of a third.
    assert_eq!(misfits(&changed(|s| scale(&mut s.x_m, 0.1))), []);
    let weak = changed(|s| {
        scale(&mut s.x_m, 0.3);
        scale(&mut s.y_m, 0.3);
    });
    assert_eq!(misfits(&weak), []);
}

/// A fault of both servos leaves the scatter of the readings as it was; a wrong unit does not.
#[test]
fn the_scatter_tells_a_unit_from_weak_servos() {
    let noise = core::cell::Cell::new(1_u64);
    let next = || {
        noise.set(noise.get().wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
        (noise.get() >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let noisy = |s: &mut Sample| {
        for value in [&mut s.x_m, &mut s.y_m].into_iter().flatten() {
            *value += 1e-3 * next();
        }
    };
    let healthy = changed(noisy);
    let mut rig = Rig::chapter("a");
    rig.calibration =
        Some(Box::new(crate::engine::calibrate(&rig, core::slice::from_ref(&healthy)).unwrap()));
    let scattered = |samples: &[Sample]| match Plausibility::of(&rig, samples).misfits()[..] {
        [Misfit::Scale { factor: 10.0, scattered, .. }] => Some(scattered),
        _ => None,
    };
    assert_eq!(scattered(&healthy), None);
    let unit = changed(|s| {
        noisy(s);
        a_tenth(s);
    });
    assert_eq!(scattered(&unit), Some(true));
    let weak = changed(|s| {
        a_tenth(s);
        noisy(s);
    });
    assert_eq!(scattered(&weak), Some(false));
}

#[test]
fn a_ball_that_does_not_fit_its_plate_is_named() {
    let mut rig = Rig::chapter("a");
    rig.ball = crate::plant::Ball::new(0.12, 0.051, 0.4).unwrap();
    let found = Plausibility::of(&rig, &changed(|_| {})).misfits();
    assert!(matches!(found[..], [Misfit::NoRoom { radius_m: 0.12, .. }]), "{found:?}");
}
