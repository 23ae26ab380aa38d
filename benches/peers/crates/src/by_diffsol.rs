//! diffsol: BDF on the compliant ball, Tsit45 on the rolling one.

use anyhow::Result;
use diffsol::{
    Bdf, NalgebraContext, NalgebraLU, NalgebraMat, NalgebraVec, OdeBuilder, OdeEquations,
    OdeEquationsImplicit, OdeSolverMethod, OdeSolverProblem, OdeSolverStopReason, Vector,
};

use crate::equations::{START, compliant, compliant_times, rolling};
use crate::measure::{ABSOLUTE, Case, Labels, tolerances};
use crate::scene::Scene;

type Matrix = NalgebraMat<f64>;
type Lu = NalgebraLU<f64>;

/// Seconds between restarts.
const TICK: f64 = 1e-3;

/// What the builder makes of the compliant equations.
trait Compliant:
    OdeEquationsImplicit<M = Matrix, V = NalgebraVec<f64>, T = f64, C = NalgebraContext>
{
}

impl<E> Compliant for E where
    E: OdeEquationsImplicit<M = Matrix, V = NalgebraVec<f64>, T = f64, C = NalgebraContext>
{
}

/// All methods and tolerances of one scene.
pub fn scan(case: &mut Case) {
    let scene = *case.scene;
    for &value in tolerances(case.quick) {
        let labels = |model, method: &str| Labels {
            model,
            method: method.into(),
            setting: "tolerance",
            value,
        };
        case.add(labels("compliant", "bdf"), |times| free_bdf(scene, value, times));
        case.add(labels("rolling", "tsit45"), |times| free_tsit45(scene, value, times));
        case.add(labels("compliant", "bdf restarted 1 ms"), |times| restarted(scene, value, times));
    }
}

fn compliant_problem(scene: Scene, tolerance: f64) -> Result<OdeSolverProblem<impl Compliant>> {
    let Scene { law, contact, .. } = scene;
    Ok(OdeBuilder::<Matrix>::new()
        .rtol(tolerance)
        .atol([ABSOLUTE * tolerance])
        .rhs_implicit(
            move |y, _, t, out| compliant(law, contact, t, y, out),
            move |y, _, t, d, out| compliant_times(law, contact, t, y, d, out),
        )
        .init(|_, _, y| y.copy_from_slice(&START), START.len())
        .build()?)
}

fn free_bdf(scene: Scene, tolerance: f64, times: &[f64]) -> Result<Vec<[f64; 2]>> {
    let problem = compliant_problem(scene, tolerance)?;
    march(problem.bdf::<Lu>()?, scene.duration, times)
}

fn free_tsit45(scene: Scene, tolerance: f64, times: &[f64]) -> Result<Vec<[f64; 2]>> {
    let law = scene.law;
    let problem = OdeBuilder::<Matrix>::new()
        .rtol(tolerance)
        .atol([ABSOLUTE * tolerance])
        .rhs(move |y, _, t, out| rolling(law, t, y, out))
        .init(|_, _, y| y.fill(0.0), 5)
        .build()?;
    march(problem.tsit45()?, scene.duration, times)
}

/// Steps past the end as the solver likes, interpolating on the way.
fn march<'a, E: OdeEquations<T = f64> + 'a>(
    mut solver: impl OdeSolverMethod<'a, E>,
    end: f64,
    times: &[f64],
) -> Result<Vec<[f64; 2]>> {
    let mut positions = Vec::with_capacity(times.len());
    while solver.state().t < end {
        solver.step()?;
        while let Some(&t) = times.get(positions.len()).filter(|&&t| t <= solver.state().t) {
            let y = solver.interpolate(t)?;
            positions.push([y.get_index(0), y.get_index(1)]);
        }
    }
    Ok(positions)
}

/// Stopped and begun again at first order after every tick, as where the plate's
/// next reading is awaited; the step size and the Jacobian are carried over.
fn restarted(scene: Scene, tolerance: f64, times: &[f64]) -> Result<Vec<[f64; 2]>> {
    let problem = compliant_problem(scene, tolerance)?;
    let mut solver: Bdf<_, Lu> = problem.bdf()?;
    let mut positions = Vec::with_capacity(times.len());
    if !times.is_empty() {
        positions.push([START[0], START[1]]);
    }
    for tick in 1..=(scene.duration / TICK).round() as u32 {
        let end = f64::from(tick) * TICK;
        let carried = solver.state().h.min(TICK);
        *solver.state_mut().h = carried;
        solver.set_stop_time(end)?;
        while !matches!(solver.step()?, OdeSolverStopReason::TstopReached) {}
        if times.get(positions.len()).is_some_and(|t| (t - end).abs() < 0.5 * TICK) {
            let state = solver.state();
            positions.push([state.y.get_index(0), state.y.get_index(1)]);
        }
    }
    Ok(positions)
}
