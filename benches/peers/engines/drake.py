"""Drake: a free ball on a box with two hinges, its discrete MultibodyPlant with point contact.

The plate's rotors have an enormous inertia and get the law's acceleration, held
over a step, so that its angles are right and the ball's reaction does not matter.
"""

from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
from pydrake.geometry import AddContactMaterial, Box, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
)
from pydrake.multibody.tree import RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Gain, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

import equations
import measure
import plate_motion
from scenes import start_in_world, steps, to_plate

MOST_STEPS = 20_000
ROTOR = 1e9  # kg·m²
HALF_THICKNESS = 1.0
RIGID = 1e12  # N/m of the ball, so that the plate's stiffness is that of the pair


@dataclass(frozen=True)
class Tuning:
    """How contact is approximated; `near_rigid` None leaves what is shipped."""

    name: str
    approximation: DiscreteContactApproximation
    near_rigid: float | None = None

    def apply(self, plant):
        """Set it."""
        plant.set_discrete_contact_approximation(self.approximation)
        if self.near_rigid is not None:
            plant.set_sap_near_rigid_threshold(self.near_rigid)


TUNINGS = [
    Tuning("sap", DiscreteContactApproximation.kSap),
    Tuning("sap, near-rigid off", DiscreteContactApproximation.kSap, 0.0),
    Tuning("tamsi", DiscreteContactApproximation.kTamsi),
    Tuning("similar", DiscreteContactApproximation.kSimilar),
]


def material(scene, stiffness):
    """The dissipation gives the scene's damping at the resting ball's weight."""
    dissipation = scene.contact[1] / (equations.MASS * equations.GRAVITY)
    properties = ProximityProperties()
    friction = CoulombFriction(equations.FRICTION, equations.FRICTION)
    AddContactMaterial(dissipation=dissipation, point_stiffness=stiffness,
                       friction=friction, properties=properties)
    return properties


def add_plate(plant, scene):
    """Two hinges and a box; returns the joints."""
    small = SpatialInertia(1.0, [0, 0, 0], UnitInertia(1e-3, 1e-3, 1e-3))
    middle, plate = (plant.AddRigidBody(name, small) for name in ("middle", "plate"))
    frames = [plant.world_frame(), middle.body_frame(), plate.body_frame()]
    joints = [
        plant.AddJoint(RevoluteJoint("x", frames[0], frames[1], [1, 0, 0])),
        plant.AddJoint(RevoluteJoint("y", frames[1], frames[2], [0, 1, 0])),
    ]
    for joint in joints:
        actuator = plant.AddJointActuator(joint.name(), joint)
        actuator.set_default_rotor_inertia(ROTOR)
        actuator.set_default_gear_ratio(1.0)
    centre = equations.REST_HEIGHT - equations.RADIUS - HALF_THICKNESS
    plant.RegisterCollisionGeometry(
        plate, RigidTransform([0, 0, centre]), Box(40, 40, 2 * HALF_THICKNESS), "plate",
        material(scene, scene.contact[0]))
    return joints


def add_ball(plant, scene):
    """A free sphere."""
    inertia = UnitInertia.SolidSphere(equations.RADIUS)
    ball = plant.AddRigidBody("ball", SpatialInertia(equations.MASS, [0, 0, 0], inertia))
    plant.RegisterCollisionGeometry(
        ball, RigidTransform(), Sphere(equations.RADIUS), "ball", material(scene, RIGID))
    return ball


def add_motion(builder, plant, scene, step):
    """The law's accelerations as torques, held over each step."""
    count = round(scene.duration / step)
    held = plate_motion.semi_implicit(scene, step, count)
    breaks = step * (np.arange(count + 1) - 1e-6)  # so that rounding never picks the one before
    path = PiecewisePolynomial.ZeroOrderHold(breaks, np.vstack([held, held[-1:]]).T)
    source, rotor = builder.AddSystem(TrajectorySource(path)), builder.AddSystem(Gain(ROTOR, 2))
    builder.Connect(source.get_output_port(), rotor.get_input_port())
    builder.Connect(rotor.get_output_port(), plant.get_actuation_input_port())


class Run:
    """A diagram for one setting."""

    def __init__(self, scene, tuning, step, lead):
        self.scene, self.lead = scene, lead
        builder = DiagramBuilder()
        self.plant, _ = AddMultibodyPlantSceneGraph(builder, step)
        tuning.apply(self.plant)
        self.plant.set_contact_model(ContactModel.kPoint)
        self.plant.mutable_gravity_field().set_gravity_vector([0, 0, -equations.GRAVITY])
        self.joints = add_plate(self.plant, scene)
        self.ball = add_ball(self.plant, scene)
        self.plant.set_stiction_tolerance(equations.SLIP_LIMIT)
        self.plant.Finalize()
        add_motion(builder, self.plant, scene, step)
        self.diagram = builder.Build()

    def begin(self):
        """A simulator at the start, and the plant's part of its context."""
        context = self.diagram.CreateDefaultContext()
        own = self.plant.GetMyMutableContextFromRoot(context)
        law = self.scene.law(0.0)[0]
        for joint, angle, rate in zip(self.joints, law[:2], law[2:4], strict=True):
            joint.set_angle(own, angle)
            joint.set_angular_rate(own, rate)
        position, velocity, spin = start_in_world(self.scene, self.lead)
        self.plant.SetFloatingBaseBodyPoseInWorldFrame(own, self.ball, RigidTransform(position))
        self.plant.SetFreeBodySpatialVelocity(own, self.ball, SpatialVelocity(spin, velocity))
        simulator = Simulator(self.diagram, context)
        simulator.Initialize()
        return simulator, own

    def advance(self, simulator, _):
        """All of the scene in one call."""
        simulator.AdvanceTo(self.scene.duration)

    def trace(self):
        """Positions at the samples, in the plate's frame."""
        simulator, own = self.begin()
        positions = []
        for time in self.scene.samples:
            simulator.AdvanceTo(time)
            positions.append(self.plant.EvalBodyPoseInWorld(own, self.ball).translation())
        return to_plate(self.scene, self.scene.samples, np.array(positions))


def scan(bench, scene, quick):
    """All approximations and steps of one scene."""
    for step in steps(scene, quick, MOST_STEPS):
        for tuning in TUNINGS:
            for ending, lead in (("", 0.0), (", staggered start", 0.5 * step)):
                run = Run(scene, tuning, step, lead)
                bench.add(scene, ("point contact", tuning.name + ending, "step_s", step),
                          run.trace, run.advance, run.begin)


if __name__ == "__main__":
    measure.main("drake", {"drake": version("drake")}, scan)
