"""The scenes: how the plate moves, for how long, and how hard the contact is."""

from dataclasses import dataclass

import numpy as np

import equations

HARD = (800_000.0, 1000.0)
SOFT = (1000.0, 100.0)


@dataclass(frozen=True)
class Scene:
    """A law of the plate with a contact; `contact` is (K in N/m, D in N·s/m)."""

    name: str
    kind: int
    duration: float
    sample_step: float
    contact: tuple[float, float]

    @property
    def arguments(self):
        """What the compiled equations take after their state."""
        return (self.kind, *self.contact)

    @property
    def samples(self):
        """Where the position is compared, in seconds; starts at 0."""
        count = round(self.duration / self.sample_step)
        return self.sample_step * np.arange(count + 1)

    def law(self, times):
        """Angles, rates and accelerations of the plate: rows of 6."""
        return np.array([equations.law(self.kind, t) for t in np.atleast_1d(times)])


_LAWS = [
    ("slope", equations.SLOPE, 0.4, 0.002),
    ("sine", equations.SINE, 10.0, 0.01),
    ("steep", equations.STEEP, 0.4, 0.002),
]
SCENES = {
    name + suffix: Scene(name + suffix, kind, duration, step, contact)
    for suffix, contact in (("", HARD), ("-soft", SOFT))
    for name, kind, duration, step in _LAWS
}
QUICK = ("sine", "steep")
STEPS = (5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
QUICK_STEPS = (2e-3, 1e-3, 5e-4)
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
QUICK_TOLERANCES = (1e-4, 1e-6, 1e-8)
ABSOLUTE = 1e-2  # absolute over relative tolerance: positions are centimetres


def chosen(quick):
    """All scenes, or those of a quick run."""
    return [scene for name, scene in SCENES.items() if not quick or name in QUICK]


def steps(scene, quick, most=100_000):
    """Steps to try, in seconds: they divide the sampling, and a run has at most `most`.

    No engine can say the soft contact, so that small steps tell nothing there.
    """
    few = quick or scene.contact == SOFT
    return [
        step for step in (QUICK_STEPS if few else STEPS)
        if step <= scene.sample_step and scene.duration <= 1.001 * most * step
    ]


def tolerances(quick):
    """Relative tolerances to try."""
    return QUICK_TOLERANCES if quick else TOLERANCES


def plate_from_world(angles):
    """Rotations that take world vectors to the plate: (n, 3, 3) from (n, 2) angles.

    The transpose of Rx(qx)·Ry(qy).
    """
    (sx, cx), (sy, cy) = ((np.sin(q), np.cos(q)) for q in np.asarray(angles).T)
    zero = np.zeros_like(sx)
    rows = [[cy, sx * sy, -cx * sy], [zero, cx, sx], [sy, -sx * cy, cx * cy]]
    return np.moveaxis(np.array(rows), -1, 0)


def start_in_world(scene, lead=0.0):
    """Ball at rest on the plate, seen from the world: position, velocity, spin.

    With a `lead` in seconds the velocity and spin are those of a rolling ball that
    much earlier: where a semi-implicit method has its velocities half a step
    behind its positions, this is the start that it should be given.
    """
    qx, qy, *_ = scene.law(0.0)[0]
    to_world = plate_from_world([[qx, qy]])[0].T
    _, turn, turn_rate = (np.array(x) for x in equations.plate(scene.kind, 0.0))
    rest = np.array([0.0, 0.0, equations.REST_HEIGHT])
    _, _, ax, ay, spin_up = equations.rolling(0.0, equations.ROLLING_START, scene.kind)
    acceleration = np.cross(turn_rate, rest) + np.cross(turn, np.cross(turn, rest)) + [ax, ay, 0.0]
    spin_rate = turn_rate + [-ay / equations.RADIUS, ax / equations.RADIUS, spin_up]
    velocity = np.cross(turn, rest) - lead * acceleration
    return to_world @ rest, to_world @ velocity, to_world @ (turn - lead * spin_rate)


def to_plate(scene, times, positions):
    """World positions (n, 3) as seen from the plate at those times."""
    return np.einsum("nij,nj->ni", plate_from_world(scene.law(times)[:, :2]), positions)
