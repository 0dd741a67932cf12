"""The arm on its belt in Drake: continuous multibody dynamics with error control, point contact, regularised friction.

Drake's discrete solvers do not serve here. The default one ("lagged") takes the limit of friction from the normal force of the step before,
an iteration that multiplies errors by 1 - p/Q22 and diverges in every posture with p > 2 Q22, however small the step.
"""

import importlib.metadata

import numpy
from pydrake.geometry import AddContactMaterial, Box, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PrismaticJoint,
    RevoluteJoint,
    RevoluteSpring,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

import arm

RADIUS_M = 1e-3
STIFFNESS_N_M = 1e5
# Hunt-Crossley dissipation that takes as much as 76 N s/m at 10 N.
DISSIPATION_S_M = 7.6


def version():
    return importlib.metadata.version("drake")


def rod():
    """A uniform rod from its joint downwards."""
    inertia = arm.LENGTH_M**2 / 12
    about_middle = UnitInertia(inertia, inertia, 1e-8)
    middle = numpy.array([0, 0, -arm.LENGTH_M / 2])
    return SpatialInertia(arm.MASS_KG, middle, about_middle.ShiftFromCenterOfMass(-middle))


class Plant:
    """Angles, force and tip in the bench's axes."""

    def __init__(self, run):
        builder = DiagramBuilder()
        # No step: continuous, with an integrator that controls its error.
        config = MultibodyPlantConfig(time_step=0.0)
        self.plant, scene = AddMultibodyPlant(config, builder)
        plant = self.plant
        world = plant.world_frame()
        friction = CoulombFriction(run["friction"], run["friction"])

        def properties():
            made = ProximityProperties()
            AddContactMaterial(
                dissipation=DISSIPATION_S_M, point_stiffness=2 * STIFFNESS_N_M, friction=friction, properties=made
            )
            return made

        # Two equal stiffnesses in series are half of each.
        self.belt = plant.AddRigidBody("belt", SpatialInertia(1e6, [0, 0, 0], UnitInertia.SolidBox(20, 2, 2)))
        belt_joint = plant.AddJoint(PrismaticJoint("belt", world, self.belt.body_frame(), [1, 0, 0]))
        box = RigidTransform([0, 0, -arm.HEIGHT_M - RADIUS_M - 1])
        plant.RegisterCollisionGeometry(self.belt, box, Box(200, 2, 2), "belt", properties())
        link1 = plant.AddRigidBody("link1", rod())
        link2 = plant.AddRigidBody("link2", rod())
        joint1 = plant.AddJoint(
            RevoluteJoint("joint1", world, link1.body_frame(), [0, -1, 0], arm.DAMPING_NMS_RAD)
        )
        elbow = plant.AddFrame(FixedOffsetFrame("elbow", link1.body_frame(), RigidTransform([0, 0, -arm.LENGTH_M])))
        joint2 = plant.AddJoint(
            RevoluteJoint("joint2", elbow, link2.body_frame(), [0, -1, 0], arm.DAMPING_NMS_RAD)
        )
        plant.AddForceElement(RevoluteSpring(joint2, arm.SPRING_REST_RAD, arm.STIFFNESS_NM_RAD))
        tip = RigidTransform([0, 0, -arm.LENGTH_M])
        plant.RegisterCollisionGeometry(link2, tip, Sphere(RADIUS_M), "tip", properties())
        plant.AddJointActuator("motor1", joint1)
        plant.AddJointActuator("motor2", joint2)
        plant.mutable_gravity_field().set_gravity_vector([0, 0, -arm.GRAVITY_M_S2])
        plant.Finalize()
        diagram = builder.Build()
        self.simulator = Simulator(diagram)
        self.context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        self.joints = (joint1, joint2)
        self.belt_joint, self.speed_m_s, self.link2 = belt_joint, run["speed_m_s"], link2
        theta1, theta2 = arm.on_belt(run["start_m"], run["elbow_down"])
        joint1.set_angle(self.context, theta1)
        joint2.set_angle(self.context, theta2 - theta1)
        belt_joint.set_translation_rate(self.context, self.speed_m_s)
        self.contacts = plant.get_contact_results_output_port()
        self.actuation = plant.get_actuation_input_port()
        self.actuation.FixValue(self.context, [0.0, 0.0])
        self.simulator.Initialize()
        self.force = (0.0, 0.0)
        self.is_touching = True

    def advance(self, torque_nm, duration_s):
        self.actuation.FixValue(self.context, numpy.array(torque_nm))
        self.simulator.AdvanceTo(self.simulator.get_context().get_time() + duration_s)
        # The belt goes on for ever.
        self.belt_joint.set_translation(self.context, 0)
        self.belt_joint.set_translation_rate(self.context, self.speed_m_s)
        results = self.contacts.Eval(self.context)
        total = numpy.zeros(3)
        for index in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(index)
            # The force on body B.
            sign = 1 if info.bodyB_index() == self.link2.index() else -1
            total += sign * info.contact_force()
        self.force = (total[0], total[2])
        self.is_touching = total[2] > 0

    def joints_rad(self):
        return tuple(joint.get_angle(self.context) for joint in self.joints)

    def force_n(self):
        return self.force

    def tip_t_m(self):
        one, two = self.joints_rad()
        return arm.LENGTH_M * (numpy.sin(one) + numpy.sin(one + two))

    def touches(self):
        return self.is_touching


def bench(_name, _library, run, _scenario, make):
    return make(Plant(run), run["seed"])
