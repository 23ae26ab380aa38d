//! Properties of real rigs that the presets lack.

use super::*;
use crate::simulation::{ControllerModel, Preset, Refresh, SensorModel, ServoTruth, Variety};
use proptest::prelude::*;

fn chapter() -> RigModel {
    Preset::Chapter.model().unwrap()
}

fn run(model: RigModel, reference: Reference, seconds: f64) -> Vec<Sample> {
    let mut rig = SimulatedRig::new(model, reference, Disturbances::default(), 5).unwrap();
    std::iter::from_fn(|| Some(rig.next_sample())).take_while(|s| s.t_s < seconds).collect()
}

/// Returns the lengths of the runs of rows with equal positions, without the first and
/// the last run.
fn runs(samples: &[Sample]) -> Vec<usize> {
    let equal = |a: &Sample, b: &Sample| a.x_m == b.x_m && a.y_m == b.y_m;
    let lengths: Vec<usize> = samples.chunk_by(equal).map(<[Sample]>::len).collect();
    lengths[1..lengths.len() - 1].to_vec()
}

#[test]
fn a_rig_off_level_rests_under_a_command_of_minus_its_level() {
    for (level_deg, gain) in [(2.0_f64, 1.0), (-1.5, 0.8)] {
        let mut model = chapter();
        model.sensor.outliers = 0.0;
        model.servos = model.servos.map(|servo| ServoTruth {
            level_rad: level_deg.to_radians(),
            gain,
            ..servo
        });
        let breakaway_rad = model.surface.breakaway_rad;
        let samples = run(model, Reference::Hold, 60.0);
        let last = &samples[samples.len() - 1000..];
        for axis in Axis::ALL {
            let commands = last.iter().map(|s| s.command(axis).unwrap());
            let mean = commands.sum::<f64>() / last.len() as f64;
            // A ball at rest allows any tilt of the plate within its breakaway tilt.
            let plate_rad = gain * mean + level_deg.to_radians();
            assert!(plate_rad.abs() < 1.5 * breakaway_rad, "{axis:?}: {plate_rad} rad off");
            // Without an integral the ball would rest 26 mm off: 1.9°·g/ω².
            assert!(last.iter().all(|s| s.position(axis).is_none_or(|m| m.abs() < 0.015)));
        }
    }
}

#[test]
fn a_derivative_makes_commands_as_noisy_as_the_readings() {
    let noisy = |derivative_filter_s, noise_m| {
        let mut model = chapter();
        model.sensor = SensorModel { noise_m, outliers: 0.0, missing: 0.0, ..model.sensor };
        model.controller = ControllerModel { derivative_filter_s, ..model.controller };
        let samples = run(model, Reference::Hold, 20.0);
        let steps = samples.windows(2).map(|w| w[1].cmd_qy_rad.unwrap() - w[0].cmd_qy_rad.unwrap());
        (steps.map(|step| step * step).sum::<f64>() / samples.len() as f64).sqrt()
    };
    assert!(noisy(0.0, 1e-3) > 3.0 * noisy(0.05, 1e-3));
    assert!(noisy(0.0, 1e-3) > 3.0 * noisy(0.0, 1e-4));
}

#[test]
fn an_origin_off_centre_shifts_where_the_ball_is_held() {
    let mut model = chapter();
    model.sensor.origin_m = PerAxis { x: 0.03, y: -0.02 };
    let mut rig = SimulatedRig::new(model, Reference::Hold, Disturbances::default(), 5).unwrap();
    let samples: Vec<Sample> = (0..3000).map(|_| rig.next_sample()).collect();
    let off = rig.truth().position - Vector2::new(-0.03, 0.02);
    assert!(off.norm() < 0.02, "{off}");
    assert!(samples[2999].x_m.unwrap().abs() < 0.02);
}

