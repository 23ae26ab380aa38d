"""SUNDIALS CVODE through scikit-sundae: BDF on the compliant ball, Adams on the rolling one."""

import numpy as np
import sksundae
from sksundae.cvode import CVODE

import equations
import measure
from scenes import tolerances

# Position enters with metres, so the absolute tolerance is a good deal below the relative one.
ABSOLUTE = 1e-2
TICK = 1e-3  # s between restarts
STEPS = 10_000_000


def solver(scene, model, tolerance, **options):
    """CVODE on one of the two models."""
    if model == "compliant":
        rhs, method = equations.compliant_into, "BDF"
    else:
        rhs, method = equations.rolling_into, "Adams"
    arguments = scene.arguments if model == "compliant" else (scene.kind,)

    def derivative(t, y, out):
        rhs(t, y, out, *arguments)

    if model == "compliant":
        options["jacfn"] = jacobian(arguments)
    return CVODE(derivative, method=method, rtol=tolerance, atol=ABSOLUTE * tolerance,
                 max_num_steps=STEPS, **options)


def jacobian(arguments):
    """The analytic Jacobian in the shape that CVODE asks for."""
    def fill(t, y, _derivative, out):
        out[:] = equations.compliant_jacobian(t, y, *arguments)
    return fill


def free(scene, model, tolerance, times, **options):
    """One solve from start to end that knows the law beforehand."""
    start = equations.START if model == "compliant" else equations.ROLLING_START
    solution = solver(scene, model, tolerance, **options).solve(times, start)
    if not solution.success:
        raise RuntimeError(solution.message)
    return solution.y


def restarted(scene, tolerance, keep):
    """Begun anew at every tick, as where the plate's next reading is awaited."""
    integrator = solver(scene, "compliant", tolerance)
    state, kept = equations.START, [equations.START]
    for tick in range(round(scene.duration / TICK)):
        integrator.init_step(tick * TICK, state)
        state = integrator.step((tick + 1) * TICK, tstop=(tick + 1) * TICK).y
        if keep:
            kept.append(state)
    return np.array(kept)


def measure_free(bench, scene, model, method, tolerance, **options):
    """Free-running; the timed run stores nothing between start and end."""
    ends = np.array([0.0, 0.5 * scene.duration, scene.duration])
    bench.add(scene, (model, method, "tolerance", tolerance),
              lambda: free(scene, model, tolerance, scene.samples, **options),
              lambda: free(scene, model, tolerance, ends, **options))


def measure_restarted(bench, scene, tolerance):
    """Restarted at every tick."""
    every = round(scene.sample_step / TICK)
    bench.add(scene, ("compliant", "bdf restarted 1 ms", "tolerance", tolerance),
              lambda: restarted(scene, tolerance, keep=True)[::every],
              lambda: restarted(scene, tolerance, keep=False))


def scan(bench, scene, quick):
    """All tolerances of one scene."""
    for tolerance in tolerances(quick):
        measure_free(bench, scene, "compliant", "bdf", tolerance)
        measure_free(bench, scene, "compliant", "bdf steps ≤ 1 ms", tolerance, max_step=TICK)
        measure_free(bench, scene, "rolling", "adams", tolerance)
    for tolerance in [1e-6] if quick else [1e-4, 1e-5, 1e-6, 1e-7, 1e-8]:
        measure_restarted(bench, scene, tolerance)


if __name__ == "__main__":
    measure.main("cvode", {"scikit-sundae": sksundae.__version__}, scan)
