"""The truth: the compliant equations, solved far more finely than any peer is asked to.

Radau IIA with an analytic Jacobian, kept as CSV (t, px, py, pz in metres) until
the equations or the scenes change. `--check` solves them again by fixed-step
RK4 with 0.25 µs and prints how far apart the two are.
"""

import argparse
import pathlib

import numpy as np
from scipy.integrate import solve_ivp

import equations
from equations import START, compiled, compliant_into
from scenes import SCENES

HERE = pathlib.Path(__file__).resolve().parent
FOLDER = HERE / ".cache" / "truth"
SOURCES = [HERE / name for name in ("equations.py", "scenes.py", "reference.py")]
RTOL, ATOL = 1e-11, 1e-13
CHECK_STEP = 2.5e-7


def solve(scene):
    """Positions at the scene's samples, by Radau."""
    solution = solve_ivp(
        equations.compliant, (0.0, scene.duration), START,
        method="Radau", t_eval=scene.samples, args=scene.arguments,
        jac=equations.compliant_jacobian, rtol=RTOL, atol=ATOL, max_step=1e-3,
    )
    if not solution.success:
        raise RuntimeError(f"{scene.name}: {solution.message}")
    return solution.y[:3].T


@compiled
def march(steps, step, every, kind, stiffness, damping):
    """Positions after each `every` steps of classical RK4."""
    y = START.copy()
    slopes = np.empty((4, 9))
    out = np.empty((steps // every + 1, 3))
    out[0] = y[:3]
    for n in range(steps):
        t = n * step
        compliant_into(t, y, slopes[0], kind, stiffness, damping)
        half = y + 0.5 * step * slopes[0]
        compliant_into(t + 0.5 * step, half, slopes[1], kind, stiffness, damping)
        half = y + 0.5 * step * slopes[1]
        compliant_into(t + 0.5 * step, half, slopes[2], kind, stiffness, damping)
        full = y + step * slopes[2]
        compliant_into(t + step, full, slopes[3], kind, stiffness, damping)
        y += step / 6 * (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3])
        if (n + 1) % every == 0:
            out[(n + 1) // every] = y[:3]
    return out


def path(scene, folder=FOLDER):
    """Where the truth of a scene is kept."""
    return pathlib.Path(folder) / f"{scene.name}.csv"


def load(scene, folder=FOLDER):
    """The kept positions: (n, 3) in the plate's frame."""
    return np.loadtxt(path(scene, folder), delimiter=",", skiprows=1)[:, 1:]


def keep(scene):
    """Solve and write, unless what is kept is newer than its sources."""
    target = path(scene)
    newest = max(source.stat().st_mtime for source in SOURCES)
    if target.exists() and target.stat().st_mtime > newest:
        return
    table = np.column_stack([scene.samples, solve(scene)])
    target.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(target, table, delimiter=",", header="t,px,py,pz", comments="", fmt="%.16e")


def check(scene):
    """Print the distance between the kept truth and fixed-step RK4."""
    steps, every = (round(x / CHECK_STEP) for x in (scene.duration, scene.sample_step))
    other = march(steps, CHECK_STEP, every, *scene.arguments)
    print(f"{scene.name}: {np.abs(other - load(scene)).max():.1e} m")


def main():
    """Keep the truth of all scenes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare with fixed-step RK4")
    arguments = parser.parse_args()
    for scene in SCENES.values():
        keep(scene)
        if arguments.check:
            check(scene)


if __name__ == "__main__":
    main()
