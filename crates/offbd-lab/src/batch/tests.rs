use nalgebra::Vector2;
use proptest::prelude::*;

use super::*;
use offbd_core::plant::{Ball, Plate, PlateShape, Rolling, Tilt};

/// The inputs of one ball's step: its rig, its state, its plate, the step size.
#[derive(Clone, Debug)]
struct Case {
    ball: Ball,
    plate: Plate,
    state: RollingState,
    tilt: Tilt,
    step_s: f64,
}

fn pair(limit: f64) -> impl Strategy<Value = Vector2<f64>> {
    [-limit..limit, -limit..limit].prop_map(Vector2::from)
}

fn rig() -> impl Strategy<Value = (Ball, Plate)> {
    (0.002..0.1, 0.0..=1.0, 0.0..0.1).prop_map(|(radius, kappa, thickness)| {
        let shape = PlateShape::Round { diameter_m: 1.0 };
        (Ball::new(radius, 0.05, kappa).unwrap(), Plate::new(shape, thickness, true).unwrap())
    })
}

fn case() -> impl Strategy<Value = Case> {
    let state = (pair(0.5), pair(3.0), -50.0..50.0)
        .prop_map(|(position, velocity, spin)| RollingState { position, velocity, spin });
    let tilt = (pair(7.0), pair(10.0), pair(100.0)).prop_map(|(angle, rate, acceleration)| Tilt {
        angle,
        rate,
        acceleration,
    });
    (rig(), state, tilt, 0.0..0.02).prop_map(|((ball, plate), state, tilt, step_s)| Case {
        ball,
        plate,
        state,
        tilt,
        step_s,
    })
}

impl Case {
    fn constants(&self) -> RollingConstants {
        RollingConstants::new(&self.ball, &self.plate)
    }

    fn alone(&self, n_steps: usize) -> RollingState {
        let constants = self.constants();
        (0..n_steps)
            .fold(self.state, |state, _| constants.midpoint(&state, &self.tilt, self.step_s))
    }
}

/// Returns the states after `n_steps` in one batch.
fn together(cases: &[Case], n_steps: usize, instructions: Instructions) -> Vec<RollingState> {
    let constants: Vec<_> = cases.iter().map(Case::constants).collect();
    let mut batch = RollingBatch::new(&constants, instructions);
    for (i, case) in cases.iter().enumerate() {
        batch.set_state(i, &case.state);
    }
    let column = |of: fn(&Case) -> f64| cases.iter().map(of).collect::<Vec<_>>();
    let plates = PlateColumns {
        qx_rad: &column(|c| c.tilt.angle.x),
        qy_rad: &column(|c| c.tilt.angle.y),
        qx_rate: &column(|c| c.tilt.rate.x),
        qy_rate: &column(|c| c.tilt.rate.y),
        qx_acceleration: &column(|c| c.tilt.acceleration.x),
        qy_acceleration: &column(|c| c.tilt.acceleration.y),
        step_s: &column(|c| c.step_s),
    };
    for _ in 0..n_steps {
        batch.step(&plates);
    }
    batch.states().collect()
}

fn numbers(state: &RollingState) -> [f64; 5] {
    let RollingState { position, velocity, spin } = *state;
    [position.x, position.y, velocity.x, velocity.y, spin]
}

fn bits(states: &[RollingState]) -> Vec<[u64; 5]> {
    states.iter().map(|state| numbers(state).map(f64::to_bits)).collect()
}

/// Returns which states consist of finite numbers only.
fn finite(states: &[RollingState]) -> Vec<bool> {
    states.iter().map(|state| numbers(state).iter().all(|n| n.is_finite())).collect()
}

proptest! {
    /// Up to three blocks, so that batches end at any lane of the last block.
    #[test]
    fn a_ball_in_a_batch_moves_as_it_does_alone(
        cases in prop::collection::vec(case(), 0..=3 * LANES),
        n_steps in 1_usize..4,
    ) {
        let alone: Vec<_> = cases.iter().map(|case| case.alone(n_steps)).collect();
        for instructions in Instructions::available() {
            let states = together(&cases, n_steps, instructions);
            prop_assert_eq!(bits(&states), bits(&alone), "{}", instructions);
        }
    }

    #[test]
    fn what_is_no_number_spoils_only_its_own_ball(
        mut cases in prop::collection::vec(case(), 2..=2 * LANES),
        at in any::<prop::sample::Index>(),
        what in prop::sample::select(vec![f64::NAN, f64::INFINITY]),
        place in 0..3,
    ) {
        let at = at.index(cases.len());
        let before: Vec<_> = cases.iter().map(|case| case.alone(1)).collect();
        match place {
            0 => cases[at].state.velocity.x = what,
            1 => cases[at].tilt.angle.y = what,
            _ => cases[at].step_s = what,
        }
        for instructions in Instructions::available() {
            let states = together(&cases, 1, instructions);
            for (i, (state, before)) in states.iter().zip(&before).enumerate() {
                if i != at {
                    prop_assert_eq!(bits(&[*state]), bits(&[*before]), "{}", instructions);
                }
            }
            prop_assert!(!finite(&states)[at]);
        }
    }

    /// Both compute the same terms in a different order: some forty roundings of
    /// 1.1e-16 each, of terms no larger than those summed here.
    #[test]
    fn a_step_agrees_with_the_rolling_model(case in case()) {
        let Case { ball, plate, state, tilt, step_s: h } = &case;
        let expected = Rolling::new(ball, plate).midpoint(state, [&tilt.motion(); 2], *h);
        let largest = |v: Vector2<f64>| v.amax();
        let (rate, curvature) = (largest(tilt.rate), 1.0 / ball.radius_m());
        let (angular, speed) =
            (largest(tilt.acceleration) + 2.0 * rate * rate, largest(state.velocity));
        let (arm, spin) = (plate.centre_gap_m(ball) + ball.radius_m(), state.spin.abs());
        let a = 9.81 + angular * (largest(state.position) + arm) + 3.0 * rate * (speed + arm * spin);
        let rotation = angular + rate * (speed + h * a) * curvature;
        let tolerance = [speed + h * a, a + 3.0 * rate * h * a + rate * arm * h * rotation, rotation]
            .map(|rate| 4e-15 * h * rate);
        for (i, (ours, theirs)) in numbers(&case.alone(1)).into_iter().zip(numbers(&expected)).enumerate() {
            let allowed = tolerance[i / 2] + 2.3e-16 * theirs.abs();
            prop_assert!((ours - theirs).abs() <= allowed, "{i}: {ours} {theirs}, {allowed:e}");
        }
    }
}

#[test]
fn no_balls_are_a_batch_too() {
    for instructions in Instructions::available() {
        assert!(together(&[], 3, instructions).is_empty());
        assert!(RollingBatch::new(&[], instructions).is_empty());
    }
}

#[test]
#[should_panic(expected = "a column needs a value per ball")]
fn a_column_that_is_too_short_is_refused() {
    let constants = RollingConstants::new(&Ball::default(), &Plate::default());
    let (all, short) = (&[0.0; 2][..], &[0.0; 1][..]);
    let mut batch = RollingBatch::new(&[constants; 2], Instructions::PORTABLE);
    batch.step(&PlateColumns {
        qx_rad: all,
        qy_rad: all,
        qx_rate: all,
        qy_rate: all,
        qx_acceleration: short,
        qy_acceleration: all,
        step_s: all,
    });
}

#[test]
fn the_portable_instructions_are_everywhere() {
    assert_eq!(Instructions::available().next(), Some(Instructions::PORTABLE));
    assert_eq!(Instructions::available().last(), Some(Instructions::widest()));
}
