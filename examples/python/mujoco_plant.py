"""MuJoCo as the plant behind painleve's controller, which comes from its C library.

    cargo build --release --package painleve-c-abi      pip install mujoco      python mujoco_plant.py

The arm of the default scenario presses its tip on a moving belt and follows a reference that ends beyond the place where
the contact equations lose their solution. The controller holds the tip before that place. Arm and normal contact are
MuJoCo's. The friction is not: MuJoCo's model of friction is convex, so that a sliding contact also pushes the tip off
the belt, by the friction times the slip. Coulomb's friction is therefore applied as a force, from the normal force of the
step before: this diverges in postures with p > 2 Q22, however small the step (benches/others/mujoco_arm.py).
"""

import ctypes
import math
import sys
from pathlib import Path

import mujoco
import numpy

SCENARIO = """
belt.friction = 0.6
controller.reference = [{ minimum-jerk = { target_m = 0.18, duration_s = 3.0 } }]
"""
TICK_HZ, STEPS_PER_TICK, DURATION_S = 1000, 10, 5.0
BELT_SPEED_M_S, FRICTION = -0.4, 0.6
EDGE_M = 0.1647
LINK_M, HEIGHT_M, TIP_RADIUS_M = 0.21, 0.3775, 0.0005
# The scenario's converters: 14-bit encoders, 12-bit force cell of ±20 N and torque stages of ±5 N·m.
COUNTS_PER_RAD, COUNTS_PER_N, NM_PER_COUNT = 2**14 / (2 * math.pi), 2**11 / 20.0, 5.0 / 2**11
ENABLE, TRACKING = 1, 2

MODEL = f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{1 / (TICK_HZ * STEPS_PER_TICK)}" integrator="implicitfast"/>
  <default><geom contype="0" conaffinity="0" condim="1" solref="0.005 1"/></default>
  <worldbody>
    <geom type="box" size="10 1 0.05" pos="0 0 -0.05" contype="1" conaffinity="1"/>
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


def normal_force_n(model, data):
    """Force of the belt on the tip, N."""
    force = numpy.zeros(6)
    for index in range(data.ncon):
        mujoco.mj_contactForce(model, data, index, force)
    return force[0]


def apply_friction(model, data, normal):
    """Applies the friction of the belt to the tip; returns it, N."""
    along_belt = numpy.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, along_belt, None, model.site("tip").id)
    slip = along_belt[0] @ data.qvel - BELT_SPEED_M_S
    tangential = -math.copysign(FRICTION * normal, slip)
    data.qfrc_applied[:] = along_belt[0] * tangential
    return tangential


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
    data.qpos[:] = theta_1, theta_2 - theta_1
    mujoco.mj_forward(model, data)
    answer, due = Actuator(), [0, 0]
    normal = normal_force_n(model, data)
    tangential = apply_friction(model, data, normal)
    airborne = 0
    for tick in range(int(DURATION_S * TICK_HZ)):
        airborne += normal <= 0.0 and tick > 100
        sensor = Sensor(tick=tick, sequence=tick, inputs=ENABLE,
                        normal_force=counts(normal, COUNTS_PER_N), tangential_force=counts(tangential, COUNTS_PER_N))
        sensor.joints[:] = [round(angle * COUNTS_PER_RAD) % 2**14 for angle in data.qpos]
        if painleve.painleve_controller_tick(controller, ctypes.byref(sensor), ctypes.byref(answer)):
            sys.exit(painleve.painleve_last_error().decode())
        # One tick of delay, as the controller's model has it.
        data.ctrl[:] = [torque * NM_PER_COUNT for torque in due]
        due = list(answer.torques)
        for _ in range(STEPS_PER_TICK):
            mujoco.mj_step(model, data)
            normal = normal_force_n(model, data)
            tangential = apply_friction(model, data, normal)
    painleve.painleve_controller_free(controller)
    tip_m = data.site("tip").xpos[0]
    print(f"tip at {tip_m:.4f} m, reference {1e-6 * answer.reference_tip_um:.4f} m, "
          f"state {answer.state}, fault {answer.fault}, ticks without contact {airborne}")
    is_held = abs(tip_m - 1e-6 * answer.reference_tip_um) < 1e-3 and 0.16 < tip_m < EDGE_M
    sys.exit(0 if is_held and answer.state == TRACKING and airborne == 0 else 1)


if __name__ == "__main__":
    main()
