#!/usr/bin/env python3
"""Writes mujoco_arms.csv: mass matrix, bias torque and Jacobian of random two-link arms from MuJoCo.

Made with Python 3.11.7, mujoco 4.0.0, numpy 2.4.6:

    pip install mujoco==4.0.0 numpy==2.4.6 && python3 mujoco_arms.py

An engine that is not ours checks the mechanics. Inputs have few digits, so that the file holds
exactly what MuJoCo was given; outputs have 13. Everything MuJoCo says is in its own joint
coordinates: q1 from the belt's inward normal, q2 from link 1. Pairs are of link or joint 1 and 2.

length centre: m; mass tip: kg; inertia (about the centre of mass) rotor: kg m2; damping: N m s/rad;
stiffness: N m/rad; rest tilt q: rad; gravity: m/s2; qd: rad/s
m11 m12 m22: mass matrix, kg m2; h1 h2: the joint torques that hold q'' = 0, N m;
jt1 jt2 jn1 jn2: tip velocity along and away from the belt per joint rate, m
"""

import pathlib

import mujoco
import numpy as np

ROWS = 1000
SEED = 20_260_728
PAIRS = ["length", "mass", "centre", "inertia", "damping", "stiffness", "rest", "rotor"]

MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 -{gravity!r}"><flag contact="disable"/></option>
  <worldbody>
    <body name="belt" euler="0 -{tilt!r} 0">
      <body name="link1">
        <joint name="joint1" type="hinge" axis="0 -1 0" damping="{damping1!r}"
               stiffness="{stiffness1!r}" springref="{rest1!r}" armature="{rotor1!r}"/>
        <inertial pos="0 0 {down1!r}" mass="{mass1!r}" diaginertia="{inertia1!r} {inertia1!r} {inertia1!r}"/>
        <body name="link2" pos="0 0 -{length1!r}">
          <joint name="joint2" type="hinge" axis="0 -1 0" damping="{damping2!r}"
                 stiffness="{stiffness2!r}" springref="{rest2!r}" armature="{rotor2!r}"/>
          <inertial pos="0 0 {down2!r}" mass="{mass2!r}" diaginertia="{inertia2!r} {inertia2!r} {inertia2!r}"/>
          <body name="tip" pos="0 0 -{length2!r}">
            <inertial pos="0 0 0" mass="{tip!r}" diaginertia="0 0 0"/>
            <site name="tip"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def draw(random):
    """One arm, with few digits."""
    uniform = lambda low, high: float(f"{random.uniform(low, high):.4g}")
    arm = {}
    for link in "12":
        length = arm["length" + link] = uniform(0.1, 0.5)
        mass = arm["mass" + link] = uniform(0.05, 2.0)
        arm["centre" + link] = uniform(-0.2 * length, 1.2 * length)
        arm["inertia" + link] = uniform(0.01, 0.3) * mass * length**2
        arm["inertia" + link] = float(f"{arm['inertia' + link]:.4g}")
        arm["damping" + link] = uniform(0.0, 0.1)
        arm["stiffness" + link] = uniform(0.0, 5.0)
        arm["rest" + link] = uniform(-1.5, 1.5)
        arm["rotor" + link] = uniform(0.0, 0.01)
    arm["tip"] = uniform(0.0, 0.5)
    arm["tilt"] = uniform(-3.1, 3.1)
    arm["gravity"] = uniform(0.0, 15.0)
    for joint in "12":
        arm["q" + joint] = uniform(-3.1, 3.1)
        arm["qd" + joint] = uniform(-8.0, 8.0)
    return arm


def answer(arm):
    """MuJoCo's values for the arm."""
    text = MODEL.format(down1=-arm["centre1"], down2=-arm["centre2"], **arm)
    text = text.replace('"0 0 --', '"0 0 ').replace(" --", " ")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = arm["q1"], arm["q2"]
    data.qvel[:] = arm["qd1"], arm["qd2"]
    mujoco.mj_forward(model, data)
    mass = np.zeros((2, 2))
    mujoco.mj_fullM(model, data, mass)
    bias = data.qfrc_bias - data.qfrc_passive
    jacobian = np.zeros((3, 2))
    mujoco.mj_jacSite(model, data, jacobian, None, model.site("tip").id)
    # The belt's axes in the world, from MuJoCo itself.
    axes = data.body("belt").xmat.reshape(3, 3)
    along, away = axes[:, 0] @ jacobian, axes[:, 2] @ jacobian
    return [mass[0, 0], mass[0, 1], mass[1, 1], *bias, *along, *away]


def main():
    random = np.random.default_rng(SEED)
    outputs = ["m11", "m12", "m22", "h1", "h2", "jt1", "jt2", "jn1", "jn2"]
    inputs = [name + link for name in PAIRS for link in "12"]
    inputs += ["tip", "tilt", "gravity", "q1", "q2", "qd1", "qd2"]
    lines = [",".join(inputs + outputs)]
    for _ in range(ROWS):
        arm = draw(random)
        values = [f"{arm[name]:.10g}" for name in inputs]
        lines.append(",".join(values + [f"{value:.13g}" for value in answer(arm)]))
    path = pathlib.Path(__file__).with_suffix(".csv")
    path.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
