"""MuJoCo: a free ball on a box with two hinges, stepped in C by `mujoco.rollout`.

The plate's inertia is enormous and each hinge has a motor that gives it the
law's acceleration, constant over a step, so that its angles and its velocities
are right and the ball's reaction does not matter.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import rollout

import equations
import measure
import plate_motion
from scenes import start_in_world, steps, to_plate

FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
BALL = slice(3, 6)  # of a full state: time, two angles, then the ball's position

MODEL = """
<mujoco>
  <option timestep="{step}" integrator="{integrator}" {option} jacobian="dense"
          gravity="0 0 -{equations.GRAVITY}"/>
  <default><geom friction="{equations.FRICTION} 0 0" condim="3" {contact}/></default>
  <worldbody>
    <body name="plate">
      <inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/>
      <joint name="x" axis="1 0 0" armature="1e9"/>
      <joint name="y" axis="0 1 0" armature="1e9"/>
      <geom type="box" size="20 20 {top}"/>
    </body>
    <body name="ball">
      <freejoint/>
      <inertial pos="0 0 0" mass="{equations.MASS}" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom type="sphere" size="{equations.RADIUS}"/>
    </body>
  </worldbody>
  <actuator><motor joint="x" gear="1e9"/><motor joint="y" gear="1e9"/></actuator>
</mujoco>
"""


@dataclass(frozen=True)
class Tuning:
    """A contact: its time constant (None: two steps), and how the solver is set."""

    name: str
    time_constant: float | None = None
    impedance: float = 0.99
    shipped: bool = False

    def contact(self, step):
        """Attributes of the geoms."""
        if self.shipped:
            return ""
        constant = self.time_constant or 2 * step
        return f'solref="{constant} 1" solimp="{self.impedance} {self.impedance} 0.001"'

    @property
    def option(self):
        """Attributes of the options. A lone contact is solved cheapest by PGS.

        The tolerance is relative to the heaviest body, and the plate's inertia is
        not part of the problem: at the 1e-8 that is shipped the ball is ignored.
        """
        if self.shipped:
            return 'tolerance="1e-15"'
        return 'cone="elliptic" impratio="1000" solver="PGS" tolerance="1e-10"'


TUNINGS = [
    Tuning("as shipped", shipped=True),
    Tuning("contact 2 steps"),
    Tuning("contact 5 ms", 0.005),
    Tuning("contact 10 ms", 0.01),
    Tuning("contact 2 steps, hard", impedance=0.999),
]
QUICK_TUNINGS = TUNINGS[:3]


def build(integrator, tuning, step):
    """The model, compiled."""
    return mujoco.MjModel.from_xml_string(MODEL.format(
        step=step, integrator=integrator, option=tuning.option, contact=tuning.contact(step),
        top=equations.REST_HEIGHT - equations.RADIUS, inertia=equations.INERTIA,
        equations=equations,
    ))


def begin(model, scene, lead):
    """Data and full state at the start; `lead` as in `start_in_world`."""
    data = mujoco.MjData(model)
    law = scene.law(0.0)[0]
    position, velocity, spin = start_in_world(scene, lead)
    data.qpos[:] = [*law[:2], *position, 1, 0, 0, 0]
    data.qvel[:] = [*law[2:4], *velocity, *spin]
    state = np.empty(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, data, state, FULL)
    return data, state


class Run:
    """Everything that one rollout takes, made beforehand."""

    def __init__(self, scene, integrator, tuning, step, lead):
        self.scene, self.step = scene, step
        self.model = build(integrator, tuning, step)
        self.data, self.start = begin(self.model, scene, lead)
        motion = plate_motion.second_order if integrator == "RK4" else plate_motion.semi_implicit
        self.control = motion(scene, step, round(scene.duration / step))
        self.states = np.empty((1, len(self.control), len(self.start)))

    def __call__(self):
        """Roll out in this thread."""
        rollout.rollout(self.model, self.data, self.start[None], self.control[None],
                        state=self.states)

    def trace(self):
        """Positions at the samples, in the plate's frame."""
        self()
        states = np.vstack([self.start, self.states[0]])
        every = round(self.scene.sample_step / self.step)
        return to_plate(self.scene, self.scene.samples, states[::every, BALL])


def measure_one(bench, scene, integrator, tuning, step, staggered):
    """One integrator with one tuning and one step."""
    run = Run(scene, integrator, tuning, step, 0.5 * step if staggered else 0.0)
    method = f"{integrator.lower()}, {tuning.name}" + (", staggered start" if staggered else "")
    bench.add(scene, ("soft contact", method, "step_s", step), run.trace, run)


def scan(bench, scene, quick):
    """All integrators, tunings and steps of one scene."""
    for step in steps(scene, quick):
        for tuning in QUICK_TUNINGS if quick else TUNINGS:
            for integrator in ("Euler", "implicitfast", "discrete", "RK4"):
                measure_one(bench, scene, integrator, tuning, step, staggered=False)
            for integrator in () if tuning.shipped else ("Euler", "discrete"):
                measure_one(bench, scene, integrator, tuning, step, staggered=True)


if __name__ == "__main__":
    measure.main("mujoco", {"mujoco": mujoco.__version__}, scan)
