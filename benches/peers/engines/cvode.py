"""SUNDIALS CVODE: BDF on the compliant ball, Adams on the rolling one."""

import importlib.metadata

import numpy as np
from numba import njit

import measure
from engines.sundials import NORMAL, Cvode, reinit, set_stop, solve
from scenes import ABSOLUTE, tolerances

TICK = 1e-3  # s between restarts


@njit
def to_each(memory, vector, y, times):
    """States at the times, interpolated where the solver steps past them."""
    reached = np.zeros(1)
    states = np.empty((len(times), len(y)))
    states[0] = y
    for n in range(1, len(times)):
        if solve(memory, times[n], vector, reached.ctypes.data, NORMAL) < 0:
            states[n:] = np.nan
            break
        states[n] = y
    return states


@njit
def restarting(memory, vector, y, ticks):
    """States after each tick, begun again at each."""
    reached = np.zeros(1)
    states = np.empty((ticks + 1, len(y)))
    states[0] = y
    for n in range(ticks):
        reinit(memory, n * TICK, vector)
        set_stop(memory, (n + 1) * TICK)
        if solve(memory, (n + 1) * TICK, vector, reached.ctypes.data, NORMAL) < 0:
            states[n + 1:] = np.nan
            break
        states[n + 1] = y
    return states


class Run:
    """One setting; every call starts at 0 again."""

    def __init__(self, scene, model, tolerance, longest=0.0):
        self.scene = scene
        self.solver = Cvode(scene, model, tolerance, ABSOLUTE * tolerance, longest)

    def _begin(self):
        self.solver.y[:] = self.solver.start
        reinit(self.solver.memory, 0.0, self.solver.vector)
        return self.solver.memory, self.solver.vector, self.solver.y

    def free(self, times):
        """One solve that knows the law beforehand."""
        return to_each(*self._begin(), times)

    def restarted(self):
        """Begun again at every tick, as where the plate's next reading is awaited."""
        return restarting(*self._begin(), round(self.scene.duration / TICK))


def measure_free(bench, scene, model, method, tolerance, longest=0.0):
    """Free-running; the timed run stops nowhere between start and end."""
    run = Run(scene, model, tolerance, longest)
    ends = np.array([0.0, scene.duration])
    bench.add(scene, (model, method, "tolerance", tolerance),
              lambda: run.free(scene.samples), lambda: run.free(ends))


def measure_restarted(bench, scene, tolerance):
    """Restarted at every tick."""
    run, every = Run(scene, "compliant", tolerance), round(scene.sample_step / TICK)
    bench.add(scene, ("compliant", "bdf restarted 1 ms", "tolerance", tolerance),
              lambda: run.restarted()[::every], run.restarted)


def scan(bench, scene, quick):
    """All tolerances of one scene."""
    for tolerance in tolerances(quick):
        measure_free(bench, scene, "compliant", "bdf", tolerance)
        measure_free(bench, scene, "compliant", "bdf steps ≤ 1 ms", tolerance, TICK)
        measure_free(bench, scene, "rolling", "adams", tolerance)
        measure_restarted(bench, scene, tolerance)


if __name__ == "__main__":
    measure.main("cvode", {"scikit-sundae": importlib.metadata.version("scikit-sundae")}, scan)
