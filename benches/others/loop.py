"""Closed loops of the controller and one plant: draws them, runs them, judges them. Started by run.py."""

import ctypes
import importlib
import json
import math
import random
import sys
import time

import arm

TICK_S = 1e-3
ENCODER_BITS, FORCE_BITS, TORQUE_BITS = 14, 12, 12
FORCE_RANGE_N, TORQUE_RANGE_NM, FORCE_NOISE_N = 20.0, 5.0, 0.02
CAPTURE_S, CAPTURE_LIMIT_S, REST_S, WATCHED_S = 0.1, 0.5, 2.0, 0.1
AT_EDGE, ENABLE = 1 << 4, 1


class SensorFrame(ctypes.Structure):
    _fields_ = [
        ("tick", ctypes.c_uint32),
        ("sequence", ctypes.c_uint32),
        ("joints", ctypes.c_uint32 * 2),
        ("normal_force", ctypes.c_int32),
        ("tangential_force", ctypes.c_int32),
        ("inputs", ctypes.c_uint32),
    ]


class ActuatorFrame(ctypes.Structure):
    _fields_ = [
        ("tick", ctypes.c_uint32),
        ("sequence", ctypes.c_uint32),
        ("torques", ctypes.c_int32 * 2),
        ("reference_tip_um", ctypes.c_int32),
        ("estimated_tip_um", ctypes.c_int32),
        ("state", ctypes.c_uint8),
        ("fault", ctypes.c_uint8),
        ("flags", ctypes.c_uint16),
    ]


class Library:
    """The C interface."""

    def __init__(self, path):
        self.c = ctypes.CDLL(path)
        self.c.painleve_last_error.restype = ctypes.c_char_p

    def call(self, name, *arguments):
        """Calls a function and raises what it reports."""
        if getattr(self.c, name)(*arguments):
            raise RuntimeError(self.c.painleve_last_error().decode())

    def new(self, kind, scenario):
        """Makes a controller or a plant."""
        handle = ctypes.c_void_p()
        self.call(f"painleve_{kind}_new", scenario.encode(), ctypes.byref(handle))
        return handle


def draw(generator):
    """A random run: friction, belt speed, posture, start, target, reference."""
    friction = generator.uniform(0.3, 0.9)
    speed_m_s = generator.uniform(0.1, 1.0) * generator.choice((-1, 1))
    elbow_down = generator.random() < 0.5
    slip = -math.copysign(1, speed_m_s)
    inside = arm.longest_stretch(friction, slip, elbow_down, 0.2)
    start_m = generator.uniform(*inside)
    low_m, high_m = arm.stretch_around(start_m, friction, slip, elbow_down)
    target_m = generator.uniform(low_m, high_m)
    if generator.random() < 0.5:
        beyond_m = generator.uniform(0, 0.02)
        target_m = low_m - beyond_m if generator.random() < 0.5 else high_m + beyond_m
    target_m = max(-0.183, min(0.183, target_m))
    return {
        "friction": friction,
        "speed_m_s": speed_m_s,
        "elbow_down": elbow_down,
        "slip": slip,
        "start_m": start_m,
        "edges_m": (low_m, high_m),
        "target_m": target_m,
        "duration_s": generator.uniform(2, 4),
        "kind": generator.choice(("minimum-jerk", "ramp")),
        "seed": generator.randrange(2**32),
    }


def scenario(run, contact):
    """The run as a scenario."""
    theta1, theta2 = arm.on_belt(run["start_m"], run["elbow_down"])
    return f"""
        [run]
        duration_s = 20.0
        seed = {run["seed"]}
        [belt]
        friction = {run["friction"]!r}
        profile = {{ kind = "constant", speed_m_s = {run["speed_m_s"]!r} }}
        [contact]
        kind = "{contact}"
        [initial]
        theta1_deg = {math.degrees(theta1)!r}
        theta2_deg = {math.degrees(theta2)!r}
        [controller]
        reference = [{{ {run["kind"]} = {{ target_m = {run["target_m"]!r}, duration_s = {run["duration_s"]!r} }} }}]
    """


