//! ode_solvers: Dopri5 and Dop853 on the rolling ball.

use anyhow::anyhow;
use ode_solvers::{Dop853, Dopri5, OutputType, SVector, System};

use crate::equations::rolling;
use crate::measure::{ABSOLUTE, Case, Labels, tolerances};
use crate::scene::{Law, Scene};

type State = SVector<f64, 5>;

struct Rolling(Law);

impl System<f64, State> for Rolling {
    fn system(&self, t: f64, y: &State, out: &mut State) {
        rolling(self.0, t, y.as_slice(), out.as_mut_slice());
    }
}

/// Solves by a stepper of the crate; both have the same constructor but no trait.
macro_rules! solve {
    ($stepper:ident, $scene:expr, $tolerance:expr, $times:expr) => {{
        let (scene, times): (Scene, &[f64]) = ($scene, $times);
        let (output, every) = match times {
            [first, second, ..] => (OutputType::Dense, second - first),
            _ => (OutputType::Sparse, scene.duration),
        };
        let (end, absolute) = (scene.duration, ABSOLUTE * $tolerance);
        let start = State::zeros();
        let mut stepper =
            $stepper::new(Rolling(scene.law), 0.0, end, every, start, $tolerance, absolute);
        stepper.set_output(output);
        stepper.integrate().map_err(|failure| anyhow!("{failure}"))?;
        Ok(stepper.y_out().iter().take(times.len()).map(|y| [y[0], y[1]]).collect())
    }};
}

/// Both methods with all tolerances on one scene.
pub fn scan(case: &mut Case) {
    let scene = *case.scene;
    for &value in tolerances(case.quick) {
        let labels = |method: &str| Labels {
            model: "rolling",
            method: method.into(),
            setting: "tolerance",
            value,
        };
        case.add(labels("dopri5"), |times| solve!(Dopri5, scene, value, times));
        case.add(labels("dop853"), |times| solve!(Dop853, scene, value, times));
    }
}
