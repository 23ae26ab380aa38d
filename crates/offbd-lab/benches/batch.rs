//! Measures the cost of a step of a rolling ball, alone and in a batch.
//!
//! `cargo bench -p offbd-lab --bench batch [-- ROUNDS]` compares in one run, on the
//! same balls and plates:
//!
//! - *rolling*: `Rolling::midpoint`, one ball at a time;
//! - *alone*: `RollingConstants::midpoint`, one ball at a time;
//! - a batch by each set of instructions that the machine has. The run checks that all
//!   sets give the states of *alone*, to the bit.
//!
//! Prints nanoseconds per ball and step, the median of interleaved rounds, and in
//! brackets the ratio to *alone*. Not included: computing the plates' motion and
//! reading states back. Uses one core.

#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

use std::hint::black_box;
use std::time::Instant;

use nalgebra::Vector2;
use offbd_core::plant::{Ball, Plate, PlateShape, Rolling, RollingState, Tilt};
use offbd_lab::batch::{Instructions, PlateColumns, RollingBatch, RollingConstants};

/// Fleet sizes, in balls: from one hall to a fleet too large for the inner caches.
const SIZES: [usize; 4] = [64, 1024, 4096, 16_384];
/// Number of ball-steps of each stepper in a round. Chosen to take under a
/// millisecond, so that a busy machine disturbs single rounds and not their median.
const BALL_STEPS: usize = 1 << 14;

fn main() {
    let rounds = std::env::args().filter_map(|a| a.parse().ok()).next().unwrap_or(1001);
    println!("ns per ball and step (times alone), median of {rounds} rounds");
    for n in SIZES {
        let fleet = Fleet::new(n);
        let mut steppers = fleet.steppers();
        let mut costs = vec![Vec::new(); steppers.len()];
        for _ in 0..rounds {
            for (stepper, costs) in steppers.iter_mut().zip(&mut costs) {
                costs.push(cost(stepper, &fleet));
            }
        }
        report(n, &steppers, &costs);
    }
}

fn report(n: usize, steppers: &[Stepper], costs: &[Vec<f64>]) {
    let alone = median(&costs[1]);
    print!("{n:6} balls:");
    for (stepper, costs) in steppers.iter().zip(costs) {
        print!("  {} {:.2} ({:.3})", stepper.name(), median(costs), median(costs) / alone);
    }
    println!();
    let expected = steppers[1].states();
    for stepper in &steppers[2..] {
        assert!(stepper.states() == expected, "{} differs", stepper.name());
    }
}

/// A fleet of different rigs, each with its own plate, whose motion is constant.
struct Fleet {
    rigs: Vec<(Ball, Plate)>,
    tilts: Vec<Tilt>,
    columns: [Vec<f64>; 7],
}

impl Fleet {
    fn new(n: usize) -> Self {
        let rigs = (0..n).map(|i| rig(spread(i, 0))).collect();
        let tilts: Vec<Tilt> = (0..n).map(tilt).collect();
        let column = |of: fn(&Tilt) -> f64| tilts.iter().map(of).collect::<Vec<_>>();
        let columns = [
            column(|t| t.angle.x),
            column(|t| t.angle.y),
            column(|t| t.rate.x),
            column(|t| t.rate.y),
            column(|t| t.acceleration.x),
            column(|t| t.acceleration.y),
            vec![STEP_S; n],
        ];
        Self { rigs, tilts, columns }
    }

    fn plates(&self) -> PlateColumns<'_> {
        let [qx_rad, qy_rad, qx_rate, qy_rate, qx_acceleration, qy_acceleration, step_s] =
            &self.columns;
        PlateColumns { qx_rad, qy_rad, qx_rate, qy_rate, qx_acceleration, qy_acceleration, step_s }
    }

    fn steppers(&self) -> Vec<Stepper> {
        let states = vec![RollingState::default(); self.rigs.len()];
        let rolling = self.rigs.iter().map(|(ball, plate)| Rolling::new(ball, plate)).collect();
        let constants: Vec<_> =
            self.rigs.iter().map(|(ball, plate)| RollingConstants::new(ball, plate)).collect();
        let batch = |instructions| {
            Stepper::Batch(RollingBatch::new(&constants, instructions), instructions)
        };
        let batches: Vec<Stepper> = Instructions::available().map(batch).collect();
        let mut steppers = vec![Stepper::Rolling(rolling, states.clone())];
        steppers.push(Stepper::Alone(constants, states));
        steppers.extend(batches);
        steppers
    }
}

/// Step size, s. Chosen so short that no ball moves far in any number of rounds.
const STEP_S: f64 = 1e-7;

/// Returns a number in [−0.5, 0.5) for ball `i`, a different one for each `what`.
fn spread(i: usize, what: usize) -> f64 {
    ((i * 7919 + what * 104_729) % 1009) as f64 / 1009.0 - 0.5
}

fn rig(by: f64) -> (Ball, Plate) {
    let ball = Ball::new(0.02 + 0.01 * by, 0.05, 0.5 + 0.2 * by).expect("in range");
    let shape = PlateShape::Round { diameter_m: 0.3 };
    (ball, Plate::new(shape, 0.02 + 0.01 * by, true).expect("in range"))
}

fn tilt(i: usize) -> Tilt {
    let pair = |what, scale: f64| Vector2::new(spread(i, what), spread(i, what + 1)) * scale;
    Tilt { angle: pair(1, 0.4), rate: pair(3, 1.0), acceleration: pair(5, 10.0) }
}

enum Stepper {
    Rolling(Vec<Rolling>, Vec<RollingState>),
    Alone(Vec<RollingConstants>, Vec<RollingState>),
    Batch(RollingBatch, Instructions),
}

impl Stepper {
    fn name(&self) -> String {
        match self {
            Self::Rolling(..) => "rolling".to_owned(),
            Self::Alone(..) => "alone".to_owned(),
            Self::Batch(_, instructions) => instructions.to_string(),
        }
    }

    fn step(&mut self, fleet: &Fleet) {
        match self {
            Self::Rolling(models, states) => {
                for ((model, state), tilt) in models.iter().zip(states).zip(&fleet.tilts) {
                    *state = model.midpoint(state, [&tilt.motion(); 2], STEP_S);
                }
            }
            Self::Alone(models, states) => {
                for ((model, state), tilt) in models.iter().zip(states).zip(&fleet.tilts) {
                    *state = model.midpoint(state, tilt, STEP_S);
                }
            }
            Self::Batch(batch, _) => batch.step(&fleet.plates()),
        }
    }

    fn states(&self) -> Vec<RollingState> {
        match self {
            Self::Rolling(_, states) | Self::Alone(_, states) => states.clone(),
            Self::Batch(batch, _) => batch.states().collect(),
        }
    }
}

/// Returns the time per ball and step, ns, measured after one step that warms the
/// caches.
fn cost(stepper: &mut Stepper, fleet: &Fleet) -> f64 {
    let steps = BALL_STEPS / fleet.rigs.len();
    stepper.step(fleet);
    let start = Instant::now();
    for _ in 0..steps {
        black_box(&mut *stepper).step(black_box(fleet));
    }
    start.elapsed().as_secs_f64() * 1e9 / BALL_STEPS as f64
}

fn median(costs: &[f64]) -> f64 {
    let mut sorted = costs.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