class Bench:
    """Converters around a plant in physical units."""

    def __init__(self, plant, seed):
        self.plant, self.noise = plant, random.Random(seed)
        self.torque_nm = (0.0, 0.0)
        self.tick = 0
        self.cpu_s = 0.0

    def sample(self, frame):
        joints = self.plant.joints_rad()
        tangential_n, normal_n = self.plant.force_n()
        for joint, angle in enumerate(joints):
            frame.joints[joint] = round(angle / math.tau * 2**ENCODER_BITS) % 2**ENCODER_BITS
        frame.tangential_force = self.counts(tangential_n + self.noise.gauss(0, FORCE_NOISE_N), FORCE_RANGE_N, FORCE_BITS)
        frame.normal_force = self.counts(normal_n + self.noise.gauss(0, FORCE_NOISE_N), FORCE_RANGE_N, FORCE_BITS)
        frame.tick = frame.sequence = self.tick
        frame.inputs = ENABLE

    @staticmethod
    def counts(value, full, bits):
        half = 2 ** (bits - 1)
        return max(-half, min(half - 1, round(value / full * half)))

    def advance(self, answer):
        """One tick with the torque that answers the sample before."""
        start = time.process_time()
        self.plant.advance(self.torque_nm, TICK_S)
        self.cpu_s += time.process_time() - start
        half = 2 ** (TORQUE_BITS - 1)
        self.torque_nm = tuple(counts * TORQUE_RANGE_NM / half for counts in answer.torques)
        self.tick += 1

    def tip_t_m(self):
        return self.plant.tip_t_m()

    def links_rad(self):
        """The angles of both links from the downward vertical."""
        theta1, elbow = self.plant.joints_rad()
        return theta1, theta1 + elbow

    def touches(self):
        return self.plant.touches()


def judge(library, run, bench):
    """Runs one closed loop to its end and says how it ends."""
    controller = library.new("controller", scenario(run, "rigid"))
    sensor, answer = SensorFrame(), ActuatorFrame()
    ticks = round((run["duration_s"] + CAPTURE_LIMIT_S + REST_S) / TICK_S)
    contact_since, captured, lifted = None, None, False
    of_target_m = of_governed_m = 0.0
    try:
        for tick in range(ticks):
            bench.sample(sensor)
            library.call("painleve_controller_tick", controller, ctypes.byref(sensor), ctypes.byref(answer))
            bench.advance(answer)
            if bench.touches():
                contact_since = tick if contact_since is None else contact_since
                if captured is None and (tick - contact_since) * TICK_S >= CAPTURE_S:
                    captured = contact_since * TICK_S
            else:
                contact_since = None
                lifted = lifted or captured is not None
            if tick > ticks - WATCHED_S / TICK_S:
                of_target_m = max(of_target_m, abs(bench.tip_t_m() - run["target_m"]))
                of_governed_m = max(of_governed_m, abs(bench.tip_t_m() - 1e-6 * answer.reference_tip_um))
    finally:
        library.c.painleve_controller_free(controller)
    tolerance_m = 1e-3 + math.tau / 2**ENCODER_BITS * (arm.HEIGHT_M + arm.LENGTH_M)
    tip_m = bench.tip_t_m()
    low_m, high_m = run["edges_m"]
    to_edge_m = high_m - tip_m if run["target_m"] > run["start_m"] else tip_m - low_m
    # In the arm's own posture: its tip is a little deep in a belt that gives.
    p_ratio = arm.p_ratio(bench.links_rad(), run["friction"], run["slip"])
    if answer.fault:
        return f"fault {answer.fault}", ticks
    if captured is None or captured + CAPTURE_S > CAPTURE_LIMIT_S:
        return "not captured", ticks
    if lifted:
        return "lift-off", ticks
    if of_target_m <= tolerance_m:
        return "reached", ticks
    if answer.flags & AT_EDGE and of_governed_m <= tolerance_m:
        early = to_edge_m > 0.01 and p_ratio > 0.1
        return ("stopped early" if early else "at the edge"), ticks
    return "not reached", ticks


def main(path, module, name, runs, seed):
    library = Library(path)
    generator = random.Random(seed)
    plants = importlib.import_module(module)
    endings, simulated_s, cpu_s = {}, 0.0, 0.0
    for _ in range(runs):
        run = draw(generator)
        bench = plants.bench(name, library, run, scenario, Bench)
        ending, ticks = judge(library, run, bench)
        endings[ending] = endings.get(ending, 0) + 1
        simulated_s += ticks * TICK_S
        cpu_s += bench.cpu_s
        print(name, run, ending, file=sys.stderr)
    successes = sum(endings.pop(ending, 0) for ending in ("reached", "at the edge"))
    print(
        json.dumps(
            {
                "version": plants.version(),
                "successes": successes,
                "failures": endings,
                "simulated_s": simulated_s,
                "plant_cpu_s": cpu_s,
            }
        )
    )


main(sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4]), int(sys.argv[5]))
