"""The paper's arm on its belt, for the other simulators: parameters, start, and output."""

import json
import math
import time

MASS_KG = 0.12
LENGTH_M = 0.21
DAMPING_NMS_RAD = 0.005
STIFFNESS_NM_RAD = 1.3
SPRING_REST_RAD = math.radians(13.72)
HEIGHT_M = 0.3775
GRAVITY_M_S2 = 9.81
FRICTION = 0.6
V_BELT_M_S = -0.4
RESTITUTION = 0.1

# x0,a of the paper: at rest on the belt, in the paradox.
THETA1_RAD = math.radians(32.0)


def start():
    """θ1 and θ2 with the tip exactly on the belt (the paper's 18.27 degrees are rounded)."""
    return THETA1_RAD, math.acos(HEIGHT_M / LENGTH_M - math.cos(THETA1_RAD))


class Report:
    """Counts the events of a simulation and prints them as JSON, with the CPU time since its start."""

    def __init__(self):
        self.max_theta1_dot_rad_s = -math.inf
        self.apex_m = 0.0
        self.touches = 0
        self.last_touch_s = 0.0
        self.start_cpu_s = time.process_time()

    def see(self, theta1_dot_rad_s, gap_m):
        """Records a state of the motion with the gap between tip and belt."""
        self.max_theta1_dot_rad_s = max(self.max_theta1_dot_rad_s, theta1_dot_rad_s)
        self.apex_m = max(self.apex_m, gap_m)

    def touch(self, time_s):
        """Counts an impact of the tip on the belt."""
        self.touches += 1
        self.last_touch_s = time_s

    def write(self, simulated_s, version, settings):
        """Prints the results, with the version of the program."""
        print(
            json.dumps(
                {
                    "simulated_s": simulated_s,
                    "cpu_s": time.process_time() - self.start_cpu_s,
                    "touches_per_s": self.touches / simulated_s,
                    "last_touch_s": self.last_touch_s,
                    "apex_m": self.apex_m,
                    "max_theta1_dot_rad_s": self.max_theta1_dot_rad_s,
                    "version": version,
                    "settings": settings,
                }
            )
        )
