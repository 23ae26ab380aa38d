"""SciPy: LSODA and Radau on the compliant ball, DOP853 and RK45 on the rolling one.

LSODA through `odeint`, whose loop is compiled; the others through `solve_ivp`,
whose loop is Python. The equations are compiled in all of them.
"""

import warnings
from functools import partial

import numpy as np
import scipy
from scipy.integrate import odeint, solve_ivp

import equations
import measure
from scenes import ABSOLUTE, tolerances

STEPS = 1_000_000


def lsoda(scene, tolerance, times):
    """Positions by odeint, which stops nowhere but interpolates."""
    warnings.simplefilter("error", scipy.integrate.ODEintWarning)
    states = odeint(
        equations.compliant, equations.START, times, args=scene.arguments,
        Dfun=equations.compliant_jacobian, tfirst=True, mxstep=STEPS,
        rtol=tolerance, atol=ABSOLUTE * tolerance,
    )
    return states[:, :3]


def by_solve_ivp(scene, model, method, tolerance, times):
    """Positions at the times, or at the end alone where there are none."""
    if model == "compliant":
        equation, start, arguments = equations.compliant, equations.START, scene.arguments
        options = {"jac": equations.compliant_jacobian}
    else:
        equation, start, arguments = equations.rolling, equations.ROLLING_START, (scene.kind,)
        options = {}
    solution = solve_ivp(
        equation, (0.0, scene.duration), start, method=method, t_eval=times,
        args=arguments, rtol=tolerance, atol=ABSOLUTE * tolerance, **options,
    )
    if not solution.success:
        raise RuntimeError(solution.message)
    return solution.y.T


def scan(bench, scene, quick):
    """All methods and tolerances of one scene."""
    ends = np.array([0.0, scene.duration])
    for tolerance in tolerances(quick):
        solve = partial(lsoda, scene, tolerance)
        bench.add(scene, ("compliant", "lsoda", "tolerance", tolerance),
                  partial(solve, scene.samples), partial(solve, ends))
        for model, method in (("compliant", "Radau"), ("rolling", "DOP853"), ("rolling", "RK45")):
            solve = partial(by_solve_ivp, scene, model, method, tolerance)
            bench.add(scene, (model, method.lower(), "tolerance", tolerance),
                      partial(solve, scene.samples), partial(solve, ends))


if __name__ == "__main__":
    measure.main("scipy", {"scipy": scipy.__version__}, scan)
