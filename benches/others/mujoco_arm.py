"""The arm on its belt in MuJoCo, in steps of 0.1 ms, with one of two kinds of friction.

MuJoCo's own friction comes from a convex problem whose solution separates surfaces that slide: the contact then carries less than the
tip presses, or none. "Coulomb" takes MuJoCo's normal contact alone and adds mu f_n along the belt; normal contact as stiff and as
damped as our own compliant plant's, for 40 g. Taking f_n from the step before would not do: that iteration multiplies errors by
1 - p/Q22 and diverges in every posture with p > 2 Q22, however small the step.
"""

import math

import mujoco
import numpy

import arm

STEP_S = 1e-4
# Of the sphere that is the tip: the contact lies so far beyond the rod's end.
RADIUS_M = 1e-4
# 1e5 N/m and 76 N s/m over 40 g: MuJoCo counts both per kilogram.
STIFFNESS_PER_S2, DAMPING_PER_S = 1e5 / 0.04, 76 / 0.04
# Slip below which the added friction is proportional to it.
STICK_M_S = 0.02

XML = """
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{step}" gravity="0 0 -{gravity}" cone="elliptic" integrator="implicitfast" iterations="100" tolerance="1e-12"/>
  <worldbody>
    <body name="belt" pos="0 0 {below}">
      <joint name="belt" type="slide" axis="1 0 0"/>
      <geom name="belt" type="box" size="10 1 1" mass="1e6" contype="0" conaffinity="0"/>
    </body>
    <body name="link1">
      <joint name="joint1" type="hinge" axis="0 -1 0" damping="{damping}"/>
      <inertial pos="0 0 {middle}" mass="{mass}" diaginertia="{inertia} {inertia} 1e-9"/>
      <body name="link2" pos="0 0 {end}">
        <joint name="joint2" type="hinge" axis="0 -1 0" damping="{damping}" stiffness="{stiffness}" springref="{rest}"/>
        <inertial pos="0 0 {middle}" mass="{mass}" diaginertia="{inertia} {inertia} 1e-9"/>
        <geom name="tip" type="sphere" size="{radius}" pos="0 0 {end}" mass="0" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <contact>
    <pair geom1="belt" geom2="tip" {contact}/>
  </contact>
  <actuator><motor joint="joint1"/><motor joint="joint2"/></actuator>
</mujoco>
"""
# MuJoCo's default softness, 20 ms.
OWN = 'condim="3" friction="{mu} {mu} 0 0 0"'
COULOMB = f'condim="1" solref="{-STIFFNESS_PER_S2} {-DAMPING_PER_S}" solimp="0.99 0.99 1e-3"'


def version():
    return mujoco.__version__


class Plant:
    """Angles, force and tip in the bench's axes."""

    def __init__(self, run, has_own_friction):
        self.friction = 0.0 if has_own_friction else run["friction"]
        contact = OWN.format(mu=run["friction"]) if has_own_friction else COULOMB
        self.model = mujoco.MjModel.from_xml_string(
            XML.format(
                step=STEP_S,
                gravity=arm.GRAVITY_M_S2,
                below=-arm.HEIGHT_M - RADIUS_M - 1,
                damping=arm.DAMPING_NMS_RAD,
                middle=-arm.LENGTH_M / 2,
                end=-arm.LENGTH_M,
                mass=arm.MASS_KG,
                inertia=arm.INERTIA_KG_M2,
                stiffness=arm.STIFFNESS_NM_RAD,
                rest=arm.SPRING_REST_RAD,
                radius=RADIUS_M,
                contact=contact,
            )
        )
        self.data = mujoco.MjData(self.model)
        theta1, theta2 = arm.on_belt(run["start_m"], run["elbow_down"])
        self.data.qpos[:] = [0, theta1, theta2 - theta1]
        self.speed_m_s = run["speed_m_s"]
        self.data.qvel[0] = self.speed_m_s
        self.tip = self.model.geom("tip").id
        self.wrench = numpy.zeros(6)
        self.added_n = 0.0
        self.has_touched = True
        mujoco.mj_forward(self.model, self.data)

    def advance(self, torque_nm, duration_s):
        steps = round(duration_s / STEP_S)
        self.data.ctrl[:] = torque_nm
        if self.friction == 0.0:
            mujoco.mj_step(self.model, self.data, steps)
            self.has_touched = self.data.ncon > 0
        else:
            self.has_touched = False
            for _ in range(steps):
                self.add_friction()
                mujoco.mj_step(self.model, self.data)
                self.has_touched = self.has_touched or self.data.ncon > 0
        # The belt goes on for ever.
        self.data.qpos[0] = 0
        self.data.qvel[0] = self.speed_m_s

    def add_friction(self):
        """Adds Coulomb friction as joint torques, together with the normal force of the same step.

        In contact MuJoCo's normal force is affine in the friction: two evaluations give the pair on the cone. Where there is none
        (p <= 0), the friction is that of the normal force without it.
        """
        _, joint1, joint2 = self.data.qpos
        along2 = arm.LENGTH_M * math.cos(joint1 + joint2)
        along1 = arm.LENGTH_M * math.cos(joint1) + along2
        slip_m_s = along1 * self.data.qvel[1] + along2 * self.data.qvel[2] - self.speed_m_s
        ratio = -self.friction * max(-1.0, min(1.0, slip_m_s / STICK_M_S))

        def normal_n(added_n):
            self.added_n = added_n
            self.data.qfrc_applied[1], self.data.qfrc_applied[2] = along1 * added_n, along2 * added_n
            mujoco.mj_forward(self.model, self.data)
            return self.contact_n()[1]

        without_n = normal_n(0.0)
        # So little that the tip stays in contact.
        tried_n = 0.1 * ratio * without_n
        if tried_n == 0.0:
            return
        slope = (normal_n(tried_n) - without_n) / tried_n
        p_ratio = 1.0 - slope * ratio
        normal_n(ratio * without_n / (p_ratio if p_ratio > 0 else 1.0))

    def contact_n(self):
        """MuJoCo's tangential and normal force on the tip."""
        tangential, normal = 0.0, 0.0
        for index in range(self.data.ncon):
            mujoco.mj_contactForce(self.model, self.data, index, self.wrench)
            world = self.data.contact[index].frame.reshape(3, 3).T @ self.wrench[:3]
            # The force of the first geometry on the second one.
            sign = 1 if self.data.contact[index].geom2 == self.tip else -1
            tangential, normal = tangential + sign * world[0], normal + sign * world[2]
        return tangential, normal

    def joints_rad(self):
        return self.data.qpos[1], self.data.qpos[2]

    def force_n(self):
        """Tangential and normal force on the tip."""
        tangential, normal = self.contact_n()
        return tangential + (self.added_n if normal > 0 else 0.0), normal

    def tip_t_m(self):
        return self.data.geom_xpos[self.tip][0]

    def touches(self):
        return self.has_touched


def bench(name, _library, run, _scenario, make):
    return make(Plant(run, "Coulomb" not in name), run["seed"])
