"""The open-loop bounce by MuJoCo: soft contact, fixed steps."""

import sys

import mujoco

import arm

STEP_S = 1e-4
# Radius of the sphere at the tip: the contact is this far beyond the rod's end.
RADIUS_M = 1e-4

XML = f"""
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{STEP_S}" gravity="0 0 -{arm.GRAVITY_M_S2}" cone="elliptic" integrator="implicitfast"
          impratio="10" iterations="100" tolerance="1e-12"/>
  <worldbody>
    <body name="belt" pos="0 0 {-arm.HEIGHT_M - RADIUS_M - 1}">
      <joint name="belt" type="slide" axis="1 0 0"/>
      <geom name="belt" type="box" size="10 1 1" mass="1e6" friction="{arm.FRICTION} 0 0"
            solref="{2 * STEP_S} 1" solimp="0.99 0.999 1e-5"/>
    </body>
    <body name="link1">
      <joint name="theta1" type="hinge" axis="0 -1 0" damping="{arm.DAMPING_NMS_RAD}"/>
      <inertial pos="0 0 {-arm.LENGTH_M / 2}" mass="{arm.MASS_KG}"
                diaginertia="{{i}} {{i}} 1e-9"/>
      <body name="link2" pos="0 0 {-arm.LENGTH_M}">
        <joint name="elbow" type="hinge" axis="0 -1 0" damping="{arm.DAMPING_NMS_RAD}"
               stiffness="{arm.STIFFNESS_NM_RAD}" springref="{-arm.SPRING_REST_RAD}"/>
        <inertial pos="0 0 {-arm.LENGTH_M / 2}" mass="{arm.MASS_KG}"
                  diaginertia="{{i}} {{i}} 1e-9"/>
        <geom name="tip" type="sphere" size="{RADIUS_M}" pos="0 0 {-arm.LENGTH_M}" mass="0"
              friction="{arm.FRICTION} 0 0" solref="{2 * STEP_S} 1" solimp="0.99 0.999 1e-5"/>
      </body>
    </body>
  </worldbody>
  <contact><exclude body1="belt" body2="link1"/></contact>
</mujoco>
""".format(i=arm.MASS_KG * arm.LENGTH_M**2 / 12)


def main(simulated_s):
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    theta1, theta2 = arm.start()
    data.qpos[:] = [0, theta1, theta2 - theta1]
    data.qvel[0] = arm.V_BELT_M_S
    # Steps between two samples of the arm, 0.5 ms.
    look = 5
    tip = model.geom("tip").id
    report = arm.Report()
    was_touching = True
    for _ in range(round(simulated_s / STEP_S / look)):
        mujoco.mj_step(model, data, look)
        # The belt is endless.
        data.qpos[0] = 0
        data.qvel[0] = arm.V_BELT_M_S
        report.see(data.qvel[1], data.geom_xpos[tip][2] + arm.HEIGHT_M)
        is_touching = data.ncon > 0
        if is_touching and not was_touching:
            report.touch(data.time)
        was_touching = is_touching
    report.write(
        simulated_s,
        mujoco.__version__,
        f"steps of {STEP_S * 1e3:g} ms, elliptic cone, time constant of two steps",
    )


main(float(sys.argv[1]))
