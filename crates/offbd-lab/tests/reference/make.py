"""Makes the trajectories beside this file, by a route that shares no code with offbd.

Compliant: the kept truth of benches/peers (Radau IIA, rtol 1e-11), thinned out.
Rolling: SciPy's DOP853, rtol 1e-13, piece by smooth piece.
Coulomb: only `steep`, which stays in the x-z plane, solved in the world's frame
by DOP853 with events: a rigid plate, true friction, an inelastic landing.

Run in benches/peers with its environment:
    .venv/bin/python reference.py && .venv/bin/python ../../tests/reference/make.py
"""

import math
import pathlib
import sys

import numpy as np
from scipy.integrate import solve_ivp

HERE = pathlib.Path(__file__).resolve().parent
PEERS = HERE.parent.parent / "benches" / "peers"
sys.path.insert(0, str(PEERS))
import equations  # noqa: E402
import reference  # noqa: E402
from equations import FRICTION, GRAVITY, RADIUS, REST_HEIGHT, RISE, SHAPE  # noqa: E402
from scenes import SCENES  # noqa: E402

EVERY = {"slope": 10, "sine": 20, "steep": 10}
TIGHT = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-16}


def write(name, header, rows):
    np.savetxt(HERE / f"{name}.csv", rows, delimiter=",", header=header, comments="", fmt="%.13e")


def compliant():
    for scene in SCENES.values():
        every = EVERY[scene.name.split("-")[0]]
        times, path = scene.samples[::every], reference.load(scene)[::every]
        write(f"compliant-{scene.name}", "t_s,x_m,y_m,z_m", np.column_stack([times, path]))


def rolling():
    for name in ("slope", "sine", "steep"):
        scene = SCENES[name]
        times = scene.samples[:: EVERY[name]]
        breaks = [0.0, RISE, scene.duration] if name == "steep" else [0.0, scene.duration]
        rows, y = [np.concatenate([[0.0], np.zeros(2)])], np.zeros(5)
        for start, end in zip(breaks, breaks[1:]):
            inside = times[(times > start + 1e-12) & (times <= end + 1e-12)]
            # A break belongs to both pieces; end just inside the first one.
            last = end - (1e-15 if end == RISE else 0.0)
            wanted = np.append(np.minimum(inside, last), last)
            solution = solve_ivp(
                equations.rolling, (start, last), y, t_eval=np.unique(wanted),
                args=(scene.kind,), **TIGHT,
            )
            rows += [np.concatenate([[t], s[:2]]) for t, s in zip(inside, solution.y.T)]
            y = solution.y[:, -1]
        write(f"rolling-{name}", "t_s,x_m,y_m", np.array(rows))


def angle(t, after):
    """qy and its rates; `after` tells the side of the break."""
    _, q, _, rate, _, acceleration = equations.law(equations.STEEP, RISE if after else t)
    return q, rate, acceleration


class World:
    """The plane of motion in the world: X right, Z up; the plate turns about the origin."""

    def __init__(self, after):
        self.after = after

    def frame(self, t):
        q, rate, acceleration = angle(t, self.after)
        along = np.array([math.cos(q), -math.sin(q)])
        normal = np.array([math.sin(q), math.cos(q)])
        return along, normal, rate, acceleration

    def plate_coordinates(self, t, y):
        along, normal, rate, _ = self.frame(t)
        p, v = y[:2], y[2:4]
        x, z = p @ along, p @ normal
        # q turns the plate about +y: d(along)/dt = -rate*normal, d(normal)/dt = rate*along.
        vx, vz = v @ along - rate * (p @ normal), v @ normal + rate * (p @ along)
        return x, z, vx, vz, y[4] - rate

    def on_plate(self, t, y):
        """Normal force and sticking friction per mass for a ball kept on the plate."""
        along, normal, rate, acceleration = self.frame(t)
        x, z, vx, _, _ = self.plate_coordinates(t, y)
        # World acceleration along the normal of a point that keeps z' = 0.
        a_normal = -acceleration * x - 2 * rate * vx - rate * rate * z
        push = a_normal + GRAVITY * normal[1]
        # World acceleration along the plate is (x'' terms); sticking: x'' = r*(w' - q'').
        # x'' = F + g_along + rate^2 x - acceleration z ; w' = -F/(SHAPE r)
        free = -GRAVITY * along[1] + rate * rate * x - acceleration * z
        stick = (-RADIUS * acceleration - free) / (1 + 1 / SHAPE)
        return push, stick

    def slope(self, t, y, mode):
        along, normal, _, _ = self.frame(t)
        force, torque = np.array([0.0, -GRAVITY]), 0.0
        if mode != "flight":
            push, stick = self.on_plate(t, y)
            friction = stick if mode == "stick" else mode * FRICTION * push
            force = force + push * normal + friction * along
            torque = -friction / (SHAPE * RADIUS)
        return np.concatenate([y[2:4], force, [torque]])


def coulomb():
    scene = SCENES["steep"]
    times = scene.samples[:: EVERY["steep"]]
    y, t, mode = np.array([0.0, REST_HEIGHT, 0.0, 0.0, 0.0]), 0.0, "stick"
    # At rest relative to the plate, whose rate is zero at the start.
    rows = {0: (0.0, 0.0)}
    while t < scene.duration:
        after = t >= RISE
        world, end = World(after), scene.duration if after else RISE

        def lifts(s, y):
            return world.on_plate(s, y)[0]

        def slips(s, y):
            push, stick = world.on_plate(s, y)
            return FRICTION * push - abs(stick)

        def lands(s, y):
            return world.plate_coordinates(s, y)[1] - REST_HEIGHT

        watched = {"stick": [slips, lifts], "flight": [lands]}.get(mode, [lifts])
        for event in watched:
            event.terminal, event.direction = True, -1
        solution = solve_ivp(
            lambda s, y: world.slope(s, y, mode), (t, end), y, events=watched,
            dense_output=True, max_step=1e-3, **TIGHT,
        )
        for i, s in enumerate(times):
            if t < s <= solution.t[-1] + 1e-12:
                at = solution.sol(min(s, solution.t[-1]))
                rows[i] = (s, world.plate_coordinates(s, at)[0])
        t, y = solution.t[-1], solution.y[:, -1]
        if t >= end - 1e-13:
            continue
        if mode == "stick":
            mode = float(np.sign(world.on_plate(t, y)[1]))
        elif mode == "flight":
            y, mode = landed(world, t, y)
        else:
            mode = "flight"
        print(f"coulomb: {mode} from {t:.6f} s")
    table = np.array([rows[i] for i in sorted(rows)])
    write("coulomb-steep", "t_s,x_m", table)


def landed(world, t, y):
    along, normal, _, _ = world.frame(t)
    _, _, vx, vz, w = world.plate_coordinates(t, y)
    slip = -vx + RADIUS * w
    impulse = np.clip(slip / (1 + 1 / SHAPE), FRICTION * vz, -FRICTION * vz)
    y = y.copy()
    y[2:4] += impulse * along - vz * normal
    y[4] -= impulse / (SHAPE * RADIUS)
    stays = abs(slip / (1 + 1 / SHAPE)) < -FRICTION * vz
    return y, "stick" if stays else float(np.sign(slip))


if __name__ == "__main__":
    compliant()
    rolling()
    coulomb()
