use proptest::prelude::*;

use super::search::{COMMANDED, IN_TIME, MARGIN_M};
use super::*;
use crate::diagnosis::{AxisCalibration, Calibration, CalibrationOrigin, SensorCalibration};
use crate::engine::AxisMapping;
use crate::plant::{Plate, PlateShape};

/// An axis as learnt from several sessions of a good rig.
const GOOD: AxisCalibration = AxisCalibration {
    gain: 0.95,
    dead_time_s: 0.04,
    lag_s: 0.05,
    level_rad: 0.008,
    level_spread_rad: 0.004,
    gain_spread: 0.03,
    resistance_m_s2: 0.005,
    noise_m: 2e-4,
    breakaway_rad: 0.004,
    longest_repeat_s: 0.02,
    rest_s: 10.0,
    residual_m_s2: 0.004,
    model_error_m_s2: 0.01,
    most_nats: 0.5,
    most_path_nats: None,
    familiar_m_s2: 0.3,
};

fn learnt(x: Option<AxisCalibration>, y: Option<AxisCalibration>) -> Rig {
    let calibration = Calibration {
        axes: PerAxis { x, y },
        sensor: SensorCalibration { most_scatter_m: 3e-4, ..SensorCalibration::default() },
        sessions: Vec::new(),
        origin: CalibrationOrigin::default(),
        n_samples: 6000,
        duration_s: 60.0,
        certificate: None,
        prospects: None,
        left_out: Vec::new(),
    };
    Rig { calibration: Some(Box::new(calibration)), ..Rig::chapter("a") }
}

fn good() -> Rig {
    learnt(Some(GOOD), Some(GOOD))
}

fn plate(length_m: f64, width_m: f64) -> Plate {
    Plate::new(PlateShape::Rectangle { length_m, width_m }, 0.02, true).unwrap()
}

#[test]
fn a_good_rig_has_a_cycle_of_seconds_in_which_every_plain_fault_is_found() {
    let cycle = drive_cycle(&good()).unwrap();
    assert!((2.0..12.0).contains(&cycle.duration_s), "{}", cycle.duration_s);
    let passed = |m: &MonitorVerdict| m.passed.is_ok_and(|s| s <= cycle.duration_s);
    assert!(cycle.monitors.iter().all(passed), "{:?}", cycle.monitors);
    let found = |f: &FaultVerdict| f.after_s.is_some_and(|s| s <= IN_TIME * cycle.duration_s);
    let (halves, plain): (Vec<_>, Vec<_>) =
        cycle.faults.iter().partition(|f| matches!(f.fault, TriedFault::HalfGain(_)));
    assert!(plain.iter().copied().all(found), "{:?}", cycle.faults);
    assert_eq!((halves.len(), plain.len()), (2, 7));
    assert_eq!(drive_cycle(&good()), Ok(cycle), "equal rigs have equal cycles");
}

#[test]
fn no_shorter_member_of_the_family_finds_as_much() {
    let search = Search::new(&good()).unwrap();
    let family = search.family().unwrap();
    let best = search.best(&family).unwrap();
    let shorter = family.iter().take_while(|m| m.duration_s() < best.motion.duration_s());
    assert!(shorter.clone().count() > 0);
    for motion in shorter {
        let found = search.try_out(motion, best.spread, usize::MAX, &mut 0);
        assert!(found.is_none_or(|f| f.missing() > best.found.missing()), "{motion:?}");
    }
}

#[test]
fn an_axis_that_is_not_learnt_is_named_and_not_moved() {
    for axis in Axis::ALL {
        let has = |of: Axis| (of == axis).then_some(GOOD);
        let cycle = drive_cycle(&learnt(has(Axis::X), has(Axis::Y))).unwrap();
        let monitor = cycle.monitors[FaultCode::servo(axis.other()) as usize];
        assert_eq!(monitor.passed, Err(NotReached::NoSuchAxis));
        let others = cycle.monitors.iter().filter(|m| m.code != monitor.code);
        assert!(others.clone().all(|m| m.passed.is_ok()), "{:?}", cycle.monitors);
        assert!(cycle.feedback[axis].is_some() && cycle.feedback[axis.other()].is_none());
        let still = |r: &Sample| {
            r.command(axis.other()).is_none()
                && r.position(axis.other()).is_none()
                && r.command(axis).is_some()
        };
        assert!(cycle.rows.iter().all(still));
        assert!(cycle.faults.iter().all(|f| f.fault.code().axis() != Some(axis.other())));
    }
}

#[test]
fn a_rig_without_a_cycle_is_told_why() {
    let why = |rig: Rig| drive_cycle(&rig).unwrap_err().to_string();
    assert!(why(Rig::chapter("a")).starts_with("/calibration: the rig is not calibrated"));
    assert!(why(learnt(None, None)).starts_with("/calibration: the rig is not calibrated"));
    let tiny = Rig { plate: plate(0.2, 0.03), ..good() };
    assert_eq!(
        why(tiny),
        "/plate: the ball has 0.0 mm to roll along y, less than the motion needs"
    );
    let sticky = AxisCalibration { breakaway_rad: 0.15, ..GOOD };
    assert!(why(learnt(Some(sticky), Some(GOOD))).starts_with("/servo/angle_limit_rad: "));
    let bad = Rig { sample_rate_hz: -1.0, ..good() };
    assert!(why(bad).contains("/sample_rate_hz"));
}

