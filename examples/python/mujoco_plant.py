"""MuJoCo as the plant behind painleve's controller, which comes from its C library.

    cargo build --release --package painleve-c-abi      pip install mujoco      python mujoco_plant.py

The arm of the default scenario presses its tip on a moving belt and follows the reference. MuJoCo's contact is
soft and convex: it does not reproduce the Painlevé paradox, so the reference stays in a region without it.
"""

import ctypes
import math
import sys
from pathlib import Path

import mujoco
import numpy

SCENARIO = """
belt.friction = 0.3
controller.reference = [{ minimum-jerk = { target_m = 0.05, duration_s = 2.0 } }]
"""
TICK_HZ, STEPS_PER_TICK, DURATION_S = 1000, 10, 3.0
BELT_SPEED_M_S, FRICTION = -0.4, 0.3
LINK_M, HEIGHT_M, TIP_RADIUS_M = 0.21, 0.3775, 0.0005
# The scenario's converters: 14-bit encoders, 12-bit force cell of ±20 N and torque stages of ±5 N·m.
COUNTS_PER_RAD, COUNTS_PER_N, NM_PER_COUNT = 2**14 / (2 * math.pi), 2**11 / 20.0, 5.0 / 2**11
ENABLE, TRACKING = 1, 2

MODEL = f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{1 / (TICK_HZ * STEPS_PER_TICK)}" integrator="implicitfast" cone="elliptic" impratio="10"/>
  <default><geom contype="0" conaffinity="0" friction="{FRICTION} 0 0"/></default>
  <worldbody>
    <body name="belt">
      <joint name="belt" type="slide" axis="1 0 0"/>
      <inertial mass="1e6" pos="0 0 0" diaginertia="1e6 1e6 1e6"/>
      <geom name="belt" type="box" size="1000 1 0.05" pos="0 0 -0.05" contype="1" conaffinity="1"/>
    </body>
    <body pos="0 0 {HEIGHT_M}">
      <joint name="shoulder" axis="0 -1 0" damping="0.005"/>
      <inertial mass="0.12" pos="0 0 -0.105" diaginertia="4.41e-4 4.41e-4 1e-6"/>
      <body pos="0 0 -{LINK_M}">
        <joint name="elbow" axis="0 -1 0" damping="0.005" stiffness="1.3" springref="-0.23945917"/>
        <inertial mass="0.12" pos="0 0 -0.105" diaginertia="4.41e-4 4.41e-4 1e-6"/>
        <geom name="tip" type="sphere" size="{TIP_RADIUS_M}" pos="0 0 {TIP_RADIUS_M - LINK_M}" contype="1" conaffinity="1"/>
        <site name="tip" pos="0 0 {-LINK_M}"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator>
</mujoco>
"""


class Sensor(ctypes.Structure):
    _fields_ = [("tick", ctypes.c_uint32), ("sequence", ctypes.c_uint32), ("joints", ctypes.c_uint32 * 2),
                ("normal_force", ctypes.c_int32), ("tangential_force", ctypes.c_int32), ("inputs", ctypes.c_uint32)]


class Actuator(ctypes.Structure):
    _fields_ = [("tick", ctypes.c_uint32), ("sequence", ctypes.c_uint32), ("torques", ctypes.c_int32 * 2),
                ("reference_tip_um", ctypes.c_int32), ("estimated_tip_um", ctypes.c_int32),
                ("state", ctypes.c_uint8), ("fault", ctypes.c_uint8), ("flags", ctypes.c_uint16)]


def library():
    """The C library: the path given, or the release build of this repository."""
    root = Path(__file__).resolve().parents[2]
    path = sys.argv[1] if len(sys.argv) > 1 else root / "target/release/libpainleve_c.so"
    painleve = ctypes.CDLL(str(path))
    painleve.painleve_last_error.restype = ctypes.c_char_p
    return painleve


def tip_force_n(model, data):
    """Force of the belt on the tip along the belt and away from it, N."""
    total = [0.0, 0.0]
    for index in range(data.ncon):
        force = numpy.zeros(6)
        mujoco.mj_contactForce(model, data, index, force)
        frame = data.contact[index].frame.reshape(3, 3)
        world = frame.T @ force[:3]
        sign = 1.0 if model.geom(data.contact[index].geom2).name == "tip" else -1.0
        total[0] += sign * world[0]
        total[1] += sign * world[2]
    return total


def counts(value, scale):
    return max(-2048, min(2047, round(value * scale)))


def main():
    painleve, controller = library(), ctypes.c_void_p()
    if painleve.painleve_controller_new(SCENARIO.encode(), ctypes.byref(controller)):
        sys.exit(painleve.painleve_last_error().decode())
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    # The second link as in the scenario, the first so that the tip touches the belt.
    theta_2 = math.radians(-35.1)
    theta_1 = -math.acos((HEIGHT_M - LINK_M * math.cos(theta_2)) / LINK_M)
    data.qpos[:] = 0.0, theta_1, theta_2 - theta_1
    mujoco.mj_forward(model, data)
    answer, due = Actuator(), [0, 0]
    airborne = 0
    for tick in range(int(DURATION_S * TICK_HZ)):
        data.qvel[0] = BELT_SPEED_M_S
        tangential, normal = tip_force_n(model, data)
        airborne += normal <= 0.0 and tick > 100
        sensor = Sensor(tick=tick, sequence=tick, inputs=ENABLE,
                        normal_force=counts(normal, COUNTS_PER_N), tangential_force=counts(tangential, COUNTS_PER_N))
        sensor.joints[:] = [round(angle * COUNTS_PER_RAD) % 2**14 for angle in data.qpos[1:3]]
        if painleve.painleve_controller_tick(controller, ctypes.byref(sensor), ctypes.byref(answer)):
            sys.exit(painleve.painleve_last_error().decode())
        # One tick of delay, as the controller's model has it.
        data.ctrl[:] = [torque * NM_PER_COUNT for torque in due]
        due = list(answer.torques)
        for _ in range(STEPS_PER_TICK):
            mujoco.mj_step(model, data)
    painleve.painleve_controller_free(controller)
    tip_m = data.site("tip").xpos[0]
    print(f"tip at {tip_m:.4f} m, reference {1e-6 * answer.reference_tip_um:.4f} m, "
          f"state {answer.state}, fault {answer.fault}, ticks without contact {airborne}")
    sys.exit(0 if abs(tip_m - 0.05) < 2e-3 and answer.state == TRACKING else 1)


if __name__ == "__main__":
    main()
