"""The open-loop bounce by SciPy: solve_ivp with events, and painleve's own rules for contact.

The rules are written again here: flight, sliding (f_n = -b/p), sticking, Routh's impact closed by
Poisson restitution, and the impact without collision where p reaches zero or starts below.
"""

import sys

import numpy as np
import scipy
from scipy.integrate import solve_ivp

import arm

M, L, G = arm.MASS_KG, arm.LENGTH_M, arm.GRAVITY_M_S2
K, SIGMA, ALPHA0, MU = arm.STIFFNESS_NM_RAD, arm.DAMPING_NMS_RAD, arm.SPRING_REST_RAD, arm.FRICTION
RTOL, ATOL = 1e-9, 1e-10
# Bounces slower than this end, m/s.
SLOWEST_M_S = 1e-6


def parts(x):
    """Inverse mass matrix, Jacobian, free joint acceleration, Q, free tip acceleration."""
    t1, t2, w1, w2 = x
    s1, c1, s2, c2 = np.sin(t1), np.cos(t1), np.sin(t2), np.cos(t2)
    coupling = 0.5 * M * L * L * (c1 * c2 + s1 * s2)
    a, d = 4 / 3 * M * L * L, M * L * L / 3
    inverse = np.array([[d, -coupling], [-coupling, a]]) / (a * d - coupling * coupling)
    spring = K * (t2 - t1 + ALPHA0)
    sine = 0.5 * M * L * L * (s1 * c2 - c1 * s2)
    torque = -np.array(
        [
            1.5 * M * G * L * s1 - spring - SIGMA * (w2 - 2 * w1) + sine * w2 * w2,
            0.5 * M * G * L * s2 + spring + SIGMA * (w2 - w1) - sine * w1 * w1,
        ]
    )
    jacobian = L * np.array([[c1, c2], [s1, s2]])
    free = inverse @ torque
    centripetal = L * np.array([-(w1 * w1 * s1 + w2 * w2 * s2), w1 * w1 * c1 + w2 * w2 * c2])
    return inverse, jacobian, free, jacobian @ inverse @ jacobian.T, jacobian @ free + centripetal


def gap(x):
    return arm.HEIGHT_M - L * (np.cos(x[0]) + np.cos(x[1]))


def tip_velocity(x):
    """(v_r, v_n) relative to the belt."""
    velocity = parts(x)[1] @ x[2:]
    return velocity - np.array([arm.V_BELT_M_S, 0.0])


def contact_force(x, slip):
    """(f_t, f_n) while sliding in direction slip, or sticking if it is 0; and p."""
    _, _, _, q, free = parts(x)
    if slip == 0:
        return -np.linalg.solve(q, free), 1.0
    p = q[1, 1] - MU * slip * q[0, 1]
    return np.array([-MU * slip, 1.0]) * (-free[1] / p), p


def motion(slip):
    """The right-hand side; slip None is flight."""

    def rhs(_, x):
        inverse, jacobian, acceleration, _, _ = parts(x)
        if slip is not None:
            acceleration = acceleration + inverse @ jacobian.T @ contact_force(x, slip)[0]
        return np.concatenate([x[2:], acceleration])

    return rhs


def impact(x, without_collision):
    """The state after Routh's process."""
    inverse, jacobian, _, q, _ = parts(x)
    velocity = tip_velocity(x)
    if without_collision:
        velocity[1] = 0.0
    impulse = np.zeros(2)
    slip = np.sign(velocity[0])
    compressed = None
    if slip == 0 and abs(q[0, 1]) > MU * q[0, 0]:
        slip = np.sign(q[0, 1])
    for _ in range(8):
        ratio = -MU * slip if slip != 0 else -q[0, 1] / q[0, 0]
        rate = q @ np.array([ratio, 1.0])
        closing = -slip * rate[0]
        until_slip_dies = slip * velocity[0] / closing if slip != 0 and closing > 0 else np.inf
        if compressed is None:
            # For p <= 0 this phase cannot end compression.
            until = max(-velocity[1] / rate[1], 0.0) if rate[1] > 0 else np.inf
        else:
            until = max((1 + arm.RESTITUTION) * compressed - impulse[1], 0.0)
        amount = min(until, until_slip_dies)
        impulse += np.array([ratio, 1.0]) * amount
        velocity = velocity + rate * amount
        if until <= until_slip_dies:
            if compressed is not None:
                break
            compressed = impulse[1]
        else:
            velocity[0] = 0.0
            slip = np.sign(q[0, 1]) if abs(q[0, 1]) > MU * q[0, 0] else 0
    return np.concatenate([x[:2], x[2:] + inverse @ jacobian.T @ impulse])


def event(function, direction):
    function.terminal, function.direction = True, direction
    return function


def contact_mode(x):
    """The next mode of a tip on the belt with v_n = 0: "flight", "throw", or a slip direction."""
    _, _, _, q, free = parts(x)
    v_r = tip_velocity(x)[0]
    if abs(v_r) > 1e-9:
        slip = np.sign(v_r)
        if free[1] >= 0:
            return "flight"
        return slip if contact_force(x, slip)[1] > 1e-6 * q[1, 1] else "throw"
    force, _ = contact_force(x, 0)
    if force[1] > 0 and abs(force[0]) <= MU * force[1]:
        return 0
    return "flight" if free[1] >= 0 else -np.sign(force[0])


def events_of(slip):
    if slip is None:
        return [event(lambda _, x: gap(x), -1)]
    lifts = event(lambda _, x: contact_force(x, slip)[0][1], -1)
    if slip == 0:
        cone = event(lambda _, x: MU * contact_force(x, 0)[0][1] - abs(contact_force(x, 0)[0][0]), -1)
        return [lifts, cone]
    free = event(lambda _, x: parts(x)[4][1], 1)
    throws = event(lambda _, x: contact_force(x, slip)[1] - 1e-6, -1)
    dies = event(lambda _, x: slip * tip_velocity(x)[0], -1)
    return [free, throws, dies]


def main(simulated_s):
    report = arm.Report()
    x = np.array([*arm.start(), 0.0, 0.0])
    time_s, mode = 0.0, contact_mode(x)
    while time_s < simulated_s:
        if mode == "throw":
            x, mode = impact(x, True), "flight"
            report.touch(time_s)
        slip = None if mode == "flight" else mode
        solution = solve_ivp(
            motion(slip), (time_s, simulated_s), x, method="DOP853", rtol=RTOL, atol=ATOL, events=events_of(slip)
        )
        for state in solution.y.T:
            report.see(state[2], gap(state))
        time_s, x = solution.t[-1], solution.y[:, -1]
        if solution.status == 0:
            break
        if slip is not None:
            if len(solution.t_events) == 3 and len(solution.t_events[2]):
                # Slip has vanished: set it to exactly zero, despite the rounding of the root.
                inverse, jacobian, _, q, _ = parts(x)
                lost = np.linalg.solve(q, np.array([-tip_velocity(x)[0], 0.0]))
                x = np.concatenate([x[:2], x[2:] + inverse @ jacobian.T @ lost])
            mode = contact_mode(x)
            continue
        x = impact(x, False)
        report.touch(time_s)
        mode = "flight" if tip_velocity(x)[1] > SLOWEST_M_S else contact_mode(x)
    report.write(simulated_s, scipy.__version__, f"DOP853, rtol {RTOL:g}, atol {ATOL:g}")


main(float(sys.argv[1]))