/// On a plate too small for the ball to move far enough, untested faults are reported.
#[test]
fn what_a_small_plate_leaves_untested_is_named() {
    let far_off = AxisCalibration { level_spread_rad: 0.02, breakaway_rad: 0.01, ..GOOD };
    let rig = Rig { plate: plate(0.09, 0.07), ..learnt(Some(far_off), Some(far_off)) };
    let cycle = drive_cycle(&rig).unwrap();
    let unfound = cycle.faults.iter().filter(|f| f.after_s.is_none()).count();
    assert!(unfound > 0 && cycle.faults.len() == 9, "{:?}", cycle.faults);
    assert!(cycle.level_within_rad.x < far_off.level_spread_rad);
}

/// A device with other axes, signs and units gets the same motion in its numbers.
#[test]
fn the_rows_and_corrections_are_in_the_numbers_of_the_device() {
    let mapping = AxisMapping {
        swap: true,
        sign: PerAxis { x: -1.0, y: 1.0 },
        position_unit_m: 1e-3,
        origin_m: PerAxis { x: 0.003, y: -0.002 },
        command_unit_rad: 0.5,
    };
    let search = Search::new(&good()).unwrap();
    let motion = search.family().unwrap()[20];
    let plain = search.cycle(&motion, &AxisMapping::default());
    let device = search.cycle(&motion, &mapping);
    for (a, b) in plain.rows.iter().zip(&device.rows) {
        let back = super::super::frame::moment(&mapping, b).unwrap();
        for axis in Axis::ALL {
            let near = |a: Option<f64>, b: Option<f64>| (a.unwrap() - b.unwrap()).abs() < 1e-12;
            assert!(near(a.command(axis), back.command[axis]), "{axis:?} {a:?} {b:?}");
            assert!(near(a.position(axis), back.position[axis]), "{axis:?} {a:?} {b:?}");
        }
    }
    // A ball 10 mm from the middle along the plate's x and 20 mm along its y.
    let (mut in_plate, mut in_device) = (DriveLaw::default(), DriveLaw::default());
    let here = Sample { x_m: Some(0.01), y_m: Some(0.02), ..Sample::default() };
    let there = Sample { x_m: Some(18.0), y_m: Some(-13.0), ..Sample::default() };
    let wanted = in_plate.command(&plain, &here);
    let found = in_device.command(&device, &there);
    for axis in Axis::ALL {
        let (wanted, found) = (wanted[axis].unwrap(), 0.5 * found[axis].unwrap());
        assert!((wanted - found).abs() < 1e-12, "{axis:?} {wanted} {found}");
    }
}

prop_compose! {
    /// Axes like those of the simulated rigs.
    fn axis()(
        gain in 0.7..1.3_f64, dead_time_s in 0.0..0.2_f64, lag_s in 0.01..0.15_f64,
        level_rad in -0.03..0.03_f64, breakaway_rad in 0.0..0.02_f64,
    ) -> AxisCalibration {
        AxisCalibration { gain, dead_time_s, lag_s, level_rad, breakaway_rad, ..GOOD }
    }
}

proptest! {
    /// Every member of the family is within the servos' limits and on the plate.
    #[test]
    fn every_member_stays_within_the_limits_and_on_the_plate(
        x in axis(), y in axis(), length_m in 0.1..0.5_f64, width_m in 0.1..0.5_f64,
        angle_limit_rad in 0.05..0.3_f64, sample_rate_hz in 5.0..500.0_f64, round in any::<bool>(),
    ) {
        let mut rig = Rig { sample_rate_hz, ..learnt(Some(x), Some(y)) };
        rig.servo.angle_limit_rad = angle_limit_rad;
        rig.plate = plate(length_m, width_m);
        if round {
            let shape = PlateShape::Round { diameter_m: length_m };
            rig.plate = Plate::new(shape, 0.02, true).unwrap();
        }
        let search = Search::new(&rig).unwrap();
        for motion in search.family().unwrap_or_default().iter().step_by(7) {
            let cycle = search.cycle(motion, &AxisMapping::default());
            for row in &cycle.rows {
                let at = |axis| row.position(axis).unwrap();
                let edge_m = rig.plate.edge_distance_m(at(Axis::X), at(Axis::Y));
                prop_assert!(edge_m >= rig.contact_room_m() + MARGIN_M - 1e-9);
                for axis in Axis::ALL {
                    let most = COMMANDED * angle_limit_rad + 1e-9;
                    prop_assert!(row.command(axis).unwrap().abs() <= most);
                }
            }
            let (first, last) = (&cycle.rows[0], &cycle.rows[cycle.rows.len() - 1]);
            prop_assert!(last.t_s >= cycle.duration_s && last.t_s < cycle.duration_s + 0.3);
            for row in [first, last] {
                prop_assert!(row.x_m.unwrap().abs() + row.y_m.unwrap().abs() < 1e-9);
            }
        }
    }
}
