"""An arm on a belt in MuJoCo, for a program that sends joint torques and receives the motion.

The arm is given as name=value in SI units; those of a joint or link end with 1 or 2. Standard input: two joint torques, N m, and
how long they last, s, as doubles. Standard output, at the start and after each: the links' angles and rates, the tip's place,
height and speed along the belt, the tangential and the normal force, and whether the tip was pressed in every step; doubles again.

Arm and normal contact are MuJoCo's. So is the friction of the joints without bristles; with these, the joints bend by so much, rad,
before they slip, as on our own plant. MuJoCo's own friction of the tip would separate surfaces that slide, so that mu f_n
of the same step is added along the belt, as benches/others/mujoco_arm.py explains.
"""

import math
import struct
import sys

import mujoco

# Longest step.
STEP_S = 1e-4
# Of the sphere that is the tip: the belt lies so much lower.
RADIUS_M = 1e-4
# Of the contact, as of our own. MuJoCo counts both per kilogram, by the inverse mass of the tip's body in its first posture.
STIFFNESS_N_M, DAMPING_NS_M = 1e5, 76.0
# Part of the acceleration that the contact takes off in the same step. With more, some steps have no solution, probably because p is
# negative where friction holds a joint: up to 0.3 % of them with 0.5. All steps with so little have one.
IMPEDANCE = 0.05
# Slip below which the friction is proportional to it.
STICK_M_S = 0.02
# How closely the forces lie on the cone of friction.
CLOSE_N = 1e-5
# Of a step, at most.
EVALUATIONS = 8

XML = """
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{step}" gravity="{gravity_t} 0 {gravity_n}" integrator="implicitfast" iterations="100" tolerance="1e-12"/>
  <worldbody>
    <geom name="belt" type="plane" size="0 0 1" pos="0 0 {below}" contype="0" conaffinity="0"/>
    <body name="link1">
      <joint name="joint1" type="hinge" axis="0 -1 0" damping="{damping1}" stiffness="{stiffness1}" springref="{rest1}"
             armature="{rotor1}" frictionloss="{friction1}" {stiff}/>
      <inertial pos="0 0 -{centre1}" mass="{mass1}" diaginertia="{inertia1} {inertia1} 1e-9"/>
      <body name="link2" pos="0 0 -{length1}">
        <joint name="joint2" type="hinge" axis="0 -1 0" damping="{damping2}" stiffness="{stiffness2}" springref="{rest2}"
               armature="{rotor2}" frictionloss="{friction2}" {stiff}/>
        <inertial pos="0 0 -{centre2}" mass="{mass2}" diaginertia="{inertia2} {inertia2} 1e-9"/>
        <geom name="tip" type="sphere" size="{radius}" pos="0 0 -{length2}" mass="0" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <contact><pair geom1="belt" geom2="tip" condim="1" solimp="{impedance} {impedance} 1e-3"/></contact>
</mujoco>
"""
# With MuJoCo's default the elbow creeps by 90 mrad/s under half of its friction; so by 0.9.
STIFF_FRICTION = 'solreffriction="0.002 1" solimpfriction="0.99 0.99 1e-3"'


