"""The paper's arm: parameters, postures on the belt, and p."""

import math

MASS_KG = 0.12
LENGTH_M = 0.21
DAMPING_NMS_RAD = 0.005
STIFFNESS_NM_RAD = 1.3
SPRING_REST_RAD = math.radians(-13.72)
HEIGHT_M = 0.3775
GRAVITY_M_S2 = 9.81

INERTIA_KG_M2 = MASS_KG * LENGTH_M**2 / 12
REACH_M = math.sqrt((2 * LENGTH_M) ** 2 - HEIGHT_M**2)
POINTS = 4000


def on_belt(tip_t_m, elbow_down):
    """Link angles (rad, from the downward vertical) with the tip on the belt."""
    direction = math.atan2(tip_t_m, HEIGHT_M)
    half = math.acos(min(1.0, math.hypot(tip_t_m, HEIGHT_M) / (2 * LENGTH_M)))
    return (direction + half, direction - half) if elbow_down else (direction - half, direction + half)


def inverse_tip_inertia(links_rad):
    """Q21 and Q22 of Q = J M^-1 J^T, 1/kg, at these link angles."""
    one, two = links_rad
    length, mass = LENGTH_M, MASS_KG
    m11 = INERTIA_KG_M2 + mass * (length / 2) ** 2 + mass * length**2
    m12 = mass * length**2 / 2 * math.cos(two - one)
    m22 = INERTIA_KG_M2 + mass * (length / 2) ** 2
    determinant = m11 * m22 - m12 * m12
    along = (length * math.cos(one), length * math.cos(two))
    normal = (length * math.sin(one), length * math.sin(two))

    def product(left, right):
        return (
            left[0] * (m22 * right[0] - m12 * right[1]) + left[1] * (m11 * right[1] - m12 * right[0])
        ) / determinant

    return product(normal, along), product(normal, normal)


def p_ratio(links_rad, friction, slip):
    """p over Q22 at these link angles, with p = Q22 - mu s Q21."""
    q21, q22 = inverse_tip_inertia(links_rad)
    return 1 - friction * slip * q21 / q22


def stretches(friction, slip, elbow_down, least):
    """Intervals of z_t, m, with p of at least this fraction of Q22, within 97 % of the reach."""
    found, start = [], None
    places = [0.97 * REACH_M * (2 * i / POINTS - 1) for i in range(POINTS + 1)]
    for place in places:
        if p_ratio(on_belt(place, elbow_down), friction, slip) >= least:
            start = place if start is None else start
            end = place
        elif start is not None:
            found.append((start, end))
            start = None
    return found + ([(start, end)] if start is not None else [])


def longest_stretch(friction, slip, elbow_down, least):
    """The longest of them."""
    return max(stretches(friction, slip, elbow_down, least), key=lambda stretch: stretch[1] - stretch[0])


def stretch_around(place_m, friction, slip, elbow_down):
    """The one with p > 0 around a place."""
    all_stretches = stretches(friction, slip, elbow_down, 0.0)
    return next(stretch for stretch in all_stretches if stretch[0] - 1e-4 <= place_m <= stretch[1] + 1e-4)
