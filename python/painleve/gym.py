"""The arm as a Gymnasium environment: torques in, angles and tip out; the reward follows the reference.

Needs the package's extra `gym`: Gymnasium and NumPy.
"""

import math

import gymnasium
import numpy
from gymnasium.error import InvalidAction, ResetNeeded

from . import Plant

__all__ = ["ArmOnBelt"]


class ArmOnBelt(gymnasium.Env):
    """The tip shall stay on the belt and go to `target_m`.

    Action: torques u1, u2 in N·m, at most `torque_limit_nm`. Observation: θ1, θ2 (rad), their rates (rad/s), tip
    position (m), gap (m). Reward: minus the distance to the target in mm, minus 10 while the tip is in the air. An
    episode is truncated after `duration_s`. Nothing is random: equal actions give equal episodes, whatever the seed.
    """

    def __init__(self, scenario="hybrid-elbow-down", target_m=0.05, duration_s=3.0, torque_limit_nm=5.0):
        if not math.isfinite(target_m):
            raise ValueError(f"target_m = {target_m} is not a finite number")
        for name, value in (("duration_s", duration_s), ("torque_limit_nm", torque_limit_nm)):
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} = {value} is not a positive number")
        self._last_tick = max(1, round(duration_s * Plant(scenario).tick_hz))
        self._plant = None
        self.scenario, self.target_m, self.duration_s = scenario, target_m, duration_s
        self.action_space = gymnasium.spaces.Box(-torque_limit_nm, torque_limit_nm, (2,), numpy.float64)
        self.observation_space = gymnasium.spaces.Box(-numpy.inf, numpy.inf, (6,), numpy.float64)

    def _observation(self):
        now = self._plant.state()
        names = ("theta1_rad", "theta2_rad", "theta1_dot_rad_s", "theta2_dot_rad_s", "tip_t_m", "gap_m")
        return numpy.array([now[name] for name in names]), now

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self._plant, self._ticks = Plant(self.scenario), 0
        return self._observation()

    def step(self, action):
        if self._plant is None:
            raise ResetNeeded("reset() comes before the first step()")
        try:
            torques_nm = numpy.asarray(action, numpy.float64)
        except (TypeError, ValueError):
            torques_nm = None
        if torques_nm is None or not self.action_space.contains(torques_nm):
            limit_nm = self.action_space.high[0]
            raise InvalidAction(f"action {action}: two torques of -{limit_nm} to {limit_nm} N·m")
        self._plant.step(*torques_nm)
        self._ticks += 1
        observation, now = self._observation()
        reward = -1e3 * abs(now["tip_t_m"] - self.target_m) - (10.0 if now["mode"] == "flight" else 0.0)
        return observation, reward, False, self._ticks >= self._last_tick, now