class Rig:
    """The arm, at rest at its start."""

    def __init__(self, arm):
        self.friction_nm = [arm["friction1"], arm["friction2"]]
        if arm["bristles"] > 0.0:
            arm = dict(arm, friction1=0.0, friction2=0.0)
        else:
            self.friction_nm = [0.0, 0.0]
        # Deflection of each joint's bristles, as a part of that in steady slip.
        self.bent = [0.0, 0.0]
        text = XML.format(
            step=STEP_S,
            gravity_t=-arm["gravity"] * math.sin(arm["tilt"]),
            gravity_n=-arm["gravity"] * math.cos(arm["tilt"]),
            below=-arm["height"] - RADIUS_M,
            radius=RADIUS_M,
            impedance=IMPEDANCE,
            stiff=STIFF_FRICTION,
            **arm,
        )
        self.arm = arm
        self.model = mujoco.MjModel.from_xml_string(text)
        inverse_mass_per_kg = self.model.body_invweight0[self.model.body("link2").id][0]
        self.model.pair_solref[0] = -STIFFNESS_N_M * inverse_mass_per_kg, -DAMPING_NS_M * inverse_mass_per_kg
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = arm["theta1"], arm["theta2"] - arm["theta1"]
        # Of what is missing from the cone, by the tangential force.
        self.slope = 1.0
        self.force_n = 0.0, 0.0
        self.solve((0.0, 0.0))

    def advance(self, torque_nm, duration_s):
        """Moves the arm; returns whether the tip was pressed on the belt in every step."""
        steps = max(1, math.ceil(duration_s / STEP_S - 1e-6))
        self.model.opt.timestep = duration_s / steps
        pressed = True
        for _ in range(steps):
            self.solve([nm - most * bent for nm, most, bent in zip(torque_nm, self.friction_nm, self.bent)])
            mujoco.mj_implicit(self.model, self.data)
            if self.arm["bristles"] > 0.0:
                turned = [rate * self.model.opt.timestep / self.arm["bristles"] for rate in self.data.qvel.tolist()]
                self.bent = [bent + turn - abs(turn) * bent for bent, turn in zip(self.bent, turned)]
            pressed = pressed and self.force_n[1] > 0
        return pressed

    def solve(self, torque_nm):
        """Finds the accelerations and the pair of tangential and normal force that lies on the cone of friction.

        MuJoCo's normal force is affine in the tangential one, as long as no joint begins or ceases to turn: the second point is then
        the solution, because the slope hardly changes from step to step. Otherwise the secant finds it.
        """
        model, data = self.model, self.data
        mujoco.mj_step1(model, data)
        along1, along2, tip_m_s = self.along()
        slip_m_s = tip_m_s - self.arm["belt"]
        ratio = -self.arm["mu"] * max(-1.0, min(1.0, slip_m_s / STICK_M_S))

        def normal_n(added_n):
            data.qfrc_applied[:] = torque_nm[0] + (along1 + along2) * added_n, torque_nm[1] + along2 * added_n
            mujoco.mj_fwdAcceleration(model, data)
            mujoco.mj_fwdConstraint(model, data)
            # The contact's is the last constraint.
            return data.efc_force[-1] if data.ncon else 0.0

        mujoco.mj_fwdActuation(model, data)
        added_n, pressing_n = 0.0, normal_n(0.0)
        off_n = -ratio * pressing_n
        for _ in range(EVALUATIONS):
            if abs(off_n) <= CLOSE_N:
                break
            before_n, before_off_n = added_n, off_n
            added_n -= off_n / self.slope
            pressing_n = normal_n(added_n)
            off_n = added_n - ratio * pressing_n
            self.slope = (off_n - before_off_n) / (added_n - before_n)
        self.force_n = added_n, pressing_n

    def links(self):
        """Angles and rates of both links."""
        (joint1, joint2), (rate1, rate2) = self.data.qpos.tolist(), self.data.qvel.tolist()
        return joint1, joint1 + joint2, rate1, rate1 + rate2

    def along(self):
        """Speed of the tip along the belt per rate of each link, m, and with the present rates, m/s."""
        theta1, theta2, rate1, rate2 = self.links()
        along1, along2 = self.arm["length1"] * math.cos(theta1), self.arm["length2"] * math.cos(theta2)
        return along1, along2, along1 * rate1 + along2 * rate2

    def answer(self, pressed):
        """What standard output receives."""
        theta1, theta2, rate1, rate2 = self.links()
        along1, along2, tip_m_s = self.along()
        tip_t_m = self.arm["length1"] * math.sin(theta1) + self.arm["length2"] * math.sin(theta2)
        gap_m = self.arm["height"] - along1 - along2
        return struct.pack("<10d", theta1, theta2, rate1, rate2, tip_t_m, gap_m, tip_m_s, *self.force_n, pressed)


def main():
    rig = Rig({name: float(value) for name, value in (given.split("=") for given in sys.argv[1:])})
    pressed = True
    while True:
        sys.stdout.buffer.write(rig.answer(pressed))
        sys.stdout.buffer.flush()
        command = sys.stdin.buffer.read(24)
        if len(command) < 24:
            break
        *torque_nm, duration_s = struct.unpack("<3d", command)
        pressed = rig.advance(torque_nm, duration_s)


main()