/// The beam guides the ball: pushes along y have no effect, and no row has a y.
#[test]
fn a_beam_has_no_y() {
    let disturbances = Disturbances { pushes_per_minute: 60.0, gusts_per_minute: 10.0 };
    for reference in Reference::ALL {
        let mut rig = SimulatedRig::new(chapter().along_x(), reference, disturbances, 5).unwrap();
        for _ in 0..2000 {
            let sample = rig.next_sample();
            assert_eq!((sample.cmd_qx_rad, sample.y_m), (None, None));
            assert!(sample.cmd_qy_rad.is_some());
            assert_eq!((rig.truth().position.y, rig.truth().velocity.y), (0.0, 0.0));
        }
        assert!(reference == Reference::Hold || rig.truth().position.x != 0.0);
    }
}

/// After the integral has levelled the plate, apart from occasional bounces.
#[test]
fn every_real_rig_keeps_its_ball_off_the_rim() {
    let kept = |seed: u64, reference: Reference| {
        let model = Variety::Real.rig(seed).unwrap().of_session(seed);
        let mut rig = SimulatedRig::new(model, reference, Disturbances::default(), seed).unwrap();
        let reach = rig.ball_on_plate.reach();
        let (mut n, mut at_rim) = (0_u32, 0_u32);
        while rig.now_s < 80.0 {
            rig.next_sample();
            let share = rig.truth().position.component_div(&reach).amax();
            n += u32::from(rig.now_s > 40.0);
            at_rim += u32::from(rig.now_s > 40.0 && share > 0.99);
        }
        f64::from(at_rim) / f64::from(n)
    };
    let mut worst: Vec<(f64, u64, Reference)> = (0..30)
        .map(|seed| (seed, Reference::ALL[seed as usize % 4]))
        .map(|(seed, reference)| (kept(seed, reference), seed, reference))
        .collect();
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    assert!(worst[0].0 < 0.05, "share of the time at the rim, seed, reference: {:?}", &worst[..5]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn a_sensor_that_is_held_repeats_every_reading_exactly_k_times(
        k in 2..9_u32,
        jitter in 0.0..0.2_f64,
    ) {
        let mut model = chapter();
        let refresh = Refresh::Rows(k);
        // So noisy that no two readings are equal; without latency.
        model.sensor = SensorModel {
            refresh,
            jitter,
            latency_s: 0.0,
            noise_m: 1e-2,
            quantum_m: 0.0,
            missing: 0.0,
            ..model.sensor
        };
        for length in runs(&run(model, Reference::Circle, 5.0)) {
            prop_assert_eq!(length, k as usize);
        }
    }

    #[test]
    fn servos_in_whole_degrees_get_whole_degrees(seed in any::<u64>()) {
        let mut model = chapter();
        model.controller.resolution_rad = 1.0_f64.to_radians();
        let disturbances = Disturbances { pushes_per_minute: 60.0, gusts_per_minute: 0.0 };
        let mut rig = SimulatedRig::new(model, Reference::Steps, disturbances, seed).unwrap();
        for _ in 0..1000 {
            let sample = rig.next_sample();
            for command in [sample.cmd_qx_rad, sample.cmd_qy_rad].into_iter().flatten() {
                // The log rounds to 10 µrad.
                let degrees = command.to_degrees();
                prop_assert!((degrees - degrees.round()).abs() < 3e-4, "{degrees}°");
            }
        }
    }

    #[test]
    fn no_real_rig_breaks_the_log(seed in any::<u64>()) {
        let model = Variety::Real.rig(seed).unwrap().of_session(seed);
        let one_axis = model.one_axis;
        for sample in run(model, Reference::Steps, 5.0) {
            let numbers = [sample.cmd_qx_rad, sample.cmd_qy_rad, sample.x_m, sample.y_m];
            prop_assert!(numbers.into_iter().flatten().all(f64::is_finite));
            prop_assert_eq!(sample.cmd_qx_rad.is_none(), one_axis);
        }
    }
}
