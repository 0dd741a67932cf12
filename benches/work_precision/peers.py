"""Error against cost of SciPy and MuJoCo for a second of sliding under torques that change from tick to tick.

    python peers.py REFERENCE.csv

Called by `cargo bench -p painleve-study --bench work_precision`, which writes the reference: time, both link
angles, and both joint torques from then on. Prints lines "program,setting,cpu_s_per_s,error_rad".
"""

import csv
import math
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "others"))

import mujoco
import mujoco_arm
import scipy
from scipy.integrate import solve_ivp

import arm

M, L, G = arm.MASS_KG, arm.LENGTH_M, arm.GRAVITY_M_S2
K, SIGMA, REST = arm.STIFFNESS_NM_RAD, arm.DAMPING_NMS_RAD, arm.SPRING_REST_RAD
FRICTION, BELT_M_S = 0.6, -0.4


def sliding(torque_nm):
    """The right-hand side of an arm that slides with positive slip, without contact events; plain floats, which are faster than arrays."""
    u1, u2 = torque_nm[0] - torque_nm[1], torque_nm[1]
    a, d = 4 / 3 * M * L * L, M * L * L / 3

    def slope(_, x):
        t1, t2, w1, w2 = x
        s1, c1, s2, c2 = math.sin(t1), math.cos(t1), math.sin(t2), math.cos(t2)
        coupling = 0.5 * M * L * L * (c1 * c2 + s1 * s2)
        sine = 0.5 * M * L * L * (s2 * c1 - c2 * s1)
        spring = K * (t2 - t1 - REST)
        load1 = u1 - (1.5 * M * G * L * s1 - spring + SIGMA * (2 * w1 - w2) - sine * w2 * w2)
        load2 = u2 - (0.5 * M * G * L * s2 + spring + SIGMA * (w2 - w1) + sine * w1 * w1)
        scale = 1 / (a * d - coupling * coupling)
        free1, free2 = scale * (d * load1 - coupling * load2), scale * (a * load2 - coupling * load1)
        push1, push2 = L * (s1 - FRICTION * c1), L * (s2 - FRICTION * c2)
        response1, response2 = scale * (d * push1 - coupling * push2), scale * (a * push2 - coupling * push1)
        b = L * (s1 * free1 + s2 * free2 + c1 * w1 * w1 + c2 * w2 * w2)
        force = -b / (L * (s1 * response1 + s2 * response2))
        return [w1, w2, free1 + response1 * force, free2 + response2 * force]

    return slope


def with_scipy(reference, method, tolerance):
    state, error = [*reference[0]["angles"], 0.0, 0.0], 0.0
    start_s = time.process_time()
    for now, then in zip(reference, reference[1:]):
        solution = solve_ivp(
            sliding(now["torque"]), (0.0, now["duration_s"]), state, method=method, rtol=tolerance, atol=0.1 * tolerance
        )
        state = solution.y[:, -1]
        error = max(error, *(abs(x - y) for x, y in zip(state, then["angles"])))
    return time.process_time() - start_s, error


def with_mujoco(reference, has_own_friction, step_s):
    mujoco_arm.STEP_S = step_s
    run = {"friction": FRICTION, "speed_m_s": BELT_M_S, "start_m": 0.0, "elbow_down": True}
    plant = mujoco_arm.Plant(run, has_own_friction)
    theta1, theta2 = reference[0]["angles"]
    plant.data.qpos[:] = [0, theta1, theta2 - theta1]
    mujoco.mj_forward(plant.model, plant.data)
    error = 0.0
    start_s = time.process_time()
    for now, then in zip(reference, reference[1:]):
        plant.advance(now["torque"], now["duration_s"])
        joint1, joint2 = plant.joints_rad()
        error = max(error, abs(joint1 - then["angles"][0]), abs(joint1 + joint2 - then["angles"][1]))
    return time.process_time() - start_s, error


def main():
    with open(sys.argv[1], newline="") as file:
        rows = [[float(value) for value in row] for row in list(csv.reader(file))[1:]]
    simulated_s = rows[-1][0]
    tick_s = simulated_s / (len(rows) - 1)
    reference = [{"duration_s": tick_s, "angles": row[1:3], "torque": row[3:5]} for row in rows]

    def report(program, setting, result):
        cpu_s, error = result
        print(f"{program},{setting:g},{cpu_s / simulated_s:.6g},{error:.6g}", flush=True)

    for method in ("RK45", "DOP853", "LSODA", "Radau"):
        for tolerance in (1e-3, 1e-5, 1e-7, 1e-9, 1e-11):
            report(f"SciPy {scipy.__version__} {method}", tolerance, with_scipy(reference, method, tolerance))
    for name, has_own_friction in (("Coulomb friction added", False), ("its own friction", True)):
        for step_s in (1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5):
            result = with_mujoco(reference, has_own_friction, step_s)
            report(f"MuJoCo {mujoco.__version__} {name}", step_s, result)


main()
