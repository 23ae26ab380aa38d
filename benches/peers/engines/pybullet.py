"""PyBullet: a ball on a box without mass that is put from pose to pose.

Before each step the box is put where it is at the step's start, with the
velocities that take it to the step's end. The loop is Python; its three calls
per step are part of the time.
"""

import importlib.metadata
import math

import numpy as np
import pybullet

import equations
import measure
from scenes import plate_from_world, start_in_world, steps, to_plate

HALF_THICKNESS = 0.5
TUNINGS = {
    "as shipped": {},
    "no slop": {"contactSlop": 0.0, "numSolverIterations": 200},
}
CONTACT = {
    # Bullet multiplies the coefficients of the two bodies.
    "lateralFriction": math.sqrt(equations.FRICTION),
    "rollingFriction": 0.0, "spinningFriction": 0.0, "restitution": 0.0,
    "linearDamping": 0.0, "angularDamping": 0.0,
    "activationState": pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
}


def plate_path(scene, step):
    """Per step: centre and quaternion at its start, velocity and spin through it."""
    times = step * np.arange(round(scene.duration / step) + 1)
    angles = scene.law(times)[:, :2]
    turns = plate_from_world(angles)
    top = equations.REST_HEIGHT - equations.RADIUS
    centres = (top - HALF_THICKNESS) * turns[:, 2, :]
    (sx, sy), (cx, cy) = np.sin(angles / 2).T, np.cos(angles / 2).T
    quaternions = np.column_stack([sx * cy, cx * sy, sx * sy, cx * cy])
    change = np.einsum("nji,njk->nik", turns[1:], turns[:-1])
    spins = np.column_stack([
        change[:, 2, 1] - change[:, 1, 2],
        change[:, 0, 2] - change[:, 2, 0],
        change[:, 1, 0] - change[:, 0, 1],
    ]) / (2 * step)
    velocities = np.diff(centres, axis=0) / step
    return list(zip(centres[:-1].tolist(), quaternions[:-1].tolist(),
                    velocities.tolist(), spins.tolist(), strict=True))


class Run:
    """A world with a plate and a ball; a new one for every repeat, outside the timing."""

    def __init__(self, scene, tuning, step, lead):
        self.scene, self.step, self.tuning, self.lead = scene, step, tuning, lead
        self.path = plate_path(scene, step)

    def build(self):
        """Fill an empty world; returns the plate and the ball."""
        pybullet.resetSimulation()
        pybullet.setGravity(0, 0, -equations.GRAVITY)
        pybullet.setPhysicsEngineParameter(fixedTimeStep=self.step, **TUNINGS[self.tuning])
        box = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[5, 5, HALF_THICKNESS])
        sphere = pybullet.createCollisionShape(
            pybullet.GEOM_SPHERE, radius=equations.RADIUS)
        position, velocity, spin = start_in_world(self.scene, self.lead)
        centre, quaternion, _, _ = self.path[0]
        plate = pybullet.createMultiBody(0, box, -1, centre, quaternion)
        ball = pybullet.createMultiBody(equations.MASS, sphere, -1, position)
        for body in (plate, ball):
            pybullet.changeDynamics(body, -1, **CONTACT)
        pybullet.changeDynamics(ball, -1, localInertiaDiagonal=[equations.INERTIA] * 3)
        pybullet.resetBaseVelocity(ball, velocity, spin)
        return plate, ball

    def advance(self, plate, path):
        """The loop itself."""
        for centre, quaternion, velocity, spin in path:
            pybullet.resetBasePositionAndOrientation(plate, centre, quaternion)
            pybullet.resetBaseVelocity(plate, velocity, spin)
            pybullet.stepSimulation()

    def __call__(self, plate, _):
        """What is timed."""
        self.advance(plate, self.path)

    def trace(self):
        """Positions at the samples, in the plate's frame."""
        plate, ball = self.build()
        every = round(self.scene.sample_step / self.step)
        positions = [pybullet.getBasePositionAndOrientation(ball)[0]]
        for begin in range(0, len(self.path), every):
            self.advance(plate, self.path[begin:begin + every])
            positions.append(pybullet.getBasePositionAndOrientation(ball)[0])
        return to_plate(self.scene, self.scene.samples, np.array(positions))


def scan(bench, scene, quick):
    """All tunings and steps of one scene."""
    for step in steps(scene, quick):
        for tuning in TUNINGS:
            for ending, lead in (("", 0.0), (", staggered start", 0.5 * step)):
                run = Run(scene, tuning, step, lead)
                bench.add(scene, ("rigid contact", tuning + ending, "step_s", step),
                          run.trace, run, run.build)


if __name__ == "__main__":
    pybullet.connect(pybullet.DIRECT)
    measure.main("pybullet", {"pybullet": importlib.metadata.version("pybullet")}, scan)
