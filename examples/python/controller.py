"""A user-defined controller in Python: holds both joints at their initial angles and presses the tip on the belt.

    painleve plant --bus mine --wait-s 60 --json &      python controller.py mine
"""

import math
import sys

from painleve_bus import ActuatorFrame, Bus

# The default scenario's converters: 14-bit encoders, 12-bit torque stages of ±5 N·m.
RAD_PER_COUNT, COUNTS_PER_NM = 2 * math.pi / 2**14, 2**11 / 5.0
STIFFNESS_NM_RAD, DAMPING_NMS_RAD, PRESSING_NM = 20.0, 0.4, (0.5, 0.8)
TRACKING, IDLE, ENABLE, CONTACT = 2, 0, 1, 1


def angles(frame):
    """Joint angles θ1 and θ2 − θ1, rad, between −π and π."""
    return [math.remainder(counts * RAD_PER_COUNT, 2 * math.pi) for counts in frame.joints]


def torques(now, before, start, tick_s):
    """Spring and damper to the first angles, with a constant torque that presses the tip on the belt."""
    for joint in range(2):
        rate = (now[joint] - before[joint]) / tick_s
        error = start[joint] - now[joint]
        torque_nm = PRESSING_NM[joint] + STIFFNESS_NM_RAD * error - DAMPING_NMS_RAD * rate
        yield max(-2048, min(2047, round(torque_nm * COUNTS_PER_NM)))


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: controller.py BUS")
    bus = Bus(sys.argv[1], "python spring")
    start = before = None
    for sensor in bus:
        now = angles(sensor)
        start, before = start or now, before or now
        answer = ActuatorFrame(tick=sensor.tick, sequence=sensor.sequence, flags=CONTACT)
        if sensor.inputs & ENABLE:
            answer.state = TRACKING
            answer.torques[:] = [*torques(now, before, start, 1.0 / bus.tick_hz)]
        bus.send(answer)
        before = now


if __name__ == "__main__":
    main()
